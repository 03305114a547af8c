"""Robot whose actions use parts of it, as Pepper's do, and blocks that call these actions."""

from __future__ import annotations

from dataclasses import replace

from app.robots.description.description import Robot
from tests.blocks.samples import block, boolean, number, robot

PARTS = {"turn": ("base",), "go-home": ("base",), "look": ("face",), "say": ("speech",)}
REPLACING = {"turn", "go-home", "look"}


def fighter(name: str = "Pepper") -> Robot:
    """Return a robot whose actions use its parts.

    A new motion of the base or the face replaces the running one; speech is queued.
    """
    made = robot(name)
    actions = tuple(
        replace(
            action,
            uses=PARTS.get(action.name, ()),
            on_busy="replace" if action.name in REPLACING else "queue",
            cancellable=True,
        )
        for action in made.actions
    )
    return replace(made, actions=actions)


def turn(id: str, name: str = "Pepper", *, again: bool = False) -> dict[str, object]:
    """Return a block that turns the robot, inside a *forever* loop if `again` is true."""
    made = block("robot_pepper_do_turn", id, ROBOT=name, DIRECTION="left", ANGLE=number(30))
    return block("control_forever", f"{id} again", BODY=[made]) if again else made


def home(id: str, name: str = "Pepper") -> dict[str, object]:
    """Return a block that sends the robot home."""
    return block("robot_pepper_do_go_home", id, ROBOT=name, WITH_SONG=boolean(False))


def look(id: str, name: str = "Pepper") -> dict[str, object]:
    """Return a block that makes the robot look happy."""
    return block("robot_pepper_do_look", id, ROBOT=name, EMOTION="happy", SECONDS=number(2))
