"""The errors that stand at blocks, each until its block is repaired or the next Run."""

from __future__ import annotations

from collections.abc import Mapping

from app.blocks.model.program import Program
from app.blocks.model.workspace import saved_blocks
from app.core.run.wanted import Wanted
from app.core.storage import deep_json

_CONTENT = ("type", "fields", "inputs", "extraState", "enabled", "disabledReasons")


class BlockErrors:
    """Sentences by the ids of blocks (``by_block``).

    An error that kept a program from starting goes when the blocks no longer have it. One that stopped a
    program goes when its block, or a block inside it, says something else than when Run was pressed.
    """

    def __init__(self) -> None:
        self.by_block: Mapping[str, str] = {}
        self._wanted: Wanted | None = None
        self._not_started = False
        self._ran: Mapping[str, object] = {}
        self._looked: Program | int | None = None  # the newest program, or count of edits, that was checked

    def begin(self, wanted: Wanted) -> None:
        """Forget the errors of the last run; this is to run now."""
        self.by_block, self._wanted, self._ran = {}, wanted, wanted.document.workspace

    def put(self, errors: Mapping[str, str], *, not_started: bool) -> None:
        """Remember errors, which kept the program from starting or stopped it."""
        self.by_block, self._not_started, self._looked = errors, not_started, None

    def forget_repaired(self) -> bool:
        """Remove the errors whose blocks are repaired; return whether any were removed."""
        if not self.by_block or self._wanted is None:
            return False
        count = len(self.by_block)
        if self._not_started:
            self.by_block = self._unsolved(self._wanted)
        elif self._looked != (edits := self._wanted.document.edits):
            self._looked = edits
            self.by_block = self._unchanged(self._wanted.document.workspace)
        return len(self.by_block) < count

    def _unsolved(self, wanted: Wanted) -> Mapping[str, str]:
        newest = wanted.document.newest()
        if newest is None or newest is self._looked:
            return self.by_block
        self._looked = newest
        program = newest if wanted.stack is None else wanted.program()
        wrong = {} if program is None else wanted.problems(program)
        return {block: said for block, said in self.by_block.items() if wrong.get(block) == said}

    def _unchanged(self, workspace: Mapping[str, object]) -> Mapping[str, str]:
        before, now = (_contents(each, self.by_block) for each in (self._ran, workspace))
        return {
            block: said
            for block, said in self.by_block.items()
            if block in now and deep_json.same(before.get(block), now[block])
        }


def _contents(workspace: Mapping[str, object], ids: Mapping[str, str]) -> dict[str, object]:
    return {
        str(block["id"]): {name: block[name] for name in _CONTENT if name in block}
        for block in saved_blocks(workspace)
        if block.get("id") in ids
    }
