"""Identity of robots: which node is a robot, and which claims and subscribers are valid. No side effects.

A robot is defined by its name, its topics and the node that announced it first. The master's graph lists the
node of each publisher, and every native message contains the id of its publisher. This protects against
programs that don't lie to the master (docs/trust.md).
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from app.robots.description.description import topic_of
from app.robots.description.model import Robot, RobotTopics
from nep.i18n import _, lazy
from nep.messages.message import Message
from nep.programs.robots.moving import DESCRIPTION_TYPE as DESCRIPTION_TYPE
from nep.programs.robots.moving import RIZE_COMMAND_TOPIC, RobotControls
from nep.protocol.graph_view import GraphView
from nep.text import bounded_str, strip_controls

GATEWAY = "gateway"
SHARED_TOPICS = frozenset({RIZE_COMMAND_TOPIC, "action_state"})
"""Topics that all robots of RIZE share (`app.robots.rize`)."""
MAX_SENDERS = 20_000
MAX_STOP_ERROR_LENGTH = 200
MAY_MOVE_MESSAGE = lazy("{robot} may still move: {why}")
MAX_ERROR_LENGTH = 1000
_NATIVE_GENERATIONS = frozenset({"native", GATEWAY})


@dataclass(frozen=True, slots=True)
class Identity:
    """Program of a robot, as the master knows its node. ``pid`` is the process id on ``host``."""

    node_id: str
    node: str = ""
    host: str = ""
    pid: int | None = None

    @property
    def display_name(self) -> str:
        """Display name, such as "“rover driver” on lab-2"."""
        name = f"“{self.node or self.node_id}”"
        return _("{program} on {host}").format(program=name, host=self.host) if self.host else name


def identity_of(view: GraphView, node_id: str) -> Identity:
    """Return the identity of a node as known to the master; only its id if it is not in the graph."""
    node = view.nodes.get(node_id)
    return Identity(node_id) if node is None else Identity(node_id, node.name, node.host, node.pid)


def publisher_nodes(view: GraphView, topic: str) -> tuple[str, ...]:
    """Return the ids of the nodes that publish a topic, in order of registration.

    Programs of the original NEP are represented by the gateway, whose node publishes their messages.
    """
    info = view.topics.get(topic)
    found = (each.node_id for each in info.publishers) if info is not None else ()
    return tuple(dict.fromkeys(id for id in found if _is_native(view, id)))


def subscriber_nodes(view: GraphView, topic: str) -> tuple[str, ...]:
    """Return the ids of the nodes that subscribe to a topic.

    Programs of the original NEP are listed instead of their gateway.
    """
    info = view.topics.get(topic)
    found = (each.node_id for each in info.subscribers) if info is not None else ()
    nodes = view.nodes
    return tuple(dict.fromkeys(id for id in found if id not in nodes or nodes[id].generation != GATEWAY))


def _is_native(view: GraphView, node_id: str) -> bool:
    node = view.nodes.get(node_id)
    return node is None or node.generation in _NATIVE_GENERATIONS


def first_announcer(view: GraphView, topic: str) -> Identity | None:
    """Return the node that first announced a robot on its description topic, or None."""
    found = publisher_nodes(view, topic)
    return identity_of(view, found[0]) if found else None


def description_topic_problem(robot: Robot, topic: str) -> str | None:
    """Return why a description is invalid on this topic, or None if it is valid.

    A robot may only be announced on ``/NAME/description`` with its own name; otherwise a program could
    announce the robot of another one.
    """
    home = topic_of(robot.name, "description")
    if topic == home and robot.topics.description == home:
        return None
    return _("{topic} announces {robot}, which may only be announced on {home}; it is ignored").format(
        topic=topic, robot=robot.name, home=home
    )


def reserved_topics(robot: Robot) -> tuple[str, ...]:
    """Return the topics that move a robot or carry its replies. No other robot may use them."""
    topics = robot.topics
    return tuple(topic for topic in (topics.command, topics.answer, topics.world) if topic is not None)


def controls_of(robot: Robot, earlier: Iterable[RobotTopics] = ()) -> RobotControls:
    """Return the topics that move a robot or change its world, including its ``earlier`` topics."""
    topics = {topic for each in (robot.topics, *earlier) for topic in (each.command, each.world)}
    topics.update(action.topic for action in robot.actions)
    return RobotControls(robot.name, frozenset(filter(None, topics)))


def program_of(key: str) -> str:
    """Derive the name of a program in ``from`` from its secret key.

    A stop whose ``ends`` is the key makes robots reject later commands under this name. Names are public: if
    the name were sufficient, any program could block another one.
    """
    return f"program-{hashlib.sha256(key.encode('utf-8', 'replace')).hexdigest()[:16]}"


def is_own_topic(robot_name: str, topic: str) -> bool:
    """Return True if a topic belongs to a robot with this name: ``/NAME/...``."""
    return topic.startswith(topic_of(robot_name, ""))


def safe_error_text(error: object) -> str:
    """Return a robot's error as text that is safe to show, with limited length."""
    return strip_controls(bounded_str(error or "", MAX_ERROR_LENGTH), lines=True)


def stop_error_text(name: str, error: object) -> str:
    """Return the error of a failed stop in the robot's words: "Arm may still move: the brake is stuck"."""
    words = "".join(
        sign if sign.isprintable() else " "
        for sign in bounded_str(error or _("the stop command failed"), MAX_ERROR_LENGTH)
    )
    words = " ".join(words[:MAX_STOP_ERROR_LENGTH].split()).rstrip(".")
    return words if is_may_move_error(name, words) else _(MAY_MOVE_MESSAGE).format(robot=name, why=words)


def is_may_move_error(name: str, words: str) -> bool:
    """Return True if an error says that the robot may still move, in the current language or in English."""
    return any(
        words.startswith(sentence.partition("{why}")[0].rstrip(": ").format(robot=name))
        for sentence in (MAY_MOVE_MESSAGE, _(MAY_MOVE_MESSAGE))
    )


def topic_conflict(robot: Robot, others: Iterable[Robot]) -> str | None:
    """Return why a robot can't use its topics, because they belong to another robot; None if it can.

    ``/NAME/...`` belongs to the robot with that name; other topics belong to the first robot that uses them.
    """
    known = [other for other in others if other.name != robot.name]
    for topic in set(reserved_topics(robot)) - SHARED_TOPICS:
        if is_own_topic(robot.name, topic):
            continue
        for other in known:
            if is_own_topic(other.name, topic) or topic in reserved_topics(other):
                return _("{robot} claims {topic}, which belongs to {other}").format(
                    robot=robot.name, topic=topic, other=other.name
                )
    return None


class Senders:
    """Nodes by publisher id, as reported by the master. Thread-safe.

    The last 20 000 entries are stored. A node that uses the publisher id of another node is ignored while
    that one is present.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._nodes: dict[int, str] = {}

    def update(self, view: GraphView, topics: Iterable[str]) -> None:
        """Add the publishers of these topics."""
        with self._lock:
            for topic in topics:
                info = view.topics.get(topic)
                for publisher in info.publishers if info is not None else ():
                    if self._nodes.get(publisher.id) not in view.nodes:
                        self._nodes[publisher.id] = publisher.node_id
            while len(self._nodes) > MAX_SENDERS:
                del self._nodes[next(iter(self._nodes))]

    def node_of(self, message: Message) -> str | None:
        """Return the id of the sending node; None while its publisher is unknown."""
        with self._lock:
            return None if message.publisher is None else self._nodes.get(message.publisher)


class RobotProcesses(Protocol):
    """Access to the processes of robots."""

    def is_started_by_studio(self, identity: Identity) -> bool:
        """Return True if this program is a virtual robot started by Studio."""

    def has_ended(self, identity: Identity) -> bool:
        """Return True if this program has certainly exited."""


class AllVirtual:
    """Accepts the claim of every robot to be virtual; for tests."""

    def is_started_by_studio(self, identity: Identity) -> bool:  # noqa: ARG002
        """Return True."""
        return True

    def has_ended(self, identity: Identity) -> bool:  # noqa: ARG002
        """Return False."""
        return False
