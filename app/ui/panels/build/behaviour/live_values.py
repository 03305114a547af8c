"""Live values on sensor blocks, such as "84 %" on a block for the battery level."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from app.robots.description.description import DataField, Robot, Sensor
from app.ui.text.sensor_values import quantity_text, reading_text, yes_no_text

SILENT_STATE = "silent"


class SensorValues(Protocol):
    """Sensor values of a robot; implemented by `app.core.robots.robot_link.RobotLink`."""

    @property
    def robot(self) -> Robot: ...
    @property
    def values(self) -> Mapping[str, object]: ...
    @property
    def state(self) -> str: ...
    @property
    def is_connected(self) -> bool: ...


class RobotLookup(Protocol):
    """Lookup of robots by name."""

    def link(self, name: str) -> SensorValues | None: ...


def sensor_texts(fleet: RobotLookup, sensors: Iterable[tuple[str, str]]) -> tuple[dict[str, str], set[str]]:
    """Format the current values for sensor blocks.

    Args:
        fleet: Lookup of robots by name.
        sensors: Names of robot and sensor for each block.

    Returns:
        Texts by key, and the keys of stale values. A key is ``<robot>/<sensor>`` or
        ``<robot>/<sensor>/<field>``. Values are stale while the robot is silent; a disconnected robot has
        no values.
    """
    texts: dict[str, str] = {}
    stale_keys: set[str] = set()
    for robot, name in sensors:
        link = fleet.link(robot)
        sensor = link.robot.sensor(name) if link is not None else None
        if link is None or sensor is None or not link.is_connected:
            continue
        sensor_values = _value_texts(f"{robot}/{name}", sensor, link.values.get(name))
        texts |= sensor_values
        if link.state == SILENT_STATE:
            stale_keys |= sensor_values.keys()
    return texts, stale_keys


def _value_texts(key: str, sensor: Sensor, value: object) -> dict[str, str]:
    if sensor.kind != "object":
        return {key: reading_text(sensor, value).value}
    parts = value if isinstance(value, Mapping) else {}
    return {
        f"{key}/{field.name}": _field_text(field, parts[field.name])
        for field in sensor.fields
        if parts.get(field.name) is not None
    }


def _field_text(field: DataField, value: object) -> str:
    if isinstance(value, bool):
        return yes_no_text(value)
    return quantity_text(value, field.unit) if isinstance(value, (int, float)) else str(value)
