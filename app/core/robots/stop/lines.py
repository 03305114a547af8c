"""Connections for Stop: command and reply topics of a robot's present and earlier descriptions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from app.robots.description.description import Robot, RobotTopics
from app.robots.identity import Identity
from nep.i18n import _
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

MAX_TOPICS = 32
"""Maximum number of command topics of one robot: the present ones, then those of earlier descriptions."""


class StopPublisher(Protocol):
    """Methods of nep's publisher that are used here."""

    @property
    def subscribers(self) -> int:
        """Number of connected subscribers."""
        ...

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of subscribed nodes that are not connected."""
        ...

    def publish(self, payload: object) -> None:
        """Send one message."""
        ...

    def close(self) -> None:
        """Close the publisher."""
        ...


class StopSubscriber(Protocol):
    """Methods of nep's subscriber that are used here."""

    def close(self) -> None:
        """Close the subscriber."""
        ...


class StopNode(Protocol):
    """Methods of nep's node that are used here."""

    id: str

    def new_pub(self, topic: str, msg_type: str = "json", *, batch: bool) -> StopPublisher:
        """Return a publisher; without `batch` no message waits for another."""
        ...

    def new_sub(
        self, topic: str, msg_type: str = "json", *, sink: Callable[[Sequence[Message]], None]
    ) -> StopSubscriber:
        """Return a subscriber that passes messages to `sink` in the node's thread."""
        ...

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Return the current graph."""
        ...


@dataclass(frozen=True)
class StopTarget:
    """Robot to be stopped.

    ``identity`` is its program (None: the first that announced it), ``earlier`` are programs of this name
    that may still run and move it, ``topics`` are those of earlier descriptions. A robot that is not
    ``is_expected`` receives the Stop in case it is still subscribed, but its reply is not awaited.
    """

    robot: Robot
    identity: Identity | None = None
    earlier: tuple[Identity, ...] = ()
    topics: tuple[RobotTopics, ...] = ()
    is_expected: bool = True

    @property
    def ways(self) -> tuple[RobotTopics, ...]:
        """Topics for the Stop: those of its description, then those of earlier ones."""
        return tuple(dict.fromkeys((self.robot.topics, *self.topics)))[:MAX_TOPICS]


@dataclass
class StopWay:
    """Command topic of one robot and the subscription to its replies."""

    topic: str
    publisher: StopPublisher
    subscriber: StopSubscriber | None
    was_connected: bool = False

    def is_connected(self, target: StopTarget, hearers: Collection[str]) -> bool:
        """Return whether a message published now reaches the robot; ``hearers`` are the subscribed nodes.

        Robots of RIZE can't be distinguished on their common topic and count as connected.
        """
        program = target.identity
        if self.subscriber is None or program is None:
            is_there = self.subscriber is None or self.publisher.subscribers > 0
        else:
            # By name: a hung program that was restarted may still be missing although all others are
            # connected.
            connected, missing = self.publisher.subscribers, self.publisher.missing
            is_complete = program.node not in missing or connected >= len(hearers)
            is_there = program.node_id in hearers and connected > 0 and is_complete
        self.was_connected |= is_there
        return is_there

    def close(self) -> None:
        """Close the publisher and the subscriber."""
        self.publisher.close()
        if self.subscriber is not None:
            self.subscriber.close()


@dataclass
class StopLine:
    """Connections to one robot; ``error`` is why one of them is missing."""

    target: StopTarget
    ways: dict[RobotTopics, StopWay] = field(default_factory=dict)
    error: str = ""

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.target.robot.name

    @property
    def answers(self) -> set[str]:
        """Topics of its replies."""
        return {way.answer for way in self.target.ways}

    @property
    def is_whole(self) -> bool:
        """True if all connections are open."""
        return self.ways.keys() >= set(self.target.ways)

    @property
    def unconnected(self) -> str:
        """Sentence why it can't have received anything; empty once a connection was established."""
        if any(way.was_connected for way in self.ways.values()):
            return ""
        return _("{robot} is not connected yet").format(robot=self.name)

    @property
    def untold(self) -> str:
        """Sentence why the Stop can't be sent to the robot."""
        why = self.error or _("not connected yet; press Stop again")
        return _("Stop can't be sent to {robot}: {why}").format(robot=self.name, why=why)
