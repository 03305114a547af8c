"""The tabs from one start to the next: whose come back, after a crash too; settings that take nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.core.documents.document import Document
from app.core.documents.file_format import BehaviourFile, write_file
from app.core.documents.journal import Journal, Unsaved, left_behind
from app.core.documents.open_documents import Documents
from app.core.documents.saved_tabs import KeptTabs
from app.core.storage.settings import Settings
from tests.core.documents.test_open_documents import OTHER, STARTED, all_kept, as_if_dead, names


class Start:
    """One start of Studio over the same folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.complaints: list[str] = []
        self.journals = folder / "journal"
        self.documents = Documents(lambda: Document(lambda: Journal(self.journals)))
        self.tabs = KeptTabs(Settings(folder), self.documents, self.complaints.append)

    def come_back(self) -> list[Unsaved]:
        return self.tabs.come_back(left_behind(self.journals) if self.journals.exists() else [])

    def work(self) -> None:
        """One file is open and is not saved."""
        path = self.folder / "A.nepb"
        write_file(path, BehaviourFile("A", STARTED, {}))
        assert self.come_back() == []
        self.documents.open(path)
        self.documents.current.edited(OTHER)
        self.tabs.keep()
        assert all_kept(self.documents)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[], Start]]:
    """Starts Studio, and ends its documents after the test."""
    made: list[Start] = []

    def begin() -> Start:
        made.append(Start(tmp_path))
        return made[-1]

    yield begin
    for each in made:
        each.documents.end()


def test_after_an_end_in_order_unsaved_work_is_there_again_and_nobody_is_asked(start) -> None:
    first = start()
    first.work()
    first.tabs.keep(ended_well=True)
    first.documents.end()
    as_if_dead(first.journals)
    after = start()
    assert after.come_back() == []
    assert names(after.documents) == ["A"]
    assert after.documents.current.workspace == OTHER


def test_after_a_crash_a_person_is_asked_for_unsaved_work(start) -> None:
    first = start()
    first.work()
    as_if_dead(first.journals)
    after = start()
    asked = after.come_back()
    assert [each.name for each in asked] == ["A"]
    assert after.documents.current.workspace == STARTED, "as it was saved"


def test_an_end_in_order_counts_for_one_start_only(start, tmp_path: Path) -> None:
    first = start()
    first.work()
    first.tabs.keep(ended_well=True)
    start().work()
    assert Settings(tmp_path).get("tabs", {})["ended_well"] is False


def test_the_tabs_of_a_second_window_do_not_come_back(start, tmp_path: Path) -> None:
    start().work()
    second = start()
    second.documents.new()
    second.documents.current.edited(STARTED)
    second.tabs.keep(ended_well=True)
    kept = Settings(tmp_path).get("tabs", {})
    assert [Path(each["path"]).name for each in kept["tabs"]] == ["A.nepb"]
    assert kept["ended_well"] is False


def test_settings_that_take_nothing_are_told_in_a_sentence(start, tmp_path: Path) -> None:
    first = start()
    first.work()
    (tmp_path / "settings.json").unlink()
    (tmp_path / "settings.json").mkdir()
    first.tabs.keep(ended_well=True)
    assert len(first.complaints) == 1
    assert first.complaints[0].startswith("settings can't be kept in ")
