"""Reader of bridge files in TOML. Errors name the line and the key."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, Struct, field

from nep.backends.base import Backend, find_backend
from nep.errors import did_you_mean
from nep.i18n import _, lazy
from nep.messages.fields import FieldPathError
from nep.nodes.arguments import check_type_name as checked_type
from nep.programs.bridges.configuration import (
    BridgeConfiguration,
    BridgeTopic,
    SideConfiguration,
    SideName,
    TopicEnd,
    check_different_networks,
    check_topic_names,
    checked_name,
    parse_direction,
    side_configuration,
)
from nep.programs.config_file import ConfigFile, ConfigKind, checks, convert_table
from nep.text import escaped, shortened

EXAMPLE = """\
# Configuration of a bridge, which forwards topics between two networks. Start: nep bridge FILE.toml
# docs/bridges.md describes all keys; commented lines show optional ones.

# name = "lab"                    # name of the bridge (default: the file's name)

[a]
backend = "zeromq"                # as in nep.node(name, "zeromq")
# master = "127.0.0.1:7780"       # as in nep.node(..., master=...)
# network = "lab"                 # for bridges that reach this network by different addresses

[b]
backend = "ros"

[[topics]]                        # one topic, both directions
a = "/chatter"
# b = "/chatter"                  # name on the other side (default: the same)

[[topics]]                        # commands to the robot, with the type it expects
a = "/cmd_vel"
direction = "a->b"                # or "b->a", or "both"
b_type = "geometry_msgs/Twist"

[[topics]]                        # camera images, at most 10 per second
a = "/camera"
b = "/usb_cam/image_raw/compressed"
direction = "b->a"
max_rate_hz = 10
# a_type = "image"                # default: the type of the topic there, else on the other side
# b_qos = "sensor"                # QoS profile, if the back end has any

[[topics]]                        # a pattern: * matches between slashes, ** also matches slashes
a = "/robot/*"
b = "/r2d2/*"
direction = "b->a"
"""
"""Example of a bridge file, printed by `nep bridge --example`."""

_KIND = ConfigKind(
    "TOML",
    "nep bridge",
    10**6,
    lazy("'{path}' is too large for a bridge file (limit: {most} bytes); choose another file"),
)
_MAX_TOPICS = 1000
_MAX_NETWORK_LENGTH = 200


class _FileTable(Struct):
    """Root table of a bridge file."""

    name: str | None = None
    a: Any = None
    b: Any = None
    topics: Any = None


class _SideTable(Struct):
    """Table `[a]` or `[b]`."""

    backend: str = ""
    master: str = ""
    network: Annotated[str, Meta(max_length=_MAX_NETWORK_LENGTH)] = ""


class _TopicTable(Struct):
    """One of the tables `[[topics]]`."""

    a: str = ""
    b: str = ""
    direction: str = "both"
    max_rate_hz: Annotated[float, Meta(ge=1e-6, le=1e6)] | None = None
    msg_type: str | None = field(name="type", default=None)
    a_type: str | None = None
    b_type: str | None = None
    a_qos: str = ""
    b_qos: str = ""


def read_configuration(path: Path) -> BridgeConfiguration:
    """Read a bridge file. Raises `NepError` if the file can't be read or its content is invalid."""
    return _configuration(ConfigFile.read(_KIND, path), path.stem)


def parse_configuration(text: str, path: str, stem: str) -> BridgeConfiguration:
    """Parse the text of a bridge file.

    Args:
        text: Content of the file.
        path: Path of the file, for error messages.
        stem: Default name of the bridge.

    Raises:
        NepError: The text isn't valid TOML, or a key or value is invalid. The message contains the line.
    """
    return _configuration(ConfigFile(_KIND, path, text), stem)


def _configuration(file: ConfigFile, stem: str) -> BridgeConfiguration:
    try:
        return _convert(file.value, stem)
    except FieldPathError as error:
        raise file.error(error) from error


def _convert(table: Mapping[str, Any], stem: str) -> BridgeConfiguration:
    root = convert_table(table, _FileTable)
    with checks("name"):
        name = checked_name(_default_name(stem) if root.name is None else root.name)
    with checks("a"):
        a = _side("a", root.a)
    with checks("b"):
        b = _side("b", root.b)
        check_different_networks(a, b)
    with checks("topics"):
        topics = _topics(root.topics, a, b)
    return BridgeConfiguration(name, a, b, topics)


def _side(side: SideName, value: object) -> SideConfiguration:
    if not isinstance(value, dict):
        raise FieldPathError(
            _("the side '{side}' is missing; write [{side}] and backend = \"zeromq\" below it").format(
                side=side
            )
        )
    table = convert_table(
        value, _SideTable, {"network": _("use at most {most} characters").format(most=_MAX_NETWORK_LENGTH)}
    )
    if not table.backend:
        raise FieldPathError(_('the back end is missing; write backend = "zeromq"'), "backend")
    with checks("backend"):
        find_backend(table.backend)
    with checks("master"):
        return side_configuration(table.backend, table.master, table.network)


def _topics(value: object, a: SideConfiguration, b: SideConfiguration) -> tuple[BridgeTopic, ...]:
    if not isinstance(value, list) or not value or not all(isinstance(each, dict) for each in value):
        raise FieldPathError(_('no topics are listed; write [[topics]] and a = "/a/topic" below it'))
    if len(value) > _MAX_TOPICS:
        raise FieldPathError(_("there are more than {most} topics; use patterns").format(most=_MAX_TOPICS))
    topics = []
    for number, each in enumerate(value):
        with checks(number):
            topics.append(_topic(each, a, b))
    known_routes: set[tuple[SideName, str, str]] = set()
    for number, topic in enumerate(topics):
        for side in topic.origins:
            route_key = (side, topic.a.name, topic.b.name)
            if route_key in known_routes:  # messages would arrive twice
                raise FieldPathError(
                    _("'{topic}' is already forwarded in that direction; remove one of the two").format(
                        topic=_printable(topic.end(side).name)
                    ),
                    number,
                    "a",
                )
            known_routes.add(route_key)
    return tuple(topics)


def _topic(value: Mapping[str, Any], a: SideConfiguration, b: SideConfiguration) -> BridgeTopic:
    rate_reason = _("must be a number from 0.000001 to 1000000, such as 10; or omit it")
    table = convert_table(value, _TopicTable, {"max_rate_hz": rate_reason})
    names = {"a": table.a or table.b, "b": table.b or table.a}
    if not names["a"]:
        raise FieldPathError(_('the topic name is missing; write a = "/a/topic"'), "a")
    with checks("b" if table.b else "a"):
        check_topic_names(names["a"], names["b"])
    with checks("direction"):
        direction = parse_direction(table.direction)
    ends = [
        TopicEnd(names[side], _type(side, value), _qos(f"{side}_qos", value, configuration.backend))
        for side, configuration in (("a", a), ("b", b))
    ]
    return BridgeTopic(ends[0], ends[1], direction, table.max_rate_hz or 0.0)


def _type(side: str, value: Mapping[str, Any]) -> str:
    key = f"{side}_type" if f"{side}_type" in value else "type"
    if key not in value:
        return ""
    with checks(key):
        return checked_type(key, value[key])


def _qos(key: str, value: Mapping[str, Any], backend: Backend) -> str:
    profile: str = value.get(key, "")
    if profile and not backend.qos:
        raise FieldPathError(
            _("the back end '{name}' doesn't support quality of service; remove this line").format(
                name=backend.name
            ),
            key,
        )
    if profile and profile not in backend.qos:
        raise FieldPathError(
            _("unknown quality of service '{word}'; {did_you_mean}").format(
                word=_printable(profile), did_you_mean=did_you_mean(profile, backend.qos)
            ),
            key,
        )
    return profile


def _default_name(stem: str) -> str:
    return escaped(stem)[:40] or "bridge"


def _printable(text: str) -> str:
    return escaped(shortened(text, 80))
