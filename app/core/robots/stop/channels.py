"""Connections for Stop: command and reply topics of a robot's current and earlier descriptions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from app.robots.client.stop import StopTarget
from app.robots.description.description import RobotTopics
from nep.i18n import _
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView


class StopPublisher(Protocol):
    """Part of the interface of nep's publisher that Stop uses."""

    @property
    def subscribers(self) -> int:
        """Number of connected subscribers."""
        ...

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of nodes that subscribe but are not connected."""
        ...

    def publish(self, payload: object) -> None:
        """Publish one message."""
        ...

    def close(self) -> None:
        """Close the publisher."""
        ...


class StopSubscriber(Protocol):
    """Part of the interface of nep's subscriber that Stop uses."""

    def close(self) -> None:
        """Close the subscriber."""
        ...


class StopNode(Protocol):
    """Part of the interface of nep's node that Stop uses."""

    id: str

    def new_pub(self, topic: str, msg_type: str = "json", *, batch: bool) -> StopPublisher:
        """Open a publisher.

        Args:
            topic: Name of the topic.
            msg_type: Message type.
            batch: False to send each message immediately.
        """
        ...

    def new_sub(
        self, topic: str, msg_type: str = "json", *, sink: Callable[[Sequence[Message]], None]
    ) -> StopSubscriber:
        """Open a subscriber.

        Args:
            topic: Name of the topic.
            msg_type: Message type.
            sink: Callback for received messages, called in the node's thread.
        """
        ...

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Return the current graph."""
        ...


@dataclass
class StopChannel:
    """Publisher on one command topic of a robot, and subscriber to the replies.

    Attributes:
        subscriber: Subscriber to the replies; None if the robot can't confirm a Stop.
        was_connected: True if the robot was connected at any time.
    """

    topic: str
    publisher: StopPublisher
    subscriber: StopSubscriber | None
    was_connected: bool = False

    def is_connected(self, target: StopTarget, subscribed_nodes: Collection[str]) -> bool:
        """Return True if a message published now would reach the robot.

        Robots of RIZE share one topic and can't be distinguished, so they count as connected.

        Args:
            target: Robot to be stopped.
            subscribed_nodes: Nodes that subscribe to the topic.
        """
        program = target.identity
        if self.subscriber is None or program is None:
            is_reachable = self.subscriber is None or self.publisher.subscribers > 0
        else:
            # By name: a hung program that was restarted may still be missing although all others are
            # connected.
            connected_count, missing_names = self.publisher.subscribers, self.publisher.missing
            is_robot_connected = program.node not in missing_names or connected_count >= len(subscribed_nodes)
            is_reachable = program.node_id in subscribed_nodes and connected_count > 0 and is_robot_connected
        self.was_connected |= is_reachable
        return is_reachable

    def close(self) -> None:
        """Close the publisher and the subscriber."""
        self.publisher.close()
        if self.subscriber is not None:
            self.subscriber.close()


@dataclass
class StopLine:
    """Connections for stopping one robot.

    Attributes:
        error: Reason why a connection could not be opened, or "".
    """

    target: StopTarget
    channels: dict[RobotTopics, StopChannel] = field(default_factory=dict)
    error: str = ""

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.target.robot.name

    @property
    def is_complete(self) -> bool:
        """True if all connections are open."""
        return self.channels.keys() >= set(self.target.topic_sets)

    @property
    def connection_problem(self) -> str:
        """Reason why the robot can't have received a message; "" if it was connected at any time."""
        if any(channel.was_connected for channel in self.channels.values()):
            return ""
        return _("{robot} isn't connected yet").format(robot=self.name)

    @property
    def send_problem(self) -> str:
        """Error message stating why the Stop can't be sent to the robot."""
        reason = self.error or _("not connected yet; press Stop again")
        return _("Stop can't be sent to {robot}: {why}").format(robot=self.name, why=reason)
