"""Parts of a session for robots: connected robots, their room, and the connections for Stop."""

from __future__ import annotations

from typing import Protocol

from app.core.alerts.alerts import Alerts
from app.core.robots.fleet import Fleet
from app.core.robots.health import Health
from app.core.robots.launcher import Launcher
from app.core.robots.motion.bridged_commands import BridgedCommands
from app.core.robots.room import SessionRoom
from app.core.robots.stop.stopper import RobotStopper
from app.core.world.live import LiveWorld
from app.core.world.part import SessionPart
from app.robots.client.stop import StopTarget
from nep.i18n import lazy
from nep.nodes.node import Node

MONITORING_FAILED_MESSAGE = lazy("can't monitor the robots: {error}")


class ConnectedRobots(SessionPart):
    """Robots on the live network."""

    task = lazy("update the robots")

    def __init__(self, live: LiveWorld, fleet: Fleet, launcher: Launcher, alerts: Alerts) -> None:
        self._live, self._fleet, self._launcher, self._alerts = live, fleet, launcher, alerts
        self._bridged_commands = BridgedCommands(fleet.moved.record_command)
        self._revision = -1

    def tick(self) -> None:
        """Apply the new graph and the robots' messages."""
        fleet, view = self._fleet, self._live.new_graph
        if view is not None:
            fleet.update(view)
            real_robots = (link.robot for link in fleet.links if not link.is_virtual)
            self._bridged_commands.update(view, real_robots)
            for notice in fleet.take_notices():
                self._live.console.add("warn", "robots", notice)
        fleet.add(self._live.batches)
        if fleet.revision != self._revision:
            self._revision = fleet.revision
            for link in fleet.connected:
                self._launcher.on_started(link.name)
                self._alerts.resolve(f"companion:{link.name}")

    def close(self) -> None:
        """Close the connections to the robots."""
        self._fleet.close()


class RoomSync(SessionPart):
    """Room of the virtual robots."""

    task = lazy("update the room")

    def __init__(self, live: LiveWorld, room: SessionRoom) -> None:
        self._live, self._room = live, room

    def tick(self) -> None:
        """Apply changes of the room by other programs, and publish and save own ones."""
        if self._live.new_graph is not None:
            self._room.update(self._live.new_graph)
        self._room.add_messages(self._live.batches)
        self._room.tick()

    def close(self) -> None:
        """Save the room."""
        self._room.close()


class StopSession(Protocol):
    """Parts of the session that `StopConnections` uses."""

    stopper: RobotStopper | None
    live: LiveWorld
    fleet: Fleet


class StopConnections(SessionPart):
    """Connections through which Stop reaches the robots.

    They include connected robots, and robots that disconnected while a program used them or without a stop.
    """

    task = lazy("monitor the robots")

    def __init__(self, session: StopSession, health: Health) -> None:
        self._session, self._health = session, health
        self._targets: tuple[StopTarget, ...] = ()
        self._must_retry = False

    def start(self) -> None:
        """Create the stopper as soon as the network is joined."""
        self._session.live.source.submit(MONITORING_FAILED_MESSAGE, self._create_stopper)

    def _create_stopper(self, node: Node) -> None:
        self._session.stopper = RobotStopper(node)

    def tick(self) -> None:
        """Connect to new robots."""
        stopper, live, fleet = self._session.stopper, self._session.live, self._session.fleet
        if stopper is None:
            return
        if live.new_graph is not None:
            stopper.update_graph(live.new_graph)
        stopper.deliver()
        for link in fleet.connected:
            link.is_reachable = stopper.is_reachable(link.name)
        targets = fleet.stop_targets
        if targets != self._targets or self._must_retry:
            self._targets, self._must_retry = targets, False
            stopper.set_expected(targets)
            live.source.submit(MONITORING_FAILED_MESSAGE, lambda _node: stopper.set_robots(targets))

    def check(self) -> None:
        """Update the alerts about robots that a Stop can't reach; the next tick connects to them again."""
        stopper = self._session.stopper
        problems = stopper.problems if stopper is not None else {}
        self._health.update_unreachable(problems)
        self._must_retry = bool(problems)

    def close(self) -> None:
        """Disconnect from all robots without stopping them."""
        if self._session.stopper is not None:
            self._session.stopper.close()
