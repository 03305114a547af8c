"""One stack of a behaviour as a program of its own: to try it at once, without the rest.

It runs as if it hung below “when started”, with the variables and functions of the behaviour.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass

from app.blocks.compiler.lowering import PLAIN, RESULT
from app.blocks.model.workspace import saved_blocks

Saved = Mapping[str, object]
_HAT = {"type": "events_started", "id": "try hat"}
SHOW = "try value"
"""The id of the block that writes a tried value."""


@dataclass(frozen=True)
class Stack:
    """What a person wants to try: a block of the behaviour by its ``id``, one of the toolbox by ``state``.

    A ``value`` is written, of a ``hat`` the blocks below it are run, any other block with those below it.
    """

    id: str
    kind: str = "stack"
    state: Saved | None = None

    @property
    def is_value(self) -> bool:
        """Whether it is a value, which nothing runs."""
        return self.kind == "value"

    @classmethod
    def from_json(cls, told: object) -> Stack:
        """What the editor's page tells; what is none is a stack that is nowhere."""
        known: Saved = told if isinstance(told, Mapping) else {}
        state = known.get("state")
        return cls(
            str(known.get("id")), str(known.get("kind")), state if isinstance(state, Mapping) else None
        )

    def workspace(self, behaviour: Saved) -> dict[str, object] | None:
        """The behaviour with nothing but this stack, and its functions; None when there is no such block."""
        made: dict[str, object] = copy.deepcopy(dict(behaviour))
        blocks = made.get("blocks")
        tops = blocks.get("blocks") if isinstance(blocks, dict) else None
        found = copy.deepcopy(dict(self.state)) if self.state is not None else self._found(made)
        first = self._below(found) if found is not None else None
        if first is None:
            return None
        functions = [
            top for top in tops or () if isinstance(top, dict) and top.get("type") in (PLAIN, RESULT)
        ]
        made["blocks"] = {"languageVersion": 0, "blocks": [*functions, {**_HAT, "next": {"block": first}}]}
        return made

    def type_in(self, behaviour: Saved) -> str:
        """The type of its first block; "" when there is no such block."""
        found = self.state if self.state is not None else self._found(behaviour)
        return str(found.get("type")) if found is not None else ""

    def variable_in(self, behaviour: Saved) -> str | None:
        """The id of the variable whose value it is, and nothing else; None for all others."""
        found = self.state if self.state is not None else self._found(behaviour)
        if not self.is_value or found is None or found.get("type") != "variables_get":
            return None
        fields = found.get("fields")
        chosen = fields.get("VAR") if isinstance(fields, Mapping) else None
        return str(chosen.get("id")) if isinstance(chosen, Mapping) else None

    def _found(self, workspace: Saved) -> dict[str, object] | None:
        return next((block for block in saved_blocks(workspace) if block.get("id") == self.id), None)

    def _below(self, found: dict[str, object]) -> dict[str, object] | None:
        """What hangs below the hat: the block and what follows it, of a hat only what follows."""
        if self.is_value:
            return {"type": "messages_write", "id": SHOW, "inputs": {"VALUE": {"block": found}}}
        if self.kind != "hat":
            return found
        below = found.get("next")
        first = below.get("block") if isinstance(below, dict) else None
        return first if isinstance(first, dict) else None
