"""Conversion of validated robot descriptions to dataclasses; `description.parse` is the entry point."""

from __future__ import annotations

from collections.abc import Mapping

from app.robots.description.inputs import Parameter, choices_of, display_unit, kind_of, parameter_of
from app.robots.description.json_access import as_object, display_text, names, number, object_member, text
from app.robots.description.model import Action, DataField, Event, Robot, RobotTopics, SafeStop, Sensor
from nep.i18n import ENGLISH, language, translate

_TOPIC_SCHEME = "nep:"
_ICONS = {"moves": "move", "locomotes": "footprints"}


def parse_document(document: Mapping[str, object], topics: RobotTopics) -> Robot:
    """Convert a valid document to a robot.

    Args:
        document: Thing Model or Thing Description.
        topics: Topics that are used if the document doesn't contain any.
    """
    topic_names = object_member(document, "rb:topics")
    topics = RobotTopics(
        description=text(topic_names.get("description")) or topics.description,
        command=text(topic_names.get("command")) or topics.command,
        reply=text(topic_names.get("answer")) or topics.reply,
        state=text(topic_names.get("state")) or topics.state,
        world=text(topic_names.get("world")) or topics.world,
    )
    name = str(document["title"])
    kind = object_member(document, "rb:robot")
    home = topics.command.rpartition("/")[0]
    return Robot(
        name=name,
        model=str(kind["model"]),
        title=text(kind.get("title")) or name,
        virtual=kind.get("virtual") is True,
        dialect=text(kind.get("dialect")) or "native",
        actions=tuple(
            _action(leaf, as_object(a), topics) for leaf, a in object_member(document, "actions").items()
        ),
        sensors=tuple(
            _sensor(leaf, as_object(s), home) for leaf, s in object_member(document, "properties").items()
        ),
        events=tuple(
            _event(leaf, as_object(e), home) for leaf, e in object_member(document, "events").items()
        ),
        safe_stop=_safe_stop(object_member(document, "rb:safeStop")),
        resources=names(document.get("rb:resources")),
        topics=topics,
        source=document,
        heartbeat_interval_s=number(document.get("rb:beat")),
    )


def _safe_stop(stop: Mapping[str, object]) -> SafeStop:
    return SafeStop(
        action=str(stop["action"]),
        watchdog_s=number(stop.get("watchdog")),
        within_s=number(stop.get("within")) or 0.5,
        stops_on_program_end=stop.get("onProgramEnd") is not False,
        stops_on_disconnect=stop.get("onDisconnect") is not False,
        can_confirm=stop.get("confirmed") is not False,
    )


def _action(name: str, action: Mapping[str, object], topics: RobotTopics) -> Action:
    input_schema = object_member(action, "input")
    required = names(input_schema.get("required"))
    parameters = _parameters(object_member(input_schema, "properties"), required)
    block = object_member(action, "rb:block")
    risk = text(action.get("rb:risk"))
    title = _title(name, action)
    return Action(
        name=name,
        title=title,
        icon=text(block.get("icon")) or _ICONS.get(risk or "", "play"),
        category=_category(block, "Actions"),
        parameters=parameters,
        text=_with_robot_placeholder(_block_text(block, "text") or _default_text(title, parameters)),
        says=_with_robot_placeholder(_block_text(block, "says")) or None,
        topic=_topic(action, topics.command),
        reply_topic=_topic(action, topics.reply, "rb:answer"),
        risk=risk,
        cancellable=action.get("rb:cancel") is True,
        timeout_s=number(action.get("rb:timeout")),
        uses=names(action.get("rb:uses")),
        on_busy=text(action.get("rb:onBusy")) or "queue",
        is_synchronous=action.get("synchronous") is True,
        feedback=_fields(object_member(action, "rb:feedback")),
        output=_fields(object_member(action, "output")),
        repeat_s=number(action.get("rb:repeat")),
    )


def _sensor(name: str, sensor: Mapping[str, object], home: str) -> Sensor:
    block = object_member(sensor, "rb:block")
    return Sensor(
        name=name,
        title=_title(name, sensor),
        kind=_sensor_kind(sensor),
        topic=_topic(sensor, f"{home}/{name}"),
        unit=display_unit(text(sensor.get("unit"))),
        minimum=number(sensor.get("minimum")),
        maximum=number(sensor.get("maximum")),
        rate_hz=number(sensor.get("rb:rate")),
        fields=_fields(sensor),
        icon=text(block.get("icon")) or "activity",
        category=_category(block, "Sensors"),
        text=_with_robot_placeholder(_block_text(block, "text")),
        camera=text(sensor.get("rb:camera")),
        choices=choices_of(sensor),
    )


def _sensor_kind(sensor: Mapping[str, object]) -> str:
    if str(sensor.get("contentMediaType", "")).startswith("image/"):
        return "image"
    if sensor.get("rb:widget") == "detections":
        return "detections"
    kind = kind_of(sensor)
    return "number" if kind == "angle" else kind


def _event(name: str, event: Mapping[str, object], home: str) -> Event:
    block = object_member(event, "rb:block")
    fields = _parameters(object_member(object_member(event, "data"), "properties"), ())
    filters = names(event.get("rb:filter"))
    title = _title(name, event)
    template = _block_text(block, "text") or f"when %robot {title}"
    return Event(
        name=name,
        title=title,
        icon=text(block.get("icon")) or "zap",
        category=_category(block, "Events"),
        fields=fields,
        filters=filters,
        text=_with_robot_placeholder(template),
        topic=_topic(event, f"{home}/{name}"),
    )


def _parameters(data: Mapping[str, object], required: tuple[str, ...]) -> tuple[Parameter, ...]:
    return tuple(parameter_of(name, as_object(d), is_required=name in required) for name, d in data.items())


def _fields(owner: Mapping[str, object]) -> tuple[DataField, ...]:
    schemas = ((name, as_object(schema)) for name, schema in object_member(owner, "properties").items())
    return tuple(
        DataField(name, _title(name, each), kind_of(each), display_unit(text(each.get("unit"))))
        for name, each in schemas
    )


def _title(name: str, owner: Mapping[str, object]) -> str:
    return display_text(owner) or translate("robot", name.replace("_", " "))


def _category(block: Mapping[str, object], fallback: str) -> str:
    category = (text(block.get("category")) or fallback).strip()
    return category[:1].upper() + category[1:]


def _block_text(block: Mapping[str, object], kind: str) -> str:
    translations = object_member(block, kind)
    english = text(translations.get(ENGLISH)) or next(
        (str(translation) for translation in translations.values()), ""
    )
    return (
        text(translations.get(language())) or translate("robot", english.strip().removeprefix("%robot "))
    ).strip()


def _default_text(title: str, parameters: tuple[Parameter, ...]) -> str:
    visible = [parameter for parameter in parameters if not parameter.is_advanced]
    values = [f"%{p.name}{' ' + p.unit if p.unit else ''}" for p in visible]
    return " ".join([title, *values])


def _with_robot_placeholder(template: str) -> str:
    if not template or "%robot" in template:
        return template
    if template.startswith("when "):
        return f"when %robot {template.removeprefix('when ')}"
    return f"%robot {template}"


def _topic(owner: Mapping[str, object], fallback: str, member: str = "href") -> str:
    forms = owner.get("forms")
    for form in forms if isinstance(forms, (list, tuple)) else ():
        href = text(as_object(form).get(member))
        if href is not None and href.startswith(_TOPIC_SCHEME):
            return href.removeprefix(_TOPIC_SCHEME)
    return fallback
