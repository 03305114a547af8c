"""Robots of RIZE: their primitives, and conversion of ``robot_action`` messages in both directions.

Robots of RIZE don't describe themselves; all are assumed to have the primitives of RIZE's drivers. They don't
reply to a stop: `SafeStop.confirmed` is False, and the user is informed that the stop can't be confirmed.
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
    found = json.loads(resources.path("robots", "rize.tm.jsonld").read_text(encoding="utf-8"))
    return as_object(found)


def robot(name: str) -> Robot:
    """Return the description of a robot of RIZE.

    Args:
        name: Name of the robot's driver, to which commands on ``robot_action`` are addressed.
    """
    return parse({**thing_model(), "title": name})


def ready(message: object) -> str | None:
    """Return the name of the robot that a message on ``rize_event`` announces; None for other messages."""
    said = as_object(message)
    return text(said.get("name")) if said.get("robot") == "ready" else None


def to_command(robot: Robot, action: str, given: Mapping[str, object], command_id: str) -> dict[str, object]:
    """Return the message for ``robot_action`` that executes an action.

    A stop is sent as the cancel of RIZE's older drivers. The message has all keys of an action, because
    drivers that don't support cancel read them: they treat the message as an unknown primitive, which fails
    without effect.

    Args:
        robot: Description of the robot.
        action: Name of the action.
        given: Input of the action; defaults are added.
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
    known = robot.action(action)
    if known is None:
        raise RobotInputError((_("{name} can't “{action}”").format(name=robot.name, action=action),))
    sentences = known.check(given)
    if sentences:
        raise RobotInputError(sentences)
    return {
        "node": "action",
        "primitives": _primitive(robot, action, known.complete(given)),
        "robots": robot.name,
        "state": "idle",
        "times": 0,
        "id": command_id,
    }


def _primitive(robot: Robot, action: str, given: Mapping[str, object]) -> dict[str, object]:
    hint = object_member(object_member(object_member(robot.source, "actions"), action), "rb:rize")
    options = {name: given[name] for name in names(hint.get("options")) if name in given}
    return {
        "primitive": text(hint.get("primitive")) or action,
        "input": _as_text(given.get(text(hint.get("input")) or "", "")),
        "options": options or "none",
    }


def _as_text(value: object) -> str:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return format_number(value)
    return str(value)


def from_reply(message: object) -> dict[str, object] | None:
    """Convert a message of ``action_state`` to a ``robot/answer`` payload; None if it isn't a final reply."""
    said = as_object(message)
    state = _STATES.get(bounded_str(said.get("state")))
    wanted = text(said.get("id"))
    if state is None or wanted is None:
        return None
    primitives = said.get("primitives")
    first = as_object(primitives[0] if isinstance(primitives, list) and primitives else primitives)
    action = bounded_str(first.get("primitive") or "")
    error = _(_FAILED_MESSAGE).format(
        robot=bounded_str(said.get("robots") or _("the robot")), action=action or _("perform the action")
    )
    return {
        "id": wanted,
        "op": "invoke",
        "action": action,
        "state": state,
        "output": {},
        "feedback": {},
        "error": error if state == "failed" else None,
    }
