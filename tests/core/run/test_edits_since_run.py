"""Tests of edits since the last run: blocks that compile to another program; a connected robot is no edit."""

from __future__ import annotations

from app.blocks.model.program import Program
from app.core.run.edits_since_run import EditsSinceRun


class Document:
    """Fake document with the compiled program of the test."""

    def __init__(self) -> None:
        self.edits = 0
        self.compiled: Program | None = program("a")

    def newest_program(self) -> Program | None:
        return self.compiled

    def edited(self, runnable: str) -> None:
        self.edits += 1
        self.compiled = program(runnable)


def program(runnable: str) -> Program:
    return Program("Mine", "", runnable, {})


def test_no_edit_is_reported_before_the_first_run() -> None:
    assert not EditsSinceRun().has_edits()


def test_edit_is_reported_until_undone_or_run() -> None:
    edits, document = EditsSinceRun(), Document()
    edits.set_program(document, program("a"))
    assert not edits.has_edits()
    document.edited("b")
    assert edits.has_edits()
    document.edited("a")
    assert not edits.has_edits()
    document.edited("b")
    edits.set_program(document, program("b"))
    assert not edits.has_edits()


def test_edit_state_is_unchanged_during_background_compilation() -> None:
    edits, document = EditsSinceRun(), Document()
    edits.set_program(document, program("a"))
    document.compiled = None
    assert not edits.has_edits()
    document.edited("b")
    assert edits.has_edits()


def test_connected_robot_is_not_an_edit() -> None:
    edits, document = EditsSinceRun(), Document()
    edits.set_program(document, program("a"))
    document.compiled = program("a, and what the robot does")
    assert not edits.has_edits()
    document.edited("a")
    assert edits.has_edits()
