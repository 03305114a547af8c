"""Tests of the error at a block: cleared when its block is fixed, kept after every other edit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.core.projects.open_project import OpenProject
from app.core.run.block_errors import BlockErrors
from app.core.run.requests import RequestedRun
from app.core.session import Session
from app.core.storage.settings import Settings
from tests.blocks.fakes import until
from tests.blocks.samples import block, number, started, text, workspace


@pytest.fixture
def document(tmp_path: Path) -> Iterator[OpenProject]:
    """Open project of a session that is never started and has no sockets."""
    made = Session(Settings(tmp_path), address="127.0.0.1:9", journal_folder=tmp_path, start_processes=False)
    yield made.document
    made.close()


def waiting(seconds: dict[str, object] | None, lines: str = "Hello") -> dict[str, object]:
    wait = block("control_wait", "w") if seconds is None else block("control_wait", "w", SECONDS=seconds)
    return workspace(started(block("messages_write", "p", VALUE=text(lines)), wait))


def test_error_of_stopped_program_is_cleared_when_its_block_changes(document: OpenProject) -> None:
    soon = text("soon")
    document.apply_edit(waiting(soon))
    errors = BlockErrors()
    errors.start_run(RequestedRun(document))
    errors.set_errors({"w": "“wait” needs a number"}, prevents_start=False)
    assert not errors.discard_fixed()
    document.apply_edit(waiting(soon, "Other"))
    assert not errors.discard_fixed()
    document.apply_edit(waiting(number(2), "Other"))
    assert errors.discard_fixed()
    assert errors.by_block == {}


def test_error_of_deleted_block_is_cleared(document: OpenProject) -> None:
    soon = text("soon")
    document.apply_edit(waiting(soon))
    errors = BlockErrors()
    errors.start_run(RequestedRun(document))
    errors.set_errors({"w": "“wait” needs a number"}, prevents_start=False)
    document.apply_edit(workspace(started()))
    assert errors.discard_fixed()


def test_error_that_prevented_start_is_cleared_when_blocks_are_fixed(document: OpenProject) -> None:
    wait = block("control_wait_until", "w")
    document.apply_edit(workspace(started(wait)))
    wanted, errors = RequestedRun(document), BlockErrors()
    errors.start_run(wanted)
    errors.set_errors(wanted.problems(document.program()), prevents_start=True)
    assert list(errors.by_block) == ["w"]
    document.apply_edit(workspace(started(block("messages_write", VALUE=text("Hello")), wait)))
    assert not errors.discard_fixed()
    document.apply_edit(
        workspace(started(block("control_wait_until", "w", CONDITION=block("values_boolean"))))
    )
    until(errors.discard_fixed)
    assert errors.by_block == {}
