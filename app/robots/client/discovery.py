"""Discovery of robots by a program without a window: waits until they have announced themselves."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from app.robots.client.announcements import Announcements, foreign_topic_claim
from app.robots.client.dialects import dialect_of
from app.robots.client.inbox import Senders
from app.robots.client.limits import DISCOVERY_POLL_INTERVAL_S
from app.robots.description.description import Robot
from app.robots.identity import DESCRIPTION_TYPE, Identity
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView


class Subscription(Protocol):
    """Interface of the subscriber that `find_robots` uses.

    Implemented by `nep.nodes.subscriber.Subscriber`.
    """

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """Return the next message, or None on timeout.

        Args:
            timeout_s: Maximum wait in seconds; None for no limit.
        """
        ...

    def close(self) -> None:
        """Close the subscriber."""
        ...


class GraphNode(Protocol):
    """Interface of the node that `find_robots` uses; implemented by `nep.nodes.node.Node`."""

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Return the current graph."""
        ...

    def new_sub(self, topic: str, msg_type: str = "json") -> Subscription:
        """Open a subscriber."""
        ...


@dataclass(frozen=True)
class FoundRobots:
    """Result of `find_robots`.

    Attributes:
        robots: Descriptions of the robots, sorted by name.
        owners: Programs by name of the robot.
        rejected_claims: Messages about programs whose announcement was ignored.
    """

    robots: tuple[Robot, ...] = ()
    owners: Mapping[str, Identity] = field(default_factory=dict)
    rejected_claims: tuple[str, ...] = ()


@dataclass
class _Subscriptions:
    """Open subscribers by topic, with the messages received in the last step."""

    node: GraphNode
    by_topic: dict[str, Subscription] = field(default_factory=dict)

    def open(self, topics: Sequence[str], /) -> _Subscription:
        for topic in topics:
            self.by_topic[topic] = self.node.new_sub(topic, DESCRIPTION_TYPE)
        return _Subscription(self, tuple(topics))

    def receive(self, awaited: Collection[str]) -> dict[str, _Received]:
        # Waits for the first message of each awaited topic.
        received = {}
        for topic, subscription in self.by_topic.items():
            messages = []
            message = subscription.receive(DISCOVERY_POLL_INTERVAL_S if topic in awaited else 0.0)
            while message is not None:
                messages.append(message)
                message = subscription.receive(0.0)
            received[topic] = _Received(messages)
        return received


@dataclass(frozen=True)
class _Subscription:
    subscriptions: _Subscriptions
    topics: tuple[str, ...]

    def close(self) -> None:
        for topic in self.topics:
            self.subscriptions.by_topic.pop(topic).close()


@dataclass(frozen=True)
class _Received:
    messages: Sequence[Message]


def find_robots(
    node: GraphNode,
    timeout_s: float,
    *,
    expected: Sequence[str] = (),
    previous: Sequence[Robot] = (),
    clock: Callable[[], float] = time.monotonic,
    wait: Callable[[float], object] | None = None,
) -> FoundRobots:
    """Find the robots in the graph. If several programs announce a name, the first one is used.

    Robots that don't announce themselves are found if they are in `previous` and their command topic has a
    subscriber.

    Args:
        node: Node that is used to read the graph and to subscribe to descriptions.
        timeout_s: Maximum wait in seconds.
        expected: Names of robots to wait for; if empty, the function waits for the descriptions of all
            announced robots.
        previous: Descriptions of robots that were connected before.
        clock: Monotonic clock in seconds.
        wait: Sleeps for a number of seconds.
    """
    wait = wait or threading.Event().wait
    deadline = clock() + timeout_s
    silent_robots = [robot for robot in previous if not dialect_of(robot).is_identified]
    connected: dict[str, Robot] = {}
    subscriptions = _Subscriptions(node)
    announcements = Announcements(subscriptions, Senders(), clock)
    try:
        while True:
            view = node.graph()
            for robot in silent_robots:
                info = view.topics.get(robot.topics.command)
                if info is not None and info.subscribers:
                    connected.setdefault(robot.name, robot)
            announcements.update(view)
            announcements.add(subscriptions.receive(announcements.unread_topics))
            announced = {robot.name: (robot, owner) for _topic, robot, owner in announcements.robots}
            is_incomplete = (
                set(expected) - connected.keys() - announced.keys()
                if expected
                else announcements.unread_topics
            )
            if not is_incomplete or clock() >= deadline:
                robots = connected | {name: robot for name, (robot, _owner) in announced.items()}
                owners = {name: owner for name, (_robot, owner) in announced.items()}
                return _result(robots, owners, announcements)
            wait(DISCOVERY_POLL_INTERVAL_S)
    finally:
        for subscription in subscriptions.by_topic.values():
            subscription.close()


def _result(
    connected: Mapping[str, Robot], owners: Mapping[str, Identity], announcements: Announcements
) -> FoundRobots:
    claims = [f"{topic}: {error}." for topic, error in announcements.decode_errors.items()]
    claims += [claim.sentence for claim in announcements.claims.values()]
    robots = {}
    for name in sorted(connected):
        claim = foreign_topic_claim(connected[name], connected.values())
        if claim is None:
            robots[name] = connected[name]
        else:
            claims.append(claim.sentence)
    return FoundRobots(
        tuple(robots.values()),
        {name: owner for name, owner in owners.items() if name in robots},
        tuple(claims),
    )
