"""Workspace: Blockly's JSON parsed into typed blocks.

Files may contain anything. Invalid parts are dropped; no function raises.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.blocks.model.names import UniqueTexts
from nep.i18n import _

MAX_DEPTH = 40
PLAIN_FUNCTION, RESULT_FUNCTION = "functions_define", "functions_define_result"
PLAIN_CALL, RESULT_CALL = "functions_call", "functions_result"
_DISABLED_BY_USER = "MANUALLY_DISABLED"


@dataclass(frozen=True)
class PlacedBlock:
    """Block in a workspace.

    Attributes:
        id: Unique id.
        type: Type of the block.
        fields: Saved field values by name.
        inputs: Blocks in each slot by name; statements are in order.
        is_enabled: False if the user has disabled the block.
        is_shadow: True for a shadow block.
    """

    id: str
    type: str
    fields: Mapping[str, object] = field(default_factory=dict)
    inputs: Mapping[str, tuple[PlacedBlock, ...]] = field(default_factory=dict)
    is_enabled: bool = True
    has_breakpoint: bool = False
    is_shadow: bool = False
    extra_state: Mapping[str, object] = field(default_factory=dict)  # the editor's extraState
    is_too_deep: bool = False  # inner blocks were dropped because of deep nesting

    def field_text(self, name: str) -> str:
        """Return the saved value of a field if it is a text, else ""."""
        saved = self.fields.get(name)
        return saved if isinstance(saved, str) else ""


@dataclass(frozen=True)
class Workspace:
    """Parsed workspace.

    Attributes:
        scripts: Scripts, each a sequence of blocks.
        variables: Names of variables by id.
        nameless_variables: Ids of used variables that have no name in the file; `variables` contains
            placeholders.
    """

    scripts: tuple[tuple[PlacedBlock, ...], ...]
    variables: Mapping[str, str]
    nameless_variables: frozenset[str] = frozenset()

    def all_blocks(self) -> list[PlacedBlock]:
        """Return all blocks of all scripts, including shadow blocks."""
        blocks: list[PlacedBlock] = []
        pending = [block for script in self.scripts for block in script]
        while pending:
            block = pending.pop()
            blocks.append(block)
            for inner in block.inputs.values():
                pending.extend(inner)
        return blocks


def saved_blocks(saved: Mapping[str, object]) -> Iterator[dict[str, object]]:
    """Yield all blocks of a saved workspace as JSON objects, including shadow blocks, outermost first."""
    blocks = saved.get("blocks")
    pending = deque(_as_list(blocks.get("blocks") if isinstance(blocks, Mapping) else None))
    while pending:
        block = pending.popleft()
        if not isinstance(block, dict):
            continue
        yield block
        inputs = block.get("inputs")
        for connection in (*(inputs.values() if isinstance(inputs, Mapping) else ()), block.get("next")):
            if isinstance(connection, Mapping):
                pending.extend(connection[name] for name in ("block", "shadow") if name in connection)


def parse_workspace(saved: Mapping[str, object], block_prefix: str = "") -> Workspace:
    """Parse a workspace saved by Blockly. Never raises; invalid parts are dropped.

    Args:
        saved: Saved workspace.
        block_prefix: Text that is put before the ids of all blocks, to distinguish the pages of a project.
    """
    blocks = saved.get("blocks")
    tops = blocks.get("blocks") if isinstance(blocks, Mapping) else None
    ids = UniqueTexts("~")
    scripts = tuple(_parse_chain(top, 0, ids, block_prefix, is_shadow=False) for top in _as_list(tops))
    variables: dict[str, str] = {}
    for variable in _as_list(saved.get("variables")):
        if isinstance(variable, Mapping) and isinstance(variable.get("id"), str):
            variables[str(variable["id"])] = str(variable.get("name") or variable["id"])
    return _with_unlisted_variables(Workspace(tuple(script for script in scripts if script), variables))


def _with_unlisted_variables(workspace: Workspace) -> Workspace:
    names = dict(workspace.variables)
    nameless_ids: set[str] = set()
    for block in workspace.all_blocks():
        for saved in block.fields.values():
            id = saved.get("id") if isinstance(saved, Mapping) else None
            if not isinstance(id, str) or not id or (id in names and id not in nameless_ids):
                continue
            name = saved.get("name") if isinstance(saved, Mapping) else None
            if isinstance(name, str) and name:
                names[id] = name
                nameless_ids.discard(id)
            else:
                names[id] = _("unnamed variable")
                nameless_ids.add(id)
    return replace(workspace, variables=names, nameless_variables=frozenset(nameless_ids))


def _as_list(saved: object) -> Sequence[object]:
    return saved if isinstance(saved, (list, tuple)) else ()


def _parse_chain(
    saved: object, depth: int, ids: UniqueTexts, prefix: str, *, is_shadow: bool
) -> tuple[PlacedBlock, ...]:
    # A loop instead of recursion, because a script may be long.
    chain: list[PlacedBlock] = []
    while isinstance(saved, Mapping) and isinstance(saved.get("type"), str):
        chain.append(_parse_block(saved, depth, ids, prefix, is_shadow=is_shadow))
        next_connection = saved.get("next")
        saved = next_connection.get("block") if isinstance(next_connection, Mapping) else None
    return tuple(chain)


def _parse_block(
    saved: Mapping[str, object], depth: int, ids: UniqueTexts, prefix: str, *, is_shadow: bool
) -> PlacedBlock:
    fields = saved.get("fields")
    saved_inputs = saved.get("inputs")
    connections = saved_inputs if isinstance(saved_inputs, Mapping) else {}
    inputs: dict[str, tuple[PlacedBlock, ...]] = {}
    saved_id = saved.get("id")
    id = ids.make_unique(prefix + (saved_id if isinstance(saved_id, str) and saved_id else "block"))
    if depth < MAX_DEPTH:
        for name, connection in connections.items():
            if isinstance(connection, Mapping):
                block = connection.get("block")
                inner = block if isinstance(block, Mapping) else connection.get("shadow")
                inputs[str(name)] = _parse_chain(
                    inner, depth + 1, ids, prefix, is_shadow=not isinstance(block, Mapping)
                )
    return PlacedBlock(
        id=id,
        type=str(saved["type"]),
        fields=dict(fields) if isinstance(fields, Mapping) else {},
        inputs=inputs,
        is_enabled=is_enabled(saved),
        has_breakpoint=_has_breakpoint(saved),
        is_shadow=is_shadow,
        extra_state=dict(extra) if isinstance(extra := saved.get("extraState"), Mapping) else {},
        is_too_deep=depth >= MAX_DEPTH and bool(connections),
    )


def _has_breakpoint(saved: Mapping[str, object]) -> bool:
    data = saved.get("data")
    if not isinstance(data, str) or '"pause"' not in data:
        return False
    try:
        decoded = json.loads(data)
    except (ValueError, RecursionError):
        return False
    return isinstance(decoded, Mapping) and decoded.get("pause") is True


def is_enabled(saved: Mapping[str, object]) -> bool:
    """Return False if the user has disabled a saved block.

    Blocks that are disabled for other reasons, such as a missing robot, count as enabled.
    """
    if saved.get("enabled") is False:
        return False
    return _DISABLED_BY_USER not in _as_list(saved.get("disabledReasons"))
