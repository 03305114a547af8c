"""Declarations of actions and sensors that several robots use, such as driving, position and battery."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from app.robots.driver.declare import FromRize, SensorSpec, action, sensor
from app.robots.driver.schema import Range, Title

MOVEMENT = "Movement"
DRIVE_TIMEOUT_S = 60


def drives(
    text: str,
    icon: str,
    says: str,
    *,
    unit: str,
    title: str | None = None,
    moved: bool = False,
    rize: str | None = None,
    from_rize: FromRize | None = None,
) -> action:
    """Return the decorator of an action that drives the robot; a newer action replaces it.

    The feedback of the action contains the remaining distance or angle ``to_go``, so that a program can
    continue after a pause.

    Args:
        text: Text of the block, as for `action`.
        icon: Icon of the block.
        says: The text in the third person, for messages.
        unit: Unit of the feedback.
        title: Display name (default: the name of the method).
        moved: True if feedback and result also contain the distance or angle covered.
        rize: Name of RIZE's primitive.
        from_rize: Converts RIZE's input and options to the action's input.
    """
    output: Mapping[str, object] = {"moved": Annotated[float, Range(unit=unit)]} if moved else {}
    return action(
        text,
        MOVEMENT,
        icon,
        says=says,
        title=title,
        uses=("base",),
        on_busy="replace",
        timeout_s=DRIVE_TIMEOUT_S,
        risk="locomotes",
        feedback={**output, "to_go": Annotated[float, Range(unit=unit), Title("to go")]},
        output=output or None,
        rize=rize,
        from_rize=from_rize,
    )


def moves(
    text: str,
    icon: str,
    says: str,
    *parts: str,
    timeout_s: float,
    title: str | None = None,
    rize: str | None = None,
) -> action:
    """Return the decorator of an action that moves parts of the robot without driving.

    A newer action that moves the same parts replaces it.

    Args:
        text: Text of the block, as for `action`.
        icon: Icon of the block.
        says: The text in the third person, for messages.
        parts: Names of the moved resources, such as "head".
        timeout_s: Maximum duration in seconds.
        title: Display name (default: the name of the method).
        rize: Name of RIZE's primitive.
    """
    return action(
        text,
        MOVEMENT,
        icon,
        says=says,
        title=title,
        uses=parts,
        on_busy="replace",
        timeout_s=timeout_s,
        risk="moves",
        rize=rize,
    )


def position_sensor(rate_hz: float) -> SensorSpec:
    """Return the declaration of a sensor for position (in m) and orientation (in degrees).

    Args:
        rate_hz: Typical publishing rate.
    """
    return sensor(
        {
            "x": Annotated[float, Range(unit="m")],
            "y": Annotated[float, Range(unit="m")],
            "theta": Annotated[float, Range(unit="deg"), Title("facing")],
        },
        title="position",
        icon="navigation",
        rate_hz=rate_hz,
    )


def battery_sensor() -> SensorSpec:
    """Return the declaration of a sensor for the battery level in percent."""
    level = Annotated[int, Range(0, 100, unit="%")]
    return sensor(level, title="battery", text="battery", icon="battery-medium")


def distance_sensor(most_m: float) -> SensorSpec:
    """Return the declaration of a sensor for the distance to an obstacle ahead.

    Args:
        most_m: Maximum distance in m.
    """
    distance = Annotated[float, Range(0, most_m, unit="m")]
    return sensor(distance, title="distance", text="distance", icon="ruler", rate_hz=10)
