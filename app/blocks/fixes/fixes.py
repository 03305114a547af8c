"""Fixes for problems, as pure functions from one workspace to the next."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace

from app.blocks.model.mutators import function_name, inputs_of
from app.blocks.model.workspace import (
    PLAIN_CALL,
    PLAIN_FUNCTION,
    RESULT_CALL,
    RESULT_FUNCTION,
    PlacedBlock,
    is_enabled,
    saved_blocks,
)
from app.blocks.toolbox.catalogue import categories
from app.intents import (
    AddReceiver,
    AddStartBlock,
    AddTimeLimit,
    BlockFix,
    DefineFunction,
    JoinScripts,
    SetAtStart,
)

DEFAULT_TIME_LIMIT_S = 10
LEFT_PX, TOP_PX = 40, 40
SCRIPT_SPACING_PX = 420
"""Horizontal offset in px of a new script; most existing scripts are narrower."""


def fix(workspace: Mapping[str, object], action: BlockFix) -> dict[str, object] | None:
    """Return the workspace after applying a fix, or None if the fix isn't possible.

    Args:
        workspace: Saved workspace of Blockly; it is not modified.
        action: Fix of a problem.
    """
    result: dict[str, object] = copy.deepcopy(dict(workspace))
    match action:
        case AddTimeLimit(id):
            block = _find_block(result, id, "control_wait_until")
            return _with_time_limit(result, block) if block is not None else None
        case DefineFunction(id):
            block = _find_block(result, id, PLAIN_CALL, RESULT_CALL)
            return _with_definition(result, block) if block is not None else None
        case SetAtStart(variable, is_list):
            return _with_initial_value(result, variable, is_list=is_list)
        case AddReceiver(broadcast):
            return _with_script(result, {"type": "events_received", "fields": {"NAME": broadcast}})
        case JoinScripts(moved, target):
            return _join_scripts(result, moved, target)
        case AddStartBlock(block_type):
            return _with_start(result, block_type)
    return None


def block_ids(action: BlockFix) -> tuple[str, ...]:
    """Return the ids of the blocks that a fix names."""
    match action:
        case AddTimeLimit(id) | DefineFunction(id):
            return (id,)
        case JoinScripts(moved, target):
            return (moved, target)
    return ()


def without_prefix(action: BlockFix, prefix: str) -> BlockFix:
    """Return a fix with a prefix removed from the ids of its blocks."""
    match action:
        case AddTimeLimit(id) | DefineFunction(id):
            return replace(action, block_id=id.removeprefix(prefix))
        case JoinScripts(moved, target):
            return JoinScripts(moved.removeprefix(prefix), target.removeprefix(prefix))
    return action


def _find_block(workspace: Mapping[str, object], id: str, *types: str) -> dict[str, object] | None:
    blocks = saved_blocks(workspace)
    return next((each for each in blocks if each.get("id") == id and each.get("type") in types), None)


def _with_initial_value(workspace: dict[str, object], variable: str, *, is_list: bool) -> dict[str, object]:
    empty_list: dict[str, object] = {"block": {"type": "lists_empty"}}
    zero: dict[str, object] = {"shadow": {"type": "values_number", "fields": {"NUMBER": 0}}}
    set_block: dict[str, object] = {
        "type": "variables_set",
        "fields": {"VAR": {"id": variable}},
        "inputs": {"VALUE": empty_list if is_list else zero},
    }
    for top in _top_blocks(workspace):
        if isinstance(top, dict) and top.get("type") == "events_started" and is_enabled(top):
            if isinstance(top.get("next"), dict):
                set_block["next"] = top["next"]
            top["next"] = {"block": set_block}
            return workspace
    return _with_script(workspace, {"type": "events_started", "next": {"block": set_block}})


def _top_blocks(workspace: dict[str, object]) -> list[object]:
    blocks = workspace.setdefault("blocks", {"languageVersion": 0, "blocks": []})
    tops = blocks.setdefault("blocks", []) if isinstance(blocks, dict) else None
    return tops if isinstance(tops, list) else []


def _with_script(workspace: dict[str, object], block: dict[str, object]) -> dict[str, object]:
    tops = _top_blocks(workspace)
    x_positions = [top.get("x") for top in tops if isinstance(top, dict)]
    right = max((x for x in x_positions if isinstance(x, (int, float))), default=LEFT_PX - SCRIPT_SPACING_PX)
    tops.append({**block, "x": right + SCRIPT_SPACING_PX, "y": TOP_PX})
    return workspace


def _with_time_limit(workspace: dict[str, object], block: dict[str, object]) -> dict[str, object]:
    block["type"] = "control_wait_until_at_most"
    inputs = block.setdefault("inputs", {})
    if isinstance(inputs, dict):
        inputs["SECONDS"] = {"shadow": {"type": "values_number", "fields": {"NUMBER": DEFAULT_TIME_LIMIT_S}}}
    return workspace


def _with_definition(workspace: dict[str, object], call: Mapping[str, object]) -> dict[str, object]:
    extra = call.get("extraState")
    extra_state: Mapping[str, object] = extra if isinstance(extra, Mapping) else {}
    call_block = PlacedBlock("", "", {}, extra_state=extra_state)
    definition: dict[str, object] = {
        "type": RESULT_FUNCTION if call.get("type") == RESULT_CALL else PLAIN_FUNCTION,
        "x": 40,
        "y": 40,
        "fields": {"NAME": function_name(call_block)},
        "extraState": {"inputs": [{"id": each.id, "name": each.name} for each in inputs_of(extra_state)]},
    }
    if isinstance(extra_state.get("function"), str):
        definition["id"] = extra_state["function"]
    blocks = workspace.get("blocks")
    tops = blocks.get("blocks") if isinstance(blocks, dict) else None
    if isinstance(tops, list):
        tops.append(definition)
    return workspace


def _join_scripts(workspace: dict[str, object], moved: str, target: str) -> dict[str, object] | None:
    # Removes the event block, which then starts nothing.
    blocks = workspace.get("blocks")
    tops = blocks.get("blocks") if isinstance(blocks, dict) else None
    if not isinstance(tops, list):
        return None
    by_id = {top.get("id"): top for top in tops if isinstance(top, dict)}
    moved_hat, last_block = by_id.get(moved), by_id.get(target)
    if (
        moved_hat is None
        or last_block is None
        or moved_hat is last_block
        or not isinstance(moved_hat.get("next"), dict)
    ):
        return None
    while isinstance(next_connection := last_block.get("next"), dict) and isinstance(
        next_connection.get("block"), dict
    ):
        last_block = next_connection["block"]
    last_block["next"] = moved_hat["next"]
    tops.remove(moved_hat)
    return workspace


def _with_start(workspace: dict[str, object], block_type: str) -> dict[str, object]:
    blocks = workspace.setdefault("blocks", {"languageVersion": 0, "blocks": []})
    tops = blocks.get("blocks") if isinstance(blocks, dict) else None
    if not isinstance(tops, list):
        return workspace
    start_block: dict[str, object] = {"type": block_type, "x": 40, "y": 40}
    for number, top in enumerate(tops):
        if isinstance(top, dict) and _can_follow(str(top.get("type", ""))):
            start_block |= {name: top.pop(name) for name in ("x", "y") if name in top}
            start_block["next"] = {"block": top}
            tops[number] = start_block
            return workspace
    tops.append(start_block)
    return workspace


def _can_follow(block_type: str) -> bool:
    shapes = {block.type: block.shape for category in categories() for block in category.blocks}
    if block_type in shapes:
        return shapes[block_type] in ("statement", "cap")
    return "_get_" not in block_type and "_when_" not in block_type
