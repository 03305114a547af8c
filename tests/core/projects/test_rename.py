"""Tests of renaming a behaviour: its file, versions, journal and entry among the recent files follow."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.file_format import read_file, write_file
from app.core.projects.journal import Journal
from app.core.projects.open_project import OpenProject
from app.core.projects.open_projects import OpenProjects
from app.core.projects.rename import name_problem, rename_file
from app.core.projects.versions import save_version, versions_of
from app.core.storage.settings import Settings
from app.errors import DocumentError
from tests.core.projects.test_open_projects import OTHER, STARTED


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[OpenProjects]:
    made = OpenProjects(lambda: OpenProject(lambda: Journal(tmp_path / "journal")))
    yield made
    made.close_all()


def file(path: Path) -> Path:
    write_file(path, Project.of_blocks(path.stem, STARTED, {}))
    return path


def test_renamed_file_keeps_its_content(opened: OpenProjects, tmp_path: Path) -> None:
    old = file(tmp_path / "Greeting.nepb")
    content = old.read_bytes()
    document = opened.open(old)
    opened.rename(document, " Quiz ")
    assert (document.name, document.path, document.dirty) == ("Quiz", tmp_path / "Quiz.nepb", False)
    assert not old.exists()
    assert (tmp_path / "Quiz.nepb").read_bytes() == content
    assert not document.is_changed_externally
    document.save()
    assert read_file(tmp_path / "Quiz.nepb").name == "Quiz"
    assert json.loads((tmp_path / "Quiz.nepb").read_text("utf-8"))["name"] == "Quiz"


def test_unsaved_work_and_earlier_versions_follow_rename(opened: OpenProjects, tmp_path: Path) -> None:
    old = file(tmp_path / "Greeting.nepb")
    document = opened.open(old)
    save_version(old)
    document.apply_edit(OTHER)
    opened.rename(document, "Quiz")
    assert document.dirty
    assert document.is_on_disk
    journal = json.loads(next((tmp_path / "journal").glob("*.json")).read_text("utf-8"))
    assert (journal["name"], journal["path"]) == ("Quiz", str(tmp_path / "Quiz.nepb"))
    assert [each.name for each in versions_of(tmp_path / "Quiz.nepb")] == ["Quiz"]
    assert versions_of(old) == []


def test_rename_of_unsaved_behaviour_changes_only_its_name(opened: OpenProjects) -> None:
    document = opened.new()
    document.apply_edit(OTHER)
    opened.rename(document, "Quiz: what?")
    assert (document.name, document.path) == ("Quiz: what?", None)


def test_rename_never_overwrites_another_file(opened: OpenProjects, tmp_path: Path) -> None:
    document = opened.open(file(tmp_path / "Greeting.nepb"))
    other = file(tmp_path / "Quiz.nepb")
    content = other.read_bytes()
    with pytest.raises(DocumentError, match="A file named “Quiz” already exists in "):
        opened.rename(document, "Quiz")
    with pytest.raises(DocumentError, match="can't rename "):
        rename_file(tmp_path / "Greeting.nepb", other)  # a target that was created in the meantime
    assert other.read_bytes() == content
    assert document.path is not None
    assert document.path.exists()
    assert document.name == "Greeting"


def test_missing_file_cannot_be_renamed_and_no_file_is_created(opened: OpenProjects, tmp_path: Path) -> None:
    document = opened.open(file(tmp_path / "Greeting.nepb"))
    (tmp_path / "Greeting.nepb").unlink()
    with pytest.raises(DocumentError, match="no longer exists"):
        opened.rename(document, "Quiz")
    assert not (tmp_path / "Quiz.nepb").exists()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("  ", "needs a name"),
        ("a/b", "“/”"),
        ("what?", r"“\?”"),
        ("two\tparts", "“ ”"),
        (".hidden", "full stop"),
        ("end.", "full stop"),
        ("CON", "Windows reserves"),
        ("nul.txt", "Windows reserves"),
        ("ä" * 101, "too long"),
    ],
)
def test_names_invalid_on_some_system_are_rejected(name: str, words: str, tmp_path: Path) -> None:
    assert re.search(words, name_problem(name, tmp_path / "A.nepb"))
    assert bool(name_problem(name, None)) == (not name.strip()), "without a file any name will do"


def test_recent_files_entry_is_renamed_in_place(tmp_path: Path) -> None:
    settings = Settings(tmp_path / "home")
    first, second = file(tmp_path / "A.nepb"), file(tmp_path / "B.nepb")
    settings.add_recent(first)
    settings.add_recent(second)
    rename_file(first, tmp_path / "C.nepb")
    settings.rename_recent(first, tmp_path / "C.nepb")
    assert [each.name for each in settings.recent_files] == ["B", "C"]


def test_duplicate_opens_next_to_its_original(opened: OpenProjects, tmp_path: Path) -> None:
    document = opened.open(file(tmp_path / "Quiz.nepb"))
    copy = opened.duplicate(document)
    again = opened.duplicate(document)
    assert [each.name for each in opened] == ["Quiz", "Quiz copy 2", "Quiz copy"]
    assert copy.workspace == document.workspace
    assert (copy.path, copy.dirty, again.dirty) == (None, True, True)
