"""The ways to a robot on which it is told to stop and answers, of its description and of earlier ones."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from app.robots.description.description import Robot, RobotTopics
from app.robots.identity import Identity
from nep.i18n import _
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

MOST_TOPICS = 32
"""So many command topics of one robot are kept: the present ones, and the first of earlier descriptions."""


class StopPublisher(Protocol):
    """What is needed of NEP's publisher."""

    @property
    def subscribers(self) -> int:
        """How many subscribers are connected."""
        ...

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of nodes that subscribe and have not connected."""
        ...

    def publish(self, payload: object) -> None:
        """Send one message."""
        ...

    def close(self) -> None:
        """Stop publishing."""
        ...


class StopSubscriber(Protocol):
    """What is needed of NEP's subscriber."""

    def close(self) -> None:
        """Stop subscribing."""
        ...


class StopNode(Protocol):
    """What is needed of NEP's node."""

    id: str

    def new_pub(self, topic: str, msg_type: str = "json", *, batch: bool) -> StopPublisher:
        """A publisher; without `batch` no message waits for another."""
        ...

    def new_sub(
        self, topic: str, msg_type: str = "json", *, sink: Callable[[Sequence[Message]], None]
    ) -> StopSubscriber:
        """A subscriber whose messages go to `sink`, in the node's thread."""
        ...

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Who publishes what."""
        ...


@dataclass(frozen=True)
class StopTarget:
    """A robot that is to be stopped.

    ``identity`` is the program that it is (None: whoever announced it first), ``earlier`` are programs of
    this name that may still run and move it, ``topics`` those of its earlier descriptions. One that is not
    ``is_expected`` is told with the others, in case that it still hears, and nobody waits for its answer.
    """

    robot: Robot
    identity: Identity | None = None
    earlier: tuple[Identity, ...] = ()
    topics: tuple[RobotTopics, ...] = ()
    is_expected: bool = True

    @property
    def ways(self) -> tuple[RobotTopics, ...]:
        """Where it is told to stop: the topics of its description first, then those that it had before."""
        return tuple(dict.fromkeys((self.robot.topics, *self.topics)))[:MOST_TOPICS]


@dataclass
class StopWay:
    """Where one robot is told to stop, and where it answers."""

    topic: str
    publisher: StopPublisher
    subscriber: StopSubscriber | None
    was_connected: bool = False

    def is_connected(self, target: StopTarget, hearers: Collection[str]) -> bool:
        """Whether what is published now arrives at the robot. ``hearers`` are the nodes that hear the topic.

        Robots of RIZE can't be told apart on their common topic; they are taken for connected.
        """
        program = target.identity
        if self.subscriber is None or program is None:
            is_there = self.subscriber is None or self.publisher.subscribers > 0
        else:
            # By name: one that hung and was started anew may still be missing, although all are connected.
            connected, missing = self.publisher.subscribers, self.publisher.missing
            is_complete = program.node not in missing or connected >= len(hearers)
            is_there = program.node_id in hearers and connected > 0 and is_complete
        self.was_connected |= is_there
        return is_there

    def close(self) -> None:
        """Let go of it."""
        self.publisher.close()
        if self.subscriber is not None:
            self.subscriber.close()


@dataclass
class StopLine:
    """The ways to one robot; ``error`` says why one of them is missing."""

    target: StopTarget
    ways: dict[RobotTopics, StopWay] = field(default_factory=dict)
    error: str = ""

    @property
    def name(self) -> str:
        """The robot's."""
        return self.target.robot.name

    @property
    def answers(self) -> set[str]:
        """The topics on which it answers."""
        return {way.answer for way in self.target.ways}

    @property
    def is_whole(self) -> bool:
        """Whether no way is missing."""
        return self.ways.keys() >= set(self.target.ways)

    @property
    def unconnected(self) -> str:
        """Why it can't have heard anything, in a sentence; empty once one of its ways was connected."""
        if any(way.was_connected for way in self.ways.values()):
            return ""
        return _("{robot} is not connected yet").format(robot=self.name)

    @property
    def untold(self) -> str:
        """Why the robot can't be told, in a sentence."""
        why = self.error or _("not connected yet; press Stop again")
        return _("Stop can't be sent to {robot}: {why}").format(robot=self.name, why=why)
