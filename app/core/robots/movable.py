"""Robots that can be moved, and the topics that move them, as the fleet knows them."""

from __future__ import annotations

from collections.abc import Mapping

from app.core.robots.robot_link import RobotLink
from app.robots.description.description import Robot
from app.robots.identity import controls_of
from nep.programs.robots.moving import MovingTopics, description_topics, moving_topics
from nep.protocol.graph_view import GraphView


class MovableRobots:
    """What `MotionGate` asks of the fleet. One thread uses it (the window's)."""

    def __init__(self, links: Mapping[str, RobotLink], names: Mapping[str, str]) -> None:
        """`links` are the fleet's robots by name, `names` the robots' names by their description topics."""
        self._links, self._names = links, names
        self.view = GraphView(0, 0)
        """The newest graph."""
        self._key: object = None
        self._moving = MovingTopics()

    @property
    def movable(self) -> tuple[Robot, ...]:
        """Those that can be moved: also a real one that is away, which may only have lost its connection."""
        return tuple(link.robot for link in self._movable)

    @property
    def _movable(self) -> tuple[RobotLink, ...]:
        return tuple(link for link in self._links.values() if link.connected or not link.virtual)

    @property
    def described(self) -> frozenset[str]:
        """The description topics of the robots that are there, which were read."""
        there = {link.name for link in self._links.values() if link.connected}
        return frozenset(topic for topic, name in self._names.items() if name in there)

    @property
    def moving(self) -> MovingTopics:
        """The topics that move robots now; another object whenever that changes."""
        links = self._movable
        now = [(link.robot, link.topics_before, link.identity) for link in links]
        described = self.described
        key = (self.view.epoch, self.view.revision, described, now)
        if key != self._key:
            known = [controls_of(link.robot, link.topics_before) for link in links]
            unread = description_topics(self.view) - described
            self._key, self._moving = key, moving_topics(self.view, known, unread)
        return self._moving
