"""Whose words count: which node a robot is, who else says so, who hears its commands. No sockets.

A robot is its name, its topics and the node that announced it first. What the master knows decides: it lists
each publisher's node, and every native message carries its publisher's id. This holds against programs that
do not lie to the master (docs/trust.md).
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
from nep.programs.robots.moving import RIZE_COMMANDS, RobotControls
from nep.protocol.graph_view import GraphView
from nep.text import bounded_str, harmless

GATEWAY = "gateway"
SHARED = frozenset({RIZE_COMMANDS, "action_state"})
"""Topics of all robots of RIZE together (`app.robots.rize`)."""
MOST_SENDERS = 20_000
WORDS_MOST = 200
MAY_MOVE = lazy("{robot} may still move: {why}")
ERROR_MOST = 1000
_NATIVE = frozenset({"native", GATEWAY})


@dataclass(frozen=True, slots=True)
class Identity:
    """The program that is a robot, as the master knows its node. ``pid`` is a process on ``host``."""

    node_id: str
    node: str = ""
    host: str = ""
    pid: int | None = None

    @property
    def words(self) -> str:
        """For people: "“rover driver” on lab-2"."""
        name = f"“{self.node or self.node_id}”"
        return _("{program} on {host}").format(program=name, host=self.host) if self.host else name


def identity_of(view: GraphView, node_id: str) -> Identity:
    """What the master knows about this node; only its id when it is not there."""
    node = view.nodes.get(node_id)
    return Identity(node_id) if node is None else Identity(node_id, node.name, node.host, node.pid)


def publishing(view: GraphView, topic: str) -> tuple[str, ...]:
    """The ids of the nodes that publish a topic, whoever came first at the front.

    For programs of the original NEP their gateway stands: its node is whom their messages come from.
    """
    info = view.topics.get(topic)
    found = (each.node_id for each in info.publishers) if info is not None else ()
    return tuple(dict.fromkeys(id for id in found if _is_native(view, id)))


def hearing(view: GraphView, topic: str) -> tuple[str, ...]:
    """The ids of the nodes that subscribe a topic; programs of the original NEP, but not their gateway."""
    info = view.topics.get(topic)
    found = (each.node_id for each in info.subscribers) if info is not None else ()
    nodes = view.nodes
    return tuple(dict.fromkeys(id for id in found if id not in nodes or nodes[id].generation != GATEWAY))


def _is_native(view: GraphView, node_id: str) -> bool:
    node = view.nodes.get(node_id)
    return node is None or node.generation in _NATIVE


def first_to_announce(view: GraphView, topic: str) -> Identity | None:
    """The node that announced a robot on its description topic first; None when nobody does."""
    found = publishing(view, topic)
    return identity_of(view, found[0]) if found else None


def wrong_topic(robot: Robot, topic: str) -> str | None:
    """Why a description that came on this topic is nobody's; None when it is at home there.

    A robot is announced on ``/NAME/description`` of its own name and nowhere else, or one program could
    speak for another's robot.
    """
    home = topic_of(robot.name, "description")
    if topic == home and robot.topics.description == home:
        return None
    return _("{topic} announces {robot}, which belongs to {home} only; it is ignored").format(
        topic=topic, robot=robot.name, home=home
    )


def reserved(robot: Robot) -> tuple[str, ...]:
    """The topics with which a robot is moved, or answers: no other robot may have them, too."""
    topics = robot.topics
    return tuple(topic for topic in (topics.command, topics.answer, topics.world) if topic is not None)


def controls_of(robot: Robot, earlier: Iterable[RobotTopics] = ()) -> RobotControls:
    """Return the topics that move a robot or change its world; ``earlier`` ones may still do so."""
    topics = {topic for each in (robot.topics, *earlier) for topic in (each.command, each.world)}
    topics.update(action.topic for action in robot.actions)
    return RobotControls(robot.name, frozenset(filter(None, topics)))


def program_of(key: str) -> str:
    """The name that a program has in ``from`` when it is to be ended by nobody but who knows its key.

    A stop whose ``ends`` is that key makes robots refuse what comes under this name from then on. Everybody
    can read names: if a name were enough, one message of a stranger would lock a program out for good.
    """
    return f"program-{hashlib.sha256(key.encode('utf-8', 'replace')).hexdigest()[:16]}"


def is_home(robot_name: str, topic: str) -> bool:
    """Whether a topic lies among those that belong to a robot of this name: ``/NAME/...``."""
    return topic.startswith(topic_of(robot_name, ""))


def said(error: object) -> str:
    """The words of a robot's error, as a person may read them between our own: no more than they need be."""
    return harmless(bounded_str(error or "", ERROR_MOST), lines=True)


def said_of_stop(name: str, error: object) -> str:
    """What a robot said that has not stopped, in its own words: "Arm may still move: the brake is stuck"."""
    words = "".join(
        sign if sign.isprintable() else " " for sign in bounded_str(error or _("its stop failed"), ERROR_MOST)
    )
    words = " ".join(words[:WORDS_MOST].split()).rstrip(".")
    return words if may_move(name, words) else _(MAY_MOVE).format(robot=name, why=words)


def may_move(name: str, words: str) -> bool:
    """Whether these words say that this robot may still move: in our language, or in English as its own."""
    return any(
        words.startswith(sentence.partition("{why}")[0].rstrip(": ").format(robot=name))
        for sentence in (MAY_MOVE, _(MAY_MOVE))
    )


def foreign_topic(robot: Robot, others: Iterable[Robot]) -> str | None:
    """Why a robot can't have the topics that it names; None when it can. They are another robot's.

    ``/NAME/...`` belongs to the robot of that name, whoever comes first; other topics to who is there first.
    """
    known = [other for other in others if other.name != robot.name]
    for topic in set(reserved(robot)) - SHARED:
        if is_home(robot.name, topic):
            continue
        for other in known:
            if is_home(other.name, topic) or topic in reserved(other):
                return _("{robot} claims {topic}, which belongs to {other}").format(
                    robot=robot.name, topic=topic, other=other.name
                )
    return None


class Senders:
    """Which node sent a message: the nodes of publishers' ids, as masters told them. Works in any thread.

    What was learnt once stays, the last 20 000 of them: who takes another's id while that one is there, is
    not believed.
    """

    def __init__(self) -> None:
        """Know nobody yet."""
        self._lock = threading.Lock()
        self._nodes: dict[int, str] = {}

    def learn(self, view: GraphView, topics: Iterable[str]) -> None:
        """Take over who publishes these topics."""
        with self._lock:
            for topic in topics:
                info = view.topics.get(topic)
                for publisher in info.publishers if info is not None else ():
                    if self._nodes.get(publisher.id) not in view.nodes:
                        self._nodes[publisher.id] = publisher.node_id
            while len(self._nodes) > MOST_SENDERS:
                del self._nodes[next(iter(self._nodes))]

    def node_of(self, message: Message) -> str | None:
        """The id of the node that sent it; None while no master has told of its publisher."""
        with self._lock:
            return None if message.publisher is None else self._nodes.get(message.publisher)


class RobotProcesses(Protocol):
    """What is needed to know about the processes of robots."""

    def is_ours(self, identity: Identity) -> bool:
        """Whether this program is a virtual robot of this person."""

    def has_ended(self, identity: Identity) -> bool:
        """Whether it is sure that this program runs no more."""


class AllVirtual:
    """Believes every robot that says that it is virtual (what tests need)."""

    def is_ours(self, identity: Identity) -> bool:  # noqa: ARG002
        """All are."""
        return True

    def has_ended(self, identity: Identity) -> bool:  # noqa: ARG002
        """Nobody knows."""
        return False
