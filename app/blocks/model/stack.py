"""Compilation of a single stack of a behaviour, so that the user can try it without the rest.

The stack runs as if it were below "when started", with the variables and functions of the behaviour.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass

from app.blocks.model.workspace import PLAIN_FUNCTION, RESULT_FUNCTION, saved_blocks

SavedJson = Mapping[str, object]
_HAT = {"type": "events_started", "id": "try hat"}
SHOW_BLOCK_ID = "try value"
"""Id of the generated block that prints the value of a tried value block."""


@dataclass(frozen=True)
class Stack:
    """Stack of blocks to try.

    Attributes:
        id: Id of the first block.
        kind: "value" to print the value of the block, "hat" to run only the blocks below it; otherwise the
            block and the blocks below it are run.
        state: Saved state of a block in the toolbox; None for a block of the behaviour.
    """

    id: str
    kind: str = "stack"
    state: SavedJson | None = None

    @property
    def is_value(self) -> bool:
        """True if the stack is a value block."""
        return self.kind == "value"

    def workspace(self, behaviour: SavedJson) -> dict[str, object] | None:
        """Return a workspace with only this stack, below a start block, and the functions of the behaviour.

        Returns None if the block doesn't exist, or if there is no block below an event block.

        Args:
            behaviour: Saved workspace of the behaviour.
        """
        result: dict[str, object] = copy.deepcopy(dict(behaviour))
        blocks = result.get("blocks")
        tops = blocks.get("blocks") if isinstance(blocks, dict) else None
        first_block = (
            copy.deepcopy(dict(self.state)) if self.state is not None else self._find_first_block(result)
        )
        first = self._blocks_to_run(first_block) if first_block is not None else None
        if first is None:
            return None
        functions = [
            top
            for top in tops or ()
            if isinstance(top, dict) and top.get("type") in (PLAIN_FUNCTION, RESULT_FUNCTION)
        ]
        result["blocks"] = {"languageVersion": 0, "blocks": [*functions, {**_HAT, "next": {"block": first}}]}
        return result

    def first_block_type(self, behaviour: SavedJson) -> str:
        """Return the type of the first block of the stack; "" if the block doesn't exist."""
        first_block = self.state if self.state is not None else self._find_first_block(behaviour)
        return str(first_block.get("type")) if first_block is not None else ""

    def variable_id(self, behaviour: SavedJson) -> str | None:
        """Return the id of the variable if the stack is a variable block, else None."""
        first_block = self.state if self.state is not None else self._find_first_block(behaviour)
        if not self.is_value or first_block is None or first_block.get("type") != "variables_get":
            return None
        fields = first_block.get("fields")
        variable = fields.get("VAR") if isinstance(fields, Mapping) else None
        return str(variable.get("id")) if isinstance(variable, Mapping) else None

    def _find_first_block(self, workspace: SavedJson) -> dict[str, object] | None:
        return next((block for block in saved_blocks(workspace) if block.get("id") == self.id), None)

    def _blocks_to_run(self, block: dict[str, object]) -> dict[str, object] | None:
        # For an event block, only the blocks below it.
        if self.is_value:
            return {"type": "messages_write", "id": SHOW_BLOCK_ID, "inputs": {"VALUE": {"block": block}}}
        if self.kind != "hat":
            return block
        next_connection = block.get("next")
        first = next_connection.get("block") if isinstance(next_connection, dict) else None
        return first if isinstance(first, dict) else None
