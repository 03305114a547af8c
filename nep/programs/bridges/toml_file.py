"""Parser of bridge files in TOML. Errors name the line and the key."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from nep.backends.base import Backend, find_backend
from nep.errors import NepError, did_you_mean
from nep.i18n import _
from nep.nodes.arguments import check_type_name as checked_type
from nep.programs.bridges.configuration import (
    SIDES,
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
from nep.text import escaped, shortened

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


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

_KEYS = ("name", *SIDES, "topics")
_SIDE_KEYS = ("backend", "master", "network")
_TOPIC_KEYS = (*SIDES, "direction", "max_rate_hz", "type", "a_type", "b_type", "a_qos", "b_qos")
_MAX_BYTES = 10**6
_MAX_TOPICS = 1000
_MAX_NETWORK_LENGTH = 200
_TABLE_HEADER = re.compile(r"\s*\[\[?\s*([^\[\]#]+?)\s*\]")
_TOML_POSITION = re.compile(r"\s*\((?:at line (\d+), column \d+|at end of document)\)")
_MAX_REASON_LENGTH = 200
_CHECKED = TypeVar("_CHECKED")


def read_configuration(path: Path) -> BridgeConfiguration:
    """Read a bridge file. Raises `NepError` if the file can't be read or its content is invalid."""
    shown_path = escaped(str(path))
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # NUL in a file name raises ValueError
        reason = getattr(error, "strerror", None) or str(error)
        raise NepError(
            _("'{path}' can't be read: {reason}; 'nep bridge --example' prints an example").format(
                path=shown_path, reason=reason[:1].lower() + reason[1:]
            )
        ) from error
    if len(data) > _MAX_BYTES:
        raise NepError(
            _("'{path}' is too large for a bridge file (limit: {most} bytes); choose another file").format(
                path=shown_path, most=_MAX_BYTES
            )
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise NepError(
            _("line {line} of '{path}' isn't UTF-8; save the file as UTF-8").format(
                line=line, path=shown_path
            )
        ) from error
    return parse_configuration(text, shown_path, path.stem)


def parse_configuration(text: str, path: str, stem: str) -> BridgeConfiguration:
    """Parse the text of a bridge file.

    Args:
        text: Content of the file.
        path: Path of the file, for error messages.
        stem: Default name of the bridge.

    Raises:
        NepError: The text isn't valid TOML, or a key or value is invalid. The message contains the line.
    """
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError also for numbers with thousands of digits
        raise NepError(_toml_error_message(path, text, str(error))) from error
    return _Reader(path, text).configuration(table, stem)


def _toml_error_message(path: str, text: str, message: str) -> str:
    match = _TOML_POSITION.search(message)
    line = int(match.group(1)) if match and match.group(1) else text.count("\n") + 1
    reason = escaped(shortened(_TOML_POSITION.sub("", message).strip(), _MAX_REASON_LENGTH))
    return _(
        "line {line} of '{path}' isn't valid TOML: {reason}; 'nep bridge --example' prints an example"
    ).format(line=line, path=path, reason=reason[:1].lower() + reason[1:])


class _Reader:
    """Converter of a parsed bridge file that finds the line of each key for error messages.

    In its methods, `table_name` is the name of a table ("" for the root) and `number` the index of a
    `[[topics]]` table.
    """

    def __init__(self, path: str, text: str) -> None:
        self._path = path
        self._lines = text.splitlines()

    def configuration(self, table: Mapping[str, Any], stem: str) -> BridgeConfiguration:
        self._check_keys(table, _KEYS, "")
        name = self._text(table, "name", "", default=_default_name(stem))
        name = self._run_check(lambda: checked_name(name), "name", "")
        a, b = (self._side(table, each) for each in SIDES)
        self._run_check(lambda: check_different_networks(a, b), "b", "")
        topics = table.get("topics")
        if not isinstance(topics, list) or not topics or not all(isinstance(each, dict) for each in topics):
            self._fail("topics", "", _('no topics are listed; write [[topics]] and a = "/a/topic" below it'))
        if len(topics) > _MAX_TOPICS:
            self._fail(
                "topics", "", _("there are more than {most} topics; use patterns").format(most=_MAX_TOPICS)
            )
        parsed_topics = tuple(self._topic(each, number, a, b) for number, each in enumerate(topics))
        self._check_duplicates(parsed_topics)
        return BridgeConfiguration(name, a, b, parsed_topics)

    def _side(self, table: Mapping[str, Any], side: SideName) -> SideConfiguration:
        section = table.get(side)
        if not isinstance(section, dict):
            self._fail(
                side,
                "",
                _("the side '{side}' is missing; write [{side}] and backend = \"zeromq\" below it").format(
                    side=side
                ),
            )
        self._check_keys(section, _SIDE_KEYS, side)
        backend = self._text(section, "backend", side)
        if not backend:
            self._fail("backend", side, _('the back end is missing; write backend = "zeromq"'))
        self._run_check(lambda: find_backend(backend), "backend", side)
        master, network = (self._text(section, key, side) for key in ("master", "network"))
        if len(network) > _MAX_NETWORK_LENGTH:
            self._fail(
                "network",
                side,
                _("use at most {most} characters").format(most=_MAX_NETWORK_LENGTH),
            )
        return self._run_check(lambda: side_configuration(backend, master, network), "master", side)

    def _topic(
        self, section: Mapping[str, Any], number: int, a: SideConfiguration, b: SideConfiguration
    ) -> BridgeTopic:
        self._check_keys(section, _TOPIC_KEYS, "topics", number)
        a_name, b_name = (self._text(section, side, "topics", number) for side in SIDES)
        a_name, b_name = a_name or b_name, b_name or a_name
        if not a_name:
            self._fail("a", "topics", _('the topic name is missing; write a = "/a/topic"'), number)
        key = "b" if section.get("b") else "a"
        self._run_check(lambda: check_topic_names(a_name, b_name), key, "topics", number)
        direction = self._text(section, "direction", "topics", number, default="both")
        parsed_direction = self._run_check(lambda: parse_direction(direction), "direction", "topics", number)
        ends = [
            TopicEnd(
                name,
                self._type(section, side, number),
                self._qos(section, f"{side}_qos", number, configuration.backend),
            )
            for name, side, configuration in ((a_name, "a", a), (b_name, "b", b))
        ]
        return BridgeTopic(ends[0], ends[1], parsed_direction, self._rate(section, number))

    def _type(self, section: Mapping[str, Any], side: str, number: int) -> str:
        key = f"{side}_type" if f"{side}_type" in section else "type"
        name = self._text(section, key, "topics", number)
        if key in section:
            self._run_check(lambda: checked_type(key, name), key, "topics", number)
        return name

    def _qos(self, section: Mapping[str, Any], key: str, number: int, backend: Backend) -> str:
        profile = self._text(section, key, "topics", number)
        if profile and not backend.qos:
            self._fail(
                key,
                "topics",
                _("the back end '{name}' doesn't support quality of service; remove this line").format(
                    name=backend.name
                ),
                number,
            )
        if profile and profile not in backend.qos:
            self._fail(
                key,
                "topics",
                _("unknown quality of service '{word}'; {did_you_mean}").format(
                    word=_printable(profile), did_you_mean=did_you_mean(profile, backend.qos)
                ),
                number,
            )
        return profile

    def _rate(self, section: Mapping[str, Any], number: int) -> float:
        value = section.get("max_rate_hz")
        if value is None:
            return 0.0
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not 1e-6 <= value <= 1e6:
            self._fail(
                "max_rate_hz",
                "topics",
                _("must be a number from 0.000001 to 1000000, such as 10; or omit it"),
                number,
            )
        return float(value)

    def _check_duplicates(self, topics: Sequence[BridgeTopic]) -> None:
        # Messages of a topic that is listed twice would arrive twice.
        known_routes: set[tuple[SideName, str, str]] = set()
        for number, topic in enumerate(topics):
            for side in topic.origins:
                route_key = (side, topic.a.name, topic.b.name)
                if route_key in known_routes:
                    self._fail(
                        "a",
                        "topics",
                        _("'{topic}' is already forwarded in that direction; remove one of the two").format(
                            topic=_printable(topic.end(side).name)
                        ),
                        number,
                    )
                known_routes.add(route_key)

    # ---- keys, values and their lines

    def _check_keys(
        self, table: Mapping[str, Any], known_keys: Sequence[str], table_name: str, number: int = 0
    ) -> None:
        for key in table:
            if key not in known_keys:
                template = _("unknown key; {did_you_mean}")
                self._fail(
                    key, table_name, template.format(did_you_mean=did_you_mean(key, known_keys)), number
                )

    def _text(
        self, table: Mapping[str, Any], key: str, table_name: str, number: int = 0, default: str = ""
    ) -> str:
        value = table.get(key, default)
        if not isinstance(value, str):
            self._fail(key, table_name, _("must be a string in quotes"), number)
        return value

    def _run_check(
        self, check: Callable[[], _CHECKED], key: str, table_name: str, number: int = 0
    ) -> _CHECKED:
        try:
            return check()
        except (NepError, ValueError) as error:
            self._fail(key, table_name, str(error), number)

    def _fail(self, key: str, table_name: str, reason: str, number: int = 0) -> NoReturn:
        shown_key = _printable(key)
        if table_name:
            shown_key = (
                f"{table_name}[{number + 1}].{shown_key}"
                if table_name == "topics"
                else f"{table_name}.{shown_key}"
            )
        line = self._line_of(key, table_name, number)
        template = _("line {line} of '{path}', {key}: {reason}") if line else _("'{path}', {key}: {reason}")
        raise NepError(escaped(template.format(line=line, path=self._path, key=shown_key, reason=reason)))

    def _line_of(self, key: str, table_name: str, number: int) -> int:
        table, topic_index, table_line = "", -1, 0
        name = re.escape(key)
        assignment = re.compile(rf"\s*[\"']?{name}[\"']?\s*[=.]")
        dotted_key = re.compile(rf"\s*{re.escape(table_name or key)}\s*[.=]")
        for line_number, line in enumerate(self._lines, 1):
            match = _TABLE_HEADER.match(line)
            if match is not None:
                table = match.group(1).strip("\"' ")
                topic_index += table == "topics"
                if not table_name and table == key:
                    return line_number
            is_in_table = table == table_name and (table_name != "topics" or topic_index == number)
            if is_in_table and match is not None:
                table_line = line_number
            elif is_in_table and assignment.match(line):
                return line_number
            elif not table and not table_line and dotted_key.match(line):
                table_line = line_number
        return table_line


def _default_name(stem: str) -> str:
    return escaped(stem)[:40] or "bridge"


def _printable(text: str) -> str:
    return escaped(shortened(text, 80))
