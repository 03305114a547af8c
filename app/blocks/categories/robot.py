"""Category Robots: blocks created from robot descriptions, for actions, sensors and events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from app.blocks.model.block import Block, RobotUse
from app.blocks.model.category import Category, Group, ToolboxEntry
from app.blocks.model.fields import ChoiceField, LiveField, NumberField, robot_field
from app.blocks.model.robot_keywords import (
    CHANGE_SEARCH_WORDS,
    PASS_SEARCH_WORDS,
    action_search_words,
    bilingual_search_words,
    sensor_search_words,
)
from app.blocks.model.robot_text import BlockTemplate, block_type_of, field_of, format_limits, input_of
from app.robots.description.description import Action, Event, Robot, Sensor
from app.robots.description.json_access import display_text, names
from nep.i18n import _, pgettext, translate

_ICONS = {
    "Speech": "message-circle",
    "Movement": "footprints",
    "Face and lights": "smile",
    "Sensors": "eye",
}
GROUPS = tuple(_ICONS)
"""Titles of the groups of action blocks in display order; robot descriptions may define further groups."""
_GROUP_TITLES = {
    "": "Movement",
    "actions": "Movement",
    "control": "Movement",
    "motion": "Movement",
    "looks": "Face and lights",
}
_SIMPLE_KINDS = ("boolean", "number", "integer", "text", "choice")
_NUMBER_KINDS = ("number", "integer")


def robot_blocks(robot: Robot, all_robots: Sequence[Robot]) -> tuple[Block, ...]:
    """Return all blocks of a robot.

    Args:
        robot: Description of the robot.
        all_robots: All robots; the drop-down of the robot's blocks offers the robots of the same model.
    """
    robot_names = [other.name for other in all_robots if other.model == robot.model] or [robot.name]
    blocks = [_action_block(robot, action, robot_names) for action in robot.actions]
    blocks += [_sensor_block(robot, sensor, robot_names) for sensor in robot.sensors if _has_block(sensor)]
    blocks += [_event_block(robot, event, robot_names) for event in robot.events if event.text]
    return (*blocks, *_change_event_blocks(robot, robot_names))


def robot_groups(robot: Robot, all_robots: Sequence[Robot]) -> tuple[Group, ...]:
    """Return the block groups under the heading of a robot; sensors and events come last.

    Args:
        robot: Description of the robot.
        all_robots: All robots; see `robot_blocks`.
    """
    titles = {action.name: _group_title(action) for action in robot.actions}
    groups: dict[str, list[ToolboxEntry]] = {title: [] for title in GROUPS}
    for block in robot_blocks(robot, all_robots):
        use = block.robot
        if use is None:
            continue
        title = titles.get(use.name, "Movement") if use.kind == "action" else "Sensors"
        groups.setdefault(title, []).append(ToolboxEntry(block, {"ROBOT": robot.name}))
    sensors = groups.pop("Sensors")
    return tuple(
        Group(title, _ICONS.get(title, "bot"), "sensors" if title == "Sensors" else "robot", tuple(entries))
        for title, entries in (*groups.items(), ("Sensors", sensors))
        if entries
    )


def _group_title(action: Action) -> str:
    return _GROUP_TITLES.get(action.category.lower(), action.category)


def _has_block(sensor: Sensor) -> bool:
    return bool(sensor.text) and (
        sensor.kind in _SIMPLE_KINDS or (sensor.kind == "object" and bool(sensor.fields))
    )


def _action_block(robot: Robot, action: Action, robot_names: Sequence[str]) -> Block:
    template = BlockTemplate(action.text, [parameter.name for parameter in action.parameters])
    arguments = [robot_field(robot.model, robot_names)]
    inputs = [
        (parameter, input_of(parameter, template.arguments[parameter.name]))
        for parameter in action.parameters
        if parameter.name in template.shown_parameters
    ]
    result_field = _result_field(robot, action)
    names_and_titles = [action.name, action.title, *_semantic_types(robot, "actions", action.name)]
    names_and_titles += [parameter.name for parameter in action.parameters]
    keywords = action_search_words(names_and_titles, action.uses)
    action_code = "robot(%ROBOT).do(%X_NAME, **%X_INPUT)"
    request_code = "robot(%ROBOT).ask(%X_NAME, %X_FIELD, **%X_INPUT)"
    return Block(
        type=block_type_of(robot.model, "do", action.name),
        text=template.text,
        shape="statement" if result_field is None else "value",
        style="robot",
        icon=action.icon or "bot",
        tooltip=_tooltip(robot, action),
        python=action_code if result_field is None else request_code,
        arguments=(*arguments, *(argument for _, argument in inputs)),
        constants={"X_NAME": action.name} | ({} if result_field is None else {"X_FIELD": result_field}),
        keywords={"X_INPUT": tuple((argument.name, parameter.name) for parameter, argument in inputs)},
        robot=RobotUse("action", action.name, action.title, robot.model),
        slot_texts={
            argument.name: (parameter.title, format_limits(parameter)) for parameter, argument in inputs
        },
        search_words=", ".join((keywords.words, translate("category", _group_title(action)))),
        english_search_words=keywords.english,
    )


def _tooltip(robot: Robot, action: Action) -> str:
    description = display_text(_member(robot, "actions", action.name), "description")
    description = description or f"{robot.title}: {action.title}."
    return _("{what_it_does} The next block waits until it is done.").format(what_it_does=description)


def _sensor_block(robot: Robot, sensor: Sensor, robot_names: Sequence[str]) -> Block:
    template = BlockTemplate(sensor.text, [])
    robots = robot_field(robot.model, robot_names)
    keywords = sensor_search_words(
        (sensor.name, sensor.title, *_semantic_types(robot, "properties", sensor.name))
    )
    if sensor.kind == "object":
        fields = tuple((field.title or field.name, field.name) for field in sensor.fields)
        return Block(
            type=block_type_of(robot.model, "get", sensor.name),
            text=f"{template.text} %FIELD %LIVE",
            shape="value",
            style="sensors",
            icon=sensor.icon or "eye",
            tooltip=_("Value reported by the robot: {sensor}.").format(sensor=sensor.title),
            python="robot(%ROBOT).get(%X_NAME, %FIELD)",
            arguments=(robots, ChoiceField("FIELD", fields), LiveField("LIVE")),
            constants={"X_NAME": sensor.name},
            robot=RobotUse("sensor", sensor.name, sensor.title, robot.model),
            search_words=keywords.words,
            english_search_words=keywords.english,
        )
    is_boolean = sensor.kind == "boolean"
    return Block(
        type=block_type_of(robot.model, "get", sensor.name),
        text=template.text if is_boolean else f"{template.text} %LIVE",
        shape="boolean" if is_boolean else "value",
        style="sensors",
        icon=sensor.icon or "eye",
        tooltip=_("Value reported by the robot: {sensor}.").format(sensor=sensor.title),
        python="robot(%ROBOT).get(%X_NAME)",
        arguments=(robots,) if is_boolean else (robots, LiveField("LIVE")),
        check="Boolean" if is_boolean else "Number" if sensor.kind in _NUMBER_KINDS else "String",
        constants={"X_NAME": sensor.name},
        robot=RobotUse("sensor", sensor.name, sensor.title, robot.model),
        search_words=keywords.words,
        english_search_words=keywords.english,
    )


def _event_block(robot: Robot, event: Event, robot_names: Sequence[str]) -> Block:
    template = BlockTemplate(event.text, list(event.filters))
    fields = {field.name: field for field in event.fields}
    filters = [
        (name, field_of(fields.get(name), template.arguments[name]))
        for name in event.filters
        if name in template.shown_parameters
    ]
    keywords = sensor_search_words((event.name, event.title, *_semantic_types(robot, "events", event.name)))
    return Block(
        type=block_type_of(robot.model, "when", event.name),
        text=template.text,
        shape="hat",
        style="events",
        icon=event.icon or "zap",
        tooltip=_("The blocks below run each time the robot reports: {event}.").format(event=event.title),
        python="robot(%ROBOT).on(%X_NAME, **%X_INPUT)",
        arguments=(robot_field(robot.model, robot_names), *(argument for _, argument in filters)),
        constants={"X_NAME": event.name},
        keywords={"X_INPUT": tuple((argument.name, name) for name, argument in filters)},
        robot=RobotUse("event", event.name, event.title, robot.model),
        search_words=keywords.words,
        english_search_words=keywords.english,
    )


def _change_event_blocks(robot: Robot, robot_names: Sequence[str]) -> tuple[Block, ...]:
    observable_sensors = [
        sensor for sensor in robot.sensors if _has_block(sensor) and sensor.kind in _SIMPLE_KINDS
    ]
    numbers = [sensor for sensor in observable_sensors if sensor.kind in _NUMBER_KINDS]
    hats = []
    if observable_sensors:
        hats.append(
            Block(
                type=block_type_of(robot.model, "when", "changes", without_verb=True),
                text=pgettext("block", "when %ROBOT %SENSOR changes"),
                shape="hat",
                style="events",
                icon="activity",
                tooltip=_("The blocks below run each time the value of this sensor changes."),
                python="robot(%ROBOT).on_change(%SENSOR)",
                arguments=(robot_field(robot.model, robot_names), _sensor_field(observable_sensors)),
                robot=RobotUse("sensor", "", "changes", robot.model),
                search_words=bilingual_search_words(CHANGE_SEARCH_WORDS).words,
                english_search_words=bilingual_search_words(CHANGE_SEARCH_WORDS).english,
            )
        )
    if numbers:
        hats.append(
            Block(
                type=block_type_of(robot.model, "when", "passes", without_verb=True),
                text=pgettext("block", "when %ROBOT %SENSOR goes %SIDE %LIMIT"),
                shape="hat",
                style="events",
                icon="activity",
                tooltip=_("The blocks below run each time the value of this sensor crosses the limit."),
                python="robot(%ROBOT).on_pass(%SENSOR, %SIDE, %LIMIT)",
                arguments=(
                    robot_field(robot.model, robot_names),
                    _sensor_field(numbers),
                    ChoiceField(
                        "SIDE",
                        ((pgettext("choice", "below"), "below"), (pgettext("choice", "above"), "above")),
                    ),
                    NumberField("LIMIT", 20),
                ),
                robot=RobotUse("sensor", "", "passes", robot.model),
                search_words=bilingual_search_words(PASS_SEARCH_WORDS).words,
                english_search_words=bilingual_search_words(PASS_SEARCH_WORDS).english,
            )
        )
    return tuple(hats)


def _sensor_field(sensors: Sequence[Sensor]) -> ChoiceField:
    return ChoiceField("SENSOR", tuple((sensor.title or sensor.name, sensor.name) for sensor in sensors))


def _result_field(robot: Robot, action: Action) -> str | None:
    block_hints = _member(robot, "actions", action.name).get("rb:block")
    returns = block_hints.get("returns") if isinstance(block_hints, Mapping) else None
    return returns if isinstance(returns, str) and returns else None


def _member(robot: Robot, kind: str, name: str) -> Mapping[str, object]:
    group = robot.source.get(kind)
    member = group.get(name) if isinstance(group, Mapping) else None
    return member if isinstance(member, Mapping) else {}


def _semantic_types(robot: Robot, kind: str, name: str) -> tuple[str, ...]:
    semantic_type = _member(robot, kind, name).get("@type")
    return (semantic_type,) if isinstance(semantic_type, str) else names(semantic_type)


CATEGORY = Category(
    name="robot",
    title="Robots",
    style="robot",
    icon="bot",
    order=70,
    make_blocks=robot_blocks,
    make_groups=robot_groups,
)
