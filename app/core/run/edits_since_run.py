"""Detection of edits of the running behaviour since its start."""

from __future__ import annotations

from typing import Protocol

from app.blocks.model.program import Program


class RunDocument(Protocol):
    """Part of the interface of `OpenProject` that `EditsSinceRun` uses."""

    edits: int

    def newest_program(self) -> Program | None:
        """Return the newest compiled program, or None."""


class EditsSinceRun:
    """Comparison of the running program with the current blocks.

    Undone edits and blocks that were moved on the canvas don't count as edits. Robots that connect or
    disconnect change the program but not the blocks.
    """

    def __init__(self) -> None:
        self._project: RunDocument | None = None
        self._edit_count = 0
        self._started_code = ""
        self._compared_program: Program | None = None
        self._is_edited = False

    def set_program(self, project: RunDocument | None, program: Program) -> None:
        """Set the running program.

        Args:
            project: Behaviour of the program; None to ignore edits.
            program: Program that was started.
        """
        self._project, self._started_code = project, program.runnable
        self._edit_count = 0 if project is None else project.edits
        self._compared_program, self._is_edited = program, False

    def has_edits(self) -> bool:
        """Return True if the current blocks differ from the running program."""
        if self._project is None:
            return False
        newest = self._project.newest_program()
        if newest is None or newest is self._compared_program:
            return self._is_edited
        self._compared_program = newest
        if self._project.edits == self._edit_count:
            self._started_code = (
                newest.runnable
            )  # robots connected or disconnected: Restart would not apply an edit
        self._is_edited = newest.runnable != self._started_code
        return self._is_edited
