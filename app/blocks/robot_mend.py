"""Let another robot do what a behaviour asks of one that is not there: its blocks, for another name."""

from __future__ import annotations

import copy
from collections.abc import Mapping

from app.blocks.categories.robot import robot_blocks
from app.blocks.robot_text import type_of
from app.blocks.workspace import saved_blocks
from app.robots.description import Robot


def blocks_of(workspace: Mapping[str, object], robot: str) -> tuple[dict[str, object], ...]:
    """Every block that names the robot, the outermost first."""
    return tuple(block for block in saved_blocks(workspace) if _robot_of(block) == robot)


def can_do(workspace: Mapping[str, object], missing: str, model: str, robot: Robot) -> bool:
    """Whether a robot can do everything that the blocks ask of the missing one, which is of this model."""
    asked = blocks_of(workspace, missing)
    known = {block.type for block in robot_blocks(robot, [robot])}
    return bool(asked) and all(_translated(str(each.get("type")), model, robot) in known for each in asked)


def use_robot(workspace: Mapping[str, object], missing: str, model: str, robot: Robot) -> dict[str, object]:
    """The workspace in which the robot does what the missing one was asked to do."""
    made: dict[str, object] = copy.deepcopy(dict(workspace))
    for block in blocks_of(made, missing):
        block["type"] = _translated(str(block.get("type")), model, robot)
        fields = block["fields"]
        if isinstance(fields, dict):
            fields["ROBOT"] = robot.name
    return made


def _translated(block_type: str, model: str, robot: Robot) -> str:
    """The same block of the other robot's model."""
    ours, theirs = (type_of(each, "", "", plain=True) for each in (model, robot.model))
    return theirs + block_type.removeprefix(ours) if block_type.startswith(ours) else block_type


def _robot_of(block: Mapping[str, object]) -> object:
    fields = block.get("fields")
    return fields.get("ROBOT") if isinstance(fields, Mapping) else None
