"""Replacement of a disconnected robot by another robot in all blocks of a behaviour."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from app.blocks.model.robot_text import block_type_of
from app.blocks.model.workspace import saved_blocks
from app.robots.description.description import Robot
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.blocks.categories import robot as robot_category
else:  # the categories take long to import
    robot_category = lazy_module("app.blocks.categories.robot")


def blocks_of(workspace: Mapping[str, object], robot: str) -> tuple[dict[str, object], ...]:
    """Return all saved blocks that use a robot, outermost first."""
    return tuple(block for block in saved_blocks(workspace) if _robot_of(block) == robot)


def block_types_by_robot(workspace: Mapping[str, object]) -> Mapping[str, frozenset[str]]:
    """Return the block types that a workspace uses, by name of the robot."""
    types_by_robot: dict[str, set[str]] = {}
    for block in saved_blocks(workspace):
        robot = _robot_of(block)
        if isinstance(robot, str):
            types_by_robot.setdefault(robot, set()).add(str(block.get("type")))
    return {robot: frozenset(types) for robot, types in types_by_robot.items()}


def block_counts_by_robot(workspace: Mapping[str, object], ids: Collection[str]) -> Mapping[str, int]:
    """Return the number of blocks with one of these ids, by name of the robot."""
    requested_ids = frozenset(ids)
    counts: dict[str, int] = {}
    for block in saved_blocks(workspace) if requested_ids else ():
        robot = _robot_of(block)
        if isinstance(robot, str) and block.get("id") in requested_ids:
            counts[robot] = counts.get(robot, 0) + 1
    return counts


def block_types_of(robot: Robot) -> frozenset[str]:
    """Return the types of all blocks of a robot."""
    return frozenset(block.type for block in robot_category.robot_blocks(robot, [robot]))


def supports_blocks(
    block_types: Collection[str], model: str, robot: Robot, supported_types: Collection[str] | None = None
) -> bool:
    """Return True if a robot supports all given block types of another robot.

    False if `block_types` is empty.

    Args:
        block_types: Block types that the other robot uses.
        model: Model of the other robot.
        robot: Robot to check.
        supported_types: Result of `block_types_of(robot)` if it was already computed.
    """
    supported_types = block_types_of(robot) if supported_types is None else supported_types
    return bool(block_types) and all(
        _translated_type(each, model, robot) in supported_types for each in block_types
    )


def with_robot_replaced(
    workspace: Mapping[str, object], missing_robot: str, model: str, robot: Robot
) -> dict[str, object]:
    """Return a copy of a workspace in which all blocks of a missing robot use another robot.

    Args:
        workspace: Saved workspace of Blockly.
        missing_robot: Name of the missing robot.
        model: Model of the missing robot.
        robot: Robot to use instead.
    """
    result: dict[str, object] = copy.deepcopy(dict(workspace))
    for block in blocks_of(result, missing_robot):
        block["type"] = _translated_type(str(block.get("type")), model, robot)
        fields = block["fields"]
        if isinstance(fields, dict):
            fields["ROBOT"] = robot.name
    return result


def _translated_type(block_type: str, model: str, robot: Robot) -> str:
    missing_prefix, robot_prefix = (
        block_type_of(each, "", "", without_verb=True) for each in (model, robot.model)
    )
    return (
        robot_prefix + block_type.removeprefix(missing_prefix)
        if block_type.startswith(missing_prefix)
        else block_type
    )


def _robot_of(block: Mapping[str, object]) -> object:
    fields = block.get("fields")
    return fields.get("ROBOT") if isinstance(fields, Mapping) else None
