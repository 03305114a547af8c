"""Configuration of a bridge, and parser of the short form `nep bridge A B`.

`nep.programs.bridges.toml_file` parses the file format.
"""

from __future__ import annotations

import os
import platform
import re
from dataclasses import dataclass
from typing import Literal

from nep.backends.base import Backend, find_backend
from nep.errors import NepError, did_you_mean
from nep.i18n import _
from nep.protocol.wire import check_node_name, check_topic
from nep.text import quotable

Direction = Literal["a->b", "b->a", "both"]
SideName = Literal["a", "b"]

SIDES: tuple[SideName, SideName] = ("a", "b")
DIRECTIONS: dict[str, Direction] = {"a->b": "a->b", "b->a": "b->a", "both": "both"}
NODE_PREFIX = "bridge-"
"""Name prefix of a bridge's nodes."""
_WILDCARD = re.compile(r"\*\*|\*")
_REACHABLE_ADDRESS = re.compile(r"(?:^|[/,])(?!127\.|localhost:)[\w.-]+:\d+", re.ASCII)
"""Pattern of a network address at which other computers can reach a master."""
_MAX_NAME_LENGTH = 60


@dataclass(frozen=True)
class SideConfiguration:
    """Configuration of one side of a bridge.

    Attributes:
        backend: Back end of the node on this side.
        master: Address of the master.
        network: Id by which all bridges recognize the network; see `nep.programs.bridges.trail`.
    """

    backend: Backend
    master: str
    network: str


@dataclass(frozen=True)
class TopicEnd:
    """Topic or pattern on one side.

    Attributes:
        name: Name of the topic, or pattern.
        msg_type: Message type for publishing and subscribing on this side; "" to detect the type.
        qos: Name of a QoS profile of the back end; "" for the default.
    """

    name: str
    msg_type: str = ""
    qos: str = ""

    @property
    def wildcard(self) -> str:
        """Wildcard of the pattern: `*` (within slashes), `**` (any characters), or "" for a topic."""
        match = _WILDCARD.search(self.name)
        return match.group() if match is not None else ""

    def matched_part(self, topic: str) -> str:
        """Return the part of a topic that the wildcard matches, or "" if the pattern doesn't match."""
        prefix, wildcard, suffix = self.name.partition(self.wildcard or "*")
        part = topic.removeprefix(prefix).removesuffix(suffix)
        is_match = wildcard and part and topic == prefix + part + suffix
        return part if is_match and (wildcard == "**" or "/" not in part) else ""

    def with_part(self, part: str) -> str:
        """Return the name with the wildcard replaced by `part`; the name itself if it has no wildcard."""
        return self.name.replace(self.wildcard, part, 1) if self.wildcard else self.name


@dataclass(frozen=True)
class BridgeTopic:
    """Topic or pattern of a bridge. Either both ends have the same wildcard, or neither has one.

    Attributes:
        a: Topic on side a.
        b: Topic on side b.
        direction: Direction in which messages are forwarded.
        max_rate_hz: Maximum number of messages per second; 0 for no limit.
    """

    a: TopicEnd
    b: TopicEnd
    direction: Direction = "both"
    max_rate_hz: float = 0.0

    @property
    def is_pattern(self) -> bool:
        """True if the name has a wildcard and so may match several topics."""
        return bool(self.a.wildcard)

    @property
    def origins(self) -> tuple[SideName, ...]:
        """Sides from which messages are forwarded."""
        return SIDES if self.direction == "both" else ("a",) if self.direction == "a->b" else ("b",)

    def end(self, side: SideName) -> TopicEnd:
        """Return the topic or pattern on a side."""
        return self.a if side == "a" else self.b


@dataclass(frozen=True)
class BridgeConfiguration:
    """Configuration of a bridge.

    The bridge's nodes are named `bridge-NAME-to-BACKEND`, after the back end of the other side.

    Attributes:
        name: Name of the bridge.
        a: Configuration of side a.
        b: Configuration of side b.
        topics: Topics and patterns to forward.
    """

    name: str
    a: SideConfiguration
    b: SideConfiguration
    topics: tuple[BridgeTopic, ...]

    def side(self, name: SideName) -> SideConfiguration:
        """Return the configuration of a side."""
        return self.a if name == "a" else self.b

    def node_name(self, side: SideName) -> str:
        """Return the name of the node on a side, which contains the back end of the other side."""
        other = self.b if side == "a" else self.a
        return f"{NODE_PREFIX}{self.name}-to-{other.backend.name}"


def checked_name(name: str) -> str:
    """Return the name of a bridge if it is valid.

    Raises `NepError` if the name is empty, too long, or has characters that a node's name must not
    have.
    """
    check_node_name(f"{NODE_PREFIX}{name}")
    if not name or len(name) > _MAX_NAME_LENGTH:
        raise NepError(
            _("a bridge's name must have 1 to {most} characters; choose another").format(
                most=_MAX_NAME_LENGTH
            )
        )
    return name


def side_configuration(backend: str, master: str = "", network: str = "") -> SideConfiguration:
    """Create the configuration of a side. Raises `NepError` for an unknown back end or an invalid address.

    Args:
        backend: Name of the back end.
        master: Address of the master (default: the back end's default).
        network: Id of the network (default: derived from the address).
    """
    resolved_backend = find_backend(backend)
    try:
        address = resolved_backend.master(master or None)
    except ValueError as error:  # also invalid numbers
        raise NepError(
            _("'{master}' isn't a valid master address for '{backend}'; see docs/backends.md").format(
                master=master, backend=resolved_backend.name
            )
        ) from error
    return SideConfiguration(resolved_backend, address, network or _network_id(resolved_backend, address))


def _network_id(backend: Backend, master: str) -> str:
    name = f"{backend.name}:{master}"
    if backend.is_in_process:
        return f"{name}@{platform.node()}/{os.getpid()}"
    return name if _REACHABLE_ADDRESS.search(master) else f"{name}@{platform.node()}"


def check_topic_names(a: str, b: str) -> None:
    """Validate the topics or patterns of both sides.

    Raises `NepError` if a name is invalid, or if the two have different wildcards.
    """
    wildcards = []
    for name in (check_topic(a), check_topic(b)):
        name_wildcards = _WILDCARD.findall(name)
        if len(name_wildcards) > 1:
            raise NepError(
                _("'{name}' has {count} wildcards; use a single '*', or '**' to match slashes, too").format(
                    name=name, count=len(name_wildcards)
                )
            )
        wildcards.append("".join(name_wildcards))
    if wildcards[0] != wildcards[1]:
        raise NepError(
            _(
                "'{a}' and '{b}' have different wildcards; use the same '*' or '**' in both, or in neither"
            ).format(a=a, b=b)
        )


def parse_direction(name: str) -> Direction:
    """Return a direction if it is valid. Raises `NepError` if it is none of `DIRECTIONS`."""
    if name not in DIRECTIONS:
        raise NepError(
            _("unknown direction '{name}'; {did_you_mean}").format(
                name=quotable(name), did_you_mean=did_you_mean(name, tuple(DIRECTIONS))
            )
        )
    return DIRECTIONS[name]


def configuration_from_arguments(
    a: str, b: str, *, name: str, direction: str = "both", max_rate_hz: float = 0.0
) -> BridgeConfiguration:
    """Create the configuration for `nep bridge A B`.

    Args:
        a: Side a as BACKEND:TOPIC or BACKEND@MASTER:TOPIC. Without a topic (`ros:`), the topic of the
            other side is used.
        b: Side b in the same form.
        name: Name of the bridge.
        direction: "a->b", "b->a" or "both".
        max_rate_hz: Maximum number of messages per second; 0 for no limit.

    Raises:
        NepError: An argument is invalid, neither side has a topic, or both sides are the same network.
    """
    (a_side, a_topic), (b_side, b_topic) = _parse_side_and_topic(a), _parse_side_and_topic(b)
    a_topic, b_topic = a_topic or b_topic, b_topic or a_topic
    if not a_topic:
        raise NepError(_("the topic name is missing; write it as 'zeromq:/topic ros:/topic'"))
    check_topic_names(a_topic, b_topic)
    check_different_networks(a_side, b_side)
    topic = BridgeTopic(TopicEnd(a_topic), TopicEnd(b_topic), parse_direction(direction), max_rate_hz)
    return BridgeConfiguration(checked_name(name), a_side, b_side, (topic,))


def check_different_networks(a: SideConfiguration, b: SideConfiguration) -> None:
    """Raise `NepError` if both sides are the same network, where every message would loop."""
    if a.network == b.network:
        raise NepError(
            _(
                "both sides are the network '{network}'; choose another back end or master for one of them"
            ).format(network=a.network)
        )


def _parse_side_and_topic(text: str) -> tuple[SideConfiguration, str]:
    backend, separator, master_and_topic = text.partition("@")
    if separator and ":" not in backend:
        master, colon, topic = master_and_topic.rpartition(":")
    else:
        master = ""
        backend, colon, topic = text.partition(":")
    if not colon or not backend:
        raise NepError(
            _(
                "'{word}' isn't in the form BACKEND:TOPIC; write it as 'zeromq:/topic' or "
                "'zeromq@HOST:7780:/topic'"
            ).format(word=quotable(text))
        )
    return side_configuration(backend, master), topic
