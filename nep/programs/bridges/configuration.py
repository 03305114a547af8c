"""What a bridge shall join: the values, the names of topics on the other side, and the short form of a line.

The form in a file is read by `nep.programs.bridges.toml_file`.
"""

from __future__ import annotations

import os
import platform
import re
from dataclasses import dataclass
from typing import Literal

from nep.backends.base import Backend, backend_named
from nep.errors import NepError, did_you_mean
from nep.i18n import _
from nep.protocol.wire import check_node_name, check_topic
from nep.text import quotable

__all__ = [
    "DIRECTIONS",
    "NODE_PREFIX",
    "SIDES",
    "BridgeConfiguration",
    "BridgeTopic",
    "Direction",
    "SideConfiguration",
    "SideName",
    "TopicEnd",
    "check_apart",
    "checked_name",
    "checked_topic_names",
    "direction_named",
    "join_line",
    "side_of",
]

Direction = Literal["a->b", "b->a", "both"]
SideName = Literal["a", "b"]

SIDES: tuple[SideName, SideName] = ("a", "b")
DIRECTIONS: dict[str, Direction] = {"a->b": "a->b", "b->a": "b->a", "both": "both"}
NODE_PREFIX = "bridge-"
"""How the names of a bridge's nodes begin."""
_WILDCARD = re.compile(r"\*\*|\*")
_FAR = re.compile(r"(?:^|[/,])(?!127\.|localhost:)[\w.-]+:\d+", re.ASCII)
"""The address of another computer, or one of this computer that others know, too."""
_NAME_MOST = 60


@dataclass(frozen=True)
class SideConfiguration:
    """One of the two networks. `network` is its name for all bridges: see `nep.programs.bridges.trail`.

    Nodes are made with `backend` and `master`.
    """

    backend: Backend
    master: str
    network: str


@dataclass(frozen=True)
class TopicEnd:
    """A topic, or a pattern of topics, on one side.

    `msg_type` is that under which messages are published and subscribed there, "" when the bridge shall find
    out. `qos` is one of the back end's words, or "".
    """

    name: str
    msg_type: str = ""
    qos: str = ""

    @property
    def wildcard(self) -> str:
        """`*` (letters between slashes), `**` (any letters), or "" for the name of one topic."""
        found = _WILDCARD.search(self.name)
        return found.group() if found is not None else ""

    def part_in(self, topic: str) -> str:
        """What stands in `topic` for the wildcard; "" when it does not match."""
        before, wildcard, after = self.name.partition(self.wildcard or "*")
        part = topic.removeprefix(before).removesuffix(after)
        is_whole = wildcard and part and topic == before + part + after
        return part if is_whole and (wildcard == "**" or "/" not in part) else ""

    def with_part(self, part: str) -> str:
        """The topic in which `part` stands for the wildcard."""
        return self.name.replace(self.wildcard, part, 1) if self.wildcard else self.name


@dataclass(frozen=True)
class BridgeTopic:
    """A topic as it is called on both sides; `max_rate_hz` of 0 lets all through.

    Either both ends have the same wildcard, or none has one.
    """

    a: TopicEnd
    b: TopicEnd
    direction: Direction = "both"
    max_rate_hz: float = 0.0

    @property
    def is_pattern(self) -> bool:
        """Whether it stands for any number of topics."""
        return bool(self.a.wildcard)

    @property
    def origins(self) -> tuple[SideName, ...]:
        """The sides from which it is carried."""
        return SIDES if self.direction == "both" else ("a",) if self.direction == "a->b" else ("b",)

    def end(self, side: SideName) -> TopicEnd:
        """Its end on that side."""
        return self.a if side == "a" else self.b


@dataclass(frozen=True)
class BridgeConfiguration:
    """All that a bridge is told. Its nodes are called `bridge-NAME-to-BACKEND`, after the other side's."""

    name: str
    a: SideConfiguration
    b: SideConfiguration
    topics: tuple[BridgeTopic, ...]

    def side(self, name: SideName) -> SideConfiguration:
        """One of the two."""
        return self.a if name == "a" else self.b

    def node_name(self, side: SideName) -> str:
        """What the node on that side is called: who looks at its graph learns where topics come from."""
        other = self.b if side == "a" else self.a
        return f"{NODE_PREFIX}{self.name}-to-{other.backend.name}"


def checked_name(name: str) -> str:
    """`name` itself when a bridge may have it. Raises `NepError`."""
    check_node_name(f"{NODE_PREFIX}{name}")
    if not name or len(name) > _NAME_MOST:
        raise NepError(_("a bridge's name has 1 to {most} letters; choose another").format(most=_NAME_MOST))
    return name


def side_of(backend: str, master: str = "", network: str = "") -> SideConfiguration:
    """One side; without `master` where this back end's nodes meet by default. Raises `NepError`."""
    found = backend_named(backend)
    try:
        place = found.master(master or None)
    except ValueError as error:  # also numbers that are none
        raise NepError(
            _("'{master}' is no place where nodes of '{backend}' meet; see docs/backends.md").format(
                master=master, backend=found.name
            )
        ) from error
    return SideConfiguration(found, place, network or _network(found, place))


def _network(backend: Backend, master: str) -> str:
    name = f"{backend.name}:{master}"
    if backend.is_in_process:
        return f"{name}@{platform.node()}/{os.getpid()}"
    return name if _FAR.search(master) else f"{name}@{platform.node()}"


def checked_topic_names(a: str, b: str) -> None:
    """Raises `NepError` when these cannot be the two names of a topic."""
    wildcards = []
    for name in (check_topic(a), check_topic(b)):
        found = _WILDCARD.findall(name)
        if len(found) > 1:
            raise NepError(
                _("'{name}' has {count} wildcards; use one '*', or '**' to match slashes, too").format(
                    name=name, count=len(found)
                )
            )
        wildcards.append("".join(found))
    if wildcards[0] != wildcards[1]:
        raise NepError(
            _("'{a}' and '{b}' do not go together; use the same '*' or '**' in both, or in none").format(
                a=a, b=b
            )
        )


def direction_named(name: str) -> Direction:
    """The direction of this name. Raises `NepError`."""
    if name not in DIRECTIONS:
        raise NepError(
            _("'{name}' is no direction; {did_you_mean}").format(
                name=quotable(name), did_you_mean=did_you_mean(name, tuple(DIRECTIONS))
            )
        )
    return DIRECTIONS[name]


def join_line(
    a: str, b: str, *, name: str, direction: str = "both", max_rate_hz: float = 0.0
) -> BridgeConfiguration:
    """The configuration of `nep bridge A B`, where each is BACKEND:TOPIC or BACKEND@MASTER:TOPIC.

    Without a topic (`ros:`) it is called as on the other side. Raises `NepError`.
    """
    (a_side, a_topic), (b_side, b_topic) = _side_and_topic(a), _side_and_topic(b)
    a_topic, b_topic = a_topic or b_topic, b_topic or a_topic
    if not a_topic:
        raise NepError(_("no topic is named; write it as 'zeromq:/topic ros:/topic'"))
    checked_topic_names(a_topic, b_topic)
    check_apart(a_side, b_side)
    topic = BridgeTopic(TopicEnd(a_topic), TopicEnd(b_topic), direction_named(direction), max_rate_hz)
    return BridgeConfiguration(checked_name(name), a_side, b_side, (topic,))


def check_apart(a: SideConfiguration, b: SideConfiguration) -> None:
    """Raises `NepError` when both are one network: every message would come back."""
    if a.network == b.network:
        raise NepError(
            _("both sides are the network '{network}'; give one of them another back end or master").format(
                network=a.network
            )
        )


def _side_and_topic(word: str) -> tuple[SideConfiguration, str]:
    backend, at, rest = word.partition("@")
    if at and ":" not in backend:
        master, colon, topic = rest.rpartition(":")
    else:
        master = ""
        backend, colon, topic = word.partition(":")
    if not colon or not backend:
        raise NepError(
            _(
                "'{word}' is no BACKEND:TOPIC; write it as 'zeromq:/topic' or 'zeromq@HOST:7780:/topic'"
            ).format(word=quotable(word))
        )
    return side_of(backend, master), topic
