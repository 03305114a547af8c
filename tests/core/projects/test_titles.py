"""Tests of document titles: derived from file names and unique."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.file_format import write_file
from app.core.projects.journal import Journal
from app.core.projects.open_project import OpenProject
from app.core.projects.open_projects import OpenProjects
from app.core.projects.titles import recent_titles, unique_titles
from app.core.storage.folders import closed_tabs_folder
from app.core.storage.settings import RecentFile, Settings


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


def file(path: Path, name: str = "Greeting") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, Project.of_blocks(name, {"blocks": {"blocks": [{"type": "events_started"}]}}, {}))
    return path


def documents(tmp_path: Path) -> OpenProjects:
    return OpenProjects(lambda: OpenProject(lambda: Journal(tmp_path / "journal")))


def test_copied_file_is_titled_by_its_file_name(tmp_path) -> None:
    opened = documents(tmp_path)
    first = opened.open(file(tmp_path / "Greeting.nepb"))
    copy = opened.open(file(tmp_path / "Greeting for class 3.nepb"))
    assert [opened.title(each) for each in opened] == ["Greeting", "Greeting for class 3"]
    copy.save()
    assert json.loads((tmp_path / "Greeting for class 3.nepb").read_text("utf-8"))["name"] == copy.name
    assert first.name == "Greeting"
    opened.close_all()


def test_files_of_same_name_show_their_folder(tmp_path) -> None:
    opened = documents(tmp_path)
    here = opened.open(file(tmp_path / "class 3" / "Greeting.nepb"))
    assert opened.title(here) == "Greeting"
    there = opened.open(file(tmp_path / "class 4" / "Greeting.nepb"))
    assert [opened.title(each) for each in opened] == ["Greeting — class 3", "Greeting — class 4"]
    opened.close(there)
    assert opened.title(here) == "Greeting"
    opened.close_all()


def test_titles_include_as_many_folders_as_needed() -> None:
    paths = [Path("/a/2025/tasks/Quiz.nepb"), Path("/a/2026/tasks/Quiz.nepb"), Path("/b/Quiz.nepb")]
    assert unique_titles(
        [("Quiz", each) for each in paths] + [("quiz", None), ("Other", Path("/b/Other"))]
    ) == [
        "Quiz — 2025/tasks",
        "Quiz — 2026/tasks",
        "Quiz — b",
        "quiz",
        "Other",
    ]
    assert unique_titles([("Quiz", Path("/Quiz.nepb")), ("Quiz", Path("/x/Quiz.nepb"))])[1] == "Quiz — x"


def test_example_opened_again_gets_a_unique_name(tmp_path) -> None:
    opened = documents(tmp_path)
    path = file(tmp_path / "example.nepb", "Tour guide")
    assert [opened.open_example(path).name for _ in range(3)] == [
        "Tour guide",
        "Tour guide 2",
        "Tour guide 3",
    ]
    opened.close_all()


def test_recent_files_have_the_same_titles_as_tabs(tmp_path) -> None:
    settings = Settings(tmp_path / "home")
    for folder in ("class 3", "class 4"):
        settings.add_recent(file(tmp_path / folder / "Greeting.nepb"), "An old name from inside")
    assert [each.name for each in recent_titles(settings.recent_files)] == [
        "Greeting — class 4",
        "Greeting — class 3",
    ]
    assert [each.name for each in settings.recent_files] == ["Greeting", "Greeting"]


def test_work_closed_without_file_keeps_its_name(tmp_path) -> None:
    document = OpenProject(lambda: Journal(tmp_path / "journal"))
    document.new("Quiz")
    document.save(closed_tabs_folder() / "Quiz 2026-11-23 08.00.nepb")
    assert document.name == "Quiz"
    settings = Settings(tmp_path / "home")
    settings.add_recent(closed_tabs_folder() / "Quiz 2026-11-23 08.00.nepb", "Quiz")
    assert isinstance(settings.recent_files[0], RecentFile)
    assert settings.recent_files[0].name == "Quiz"
    again = OpenProject(lambda: Journal(tmp_path / "journal"))
    again.open(settings.recent_files[0].path)
    assert again.name == "Quiz"
