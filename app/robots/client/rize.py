"""Robots of RIZE: their primitives, and conversion of ``robot_action`` messages in both directions.

Robots of RIZE don't describe themselves; all are assumed to have the primitives of RIZE's drivers. They don't
reply to a stop: `SafeStop.can_confirm` is False, and the user is informed that the stop can't be confirmed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache

from app import resources
from app.errors import RobotInputError
from app.robots.description.description import parse
from app.robots.description.inputs import format_number
from app.robots.description.json_access import as_object, names, object_member, text
from app.robots.description.model import Robot
from nep.i18n import _, lazy
from nep.programs.robots.moving import RIZE_COMMAND_TOPIC
from nep.text import bounded_str

COMMANDS, ANSWERS, EVENTS = RIZE_COMMAND_TOPIC, "action_state", "rize_event"
_STATES = {"success": "succeeded", "failure": "failed"}
_FAILED_MESSAGE = lazy("{robot} couldn't {action}")


@lru_cache(maxsize=1)
def thing_model() -> Mapping[str, object]:
    """Return the Thing Model that all robots of RIZE share."""
    document = json.loads(resources.path("robots", "rize.tm.jsonld").read_text(encoding="utf-8"))
    return as_object(document)


def robot(name: str) -> Robot:
    """Return the description of a robot of RIZE.

    Args:
        name: Name of the robot's driver, to which commands on ``robot_action`` are addressed.
    """
    return parse({**thing_model(), "title": name})


def announced_name(message: object) -> str | None:
    """Return the name of the robot that a message on ``rize_event`` announces; None for other messages."""
    fields = as_object(message)
    return text(fields.get("name")) if fields.get("robot") == "ready" else None


def to_command(
    robot: Robot, action: str, action_input: Mapping[str, object], command_id: str
) -> dict[str, object]:
    """Return the message for ``robot_action`` that executes an action.

    A stop is sent as the cancel of RIZE's older drivers. The message has all keys of an action, because
    drivers that don't support cancel read them: they treat the message as an unknown primitive, which fails
    without effect.

    Args:
        robot: Description of the robot.
        action: Name of the action.
        action_input: Input of the action; defaults are added.
        command_id: Id of the command.

    Raises:
        RobotInputError: The robot has no such action, or the input is invalid.
    """
    if action == robot.safe_stop.action:
        return {
            "node": "cancel",
            "primitives": {"primitive": "stop", "input": "all", "options": "none"},
            "robots": robot.name,
            "state": "idle",
            "times": 0,
            "id": command_id,
        }
    action_info = robot.action(action)
    if action_info is None:
        raise RobotInputError((_("{name} can't “{action}”").format(name=robot.name, action=action),))
    problems = action_info.check(action_input)
    if problems:
        raise RobotInputError(problems)
    return {
        "node": "action",
        "primitives": _primitive(robot, action, action_info.complete(action_input)),
        "robots": robot.name,
        "state": "idle",
        "times": 0,
        "id": command_id,
    }


def _primitive(robot: Robot, action: str, action_input: Mapping[str, object]) -> dict[str, object]:
    hint = object_member(object_member(object_member(robot.source, "actions"), action), "rb:rize")
    options = {name: action_input[name] for name in names(hint.get("options")) if name in action_input}
    return {
        "primitive": text(hint.get("primitive")) or action,
        "input": _as_text(action_input.get(text(hint.get("input")) or "", "")),
        "options": options or "none",
    }


def _as_text(value: object) -> str:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return format_number(value)
    return str(value)


def from_reply(message: object) -> dict[str, object] | None:
    """Convert a message of ``action_state`` to a ``robot/answer`` payload.

    Returns None if the message isn't a final reply, or contains no id.
    """
    fields = as_object(message)
    state = _STATES.get(bounded_str(fields.get("state")))
    command_id = text(fields.get("id"))
    if state is None or command_id is None:
        return None
    primitives = fields.get("primitives")
    first = as_object(primitives[0] if isinstance(primitives, list) and primitives else primitives)
    action = bounded_str(first.get("primitive") or "")
    error = _(_FAILED_MESSAGE).format(
        robot=bounded_str(fields.get("robots") or _("the robot")), action=action or _("perform the action")
    )
    return {
        "id": command_id,
        "op": "invoke",
        "action": action,
        "state": state,
        "output": {},
        "feedback": {},
        "error": error if state == "failed" else None,
    }
