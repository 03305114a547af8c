"""Publishing on a robot's own topics is moving that robot: who would be moved, and whether that was asked."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from app.blocks.runtime.errors import BehaviourError
from app.robots.description.description import Robot
from app.robots.identity import controls_of
from nep.i18n import _, listed
from nep.programs.robots.moving import MovingTopics, RobotControls


def moved_by(topic: str, robots: Iterable[Robot]) -> tuple[str, ...]:
    """Return the names of these robots that a message may move, or whose world it changes."""
    return MovingTopics(map(controls_of, robots)).robots_on(topic)


def guarded(robots: Iterable[Robot]) -> dict[str, tuple[str, ...]]:
    """Return the topics with which these robots are moved, each with the names of those that it moves."""
    return MovingTopics(map(controls_of, robots)).topics


class PublishGuard:
    """Lets a running program publish anywhere but where it would move a robot that nobody was asked about."""

    def __init__(self, topics: Mapping[str, Collection[str]], allowed: Collection[str]) -> None:
        """``topics`` move the robots of these names; ``allowed`` are those that a person was asked about."""
        self._allowed = frozenset(allowed)
        self.know(topics)

    def know(self, topics: Mapping[str, Collection[str]]) -> None:
        """These are the robots that are there now."""
        moved: dict[str, set[str]] = {}
        for topic, names in topics.items():
            for name in names:
                moved.setdefault(name, set()).add(topic)
        self._moving = MovingTopics(RobotControls(name, frozenset(each)) for name, each in moved.items())

    def check(self, topic: str) -> None:
        """Raise BehaviourError when a message on this topic would move a robot that is not allowed."""
        names = [name for name in self._moving.robots_on(topic) if name not in self._allowed]
        if names:
            who = listed(names)
            raise BehaviourError(
                _(
                    "Publishing on {topic} would move {who}, which has not been allowed. Stop the behaviour "
                    "and run it again."
                ).format(topic=topic, who=who)
            )
