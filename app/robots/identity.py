"""Identity of robots: which node is a robot, and which claims and subscribers are valid.

A robot is defined by its name, its topics and the node that announced it first. The master's graph lists the
node of each publisher, and every native message contains the id of its publisher. This protects against
programs that don't lie to the master (docs/trust.md).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from app.robots.description.description import topic_of
from app.robots.description.model import Robot, RobotTopics
from nep.i18n import _, lazy
from nep.programs.robots.moving import DESCRIPTION_TYPE as DESCRIPTION_TYPE
from nep.programs.robots.moving import RIZE_COMMAND_TOPIC, RobotControls
from nep.protocol.graph_view import GraphView
from nep.text import bounded_str, strip_controls

GATEWAY = "gateway"
SHARED_TOPICS = frozenset({RIZE_COMMAND_TOPIC, "action_state"})
"""Topics that all robots of RIZE use (`app.robots.client.rize`)."""
MAX_STOP_ERROR_LENGTH = 200
MAY_MOVE_MESSAGE = lazy("{robot} may still move: {why}")
MAX_ERROR_LENGTH = 1000
NATIVE_GENERATIONS = frozenset({"native", GATEWAY})


@dataclass(frozen=True, slots=True)
class Identity:
    """Program of a robot, as registered with the master.

    Attributes:
        node_id: Id of the node.
        node: Name of the node; "" if unknown.
        host: Name of the computer; "" if unknown.
        pid: Process id on `host`; None if unknown.
    """

    node_id: str
    node: str = ""
    host: str = ""
    pid: int | None = None

    @property
    def display_name(self) -> str:
        """Display name, such as ``“rover driver” on lab-2``."""
        name = f"“{self.node or self.node_id}”"
        return _("{program} on {host}").format(program=name, host=self.host) if self.host else name


def identity_of(view: GraphView, node_id: str) -> Identity:
    """Return the identity of a node in the graph; it contains only the id if the node isn't in the graph."""
    node = view.nodes.get(node_id)
    return Identity(node_id) if node is None else Identity(node_id, node.name, node.host, node.pid)


def publisher_nodes(view: GraphView, topic: str) -> tuple[str, ...]:
    """Return the ids of the nodes that publish a topic, in order of registration.

    Programs of the original NEP are represented by the gateway, whose node publishes their messages.
    """
    info = view.topics.get(topic)
    node_ids = (each.node_id for each in info.publishers) if info is not None else ()
    return tuple(dict.fromkeys(id for id in node_ids if _is_native(view, id)))


def subscriber_nodes(view: GraphView, topic: str) -> tuple[str, ...]:
    """Return the ids of the nodes that subscribe to a topic.

    Programs of the original NEP are included instead of the gateway that subscribes for them.
    """
    info = view.topics.get(topic)
    node_ids = (each.node_id for each in info.subscribers) if info is not None else ()
    nodes = view.nodes
    return tuple(dict.fromkeys(id for id in node_ids if id not in nodes or nodes[id].generation != GATEWAY))


def _is_native(view: GraphView, node_id: str) -> bool:
    node = view.nodes.get(node_id)
    return node is None or node.generation in NATIVE_GENERATIONS


def first_announcer(view: GraphView, topic: str) -> Identity | None:
    """Return the program that first announced a robot; None if no program does.

    Args:
        view: Graph of the network.
        topic: Description topic of the robot.
    """
    node_ids = publisher_nodes(view, topic)
    return identity_of(view, node_ids[0]) if node_ids else None


def description_topic_problem(robot: Robot, topic: str) -> str | None:
    """Return an error message if a description was received on a wrong topic, else None.

    A robot may only be announced on ``/NAME/description`` with its own name; otherwise a program could
    announce the robot of another program.
    """
    home = topic_of(robot.name, "description")
    if topic == home and robot.topics.description == home:
        return None
    return _(
        "{topic} announces {robot}, which can only be announced on {home}; the announcement is ignored"
    ).format(topic=topic, robot=robot.name, home=home)


def reserved_topics(robot: Robot) -> tuple[str, ...]:
    """Return the topics that move a robot or carry its replies; no other robot may use these topics."""
    topics = robot.topics
    return tuple(topic for topic in (topics.command, topics.reply, topics.world) if topic is not None)


def controls_of(robot: Robot, earlier: Iterable[RobotTopics] = ()) -> RobotControls:
    """Return the topics that move a robot or change its virtual world.

    Args:
        robot: Description of the robot.
        earlier: Topics of earlier descriptions of the robot, which are included.
    """
    topics = {topic for each in (robot.topics, *earlier) for topic in (each.command, each.world)}
    topics.update(action.topic for action in robot.actions)
    return RobotControls(robot.name, frozenset(filter(None, topics)))


def program_of(key: str) -> str:
    """Derive the id of a program, sent in ``from``, from its secret key.

    A stop command with the key in ``ends`` makes robots reject later commands with this id. Ids are public:
    if the id were sufficient, any program could block another one.
    """
    return f"program-{hashlib.sha256(key.encode('utf-8', 'replace')).hexdigest()[:16]}"


def is_own_topic(robot_name: str, topic: str) -> bool:
    """Return True if a topic starts with the name of the robot: ``/NAME/...``."""
    return topic.startswith(topic_of(robot_name, ""))


def safe_error_text(error: object) -> str:
    """Return the error in a robot's reply as harmless text of limited length."""
    return strip_controls(bounded_str(error or "", MAX_ERROR_LENGTH), lines=True)


def stop_error_text(name: str, error: object) -> str:
    """Return the error message of a failed stop, such as ``Arm may still move: the brake is stuck``.

    Args:
        name: Name of the robot.
        error: Error in the robot's reply, of any type.
    """
    message = "".join(
        character if character.isprintable() else " "
        for character in bounded_str(error or _("the stop command failed"), MAX_ERROR_LENGTH)
    )
    message = " ".join(message[:MAX_STOP_ERROR_LENGTH].split()).rstrip(".")
    return (
        message if is_may_move_error(name, message) else _(MAY_MOVE_MESSAGE).format(robot=name, why=message)
    )


def is_may_move_error(name: str, message: str) -> bool:
    """Return True if an error says that the robot may still move, in the current language or in English."""
    return any(
        message.startswith(template.partition("{why}")[0].rstrip(": ").format(robot=name))
        for template in (MAY_MOVE_MESSAGE, _(MAY_MOVE_MESSAGE))
    )


def topic_conflict(robot: Robot, robots: Iterable[Robot]) -> str | None:
    """Return an error message if a topic of a robot belongs to another robot, else None.

    ``/NAME/...`` belongs to the robot with that name; other topics belong to the first robot that uses them.

    Args:
        robot: Robot to check.
        robots: All known robots; `robot` itself is ignored.
    """
    other_robots = [other for other in robots if other.name != robot.name]
    for topic in set(reserved_topics(robot)) - SHARED_TOPICS:
        if is_own_topic(robot.name, topic):
            continue
        for other in other_robots:
            if is_own_topic(other.name, topic) or topic in reserved_topics(other):
                return _("{robot} claims {topic}, which belongs to {other}").format(
                    robot=robot.name, topic=topic, other=other.name
                )
    return None


class RobotProcesses(Protocol):
    """Interface for information about the processes of robots."""

    def is_started_by_studio(self, identity: Identity) -> bool:
        """Return True if a program is a virtual robot started by Studio."""

    def has_ended(self, identity: Identity) -> bool:
        """Return True if a program has certainly exited."""


class AllVirtualProcesses:
    """Implementation of `RobotProcesses` for tests, in which every robot was started by Studio."""

    def is_started_by_studio(self, identity: Identity) -> bool:  # noqa: ARG002
        """Return True for every program."""
        return True

    def has_ended(self, identity: Identity) -> bool:  # noqa: ARG002
        """Return False for every program."""
        return False
