"""A simulated lab: Studio, robots and a stranger on one network, in virtual time."""

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
    """Everything that takes part in a test of Stop. Things happen in `settle`, time passes in `advance`."""

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
        """End the history and join every thread."""
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
        """Let everything happen that happens at this moment; Studio looks once the network is quiet."""
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
        """Let time pass, from one moment in which something is due to the next."""
        until = self.clock.now() + seconds
        while self.clock.now() < until:
            self.clock.move_to(min(until, self.clock.next_due()))
            self.settle()
            self.after_step()

    # -- robots and people

    def start_robot(self, name: str, *, connects_late: bool = False) -> SimulatedRobot:
        """Start a process that is a robot; others do not notice before `settle`."""
        robot = SimulatedRobot(self.network, self.clock, name, connects_late=connects_late)
        self.robots.append(robot)
        return robot

    def wait_for_link(self, name: str) -> RobotLink:
        """Let Studio look at the graph and return the robot, connected, as Studio sees it then."""
        self.advance(GRAPH_POLL_S)
        link = self.studio.session.fleet.link(name)
        assert link is not None
        assert link.is_connected
        assert not link.is_virtual
        return link

    def stop(self) -> None:
        """Press Stop and let time pass until Studio has its report."""
        self.studio.session.runs.stop()
        self.settle()
        self.wait_for_report()

    def wait_for_report(self) -> None:
        """Let time pass until Studio has the report of the Stop that was pressed."""
        runs = self.studio.session.runs
        while runs.state.state == "stopping":
            self.advance(GRAPH_POLL_S)

    # -- what was sent

    def stops_received(self, robot: SimulatedRobot) -> int:
        """Return the number of stops that the robot's process has received."""
        received = (each.message for each in self.network.delivered if each.subscriber.node is robot.node)
        return len(_stops(received))

    @property
    def stop_ids(self) -> list[str]:
        """Ids of the stops that Studio sent, the oldest first."""
        return _stops(each.message for each in self.network.sent if each.publisher.node is self.studio.node)


def _stops(messages: Iterable[Message]) -> list[str]:
    values = [each.payload for each in messages if each.topic.endswith("/command")]
    return [str(value["id"]) for value in values if isinstance(value, dict) and value.get("op") == "stop"]
