"""Declarations that several robots use: driving, moving parts, position, battery, distance."""

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
    """Declare an action that moves the robot to another place; a newer action replaces it.

    Its feedback contains the remaining amount ``to_go`` in ``unit``, so that a program can continue after a
    pause; with ``moved`` also the amount done.
    """
    made: Mapping[str, object] = {"moved": Annotated[float, Range(unit=unit)]} if moved else {}
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
        feedback={**made, "to_go": Annotated[float, Range(unit=unit), Title("to go")]},
        output=made or None,
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
    """Declare an action that moves ``parts`` of the robot without driving; a newer action replaces it."""
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
    """Declare the sensor of position and orientation."""
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
    """Declare the sensor of the battery level in percent."""
    full = Annotated[int, Range(0, 100, unit="%")]
    return sensor(full, title="battery", text="battery", icon="battery-medium")


def distance_sensor(most_m: float) -> SensorSpec:
    """Declare the sensor of the distance to an obstacle ahead, up to ``most_m`` metres."""
    ahead = Annotated[float, Range(0, most_m, unit="m")]
    return sensor(ahead, title="distance", text="distance", icon="ruler", rate_hz=10)
