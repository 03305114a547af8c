"""Tests of restoring tabs at the next start, also after a crash and with read-only settings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.file_format import write_file
from app.core.projects.journal import Journal, UnsavedWork, unsaved_work
from app.core.projects.open_project import OpenProject
from app.core.projects.open_projects import OpenProjects
from app.core.projects.saved_tabs import SavedTabs
from app.core.storage.settings import Settings
from tests.core.projects.test_open_projects import OTHER, STARTED, all_kept, as_if_dead, names


class Start:
    """One start of Studio on the same folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.complaints: list[str] = []
        self.journals = folder / "journal"
        self.documents = OpenProjects(lambda: OpenProject(lambda: Journal(self.journals)))
        self.tabs = SavedTabs(Settings(folder), self.documents, self.complaints.append)

    def come_back(self) -> list[UnsavedWork]:
        return self.tabs.restore(unsaved_work(self.journals) if self.journals.exists() else [])

    def work(self) -> None:
        """Open a file, change it without saving, and save the tabs."""
        path = self.folder / "A.nepb"
        write_file(path, Project.of_blocks("A", STARTED, {}))
        assert self.come_back() == []
        self.documents.open(path)
        self.documents.current.apply_edit(OTHER)
        self.tabs.save()
        assert all_kept(self.documents)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[], Start]]:
    """Function that starts Studio; its documents are closed after the test."""
    made: list[Start] = []

    def begin() -> Start:
        made.append(Start(tmp_path))
        return made[-1]

    yield begin
    for each in made:
        each.documents.close_all()


def test_after_clean_exit_unsaved_work_is_restored_without_asking(start) -> None:
    first = start()
    first.work()
    first.tabs.save(has_ended_normally=True)
    first.documents.close_all()
    as_if_dead(first.journals)
    after = start()
    assert after.come_back() == []
    assert names(after.documents) == ["A"]
    assert after.documents.current.workspace == OTHER


def test_after_crash_user_is_asked_about_unsaved_work(start) -> None:
    first = start()
    first.work()
    as_if_dead(first.journals)
    after = start()
    asked = after.come_back()
    assert [each.name for each in asked] == ["A"]
    assert after.documents.current.workspace == STARTED, "as it was saved"


def test_clean_exit_flag_applies_to_one_start_only(start, tmp_path: Path) -> None:
    first = start()
    first.work()
    first.tabs.save(has_ended_normally=True)
    start().work()
    assert Settings(tmp_path).tabs["ended_well"] is False


def test_second_window_does_not_overwrite_saved_tabs(start, tmp_path: Path) -> None:
    start().work()
    second = start()
    second.documents.new()
    second.documents.current.apply_edit(STARTED)
    second.tabs.save(has_ended_normally=True)
    kept = Settings(tmp_path).tabs
    assert [Path(each["path"]).name for each in kept["tabs"]] == ["A.nepb"]
    assert kept["ended_well"] is False


def test_unwritable_settings_are_reported(start, tmp_path: Path) -> None:
    first = start()
    first.work()
    (tmp_path / "settings.json").unlink()
    (tmp_path / "settings.json").mkdir()
    first.tabs.save(has_ended_normally=True)
    assert len(first.complaints) == 1
    assert first.complaints[0].startswith("can't save settings in ")


def test_after_crash_tabs_keep_their_order_and_the_current_tab(start) -> None:
    first = start()
    for name in "AB":
        write_file(first.folder / f"{name}.nepb", Project.of_blocks(name, STARTED, {}))
    assert first.come_back() == []
    first.documents.open(first.folder / "A.nepb")
    first.documents.new().apply_edit(OTHER)
    first.documents.open(first.folder / "B.nepb").apply_edit(OTHER)
    middle = first.documents.neighbour(-1)
    first.documents.show(middle)
    first.tabs.save_if_changed()
    assert names(first.documents) == ["A", "New behaviour", "B"]
    assert all_kept(first.documents)
    as_if_dead(first.journals)

    second = start()
    left = second.come_back()
    assert names(second.documents) == ["A", "B"], "files are open; a person is asked for what was not saved"
    second.tabs.recover(left)
    assert names(second.documents) == ["A", "New behaviour", "B"]
    assert [each.dirty for each in second.documents] == [False, True, True]
    assert second.documents.current.name == "New behaviour"


def test_tab_of_new_behaviour_is_saved_from_first_edit(start) -> None:
    first = start()
    assert first.come_back() == []
    blank = first.documents.current
    first.tabs.save_if_changed()
    blank.apply_edit(OTHER)
    first.tabs.on_edited(blank, was_blank=True)
    kept = Settings(first.folder).tabs
    assert [tab["journal"] for tab in kept["tabs"]] == [blank.journal_name]


def test_switching_tabs_does_not_write_settings_at_once(start) -> None:
    first = start()
    first.work()
    made = first.documents.new()
    made.apply_edit(OTHER)
    first.tabs.save_if_changed()
    before = Settings(first.folder).tabs
    assert before["current"] == 1
    first.documents.show(first.documents.neighbour(-1))
    assert Settings(first.folder).tabs == before
    first.tabs.save_if_changed()
    assert Settings(first.folder).tabs["current"] == 0
