"""Simulated lab: Studio, robots and a hostile program on one network, in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from app.core.robots.robot_link import RobotLink
from nep.messages.message import Message
from tests.core.robots.stop_model.clock import SimulatedClock
from tests.core.robots.stop_model.network import SimulatedNetwork
from tests.core.robots.stop_model.robots import SimulatedRobot, Stranger
from tests.core.robots.stop_model.studio import GRAPH_POLL_S, SimulatedStudio


def _do_nothing() -> None:
    pass


class SimulatedLab:
    """All participants of a test of Stop.

    `settle` processes the pending events; `advance` moves the virtual time.
    """

    def __init__(self, folder: Path) -> None:
        self.before_delivery: Callable[[], object] = _do_nothing
        """Called whenever the messages that were sent are about to be delivered."""
        self.after_step: Callable[[], object] = _do_nothing
        """Called after each moment of `advance`."""
        self.clock = SimulatedClock()
        self.clock.follow("studio-stop")
        self.network = SimulatedNetwork(self.clock.now)
        self.studio = SimulatedStudio(self.network, self.clock, folder)
        self.stranger = Stranger(self.network)
        self.robots: list[SimulatedRobot] = []
        self._poll_graph()
        self.settle()

    def close(self) -> None:
        """End the simulation and join every thread."""
        self.clock.end()
        for robot in self.robots:
            robot.node.is_frozen = robot.node.is_dead = False
            robot.driver.close()
        self.studio.close()
        self.clock.join()

    # -- time

    def _poll_graph(self) -> None:
        self.studio.see()
        self.clock.call_at(self.clock.now() + GRAPH_POLL_S, self._poll_graph)

    def settle(self) -> None:
        """Process all events of the current moment; Studio ticks once the network is quiet."""
        before = None
        while True:
            self.clock.settle()
            self.network.connect()
            self.before_delivery()
            if self.network.deliver():
                continue
            now = len(self.network.sent), self.network.revision
            if now == before:
                return
            before = now
            self.studio.tick()

    def advance(self, seconds: float) -> None:
        """Advance the virtual time from one due moment to the next, and settle at each."""
        until = self.clock.now() + seconds
        while self.clock.now() < until:
            self.clock.move_to(min(until, self.clock.next_due()))
            self.settle()
            self.after_step()

    # -- robots and users

    def start_robot(self, name: str, *, connects_late: bool = False) -> SimulatedRobot:
        """Start a robot process; other participants notice it in the next `settle`."""
        robot = SimulatedRobot(self.network, self.clock, name, connects_late=connects_late)
        self.robots.append(robot)
        return robot

    def wait_for_link(self, name: str) -> RobotLink:
        """Advance until Studio has polled the graph, and return its link to the connected robot."""
        self.advance(GRAPH_POLL_S)
        link = self.studio.session.fleet.link(name)
        assert link is not None
        assert link.is_connected
        assert not link.is_virtual
        return link

    def stop(self) -> None:
        """Press Stop and advance until Studio has its report."""
        self.studio.session.runs.stop()
        self.settle()
        self.wait_for_report()

    def wait_for_report(self) -> None:
        """Advance until Studio has the report of the Stop that was pressed."""
        runs = self.studio.session.runs
        while runs.state.state == "stopping":
            self.advance(GRAPH_POLL_S)

    # -- sent messages

    def stops_received(self, robot: SimulatedRobot) -> int:
        """Return the number of stops that the robot's process has received."""
        received = (each.message for each in self.network.delivered if each.subscriber.node is robot.node)
        return len(_stops(received))

    @property
    def stop_ids(self) -> list[str]:
        """Return the IDs of the stops that Studio sent, oldest first."""
        return _stops(each.message for each in self.network.sent if each.publisher.node is self.studio.node)


def _stops(messages: Iterable[Message]) -> list[str]:
    values = [each.payload for each in messages if each.topic.endswith("/command")]
    return [str(value["id"]) for value in values if isinstance(value, dict) and value.get("op") == "stop"]
