"""The robots that are there: found in the graph by their type, never by a topic's name."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Protocol

from app.errors import DescriptionError
from app.robots.description import Robot, announced
from nep.errors import NepError
from nep.graph import GraphView
from nep.message import Message

DESCRIPTION = "robot/description"
RIZE = "rize"
SLICE_S = 0.1


class Subscription(Protocol):
    """What is needed of NEP's subscriber."""

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """The next message."""
        ...

    def close(self) -> None:
        """Stop subscribing."""
        ...


class Node(Protocol):
    """What is needed of NEP's node."""

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Who publishes what."""
        ...

    def new_sub(self, topic: str, msg_type: str = "json") -> Subscription:
        """A subscriber."""
        ...


def find_robots(
    node: Node,
    timeout_s: float,
    *,
    wanted: Sequence[str] = (),
    known: Sequence[Robot] = (),
    clock: Callable[[], float] = time.monotonic,
    wait: Callable[[float], object] | None = None,
) -> tuple[Robot, ...]:
    """The robots that announce themselves, by name.

    With `wanted` it waits until those are there, `timeout_s` at most; else it takes who is there at once.
    Robots of RIZE announce nothing: those of `known` count as there when somebody listens to their commands.
    """
    wait = wait or threading.Event().wait
    until = clock() + timeout_s
    found: dict[str, Robot] = {}
    asked: dict[str, Subscription] = {}
    try:
        while True:
            topics = node.graph().topics
            for robot in known:
                info = topics.get(robot.topics.command)
                if robot.dialect == RIZE and info is not None and info.subscribers:
                    found.setdefault(robot.name, robot)
            for topic, info in topics.items():
                if info.msg_type == DESCRIPTION and info.publishers and topic not in asked:
                    asked[topic] = node.new_sub(topic, DESCRIPTION)
            for subscription in asked.values():
                described = _described(subscription)
                if described is not None:
                    found[described.name] = described
            missing = set(wanted) - set(found) if wanted else len(asked) > len(found)
            if not missing or clock() >= until:
                return tuple(found[name] for name in sorted(found))
            wait(SLICE_S)
    finally:
        for subscription in asked.values():
            subscription.close()


def _described(subscription: Subscription) -> Robot | None:
    """The robot of a description that has arrived; None while it has not, or when it can't be understood."""
    message = subscription.receive(SLICE_S)
    with suppress(NepError, DescriptionError):
        if message is not None:
            return announced(message)
    return None
