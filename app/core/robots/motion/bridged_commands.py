"""Detection of commands that bridges publish to robots, based on the graph."""

from __future__ import annotations

from collections.abc import Iterable

from app.core.robots.stop.moved_robots import OnMoved
from app.robots.description.description import Robot
from nep.protocol.graph_view import BRIDGES_TOPIC, GraphView


class BridgedCommands:
    """Detector of robots that receive commands from bridges. Not thread-safe; use it from the main thread.

    A bridge announces itself on `BRIDGES_TOPIC`. The graph contains the number of messages that the
    bridge published on a robot's command topic, so that no subscription is needed.
    """

    def __init__(self, on_moved: OnMoved) -> None:
        self._on_moved = on_moved
        self._counts: dict[int, int] = {}

    def update(self, view: GraphView, robots: Iterable[Robot]) -> None:
        """Apply a new graph; report robots that received commands from a bridge since the previous graph."""
        bridge_topic = view.topics.get(BRIDGES_TOPIC)
        bridges = (
            {publisher.node_id for publisher in bridge_topic.publishers}
            if bridge_topic is not None
            else set()
        )
        counts: dict[int, int] = {}
        moved_robots: list[str] = []
        for robot in robots if bridges else ():
            topic = view.topics.get(robot.topics.command)
            for publisher in topic.publishers if topic is not None else ():
                if publisher.node_id in bridges:
                    counts[publisher.id] = publisher.count
                    if publisher.count > self._counts.get(publisher.id, 0):
                        moved_robots.append(robot.name)
        self._counts = counts
        if moved_robots:
            self._on_moved(tuple(dict.fromkeys(moved_robots)), "bridge")
