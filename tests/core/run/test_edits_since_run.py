"""An edit counts while the blocks say something else than what runs; robots that come are no edit."""

from __future__ import annotations

from app.blocks.model.program import Program
from app.core.run.edits_since_run import EditsSinceRun


class Document:
    """A behaviour of which a test says what it compiles to."""

    def __init__(self) -> None:
        self.edits = 0
        self.compiled: Program | None = program("a")

    def newest(self) -> Program | None:
        return self.compiled

    def edited(self, runnable: str) -> None:
        self.edits += 1
        self.compiled = program(runnable)


def program(runnable: str) -> Program:
    return Program("Mine", "", runnable, {})


def test_nothing_ran_nothing_was_edited() -> None:
    assert not EditsSinceRun().seen()


def test_an_edit_is_seen_until_it_is_undone_or_run() -> None:
    edits, document = EditsSinceRun(), Document()
    edits.ran(document, program("a"))
    assert not edits.seen()
    document.edited("b")
    assert edits.seen()
    document.edited("a")
    assert not edits.seen()
    document.edited("b")
    edits.ran(document, program("b"))
    assert not edits.seen()


def test_while_a_long_behaviour_is_compiled_it_stays_as_it_was() -> None:
    edits, document = EditsSinceRun(), Document()
    edits.ran(document, program("a"))
    document.compiled = None
    assert not edits.seen()
    document.edited("b")
    assert edits.seen()


def test_a_robot_that_comes_is_no_edit() -> None:
    edits, document = EditsSinceRun(), Document()
    edits.ran(document, program("a"))
    document.compiled = program("a, and what the robot does")
    assert not edits.seen()
    document.edited("a")
    assert edits.seen()
