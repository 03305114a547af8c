"""Detection of edits of the running behaviour since its start."""

from __future__ import annotations

from typing import Protocol

from app.blocks.model.program import Program


class RunDocument(Protocol):
    """Part of the interface of `Document` that `EditsSinceRun` uses."""

    edits: int

    def newest_program(self) -> Program | None:
        """Return the newest compiled program, or None."""


class EditsSinceRun:
    """Comparison of the running program with the current blocks.

    Undone edits and blocks that were moved on the canvas don't count as edits. Robots that connect or
    disconnect change the program but not the blocks.
    """

    def __init__(self) -> None:
        self._document: RunDocument | None = None
        self._edits = 0
        self._ran = ""
        self._compared: Program | None = None
        self._differs = False

    def set_program(self, document: RunDocument | None, program: Program) -> None:
        """Set the running program.

        Args:
            document: Behaviour of the program; None to ignore edits.
            program: Program that was started.
        """
        self._document, self._ran = document, program.runnable
        self._edits = 0 if document is None else document.edits
        self._compared, self._differs = program, False

    def has_edits(self) -> bool:
        """Return True if the current blocks differ from the running program."""
        if self._document is None:
            return False
        newest = self._document.newest_program()
        if newest is None or newest is self._compared:
            return self._differs
        self._compared = newest
        if self._document.edits == self._edits:
            self._ran = newest.runnable  # robots connected or disconnected: Restart would not apply an edit
        self._differs = newest.runnable != self._ran
        return self._differs
