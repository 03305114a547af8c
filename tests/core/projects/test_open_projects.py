"""Tests of several open behaviours: tabs, the current one, closing, reopening, and the next start."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.blocks.model.project import Project
from app.core.projects.file_format import write_file
from app.core.projects.journal import Journal, unsaved_work
from app.core.projects.open_project import OpenProject
from app.core.projects.open_projects import MAX_CLOSED_TABS, OpenProjects
from app.errors import DocumentError
from app.robots.client import rize

STARTED: dict[str, object] = {
    "blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": "a", "x": 1, "y": 2}]}
}
OTHER: dict[str, object] = {
    "blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": "b", "x": 1, "y": 2}]}
}


@pytest.fixture
def journals(tmp_path: Path) -> Path:
    return tmp_path / "journal"


class Opens:
    """Factory that opens behaviours as Studio does; their threads end after the test."""

    def __init__(self, journals: Path) -> None:
        self.journals, self.all = journals, list[OpenProjects]()

    def __call__(self) -> OpenProjects:
        made = OpenProjects(lambda: OpenProject(lambda: Journal(self.journals)))
        self.all.append(made)
        return made


@pytest.fixture
def opened(journals: Path) -> Iterator[Opens]:
    made = Opens(journals)
    yield made
    for each in made.all:
        each.close_all()


@pytest.fixture
def documents(opened: Opens) -> OpenProjects:
    return opened()


def all_kept(documents: OpenProjects) -> bool:
    """Return whether all documents are written to their journals."""
    return all(document.is_on_disk for document in documents)


def file(folder: Path, name: str, blocks: dict[str, object] = STARTED) -> Path:
    path = folder / f"{name}.nepb"
    write_file(path, Project.of_blocks(name, blocks, {}))
    return path


def names(documents: OpenProjects) -> list[str]:
    return [document.name for document in documents]


def as_if_dead(journals: Path) -> None:
    """Rewrite the journals as if their process no longer existed."""
    for journal in journals.glob("*.json"):
        entry = json.loads(journal.read_bytes())
        entry["pid"], entry["born_s"] = 2**22 + 5, 0.0
        journal.write_text(json.dumps(entry))


def test_opened_file_replaces_unmodified_behaviour_then_opens_new_tabs(documents, tmp_path) -> None:
    documents.open(file(tmp_path, "A"))
    documents.open(file(tmp_path, "B"))
    assert names(documents) == ["A", "B"]
    assert documents.current.name == "B"
    documents.show(next(iter(documents)))
    documents.open(file(tmp_path, "C"))
    assert names(documents) == ["A", "C", "B"], "beside the tab that shows"


def test_opening_an_open_file_shows_its_tab(documents, tmp_path) -> None:
    path = file(tmp_path, "A")
    first = documents.open(path)
    documents.open(file(tmp_path, "B"))
    assert documents.open(tmp_path / "." / "A.nepb") is first
    assert documents.current is first
    assert len(documents) == 2


def test_invalid_file_leaves_all_tabs_unchanged(documents, tmp_path) -> None:
    documents.open(file(tmp_path, "A"))
    (tmp_path / "bad.nepb").write_text("{")
    revision = documents.revision
    with pytest.raises(DocumentError):
        documents.open(tmp_path / "bad.nepb")
    assert (names(documents), documents.revision) == (["A"], revision)


def test_new_behaviours_have_unique_names(documents) -> None:
    first = documents.new()
    assert documents.new() is first, "an untouched one is taken as it is"
    documents.current.apply_edit(STARTED)
    documents.new()
    documents.current.apply_edit(STARTED)
    documents.new()
    assert names(documents) == ["New behaviour", "New behaviour 2", "New behaviour 3"]
    assert len({document.key for document in documents}) == 3


def test_each_tab_has_its_own_blocks_journal_and_dirty_state(documents, journals, tmp_path) -> None:
    documents.open(file(tmp_path, "A"))
    documents.open(file(tmp_path, "B"))
    first, second = documents
    first.apply_edit(OTHER)
    assert (first.dirty, second.dirty) == (True, False)
    assert (first.workspace, second.workspace) == (OTHER, STARTED)
    assert all_kept(documents)
    assert [journal.name for journal in journals.glob("*.json")] == [first.journal_name]


def test_tab_navigation_wraps_around_and_tabs_can_be_moved(documents, tmp_path) -> None:
    for name in "ABC":
        documents.open(file(tmp_path, name))
    assert documents.neighbour(1).name == "A"
    assert documents.neighbour(-1).name == "B"
    documents.move(documents.current, 0)
    assert names(documents) == ["C", "A", "B"]
    assert documents.current.name == "C"


def test_close_shows_next_tab_and_last_close_opens_empty_behaviour(documents, tmp_path) -> None:
    for name in "ABC":
        documents.open(file(tmp_path, name))
    documents.show(documents.find_by_path(tmp_path / "B.nepb"))
    documents.close(documents.current)
    assert documents.current.name == "C"
    documents.close(documents.current)
    documents.close(documents.current)
    assert names(documents) == ["New behaviour"]
    assert documents.current.is_blank


def test_closed_tabs_reopen_newest_first(documents, tmp_path) -> None:
    for name in "AB":
        documents.open(file(tmp_path, name))
    for document in tuple(documents):
        documents.close(document)
    assert documents.can_reopen
    assert [documents.reopen().name, documents.reopen().name] == ["B", "A"]
    assert documents.reopen() is None
    assert not documents.can_reopen


def test_save_over_file_of_another_tab_keeps_that_tab_as_unsaved(documents, journals, tmp_path) -> None:
    path = file(tmp_path, "A")
    first = documents.open(path)
    documents.open(file(tmp_path, "B", OTHER))
    documents.current.save(path)
    documents.on_saved(documents.current)
    assert (first.path, first.dirty, first.workspace) == (None, True, STARTED)
    assert all_kept(documents)
    assert (journals / first.journal_name).is_file()


def test_connected_robots_are_available_in_every_tab_including_later_tabs(documents, tmp_path) -> None:
    documents.open(file(tmp_path, "A"))
    documents.set_connected([rize.robot("Pepper")])
    documents.set_topics(["/faces"])
    documents.open(file(tmp_path, "B"))
    for document in documents:
        text = json.dumps(document.definitions())
        assert "Pepper" in text
        assert "/faces" in text


def test_tabs_are_restored_with_unsaved_work(opened, documents, journals, tmp_path) -> None:
    for name in "AB":
        documents.open(file(tmp_path, name))
    documents.show(next(iter(documents)))
    documents.current.apply_edit(OTHER)
    documents.new()
    documents.current.apply_edit(STARTED)
    kept = json.loads(json.dumps(documents.tabs_state()))
    documents.close_all()
    as_if_dead(journals)
    after = opened()
    taken = after.restore_tabs(kept, unsaved_work(journals), has_ended_normally=True)
    assert names(after) == ["A", "New behaviour", "B"]
    assert [document.dirty for document in after] == [True, True, False]
    assert next(iter(after)).workspace == OTHER
    assert after.current.name == "New behaviour"
    assert len(taken) == 2
    assert all_kept(after)
    assert len(list(journals.glob("*.json"))) == 2, "journalled anew"


def test_after_crash_files_reopen_as_saved_and_unsaved_work_awaits_recovery(
    opened, documents, journals, tmp_path
) -> None:
    documents.open(file(tmp_path, "A"))
    documents.current.apply_edit(OTHER)
    kept = documents.tabs_state()
    assert all_kept(documents)
    as_if_dead(journals)
    after = opened()
    left = unsaved_work(journals)
    assert after.restore_tabs(kept, left, has_ended_normally=False) == set()
    assert (names(after), after.current.workspace, after.current.dirty) == (["A"], STARTED, False)
    after.recover(left[0])
    assert (names(after), after.current.workspace, after.current.dirty) == (["A"], OTHER, True)


@pytest.mark.parametrize(
    "kept",
    [
        {},
        {"tabs": 3, "current": "x"},
        {"tabs": [None, {"path": 3}, {"path": "/no/such.nepb", "journal": []}, {}], "current": 7},
    ],
)
def test_invalid_tab_settings_open_only_an_empty_behaviour(documents, kept) -> None:
    documents.restore_tabs(kept, [], has_ended_normally=True)
    assert names(documents) == ["New behaviour"]


def test_damaged_file_is_not_reopened(opened, documents, tmp_path) -> None:
    path = file(tmp_path, "A")
    documents.open(path)
    kept = documents.tabs_state()
    path.write_text("{")
    after = opened()
    after.restore_tabs(kept, [], has_ended_normally=True)
    assert after.current.is_blank


def test_close_leaves_no_journal_of_saved_work(documents, journals, tmp_path) -> None:
    documents.open(file(tmp_path, "A"))
    documents.current.apply_edit(OTHER)
    documents.current.save()
    documents.close(documents.current)
    documents.close_all()
    assert list(journals.glob("*")) == []


def test_recovered_work_does_not_replace_newer_work(opened, documents, journals, tmp_path) -> None:
    path = file(tmp_path, "A")
    documents.open(path)
    documents.current.apply_edit(OTHER)
    assert all_kept(documents)
    as_if_dead(journals)
    after = opened()
    left = unsaved_work(journals)
    after.open(path)
    newer = {"blocks": {"blocks": [{"type": "events_started", "id": "newer"}]}}
    after.current.apply_edit(newer)
    after.recover(left[0])
    assert [document.workspace for document in after] == [newer, OTHER]
    assert all(document.dirty for document in after)


def test_number_of_remembered_closed_tabs_is_limited(documents, tmp_path) -> None:
    for number in range(MAX_CLOSED_TABS + 2):
        documents.open(file(tmp_path, f"F{number}"))
        documents.close(documents.current)
    again = 0
    while documents.reopen() is not None:
        again += 1
    assert again == MAX_CLOSED_TABS
