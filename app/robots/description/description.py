"""Entry point for robot descriptions: parsing of W3C Thing Models and Thing Descriptions.

:func:`parse` parses the document once; Studio works with :class:`Robot`. The ``rb:`` terms are documented in
``resources/robots/README.md``.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping

from app.errors import DescriptionError
from app.robots.description.inputs import Choice, Parameter, display_unit
from app.robots.description.json_access import as_object, object_member, text
from app.robots.description.model import Action, DataField, Event, Robot, RobotTopics, SafeStop, Sensor
from app.robots.description.parser import parse_document
from app.robots.description.validate import validate, without_control_characters
from nep.i18n import _, number
from nep.messages.message import Message

__all__ = [
    "Action",
    "Choice",
    "DataField",
    "Event",
    "Parameter",
    "Robot",
    "RobotTopics",
    "SafeStop",
    "Sensor",
    "display_unit",
    "parse",
    "parse_announcement",
    "thing_description",
    "topic_of",
    "validate",
]  # fmt: skip

MAX_BYTES = 1_000_000
"""Maximum size of a description in bytes; larger descriptions are rejected before decoding."""
_INVALID_TOPIC_CHARACTERS = re.compile(r"[^\w.-]")


def topic_of(name: str, leaf: str) -> str:
    """Return the topic of a sensor, event or other part of a robot.

    ``topic_of("My robot", "camera")`` is ``/My_robot/camera``.

    Args:
        name: Name of the robot.
        leaf: Last level of the topic.
    """
    return f"/{_INVALID_TOPIC_CHARACTERS.sub('_', name)}/{leaf}"


def parse(document: Mapping[str, object]) -> Robot:
    """Parse a Thing Model or Thing Description.

    Raises:
        DescriptionError: The document is invalid; the error lists all problems.
    """
    problems = validate(document)
    if problems:
        title = as_object(document).get("title")
        raise DescriptionError(title if isinstance(title, str) else _("a robot"), problems)
    document = without_control_characters(document)
    return parse_document(document, default_topics(str(document["title"])))


def parse_announcement(message: Message) -> Robot:
    """Parse the robot description in a message.

    Raises:
        DescriptionError: The description is invalid or larger than `MAX_BYTES`.
        NepError: The message can't be decoded.
    """
    size = len(message.data)
    if size > MAX_BYTES:
        problem = _("it is {size} MB in size; the limit is {limit} MB").format(
            size=number(size / 1000000.0, ".1f"), limit=number(MAX_BYTES / 1000000.0, ".0f")
        )
        raise DescriptionError(message.topic, (problem,))
    payload = message.payload
    if not isinstance(payload, Mapping):
        raise DescriptionError(message.topic, (_("a description must be a JSON object"),))
    return parse(payload)


def default_topics(name: str, *, virtual: bool = False) -> RobotTopics:
    """Return the topics that the driver kit uses for a robot with this name.

    Args:
        name: Name of the robot.
        virtual: True to include the topics that only virtual robots have.
    """
    return RobotTopics(
        description=topic_of(name, "description"),
        command=topic_of(name, "command"),
        reply=topic_of(name, "answer"),
        state=topic_of(name, "state") if virtual else None,
        world=topic_of(name, "world") if virtual else None,
    )


def thing_description(model: Mapping[str, object], name: str) -> dict[str, object]:
    """Return the Thing Description of one robot, including id and forms.

    Args:
        model: Valid Thing Model (see :func:`validate`); it is not modified.
        name: Name of the robot.
    """
    model_copy = copy.deepcopy(dict(model))
    kind = object_member(model_copy, "rb:robot")
    topics = default_topics(name, virtual=kind.get("virtual") is True)
    document = {
        key: value
        for key, value in model_copy.items()
        if key not in {"titles", "actions", "properties", "events"}
    }
    document |= {
        "@type": ["rb:Robot"],
        "title": name,
        "id": f"urn:nep:robot:{_INVALID_TOPIC_CHARACTERS.sub('_', name)}",
        "version": {"instance": "1.0.0", **object_member(model_copy, "version")},
        "securityDefinitions": {"nosec_sc": {"scheme": "nosec"}},
        "security": "nosec_sc",
        "rb:robot": {**kind, "title": text(kind.get("title")) or str(model["title"])},
        "rb:topics": _topics_json(topics),
    }
    action_form = _form(topics.command, "invokeaction", "cancelaction") | {"rb:answer": f"nep:{topics.reply}"}
    document["properties"] = {
        leaf: {**as_object(sensor), "forms": [_sensor_form(topic_of(name, leaf), as_object(sensor))]}
        for leaf, sensor in object_member(model_copy, "properties").items()
    }
    document["actions"] = {
        leaf: {**as_object(action), "forms": [dict(action_form)]}
        for leaf, action in object_member(model_copy, "actions").items()
    }
    document["events"] = {
        leaf: {
            **as_object(event),
            "forms": [_form(topic_of(name, leaf), "subscribeevent", "unsubscribeevent")],
        }
        for leaf, event in object_member(model_copy, "events").items()
    }
    return document


def _topics_json(topics: RobotTopics) -> dict[str, str]:
    topic_by_key = {
        "description": topics.description,
        "command": topics.command,
        "answer": topics.reply,
        "state": topics.state,
        "world": topics.world,
    }
    return {key: topic for key, topic in topic_by_key.items() if topic is not None}


def _form(topic: str, *ops: str) -> dict[str, object]:
    return {"href": f"nep:{topic}", "contentType": "application/json", "op": list(ops)}


def _sensor_form(topic: str, sensor: Mapping[str, object]) -> dict[str, object]:
    form = _form(topic, "observeproperty", "unobserveproperty")
    media = text(sensor.get("contentMediaType"))
    return {**form, "contentType": media} if media else form
