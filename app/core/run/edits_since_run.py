"""Whether the blocks of the behaviour that runs say something else than when Run was pressed."""

from __future__ import annotations

from typing import Protocol

from app.blocks.model.program import Program


class RunDocument(Protocol):
    """What is needed of the behaviour that runs."""

    edits: int

    def newest(self) -> Program | None:
        """The program of its newest edit that is compiled."""


class EditsSinceRun:
    """Compares the program that runs with that of the blocks now; one that was undone is the same again.

    A block that is only moved to another place changes nothing. Robots that come or go change the program,
    too, but not the blocks.
    """

    def __init__(self) -> None:
        self._document: RunDocument | None = None
        self._edits = 0
        self._ran = ""
        self._looked: Program | None = None
        self._differs = False

    def ran(self, document: RunDocument | None, program: Program) -> None:
        """This program of this behaviour runs now; None: edits are no matter of what runs."""
        self._document, self._ran = document, program.runnable
        self._edits = 0 if document is None else document.edits
        self._looked, self._differs = program, False

    def seen(self) -> bool:
        """Whether the blocks say something else now; each program is compared once."""
        if self._document is None:
            return False
        newest = self._document.newest()
        if newest is None or newest is self._looked:
            return self._differs
        self._looked = newest
        if self._document.edits == self._edits:
            self._ran = newest.runnable  # robots came or went: Restart would not do what a person changed
        self._differs = newest.runnable != self._ran
        return self._differs
