"""Discovery of robots in the graph by message type, independent of topic names."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from app.errors import DescriptionError
from app.robots.description.description import Robot, announced
from app.robots.identity import (
    DESCRIPTION_TYPE,
    Identity,
    Senders,
    foreign_topic,
    identity_of,
    publishing,
    wrong_topic,
)
from nep.errors import NepError
from nep.i18n import _, listed
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

RIZE = "rize"
SLICE_S = 0.1
MAX_ROBOTS = 200
MAX_REPORTED = 8


class Subscription(Protocol):
    """Part of the interface of nep's subscriber that is used here."""

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """Return the next message, or None."""
        ...

    def close(self) -> None:
        """Unsubscribe."""
        ...


class GraphNode(Protocol):
    """Part of the interface of nep's node that is used here."""

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Return the current graph."""
        ...

    def new_sub(self, topic: str, msg_type: str = "json") -> Subscription:
        """Open a subscriber."""
        ...


@dataclass(frozen=True)
class FoundRobots:
    """Robots that were found. ``owners`` are their programs by name of the robot.

    ``claims`` are messages about programs whose claim to a name was rejected.
    """

    robots: tuple[Robot, ...] = ()
    owners: Mapping[str, Identity] = field(default_factory=dict)
    claims: tuple[str, ...] = ()


@dataclass
class _Topic:
    """Topic of a description: its owner, and the messages received on it."""

    subscription: Subscription
    owner: Identity
    told: list[Message] = field(default_factory=list)
    read: Message | None = None
    twins: tuple[str, ...] = ()
    robot: Robot | None = None
    wrong: str = ""


def find_robots(
    node: GraphNode,
    timeout_s: float,
    *,
    wanted: Sequence[str] = (),
    known: Sequence[Robot] = (),
    clock: Callable[[], float] = time.monotonic,
    wait: Callable[[float], object] | None = None,
) -> FoundRobots:
    """Find the robots that announce themselves; each name belongs to the first program that announced it.

    Robots of RIZE announce nothing: those in ``known`` are found if their command topic has a subscriber.

    Args:
        node: Node for the graph and subscriptions.
        timeout_s: Maximum wait.
        wanted: Names to wait for; without any, the currently connected robots are returned.
        known: Robots known before.
        clock: Returns monotonic seconds.
        wait: Sleeps for a number of seconds.
    """
    wait = wait or threading.Event().wait
    until = clock() + timeout_s
    found: dict[str, Robot] = {}
    asked: dict[str, _Topic] = {}
    senders = Senders()
    try:
        while True:
            view = node.graph()
            for robot in known:
                info = view.topics.get(robot.topics.command)
                if robot.dialect == RIZE and info is not None and info.subscribers:
                    found.setdefault(robot.name, robot)
            _update_topics(node, view, asked)
            senders.learn(view, asked)
            for topic, each in asked.items():
                _read_descriptions(each, topic, senders)
            there = found | {each.robot.name: each.robot for each in asked.values() if each.robot is not None}
            heard = sum(each.robot is not None or bool(each.wrong) for each in asked.values())
            missing = set(wanted) - there.keys() if wanted else heard < len(asked)
            if not missing or clock() >= until:
                return _result(there, asked)
            wait(SLICE_S)
    finally:
        for each in asked.values():
            each.subscription.close()


def _update_topics(node: GraphNode, view: GraphView, asked: dict[str, _Topic]) -> None:
    for topic, info in view.topics.items():
        nodes = publishing(view, topic) if info.msg_type == DESCRIPTION_TYPE else ()
        if not nodes or (topic not in asked and len(asked) >= MAX_ROBOTS):
            continue
        if topic not in asked:
            asked[topic] = _Topic(node.new_sub(topic, DESCRIPTION_TYPE), identity_of(view, nodes[0]))
        each = asked[topic]
        if each.owner.node_id not in nodes:
            each.owner, each.robot, each.read = identity_of(view, nodes[0]), None, None
        each.twins = tuple(identity_of(view, id).words for id in nodes if id != each.owner.node_id)


def _read_descriptions(each: _Topic, topic: str, senders: Senders) -> None:
    message = each.subscription.receive(SLICE_S if each.robot is None else 0.0)
    while message is not None:
        each.told = [*each.told[1 - MAX_REPORTED :], message]
        message = each.subscription.receive(0.0)
    its_own = (told for told in reversed(each.told) if senders.node_of(told) == each.owner.node_id)
    newest = next(its_own, None)
    if newest is None or newest is each.read:
        return
    each.read, each.wrong = newest, ""
    try:
        robot = announced(newest)
    except (NepError, DescriptionError) as error:
        each.wrong = f"{topic}: {error}"  # the previous description stays valid
        return
    each.wrong = wrong_topic(robot, topic) or ""
    each.robot = None if each.wrong else robot


def _result(there: Mapping[str, Robot], asked: Mapping[str, _Topic]) -> FoundRobots:
    claims = [f"{each.wrong}." for each in asked.values() if each.wrong]
    claims += [
        _(
            "{count} programs announce themselves as {robot}. {first} was first and is used; ignored: "
            "{others}."
        ).format(
            count=len(each.twins) + 1,
            robot=each.robot.name,
            first=each.owner.words,
            others=listed(list(each.twins)),
        )
        for each in asked.values()
        if each.twins and each.robot is not None
    ]
    robots = {}
    for name in sorted(there):
        claim = foreign_topic(there[name], there.values())
        if claim is None:
            robots[name] = there[name]
        else:
            claims.append(_("{claim}; {robot} is ignored.").format(claim=claim, robot=name))
    owners = {
        each.robot.name: each.owner
        for each in asked.values()
        if each.robot is not None and each.robot.name in robots
    }
    return FoundRobots(tuple(robots.values()), owners, tuple(claims))
