"""The tabs from one start to the next: whose come back, after a crash too; settings that take nothing."""

from __future__ import annotations

from pathlib import Path

from app.core.documents.document import Document
from app.core.documents.file_format import BehaviourFile, write_file
from app.core.documents.journal import Journal, Unsaved, left_behind
from app.core.documents.open_documents import Documents
from app.core.documents.saved_tabs import KeptTabs
from app.core.storage.settings import Settings
from tests.core.documents.test_open_documents import OTHER, STARTED, as_if_dead, names


class Start:
    """One start of Studio over the same folder."""

    def __init__(self, folder: Path) -> None:
        self.complaints: list[str] = []
        self.journals = folder / "journal"
        self.documents = Documents(lambda: Document(lambda: Journal(self.journals)))
        self.tabs = KeptTabs(Settings(folder), self.documents, self.complaints.append)

    def come_back(self) -> list[Unsaved]:
        return self.tabs.come_back(left_behind(self.journals) if self.journals.exists() else [])


def begun(folder: Path) -> Start:
    """A start with one file open that is not saved."""
    path = folder / "A.nepb"
    write_file(path, BehaviourFile("A", STARTED, {}))
    start = Start(folder)
    assert start.come_back() == []
    start.documents.open(path)
    start.documents.current.edited(OTHER)
    start.tabs.keep()
    return start


def test_after_an_end_in_order_unsaved_work_is_there_again_and_nobody_is_asked(tmp_path: Path) -> None:
    first = begun(tmp_path)
    first.tabs.keep(ended_well=True)
    first.documents.end()
    as_if_dead(first.journals)
    after = Start(tmp_path)
    assert after.come_back() == []
    assert names(after.documents) == ["A"]
    assert after.documents.current.workspace == OTHER
    after.documents.end()


def test_after_a_crash_a_person_is_asked_for_unsaved_work(tmp_path: Path) -> None:
    first = begun(tmp_path)
    as_if_dead(first.journals)
    after = Start(tmp_path)
    asked = after.come_back()
    assert [each.name for each in asked] == ["A"]
    assert after.documents.current.workspace == STARTED, "as it was saved"
    after.documents.end()
    first.documents.end()


def test_an_end_in_order_counts_for_one_start_only(tmp_path: Path) -> None:
    first = begun(tmp_path)
    first.tabs.keep(ended_well=True)
    begun(tmp_path).documents.end()
    assert Settings(tmp_path).get("tabs", {})["ended_well"] is False
    first.documents.end()


def test_the_tabs_of_a_second_window_do_not_come_back(tmp_path: Path) -> None:
    first = begun(tmp_path)
    second = Start(tmp_path)
    second.documents.new()
    second.documents.current.edited(STARTED)
    second.tabs.keep(ended_well=True)
    kept = Settings(tmp_path).get("tabs", {})
    assert [Path(each["path"]).name for each in kept["tabs"]] == ["A.nepb"]
    assert kept["ended_well"] is False
    second.documents.end()
    first.documents.end()


def test_settings_that_take_nothing_are_told_in_a_sentence(tmp_path: Path) -> None:
    start = begun(tmp_path)
    (tmp_path / "settings.json").unlink()
    (tmp_path / "settings.json").mkdir()
    start.tabs.keep(ended_well=True)
    assert len(start.complaints) == 1
    assert start.complaints[0].startswith("settings can't be kept in ")
    start.documents.end()
