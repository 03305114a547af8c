"""Values that blocks in open behaviours wait for, such as words that a robot should recognize."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from app.blocks.model.robot_text import BlockTemplate, block_type_of
from app.blocks.model.workspace import saved_blocks
from app.robots.description.description import Event, Robot

MAX_VALUES = 12
MIN_LENGTH, MAX_LENGTH = 1, 60


def awaited_values(
    workspaces: Iterable[Mapping[str, object]], robot: Robot, event: Event, name: str
) -> tuple[str, ...]:
    """Return the values of an event field that blocks wait for, followed by the default of the field.

    The values also include texts that blocks compare with a text sensor of the robot. At most
    `MAX_VALUES` unique values are returned.

    Args:
        workspaces: Workspaces of the open behaviours, the current one first.
        robot: Robot that sends the event.
        event: Description of the event.
        name: Name of the field in the event's data.
    """
    event_block_type = block_type_of(robot.model, "when", event.name)
    argument = BlockTemplate(event.text, event.filters).arguments.get(name, "")
    sensor_block_types = {
        block_type_of(robot.model, "get", each.name) for each in robot.sensors if each.kind == "text"
    }
    values: dict[str, None] = {}
    for workspace in workspaces:
        for block in saved_blocks(workspace):
            if (
                block.get("type") == event_block_type
                and _fields(block).get("ROBOT", robot.name) == robot.name
            ):
                values[str(_fields(block).get(argument) or "").strip()] = None
            else:
                values.update(dict.fromkeys(_compared_texts(block, sensor_block_types)))
    parameter = next((each for each in event.fields if each.name == name), None)
    if parameter is not None and isinstance(parameter.default, str):
        values[parameter.default] = None
    return tuple(value for value in values if MIN_LENGTH <= len(value) <= MAX_LENGTH)[:MAX_VALUES]


def _compared_texts(block: Mapping[str, object], sensor_block_types: set[str]) -> list[str]:
    # Texts compared with a sensor in one block: “last word heard” = “yes”.
    inputs = block.get("inputs")
    connected: list[Mapping[str, object]] = []
    for connection in inputs.values() if isinstance(inputs, Mapping) else ():
        child = connection.get("block", connection.get("shadow")) if isinstance(connection, Mapping) else None
        if isinstance(child, Mapping):
            connected.append(child)
    if not any(each.get("type") in sensor_block_types for each in connected):
        return []
    texts = [_fields(each).get("TEXT") for each in connected]
    return [text.strip() for text in texts if isinstance(text, str)]


def _fields(block: Mapping[str, object]) -> Mapping[str, object]:
    fields = block.get("fields")
    return fields if isinstance(fields, Mapping) else {}
