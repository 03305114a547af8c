"""Tests of an open behaviour: edits are journalled, saving is atomic, damaged files are reported."""

from __future__ import annotations

import errno
import json
import os
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from app.core.projects import file_format
from app.core.projects.journal import Journal, unsaved_work
from app.core.projects.open_project import CompiledProgram, OpenProject
from app.core.storage.atomic_file import MAX_BYTES
from app.core.storage.background_worker import BackgroundWorker
from app.errors import DocumentError
from app.robots.client import rize
from tests.blocks.fakes import until

EMPTY: dict[str, object] = {}
STARTED: dict[str, object] = {
    "blocks": {"languageVersion": 0, "blocks": [{"type": "events_started", "id": "a", "x": 1, "y": 2}]}
}


@pytest.fixture
def journals(tmp_path: Path) -> Path:
    return tmp_path / "journal"


@pytest.fixture
def journal_writer() -> Iterator[BackgroundWorker[Path]]:
    made: BackgroundWorker[Path] = BackgroundWorker("test journal")
    yield made
    made.close()


@pytest.fixture(params=["written at once", "written beside the window"])
def document(request, journals: Path, journal_writer: BackgroundWorker[Path]) -> OpenProject:
    made = OpenProject(lambda: Journal(journals), clock=lambda: 5.0)
    if request.param == "written beside the window":
        made.journal_writer = journal_writer
    return made


class SlowJournal(Journal):
    """Journal whose writes block until the test releases them, as on a slow disk."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.began, self.goes, self.wrote = threading.Event(), threading.Event(), 0

    def write(self, *arguments, **named) -> Path:
        self.began.set()
        assert self.goes.wait(60)
        path = super().write(*arguments, **named)
        self.wrote += 1
        return path


@pytest.fixture
def slow(journals: Path) -> SlowJournal:
    return SlowJournal(journals)


@pytest.fixture
def on_a_slow_disk(slow: SlowJournal, journal_writer: BackgroundWorker[Path]) -> Iterator[OpenProject]:
    document = OpenProject(lambda: slow)
    document.journal_writer = journal_writer
    yield document
    slow.goes.set()


def test_slow_disk_does_not_block_and_newest_edit_is_journalled(
    on_a_slow_disk: OpenProject, slow: SlowJournal, journals: Path
) -> None:
    document = on_a_slow_disk
    document.apply_edit(STARTED)
    assert slow.began.wait(60)
    for number in range(5):
        document.apply_edit(_many(number + 1))
    assert document.edits == 6
    assert not list(journals.glob("*.json")), "and yet nothing is there"
    slow.goes.set()
    assert document.is_on_disk
    (file,) = journals.glob("*.json")
    assert json.loads(file.read_bytes())["workspace"] == _many(5)
    assert slow.wrote == 2, "what is outdated is not written"


@pytest.mark.parametrize("end", [OpenProject.new, OpenProject.close, lambda document: document.save()])
def test_journal_is_deleted_when_its_document_is_replaced_closed_or_saved_during_a_write(
    on_a_slow_disk: OpenProject,
    slow: SlowJournal,
    journal_writer: BackgroundWorker[Path],
    tmp_path: Path,
    journals: Path,
    end: Callable[[OpenProject], object],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("app.core.storage.background_worker.JOIN_TIMEOUT_S", 60.0)
    document = on_a_slow_disk
    document.path = tmp_path / "mine.nepb"
    document.apply_edit(STARTED)
    assert slow.began.wait(60)
    document.dirty = False
    threading.Timer(0.05, slow.goes.set).start()
    end(document)
    assert journal_writer.finish(slow.name), "what was under way has ended, too"
    assert list(journals.glob("*")) == []


def test_journal_retry_fails_while_the_disk_is_unresponsive_and_then_succeeds(
    on_a_slow_disk: OpenProject, slow: SlowJournal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.core.storage.background_worker.JOIN_TIMEOUT_S", 0.01)
    on_a_slow_disk.apply_edit(STARTED)
    assert slow.began.wait(60)
    assert not on_a_slow_disk.retry_journal()
    monkeypatch.setattr("app.core.storage.background_worker.JOIN_TIMEOUT_S", 60.0)
    slow.goes.set()
    assert on_a_slow_disk.retry_journal()


def test_old_journal_is_kept_until_the_new_journal_is_written(document: OpenProject, journals: Path) -> None:
    document.apply_edit(STARTED)
    assert document.is_on_disk
    _as_if_dead(journals)
    (unsaved,) = unsaved_work(journals)
    full = journals.parent / "full"
    full.write_text("no folder")
    after = OpenProject(lambda: Journal(full))
    after.recover(unsaved)
    assert after.dirty
    assert unsaved.journal.is_file()


def _as_if_dead(journals: Path) -> None:
    (file,) = journals.glob("*.json")
    entry = json.loads(file.read_bytes())
    entry["pid"], entry["born_s"] = 2**22 + 5, 0.0
    file.write_text(json.dumps(entry))


def test_edit_is_journalled(document: OpenProject, journals: Path) -> None:
    document.apply_edit(STARTED)
    assert document.is_on_disk
    (file,) = journals.glob("*.json")
    assert json.loads(file.read_bytes())["workspace"] == STARTED
    assert document.dirty


def test_identical_blocks_are_not_an_edit(document: OpenProject) -> None:
    document.apply_edit(STARTED)
    edits = document.edits
    document.apply_edit(json.loads(json.dumps(STARTED)))
    assert document.edits == edits


def test_saved_behaviour_reopens_unchanged_and_its_journal_is_deleted(
    document: OpenProject, journals: Path, tmp_path: Path
) -> None:
    document.apply_edit(STARTED)
    path = tmp_path / "Grüße.nepb"
    document.save(path)
    assert not document.dirty
    assert list(journals.glob("*")) == []
    other = OpenProject(lambda: Journal(journals))
    other.open(path)
    assert (other.name, other.workspace, other.dirty) == ("Grüße", STARTED, False)


def test_save_without_file_raises_with_advice(document: OpenProject) -> None:
    with pytest.raises(DocumentError, match="choose a file"):
        document.save()


def test_failed_save_keeps_document_dirty_and_journalled(
    document: OpenProject, journals: Path, tmp_path: Path
) -> None:
    document.apply_edit(STARTED)
    (tmp_path / "folder.nepb").mkdir()
    with pytest.raises(DocumentError, match="save it in another folder"):
        document.save(tmp_path / "folder.nepb")
    assert document.dirty
    assert len(list(journals.glob("*.json"))) == 1


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "damaged"),
        (b"{", "damaged"),
        (b"[1, 2]", "isn't a behaviour"),
        (b'{"format": "other"}', "isn't a behaviour"),
        (b'{"format": "nep-behaviour", "version": 99, "workspace": {}}', "newer NEP Studio"),
        (b'{"format": "nep-behaviour", "version": 1}', "no blocks"),
        (b'{"format": "nep-behaviour", "version": 1, "workspace": []}', "no blocks"),
        (b"[" * 100_000, "damaged"),
    ],
)
def test_invalid_file_is_rejected_with_reason_and_changes_nothing(
    document: OpenProject, tmp_path: Path, data: bytes, reason: str
) -> None:
    document.apply_edit(STARTED)
    path = tmp_path / "bad.nepb"
    path.write_bytes(data)
    with pytest.raises(DocumentError, match=reason):
        document.open(path)
    assert document.workspace == STARTED


def test_file_truncated_at_any_length_is_rejected(document: OpenProject, tmp_path: Path) -> None:
    document.apply_edit(STARTED)
    path = tmp_path / "a.nepb"
    document.save(path)
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(DocumentError):
            file_format.read_file(path)


def test_oversized_file_is_rejected(document: OpenProject, tmp_path: Path) -> None:
    path = tmp_path / "huge.nepb"
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(DocumentError, match="the limit is 10 MB"):
        document.open(path)


def test_behaviour_too_large_to_reopen_is_not_saved(document: OpenProject, tmp_path: Path) -> None:
    path = tmp_path / "large.nepb"
    document.apply_edit({"blocks": {"x": "y" * MAX_BYTES}})
    with pytest.raises(DocumentError, match="the limit is 10 MB; use smaller images"):
        document.save(path)
    assert not path.exists()


def test_stack_too_long_for_json_is_rejected_with_reason_and_stays_open(
    document: OpenProject, tmp_path: Path
) -> None:
    block: dict[str, object] = {"type": "control_wait", "id": "x"}
    for number in range(6000):
        block = {"type": "control_wait", "id": str(number), "next": {"block": block}}
    stack = {"blocks": {"languageVersion": 0, "blocks": [block]}}
    document.apply_edit(stack)
    assert document.workspace is stack
    until(lambda: document.journal_error is not None)
    assert not document.is_on_disk
    assert document.journal_error is not None
    assert "split it into several scripts" in document.journal_error
    with pytest.raises(DocumentError, match="split it into several scripts"):
        document.save(tmp_path / "long.nepb")
    document.apply_edit(STARTED)
    assert document.is_on_disk
    assert document.journal_error is None


def test_missing_file_is_rejected_with_reason(document: OpenProject, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="can't read "):
        document.open(tmp_path / "none.nepb")


def test_example_opens_without_its_file_path(document: OpenProject, tmp_path: Path) -> None:
    document.apply_edit(STARTED)
    path = tmp_path / "Example.nepb"
    document.save(path)
    document.new()
    document.open_example(path)
    assert document.path is None
    assert document.workspace == STARTED
    assert not document.dirty


def test_recovered_work_stays_journalled(document: OpenProject, journals: Path) -> None:
    document.project = replace(document.project, unknown_fields={"description": "what it does"})
    document.apply_edit(STARTED)
    assert document.is_on_disk
    _as_if_dead(journals)
    (unsaved,) = unsaved_work(journals)
    after = OpenProject(lambda: Journal(journals))
    after.recover(unsaved)
    assert after.workspace == STARTED
    assert after.project.unknown_fields == {"description": "what it does"}
    assert after.dirty
    assert not unsaved.journal.exists()
    assert len(list(journals.glob("*.json"))) == 1


def test_close_keeps_journal_of_unsaved_work_only(document: OpenProject, journals: Path) -> None:
    document.close()
    assert list(journals.glob("*")) == []
    document.apply_edit(STARTED)
    document.close()
    assert len(list(journals.glob("*.json"))) == 1


def test_unwritable_journal_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    document = OpenProject(lambda: Journal(tmp_path / "file"))
    document.apply_edit(STARTED)
    assert document.journal_error is not None
    assert "save the file now" in document.journal_error


def test_failed_journal_write_is_retried_successfully(tmp_path: Path) -> None:
    folder = tmp_path / "full"
    folder.write_text("no folder")
    document = OpenProject(lambda: Journal(folder))
    document.apply_edit(STARTED)
    assert not document.retry_journal()
    folder.unlink()
    assert document.retry_journal()
    assert document.journal_error is None
    (file,) = folder.glob("*.json")
    assert json.loads(file.read_bytes())["workspace"] == STARTED


def test_journal_error_is_cleared_after_save_and_for_new_behaviour(tmp_path: Path) -> None:
    (tmp_path / "full").write_text("no folder")
    document = OpenProject(lambda: Journal(tmp_path / "full"))
    document.apply_edit(STARTED)
    assert document.journal_error is not None
    document.save(tmp_path / "Mine.nepb")
    assert document.journal_error is None
    assert document.retry_journal()
    document.apply_edit(EMPTY)
    assert document.journal_error is not None
    document.new()
    assert document.journal_error is None


@pytest.mark.parametrize(
    ("number", "then"),
    [
        (errno.ENOSPC, "; free some space or choose another folder"),
        (errno.EROFS, "; save it in another folder"),
        (errno.EACCES, "; save it in another folder"),
    ],
)
def test_free_space_advice_appears_only_for_full_disk(
    document: OpenProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, then: str
) -> None:
    def refuse(*_given: object, **_named: object) -> None:
        raise OSError(number, os.strerror(number))

    document.apply_edit(STARTED)
    monkeypatch.setattr(file_format, "write_atomically", refuse)
    with pytest.raises(DocumentError) as raised:
        document.save(tmp_path / "Mine.nepb")
    assert str(raised.value).endswith(f"can't write Mine.nepb ({os.strerror(number)}){then}")


def test_file_includes_descriptions_of_robots_used_by_its_blocks(
    document: OpenProject, tmp_path: Path
) -> None:
    pepper, other = rize.robot("Pepper"), rize.robot("Other")
    block = {"type": "robot_rize_do_say", "id": "b", "fields": {"ROBOT": "Pepper"}}
    document.set_connected([pepper, other])
    document.apply_edit({"blocks": {"blocks": [block]}})
    document.save(tmp_path / "a.nepb")
    assert list(document.robots) == ["Pepper"]
    document.set_connected([])
    assert [robot.name for robot in document.absent_robots] == ["Pepper"]
    later = OpenProject(lambda: Journal(tmp_path / "other"))
    later.open(tmp_path / "a.nepb")
    assert [robot.name for robot in later.absent_robots] == ["Pepper"]


def test_robot_description_is_parsed_once_until_it_changes(
    document: OpenProject, monkeypatch: pytest.MonkeyPatch
) -> None:
    pepper = rize.robot("Pepper")
    block = {"type": "robot_rize_do_say", "id": "b", "fields": {"ROBOT": "Pepper"}}
    document.set_connected([pepper])
    document.apply_edit({"blocks": {"blocks": [block]}})
    document.set_connected([])
    assert [robot.name for robot in document.absent_robots] == ["Pepper"]
    with monkeypatch.context() as patched:
        patched.setattr("app.core.projects.open_project.parse", None)  # a second parse would fail
        document.apply_edit({"blocks": {"blocks": [{**block, "x": 9}]}})
        assert [robot.name for robot in document.absent_robots] == ["Pepper"]
    document.robots["Pepper"] = {**pepper.source, "title": "Salt"}
    assert [robot.name for robot in document.absent_robots] == ["Salt"]
    deep: dict[str, object] = {}
    for _level in range(100_000):
        deep = {"deep": deep}
    document.robots["Pepper"] = deep
    assert document.absent_robots == ()
    document.robots["Pepper"] = {"deep": deep}
    assert document.absent_robots == ()
    while deep:  # from the outside in, because deallocating nested dicts recurses, too
        deep = deep.popitem()[1]  # type: ignore[assignment]


def test_program_is_compiled_once_per_edit_and_robot_change(document: OpenProject) -> None:
    document.apply_edit(STARTED)
    first = document.program()
    assert document.program() is first
    document.set_connected([rize.robot("Pepper")])
    second = document.program()
    assert second is not first
    document.apply_edit(EMPTY)
    assert document.program() is not second


def test_editor_definitions_follow_connected_robots(document: OpenProject) -> None:
    before = document.definitions()
    revision = document.definitions_revision
    assert document.definitions() is before
    document.set_connected([rize.robot("Pepper")])
    assert document.definitions_revision > revision
    assert "Pepper" in json.dumps(document.definitions())


def _many(count: int) -> dict[str, object]:
    tops = [{"type": "events_started", "id": f"s{number}", "x": 0, "y": number} for number in range(count)]
    return {"blocks": {"languageVersion": 0, "blocks": tops}}


def test_long_behaviour_is_compiled_in_background(document: OpenProject) -> None:
    compiler: BackgroundWorker[CompiledProgram] = BackgroundWorker("test compiler")
    document.compiler = compiler
    document.apply_edit(_many(800))
    assert document.newest_program() is None, "nothing waits for it"
    until(lambda: document.newest_program() is not None)
    first = document.newest_program()
    document._compile_s = 1.0
    document.apply_edit(_many(801))
    assert document.newest_program() is first, "the one before, meanwhile"
    until(lambda: document.newest_program() is not first)
    assert document.newest_program() is document.program()
    compiler.close()


def test_short_behaviour_is_compiled_at_once(document: OpenProject) -> None:
    compiler: BackgroundWorker[CompiledProgram] = BackgroundWorker("test compiler")
    document.compiler = compiler
    document.apply_edit(STARTED)
    assert document.newest_program() is document.program()
    assert compiler._thread is None


def test_long_file_opened_in_unmodified_tab_is_compiled_in_background(
    document: OpenProject, tmp_path: Path
) -> None:
    other = OpenProject(lambda: Journal(tmp_path / "other"))
    other.apply_edit(_many(800))
    other.save(tmp_path / "long.nepb")
    compiler: BackgroundWorker[CompiledProgram] = BackgroundWorker("test compiler")
    document.compiler = compiler
    assert document.newest_program() is not None, "an empty one is compiled at once"
    document.open(tmp_path / "long.nepb")
    assert document.newest_program() is None, "the program of the previous content isn't returned"
    until(lambda: document.newest_program() is not None)
    assert document.newest_program() is document.program()
    compiler.close()
