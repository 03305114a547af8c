"""Publishing on a robot's own topics is moving that robot: who would be moved, and whether that was asked."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from app.blocks.runtime.errors import BehaviourError
from app.robots import rize
from app.robots.description.description import Robot
from nep.i18n import _, listed


def moved_by(topic: str, robots: Iterable[Robot]) -> tuple[str, ...]:
    """The names of the robots that a message on this topic may move, or whose world it changes.

    What is published for the robots of RIZE is heard by each robot of the kit as well.
    """
    return tuple(
        robot.name
        for robot in robots
        if topic in (robot.topics.command, robot.topics.world, rize.COMMANDS)
        or topic in (action.topic for action in robot.actions)
    )


def guarded(robots: Iterable[Robot]) -> dict[str, tuple[str, ...]]:
    """The topics with which these robots are moved, each with the names of those that it moves."""
    known = tuple(robots)
    topics = {topic for robot in known for topic in (robot.topics.command, robot.topics.world, rize.COMMANDS)}
    topics |= {action.topic for robot in known for action in robot.actions}
    return {topic: moved_by(topic, known) for topic in sorted(filter(None, topics))}


class PublishGuard:
    """Lets a running program publish anywhere but where it would move a robot that nobody was asked about."""

    def __init__(self, topics: Mapping[str, Collection[str]], allowed: Collection[str]) -> None:
        """``topics`` move the robots of these names; ``allowed`` are those that a person was asked about."""
        self._topics, self._allowed = topics, frozenset(allowed)

    def know(self, topics: Mapping[str, Collection[str]]) -> None:
        """These are the robots that are there now."""
        self._topics = topics

    def check(self, topic: str) -> None:
        """Raise BehaviourError when a message on this topic would move a robot that is not allowed."""
        names = [name for name in self._topics.get(topic, ()) if name not in self._allowed]
        if names:
            who = listed(names)
            raise BehaviourError(
                _(
                    "Publishing on {topic} would move {who}, and nobody was asked whether it may. Stop "
                    "the behaviour and run it again."
                ).format(topic=topic, who=who)
            )
