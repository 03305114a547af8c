"""Studio's session on a simulated network, with the actions of a user who moves robots and presses Stop."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import orjson

from app.blocks.model.program import Program
from app.blocks.runtime.events import ProgramEnded, RunnerEvent
from app.core.network.source import GraphReceived, MasterFound
from app.core.robots.stop.stopper import RobotStopper
from app.core.run.acting.arming import Target
from app.core.run.acting.shelf import SavedMessage
from app.core.run.requests import RequestedRun
from app.core.session import Session
from app.core.storage.settings import Settings
from app.errors import AppError
from app.robots.identity import program_of
from nep.messages.message import Message
from nep.programs.alarms.evaluator import AlarmEvent
from nep.programs.alarms.rule import AlarmAction, AlarmCondition, AlarmRule
from nep.protocol.graph_view import BRIDGES_TOPIC
from tests.core.robots.stop_model.clock import SimulatedClock
from tests.core.robots.stop_model.network import (
    SimulatedNetwork,
    SimulatedNode,
    SimulatedPublisher,
    SimulatedSource,
)

GRAPH_POLL_S = 0.4
ALIVE_S = GRAPH_POLL_S  # equal to the graph interval, so that fewer moments are simulated


class SimulatedHeartbeat:
    """Fake of `app.robots.client.heartbeat.Heartbeat` in virtual time, without a thread."""

    def __init__(self, clock: SimulatedClock, sender: str) -> None:
        self._clock, self._sender = clock, sender
        self._robots: dict[str, Callable[[Mapping[str, object]], object]] = {}
        self._is_due = False

    def start(self, robot: str, publish: Callable[[Mapping[str, object]], object]) -> None:
        self._robots[robot] = publish
        if not self._is_due:
            self._is_due = True
            self._clock.call_at(self._clock.now() + ALIVE_S, self._tell)

    def stop(self, robot: str) -> None:
        self._robots.pop(robot, None)

    def close(self) -> None:
        self._robots.clear()

    def _tell(self) -> None:
        self._is_due = bool(self._robots)
        for publish in list(self._robots.values()):
            publish({"id": "alive", "op": "alive", "from": self._sender, "action": "", "input": {}})
        if self._robots:
            self._clock.call_at(self._clock.now() + ALIVE_S, self._tell)


class SimulatedRunner:
    """Fake runner of a program that commands robots to drive."""

    _runs = 0

    def __init__(
        self, clock: SimulatedClock, network: SimulatedNetwork, post: Callable[[RunnerEvent], object]
    ) -> None:
        SimulatedRunner._runs += 1
        self.run, self.pid = SimulatedRunner._runs, 4242
        self.program_key = f"key {self.run}"
        self.program_id = program_of(self.program_key)
        self._clock, self._network, self._post = clock, network, post
        self.node: SimulatedNode | None = None
        self._alive = SimulatedHeartbeat(clock, self.program_id)

    def start(self, program: Program, *_given: object, **_options: object) -> None:
        self.node = self._network.node("program")
        self.publishers = {
            name: self.node.new_pub(f"/{name}/command", "robot/command") for name in program.robots
        }
        self._network.connect()
        for name, publisher in self.publishers.items():
            self.move(name, "drive")
            self._alive.start(name, publisher.publish)

    def move(self, name: str, action: str) -> None:
        publisher = self.publishers[name]
        command = {
            "id": f"p{self.run}",
            "op": "invoke",
            "from": self.program_id,
            "action": action,
            "input": {},
        }
        publisher.publish(command)

    def stop(self) -> None:
        if self.node is not None:
            self._alive.close()
            self.node.close()
            self._post(ProgramEnded(run=self.run))

    def set_robots(self, *_given: object) -> None:
        pass

    def set_breakpoints(self, *_given: object) -> None:
        pass

    def set_pace(self, *_given: object) -> None:
        pass


class _Driving(RequestedRun):
    """Requested run of a behaviour that drives robots."""

    __slots__ = ("robots",)

    def program(self) -> Program:
        robots: tuple[str, ...] = self.robots  # type: ignore[attr-defined]
        return Program(
            "driving", "", "", {}, robots=robots, actions=dict.fromkeys(robots, ("drive",)), starts=1
        )

    def problems(self, program: Program) -> dict[str, str]:
        return {}


class SimulatedStudio:
    """Studio without its window, master and processes; everything else is the real code."""

    def __init__(self, network: SimulatedNetwork, clock: SimulatedClock, folder: Path) -> None:
        self.network, self.clock = network, clock
        self.node = network.node("studio")
        self.session = Session(
            Settings(folder),
            address="127.0.0.1:9",
            source=cast("Any", SimulatedSource),
            journal_folder=folder,
            start_processes=False,
            clock=clock.now,
        )
        source = self.session.live.source
        assert isinstance(source, SimulatedSource)
        source.node, self._source = self.node, source
        fleet, runs = self.session.fleet, self.session.runs
        fleet._heartbeat = cast("Any", SimulatedHeartbeat(clock, "studio"))
        fleet._invocations._on_idle = fleet._heartbeat.stop
        runs._create_runner = cast("Any", lambda post: SimulatedRunner(clock, network, post))
        self.session.stopper = stopper = RobotStopper(cast("Any", self.node), clock.now)
        stopper._changed = clock.condition()
        source.post(MasterFound("127.0.0.1:9"))

    def see(self) -> None:
        self._source.post(GraphReceived(self.network.view(), 0.0))

    def tick(self) -> None:
        self.session.tick()

    def hand_to_stopper(self, topic: str, messages: Sequence[Message]) -> None:
        """Deliver a batch immediately, and only to the stopper."""
        watched = self._source.watched.get(topic)
        stopper = [each for each in self.node.subscribers if each.topic == topic and each is not watched]
        assert stopper, f"the stopper does not subscribe to {topic}"
        for subscriber in stopper:
            subscriber.sink(messages)

    # -- user actions

    def allow(self) -> None:
        """Give the permission to move robots if Studio asks for it."""
        if self.session.fleet.permission.question is not None:
            self.session.fleet.permission.answer(is_allowed=True)

    def move(self, name: str, action: str) -> None:
        """Invoke an action as its form does, and give the permission if it is required."""
        try:
            self.session.fleet.invoke(name, action, {})
        except AppError:
            self.allow()

    def run(self, robots: Sequence[str]) -> None:
        wanted = _Driving(self.session.documents.current)
        object.__setattr__(wanted, "robots", tuple(robots))
        self.session.runs._request_run(wanted)
        self.allow()

    def send_from_shelf(self, name: str) -> None:
        """Send a saved message from the shelf, as its button and shortcut do."""
        acting = self.session.acting
        message = SavedMessage("m", "drive", f"/{name}/command", "robot/command", _drive_text(name))
        acting.send(message)
        while acting.question is not None or self.session.fleet.permission.question is not None:
            if acting.question is not None:
                acting.answer(is_allowed=True)
            self.allow()

    def send_from_alarm(self, name: str) -> None:
        """Trigger an alarm that sends a command."""
        action = AlarmAction("send", f"/{name}/command", orjson.loads(_drive_text(name)), "robot/command")
        event = AlarmEvent("on", AlarmRule("a", AlarmCondition("appears", "/door"), (action,)), 0.0)
        self.session.alarms._send(event, action, lambda _ok, _said: None)
        self.allow()

    def replay(self, name: str) -> None:
        """Publish a recorded command, with the same permission and notification as `ReplayOutbox`."""
        topic = f"/{name}/command"
        if self.session.fleet.gate.request_permission(topic, lambda: self.replay(name)):
            self.session.acting.notify_moved(Target("topic", topic), "replay")
            publisher = self.node.new_pub(topic, "robot/command")
            self.network.connect()
            publisher.publish(orjson.loads(_drive_text(name)))
        else:
            self.allow()

    def close(self) -> None:
        self.session.close()


class SimulatedBridge:
    """Separate bridge process that forwards commands from another network."""

    def __init__(self, network: SimulatedNetwork) -> None:
        self.network = network
        self.node = network.node("bridge")
        self.node.new_pub(BRIDGES_TOPIC, latched=True).publish({})
        self._made: dict[str, SimulatedPublisher] = {}

    def carry(self, name: str) -> None:
        topic = f"/{name}/command"
        if topic not in self._made:
            self._made[topic] = self.node.new_pub(topic, "robot/command")
            self.network.connect()
        self._made[topic].publish(orjson.loads(_drive_text(name)))


def _drive_text(name: str) -> str:
    return f'{{"id": "{name} {uuid.uuid4().hex}", "op": "invoke", "action": "drive", "input": {{}}}}'
