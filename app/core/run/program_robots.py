"""Robots that a running program knows. New and restarted robots are reported to the program."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from app.core.robots.fleet import Fleet
from app.core.run.runner import Runner
from app.robots.description.description import Robot
from nep.programs.robots.moving import MovingTopics


def owners_of(fleet: Fleet) -> dict[str, str]:
    """Return the node ids of the connected robots' programs, by the robot's name."""
    return {link.name: link.identity.node_id for link in fleet.connected if link.identity is not None}


class ProgramRobots:
    """Reporter of new and restarted robots to the running program.

    If the program moves a robot, the robot is reported once the user has allowed the motion.
    """

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._runner: Runner | None = None
        self._requested_actions: Mapping[str, Sequence[str]] = {}
        self._known_owners: Mapping[str, str] = {}
        self._revision = -1
        self._moving_topics = MovingTopics()
        self._reported_topics: Mapping[str, Sequence[str]] = {}

    def start(
        self,
        runner: Runner,
        requested_actions: Sequence[tuple[Robot, Sequence[str]]],
        owners: Mapping[str, str],
    ) -> None:
        """Start reporting to a program.

        Args:
            runner: Runner of the program.
            requested_actions: Robots that the program uses, and the actions that it invokes.
            owners: Node ids of the robots that the program already knows, by name.
        """
        self._runner, self._known_owners, self._revision = runner, owners, self._fleet.revision
        moving_topics, connected_names = (
            self._fleet.moving_topics,
            {link.name for link in self._fleet.connected},
        )
        # the program was started with the connected robots; unreadable ones are reported at the next tick
        self._moving_topics = (
            moving_topics if connected_names.issuperset(moving_topics.robots) else MovingTopics()
        )
        self._reported_topics = self._moving_topics.topics
        self._requested_actions = {robot.name: actions for robot, actions in requested_actions}

    def stop(self) -> None:
        """Stop reporting after the program has ended."""
        self._runner = None

    def update(self) -> None:
        """Report the connected robots to the program if they have changed since the last call."""
        if self._runner is None or not self._has_changed():
            return
        self._revision, owners = self._fleet.revision, owners_of(self._fleet)
        links = [self._fleet.link(name) for name in self._requested_actions]
        replaced_links = [
            link
            for link in links
            if link is not None
            and link.name in owners
            and owners[link.name] != self._known_owners.get(link.name)
        ]
        requested_actions = [(link.robot, self._requested_actions[link.name]) for link in replaced_links]
        if self._fleet.permission.request_permission(requested_actions, self._send):
            self._send()
        else:
            self._send(excluded_names=[link.name for link in replaced_links])

    def _has_changed(self) -> bool:
        is_same = self._fleet.revision == self._revision
        if is_same and self._fleet.moving_topics is self._moving_topics:
            return False
        self._moving_topics = self._fleet.moving_topics
        return not is_same or self._moving_topics.topics != self._reported_topics

    def _send(self, excluded_names: Collection[str] = ()) -> None:
        if self._runner is None:
            return
        owners = {name: id for name, id in owners_of(self._fleet).items() if name not in excluded_names}
        replaced_names = [
            name
            for name, id in owners.items()
            if name in self._requested_actions and self._known_owners.get(name) != id
        ]
        self._fleet.moved.record_command(replaced_names, "behaviour")
        self._known_owners = {**self._known_owners, **owners}
        self._reported_topics = self._fleet.moving_topics.topics
        self._runner.set_robots(owners, self._reported_topics)
