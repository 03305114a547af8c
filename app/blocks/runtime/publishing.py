"""Protection of topics that move robots: determines which robots a program would move by publishing."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from app.blocks.runtime.errors import BehaviourError
from app.robots.description.description import Robot
from app.robots.identity import controls_of
from nep.i18n import _, format_list
from nep.programs.robots.moving import MovingTopics, RobotControls


def robots_moved_by(topic: str, robots: Iterable[Robot]) -> tuple[str, ...]:
    """Return the names of the robots that a message on a topic may move, or whose world it may change."""
    return MovingTopics(map(controls_of, robots)).robots_on(topic)


def guarded_topics(robots: Iterable[Robot]) -> dict[str, tuple[str, ...]]:
    """Return the topics that move robots, with the names of the moved robots."""
    return MovingTopics(map(controls_of, robots)).topics


class PublishGuard:
    """Guard that prevents a running program from moving a robot without permission by publishing.

    Args:
        topics: Names of the moved robots by topic.
        allowed: Names of the robots that the program may move.
    """

    def __init__(self, topics: Mapping[str, Collection[str]], allowed: Collection[str]) -> None:
        self._allowed = frozenset(allowed)
        self.set_topics(topics)

    def set_topics(self, topics: Mapping[str, Collection[str]]) -> None:
        """Replace the topics that move robots.

        Args:
            topics: Names of the moved robots by topic.
        """
        topics_by_robot: dict[str, set[str]] = {}
        for topic, names in topics.items():
            for name in names:
                topics_by_robot.setdefault(name, set()).add(topic)
        self._moving_topics = MovingTopics(
            RobotControls(name, frozenset(each)) for name, each in topics_by_robot.items()
        )

    def check(self, topic: str) -> None:
        """Raise BehaviourError if a message on a topic would move a robot that the program may not move."""
        names = [name for name in self._moving_topics.robots_on(topic) if name not in self._allowed]
        if names:
            robot_names = format_list(names)
            raise BehaviourError(
                _(
                    "Can't publish on {topic}: this would move {who} without permission. Stop the behaviour "
                    "and run it again to allow it."
                ).format(topic=topic, who=robot_names)
            )
