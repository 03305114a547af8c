"""Detection of commands that bridges publish to robots, by means of the graph."""

from __future__ import annotations

from collections.abc import Iterable

from app.core.robots.stop.moved_robots import OnMoved
from app.robots.description.description import Robot
from nep.protocol.graph_view import BRIDGES_TOPIC, GraphView


class BridgedCommands:
    """Reports robots that received commands from bridges. Not thread-safe: use it from the window's thread.

    A bridge announces itself on `BRIDGES_TOPIC`. The master counts its messages on the command topic of a
    robot, so that it isn't necessary to subscribe to that topic.
    """

    def __init__(self, on_moved: OnMoved) -> None:
        self._on_moved = on_moved
        self._counts: dict[int, int] = {}

    def update(self, view: GraphView, robots: Iterable[Robot]) -> None:
        """Apply a new graph; report robots that received commands from a bridge since the last one."""
        known = view.topics.get(BRIDGES_TOPIC)
        bridges = {publisher.node_id for publisher in known.publishers} if known is not None else set()
        counts: dict[int, int] = {}
        moved: list[str] = []
        for robot in robots if bridges else ():
            topic = view.topics.get(robot.topics.command)
            for publisher in topic.publishers if topic is not None else ():
                if publisher.node_id in bridges:
                    counts[publisher.id] = publisher.count
                    if publisher.count > self._counts.get(publisher.id, 0):
                        moved.append(robot.name)
        self._counts = counts
        if moved:
            self._on_moved(tuple(dict.fromkeys(moved)), "bridge")
