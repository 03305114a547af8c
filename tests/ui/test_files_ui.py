"""Opening and saving: nothing is lost, so nothing asks."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.core.document import Document
from app.ui.commands import Commands
from app.ui.files import kept_path
from app.ui.main_window import MainWindow
from tests.ui.shell_parts import Answers

pytest_plugins = ["tests.ui.shell_fixtures"]
BLOCKS = {"blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": "a"}]}}


@pytest.fixture
def document(window: MainWindow) -> Document:
    return window.session.document


def saved(path: Path) -> Path:
    """A behaviour file."""
    other = Document(_NoJournal)  # type: ignore[arg-type,return-value]
    other.workspace = BLOCKS
    other.save(path)
    return path


class _NoJournal:
    def write(self, *_what: object) -> None: ...
    def discard(self) -> None: ...


def test_saving_a_new_behaviour_asks_where(
    commands: Commands, document: Document, answers: Answers, tmp_path
) -> None:
    document.edited(BLOCKS)
    answers.path = tmp_path / "Story.nepb"
    commands.run("file.save")
    assert answers.asked[0].endswith("New behaviour.nepb")
    assert answers.path.is_file()
    assert (document.name, document.dirty) == ("Story", False)
    commands.run("file.save")
    assert len(answers.asked) == 1


def test_the_editors_newest_edit_is_saved(
    commands: Commands, window: MainWindow, document, answers, tmp_path
) -> None:
    answers.path = tmp_path / "a.nepb"
    bench = window.show_layout("behaviour")
    commands.run("file.save")
    assert bench.docks["behaviour"].panel.flushed == 1


def test_work_without_a_file_is_kept_when_another_opens(
    commands: Commands, window: MainWindow, document: Document, home: Path, tmp_path: Path
) -> None:
    path = saved(tmp_path / "Other.nepb")
    document.edited(BLOCKS)
    commands.files.open(path)
    assert document.name == "Other"
    kept = list((home / "kept").glob("New behaviour*.nepb"))
    assert len(kept) == 1
    assert {file.path for file in window.session.settings.recent} == {kept[0].resolve(), path.resolve()}
    assert window.toast.text == "Kept New behaviour in Recent"
    assert window.showing == "behaviour"


def test_a_changed_file_is_saved_when_a_new_behaviour_begins(
    commands: Commands, document: Document, tmp_path
) -> None:
    path = saved(tmp_path / "Mine.nepb")
    commands.files.open(path)
    changed = {"blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": "z"}]}}
    document.edited(changed)
    commands.run("file.new")
    assert document.name == "New behaviour"
    commands.files.open(path)
    assert document.workspace == changed


def test_an_untouched_behaviour_leaves_no_file(commands: Commands, home: Path) -> None:
    commands.run("file.new")
    assert not (home / "kept").exists()


def test_a_file_that_is_no_behaviour_becomes_an_alert(
    commands: Commands, window, document, tmp_path: Path
) -> None:
    path = tmp_path / "bad.nepb"
    path.write_text("not json", "utf-8")
    document.edited(BLOCKS)
    commands.files.open(path)
    alert = window.session.alerts.active[0]
    assert alert.title.startswith("Bad.nepb can't be opened") or alert.title.startswith("bad.nepb can't")
    assert alert.action == "file.open"
    assert document.workspace == BLOCKS


def test_a_place_that_can_not_be_written_becomes_an_alert(
    commands: Commands, window, document, answers, tmp_path
) -> None:
    document.edited(BLOCKS)
    (tmp_path / "file").write_text("in the way", "utf-8")
    answers.path = tmp_path / "file" / "x.nepb"
    commands.run("file.save")
    assert window.session.alerts.active[0].button == "Save somewhere else"
    assert document.dirty
    answers.path = tmp_path / "x.nepb"
    commands.run("file.save_as")
    assert list(window.session.alerts.active) == []


def test_mending_changes_the_blocks_and_tells_the_editor(commands: Commands, document: Document) -> None:
    wait = {"type": "control_wait_until", "id": "w"}
    document.edited({"blocks": {"languageVersion": 0, "blocks": [wait]}})
    before = document.revision
    assert commands.run("limit:w")
    assert document.workspace["blocks"]["blocks"][0]["type"] == "control_wait_until_at_most"
    assert document.revision > before
    assert document.dirty


def test_kept_files_never_replace_each_other(tmp_path: Path) -> None:
    first = kept_path(tmp_path, "a/b: c", 0)
    first.touch()
    second = kept_path(tmp_path, "a/b: c", 0)
    assert first.parent == tmp_path
    assert first != second
