"""Errors shown on blocks until the block is fixed or the next run starts."""

from __future__ import annotations

from collections.abc import Mapping

from app.blocks.model import deep_json
from app.blocks.model.program import Program
from app.blocks.model.workspace import saved_blocks
from app.core.run.requests import RequestedRun

_CONTENT_KEYS = ("type", "fields", "inputs", "extraState", "enabled", "disabledReasons")


class BlockErrors:
    """Error messages shown on blocks.

    An error that prevented the start is removed when the compiler no longer reports it. An error that
    stopped a program is removed when its block, or a block inside it, has been edited since the start.

    Attributes:
        by_block: Error message of each block, by block id.
    """

    def __init__(self) -> None:
        self.by_block: Mapping[str, str] = {}
        self._requested_run: RequestedRun | None = None
        self._prevents_start = False
        self._started_workspace: Mapping[str, object] = {}
        self._last_checked: Program | int | None = (
            None  # the newest program, or count of edits, that was checked
        )

    def start_run(self, request: RequestedRun) -> None:
        """Clear the errors of the previous run, at the start of a new one."""
        self.by_block, self._requested_run, self._started_workspace = {}, request, request.document.workspace

    def set_errors(self, errors: Mapping[str, str], *, prevents_start: bool) -> None:
        """Set the errors of the run.

        Args:
            errors: Error messages by block id.
            prevents_start: True if the errors prevented the start, False if they stopped the program.
        """
        self.by_block, self._prevents_start, self._last_checked = errors, prevents_start, None

    def discard_fixed(self) -> bool:
        """Remove the errors of fixed blocks; return True if any were removed."""
        if not self.by_block or self._requested_run is None:
            return False
        count = len(self.by_block)
        if self._prevents_start:
            self.by_block = self._unsolved_errors(self._requested_run)
        elif self._last_checked != (edits := self._requested_run.document.edits):
            self._last_checked = edits
            self.by_block = self._unchanged_errors(self._requested_run.document.workspace)
        return len(self.by_block) < count

    def _unsolved_errors(self, request: RequestedRun) -> Mapping[str, str]:
        newest = request.document.newest_program()
        if newest is None or newest is self._last_checked:
            return self.by_block
        self._last_checked = newest
        program = newest if request.stack is None else request.program()
        problems = {} if program is None else request.problems(program)
        return {block: error for block, error in self.by_block.items() if problems.get(block) == error}

    def _unchanged_errors(self, workspace: Mapping[str, object]) -> Mapping[str, str]:
        started_contents, contents = (
            _contents(each, self.by_block) for each in (self._started_workspace, workspace)
        )
        return {
            block: error
            for block, error in self.by_block.items()
            if block in contents and deep_json.are_equal(started_contents.get(block), contents[block])
        }


def _contents(workspace: Mapping[str, object], ids: Mapping[str, str]) -> dict[str, object]:
    return {
        str(block["id"]): {name: block[name] for name in _CONTENT_KEYS if name in block}
        for block in saved_blocks(workspace)
        if block.get("id") in ids
    }
