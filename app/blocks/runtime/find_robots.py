"""Discovery of robots in the graph by message type, independent of topic names."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from app.errors import DescriptionError
from app.robots.description.description import Robot, parse_announcement
from app.robots.identity import (
    DESCRIPTION_TYPE,
    Identity,
    Senders,
    description_topic_problem,
    identity_of,
    publisher_nodes,
    topic_conflict,
)
from nep.errors import NepError
from nep.i18n import _, format_list
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

RIZE = "rize"
POLL_INTERVAL_S = 0.1
MAX_ROBOTS = 200
MAX_STORED_DESCRIPTIONS = 8


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
class _DescriptionTopic:
    """Topic of a robot description: its subscription, owner, and newest messages."""

    subscription: Subscription
    owner: Identity
    messages: list[Message] = field(default_factory=list)
    newest_read: Message | None = None
    duplicates: tuple[str, ...] = ()
    robot: Robot | None = None
    error: str = ""


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

    Robots of RIZE don't announce themselves: those in `previous` are found if their command topic has a
    subscriber.

    Args:
        node: Node that is used to read the graph and to subscribe to descriptions.
        timeout_s: Maximum wait in seconds.
        expected: Names of robots to wait for; if empty, the function waits for the descriptions of all
            announced robots.
        previous: Descriptions of robots that were connected before; only robots of RIZE are used.
        clock: Monotonic clock in seconds.
        wait: Sleeps for a number of seconds.
    """
    wait = wait or threading.Event().wait
    deadline = clock() + timeout_s
    rize_robots: dict[str, Robot] = {}
    description_topics: dict[str, _DescriptionTopic] = {}
    senders = Senders()
    try:
        while True:
            view = node.graph()
            for robot in previous:
                info = view.topics.get(robot.topics.command)
                if robot.dialect == RIZE and info is not None and info.subscribers:
                    rize_robots.setdefault(robot.name, robot)
            _update_topics(node, view, description_topics)
            senders.update(view, description_topics)
            for topic, description_topic in description_topics.items():
                _read_descriptions(description_topic, topic, senders)
            connected = rize_robots | {
                description_topic.robot.name: description_topic.robot
                for description_topic in description_topics.values()
                if description_topic.robot is not None
            }
            received_count = sum(
                description_topic.robot is not None or bool(description_topic.error)
                for description_topic in description_topics.values()
            )
            is_incomplete = (
                set(expected) - connected.keys() if expected else received_count < len(description_topics)
            )
            if not is_incomplete or clock() >= deadline:
                return _result(connected, description_topics)
            wait(POLL_INTERVAL_S)
    finally:
        for description_topic in description_topics.values():
            description_topic.subscription.close()


def _update_topics(
    node: GraphNode, view: GraphView, description_topics: dict[str, _DescriptionTopic]
) -> None:
    for topic, info in view.topics.items():
        nodes = publisher_nodes(view, topic) if info.msg_type == DESCRIPTION_TYPE else ()
        if not nodes or (topic not in description_topics and len(description_topics) >= MAX_ROBOTS):
            continue
        if topic not in description_topics:
            description_topics[topic] = _DescriptionTopic(
                node.new_sub(topic, DESCRIPTION_TYPE), identity_of(view, nodes[0])
            )
        each = description_topics[topic]
        if each.owner.node_id not in nodes:
            each.owner, each.robot, each.newest_read = identity_of(view, nodes[0]), None, None
        each.duplicates = tuple(
            identity_of(view, id).display_name for id in nodes if id != each.owner.node_id
        )


def _read_descriptions(description_topic: _DescriptionTopic, topic: str, senders: Senders) -> None:
    message = description_topic.subscription.receive(
        POLL_INTERVAL_S if description_topic.robot is None else 0.0
    )
    while message is not None:
        description_topic.messages = [*description_topic.messages[1 - MAX_STORED_DESCRIPTIONS :], message]
        message = description_topic.subscription.receive(0.0)
    own_messages = (
        announcement
        for announcement in reversed(description_topic.messages)
        if senders.node_of(announcement) == description_topic.owner.node_id
    )
    newest = next(own_messages, None)
    if newest is None or newest is description_topic.newest_read:
        return
    description_topic.newest_read, description_topic.error = newest, ""
    try:
        robot = parse_announcement(newest)
    except (NepError, DescriptionError) as error:
        description_topic.error = f"{topic}: {error}"  # the previous description stays valid
        return
    description_topic.error = description_topic_problem(robot, topic) or ""
    description_topic.robot = None if description_topic.error else robot


def _result(
    connected: Mapping[str, Robot], description_topics: Mapping[str, _DescriptionTopic]
) -> FoundRobots:
    claims = [f"{each.error}." for each in description_topics.values() if each.error]
    claims += [
        _(
            "{count} programs announce themselves as {robot}. Using the first one, {first}; ignoring "
            "{others}."
        ).format(
            count=len(each.duplicates) + 1,
            robot=each.robot.name,
            first=each.owner.display_name,
            others=format_list(list(each.duplicates)),
        )
        for each in description_topics.values()
        if each.duplicates and each.robot is not None
    ]
    robots = {}
    for name in sorted(connected):
        claim = topic_conflict(connected[name], connected.values())
        if claim is None:
            robots[name] = connected[name]
        else:
            claims.append(_("{claim}; {robot} is ignored.").format(claim=claim, robot=name))
    owners = {
        each.robot.name: each.owner
        for each in description_topics.values()
        if each.robot is not None and each.robot.name in robots
    }
    return FoundRobots(tuple(robots.values()), owners, tuple(claims))
