"""A workspace: Blockly's JSON, parsed once into typed blocks.

A file may hold anything. What has not the right form is left out; nothing raises.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.blocks.model.names import Unique
from nep.i18n import _

MAX_DEPTH = 40
_MANUAL = "MANUALLY_DISABLED"


@dataclass(frozen=True)
class Placed:
    """A block as it was placed.

    Its fields as saved, and what is in its inputs (a list: statements follow).
    """

    id: str
    type: str
    fields: Mapping[str, object] = field(default_factory=dict)
    inputs: Mapping[str, tuple[Placed, ...]] = field(default_factory=dict)
    enabled: bool = True
    pauses: bool = False  # a person wants the program to pause before it
    shadow: bool = False
    extra: Mapping[str, object] = field(default_factory=dict)  # what the editor keeps of its own shape
    too_deep: bool = False  # something inside was left out because it is nested too deep

    def field_id(self, name: str) -> str:
        """The saved text of a field, "" when it has none."""
        saved = self.fields.get(name)
        return saved if isinstance(saved, str) else ""


@dataclass(frozen=True)
class Workspace:
    """All scripts (the blocks that hang together from each top block) and the variables: id -> name.

    ``nameless`` are the ids of variables that blocks use and whose names the file does not say; they have a
    placeholder among the names.
    """

    scripts: tuple[tuple[Placed, ...], ...]
    variables: Mapping[str, str]
    nameless: frozenset[str] = frozenset()

    def all_blocks(self) -> list[Placed]:
        """Every block, shadows too."""
        found: list[Placed] = []
        waiting = [block for script in self.scripts for block in script]
        while waiting:
            block = waiting.pop()
            found.append(block)
            for inner in block.inputs.values():
                waiting.extend(inner)
        return found


def saved_blocks(saved: Mapping[str, object]) -> Iterator[dict[str, object]]:
    """Every block of a saved workspace as it was saved, shadows too, the outermost first."""
    blocks = saved.get("blocks")
    waiting = deque(_list(blocks.get("blocks") if isinstance(blocks, Mapping) else None))
    while waiting:
        block = waiting.popleft()
        if not isinstance(block, dict):
            continue
        yield block
        inputs = block.get("inputs")
        for connection in (*(inputs.values() if isinstance(inputs, Mapping) else ()), block.get("next")):
            if isinstance(connection, Mapping):
                waiting.extend(connection[name] for name in ("block", "shadow") if name in connection)


def parse_workspace(saved: Mapping[str, object]) -> Workspace:
    """The workspace of Blockly's JSON, whatever it holds."""
    blocks = saved.get("blocks")
    tops = blocks.get("blocks") if isinstance(blocks, Mapping) else None
    ids = Unique("~")
    scripts = tuple(_chain(top, 0, ids, shadow=False) for top in _list(tops))
    variables: dict[str, str] = {}
    for variable in _list(saved.get("variables")):
        if isinstance(variable, Mapping) and isinstance(variable.get("id"), str):
            variables[str(variable["id"])] = str(variable.get("name") or variable["id"])
    return _with_unlisted(Workspace(tuple(script for script in scripts if script), variables))


def _with_unlisted(workspace: Workspace) -> Workspace:
    """Add the variables that blocks use and the list of variables lacks."""
    names = dict(workspace.variables)
    nameless: set[str] = set()
    for block in workspace.all_blocks():
        for saved in block.fields.values():
            id = saved.get("id") if isinstance(saved, Mapping) else None
            if not isinstance(id, str) or not id or (id in names and id not in nameless):
                continue
            name = saved.get("name") if isinstance(saved, Mapping) else None
            if isinstance(name, str) and name:
                names[id] = name
                nameless.discard(id)
            else:
                names[id] = _("variable without a name")
                nameless.add(id)
    return replace(workspace, variables=names, nameless=frozenset(nameless))


def _list(saved: object) -> Sequence[object]:
    return saved if isinstance(saved, (list, tuple)) else ()


def _chain(saved: object, depth: int, ids: Unique, *, shadow: bool) -> tuple[Placed, ...]:
    """A block and all that follow it; a loop, because a script may be long."""
    chain: list[Placed] = []
    while isinstance(saved, Mapping) and isinstance(saved.get("type"), str):
        chain.append(_block(saved, depth, ids, shadow=shadow))
        following = saved.get("next")
        saved = following.get("block") if isinstance(following, Mapping) else None
    return tuple(chain)


def _block(saved: Mapping[str, object], depth: int, ids: Unique, *, shadow: bool) -> Placed:
    fields = saved.get("fields")
    raw = saved.get("inputs")
    connections = raw if isinstance(raw, Mapping) else {}
    inputs: dict[str, tuple[Placed, ...]] = {}
    saved_id = saved.get("id")
    id = ids.of(saved_id if isinstance(saved_id, str) and saved_id else "block")
    if depth < MAX_DEPTH:
        for name, connection in connections.items():
            if isinstance(connection, Mapping):
                real = connection.get("block")
                inner = real if isinstance(real, Mapping) else connection.get("shadow")
                inputs[str(name)] = _chain(inner, depth + 1, ids, shadow=not isinstance(real, Mapping))
    return Placed(
        id=id,
        type=str(saved["type"]),
        fields=dict(fields) if isinstance(fields, Mapping) else {},
        inputs=inputs,
        enabled=is_enabled(saved),
        pauses=_pauses(saved),
        shadow=shadow,
        extra=dict(extra) if isinstance(extra := saved.get("extraState"), Mapping) else {},
        too_deep=depth >= MAX_DEPTH and bool(connections),
    )


def _pauses(saved: Mapping[str, object]) -> bool:
    """Whether its data, which Blockly keeps as text, say ``{"pause": true}``."""
    data = saved.get("data")
    if not isinstance(data, str) or '"pause"' not in data:
        return False
    try:
        told = json.loads(data)
    except (ValueError, RecursionError):
        return False
    return isinstance(told, Mapping) and told.get("pause") is True


def is_enabled(saved: Mapping[str, object]) -> bool:
    """Whether a person switched the block off; other reasons (an absent robot) are ours to judge."""
    if saved.get("enabled") is False:
        return False
    return _MANUAL not in _list(saved.get("disabledReasons"))
