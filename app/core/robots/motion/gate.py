"""Motion gate: check of all messages that may move robots (alarms, saved messages, replays, clicks).

The main thread asks the user (`MotionGate.request_permission`). Any thread checks immediately before each
message (`MotionGate.rejection_reason`), so that a robot that connects in the meantime is not moved.
`nep.programs.robots` determines which topics move robots.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

from app.core.robots.motion.permission import MotionPermission, risky_action_titles
from app.core.robots.robot_link import RobotLink
from app.robots.description.description import Robot
from app.robots.identity import controls_of
from nep.errors import NepError
from nep.i18n import _, format_list
from nep.nodes.node import Node
from nep.programs.robots.moving import MovingTopics, description_topics, moving_topics
from nep.protocol.graph_view import GraphView

_GRAPH_TIMEOUT_S = 0.5


class GatedRobots(Protocol):
    """Information about robots that `MotionGate` needs."""

    @property
    def moving_topics(self) -> MovingTopics:
        """Topics whose messages move robots. Replaced by a new object when they change."""

    @property
    def movable_robots(self) -> Iterable[Robot]:
        """Robots that messages may move, including real robots whose connection is lost."""

    @property
    def described_topics(self) -> frozenset[str]:
        """Description topics of the `movable_robots` robots whose descriptions are valid."""


class MovableRobots:
    """Movable robots of the fleet, for `MotionGate`. Not thread-safe; use it from the main thread."""

    def __init__(self, links: Mapping[str, RobotLink], names: Mapping[str, str]) -> None:
        self._links, self._names = links, names
        self.view = GraphView(0, 0)
        """Newest graph."""
        self._cache_key: object = None
        self._moving_topics = MovingTopics()

    @property
    def movable_robots(self) -> tuple[Robot, ...]:
        """Robots that messages may move, including real robots whose connection is lost."""
        return tuple(link.robot for link in self._movable_links)

    @property
    def _movable_links(self) -> tuple[RobotLink, ...]:
        return tuple(link for link in self._links.values() if link.is_connected or not link.is_virtual)

    @property
    def described_topics(self) -> frozenset[str]:
        """Description topics of the connected robots."""
        connected_names = {link.name for link in self._links.values() if link.is_connected}
        return frozenset(topic for topic, name in self._names.items() if name in connected_names)

    @property
    def moving_topics(self) -> MovingTopics:
        """Topics whose messages move robots. Replaced by a new object when they change."""
        links = self._movable_links
        robot_states = [(link.robot, link.earlier_topics, link.identity) for link in links]
        described_topics = self.described_topics
        key = (self.view.epoch, self.view.revision, described_topics, robot_states)
        if key != self._cache_key:
            controls = [controls_of(link.robot, link.earlier_topics) for link in links]
            unread_topics = description_topics(self.view) - described_topics
            self._cache_key, self._moving_topics = key, moving_topics(self.view, controls, unread_topics)
        return self._moving_topics


class _Snapshot(NamedTuple):
    moving_topics: MovingTopics = MovingTopics()
    allowed_robots: frozenset[str] = frozenset()
    unknown_robots: frozenset[str] = frozenset()
    described_topics: frozenset[str] = frozenset()


class MotionGate:
    """Gate that decides which messages may be published on topics that move robots.

    Use it from the main thread. Only `rejection_reason` and `current_rejection_reason` are thread-safe;
    they use the state at the last call of `update`.
    """

    def __init__(self, permission: MotionPermission, robots: GatedRobots) -> None:
        self._permission, self._robots = permission, robots
        self._snapshot_source: tuple[MovingTopics, int] | None = None
        self._snapshot = _Snapshot()

    def robots_moved_by(self, topic: str, msg_type: str = "") -> tuple[str, ...]:
        """Return the names of the robots that a message moves; the topic's name if the robot is unknown."""
        return self._robots.moving_topics.robots_moved_by(topic, msg_type)

    def is_permitted(self, topic: str, msg_type: str = "") -> bool:
        """Return True if a message may be published without asking the user.

        Args:
            topic: Topic of the message.
            msg_type: Message type; "" if unknown.
        """
        self.update()
        return not self.rejection_reason(topic, msg_type)

    def request_permission(
        self, topic: str, on_allow: Callable[[], object], msg_type: str = "", *, reason: str = ""
    ) -> bool:
        """Return True if a message may be published now; otherwise ask the user and return False.

        Args:
            topic: Topic of the message.
            on_allow: Called if the user allows the motion.
            msg_type: Message type; "" if unknown.
            reason: Sentence for the user about the part of Studio that wants to publish.
        """
        robots_by_name = {robot.name: robot for robot in self._robots.movable_robots}
        names = self.robots_moved_by(topic, msg_type)
        targets = [
            (robots_by_name[name], _action_names(robots_by_name[name]))
            for name in names
            if name in robots_by_name
        ]
        unknown_robots = [name for name in names if name not in robots_by_name]
        is_permitted = self._permission.request_permission(targets, on_allow, unknown_robots, reason)
        self.update()
        return is_permitted

    def update(self) -> None:
        """Update the robots and permissions that `rejection_reason` uses."""
        source = self._robots.moving_topics, self._permission.revision
        if source == self._snapshot_source:
            return
        robots_by_name = {robot.name: robot for robot in self._robots.movable_robots}
        allowed_names = {
            name
            for name, robot in robots_by_name.items()
            if self._permission.is_allowed(robot) or not risky_action_titles(robot, _action_names(robot))
        }
        # a permission counts until the robot is identified
        unknown_robots = self._permission.allowed_unknown_robots - robots_by_name.keys()
        self._snapshot = _Snapshot(
            source[0], unknown_robots | allowed_names, unknown_robots, self._robots.described_topics
        )
        self._snapshot_source = source

    def rejection_reason(self, topic: str, msg_type: str = "") -> str:
        """Return the reason why a message may not be published now; "" if it may be published.

        Thread-safe.
        """
        snapshot = self._snapshot
        return _rejection_text(
            topic,
            [
                name
                for name in snapshot.moving_topics.robots_moved_by(topic, msg_type)
                if name not in snapshot.allowed_robots
            ],
        )

    def current_rejection_reason(self, node: Node, topic: str, msg_type: str = "") -> str:
        """Check like `rejection_reason`, and query the graph for robots that have just joined.

        The query takes at most 0.5 s; it is skipped if the message is rejected anyway, and ignored if
        the master doesn't reply. Thread-safe. Use it for the first message to subscribers that have
        just connected.
        """
        reason = self.rejection_reason(topic, msg_type)
        if reason:
            return reason
        try:
            view = node.graph(_GRAPH_TIMEOUT_S)
        except NepError:
            return ""  # no node can have joined without the master
        snapshot = self._snapshot
        new_moving_topics = moving_topics(view, (), description_topics(view) - snapshot.described_topics)
        return _rejection_text(
            topic,
            [name for name in new_moving_topics.robots_on(topic) if name not in snapshot.unknown_robots],
        )


def _rejection_text(topic: str, names: Sequence[str]) -> str:
    if not names:
        return ""
    if names == [topic]:
        return _("a message on {topic} would move a robot that isn't allowed to move").format(topic=topic)
    template = _("the message would move {robots}, which isn't allowed")
    return template.format(robots=format_list(list(names)))


def _action_names(robot: Robot) -> Sequence[str]:
    # All actions, because a message doesn't reveal which action it triggers.
    return [action.name for action in robot.actions]
