"""Simulated robots with the real driver kit on a simulated body, clock and network; a hostile program."""

from __future__ import annotations

import threading
from typing import Annotated, Any, cast

import orjson

from app.clock import MonotonicClock
from app.robots.identity import DESCRIPTION_TYPE
from app.robots.kit import Call, Driver, Failed, Kind, Link, Range, action, safe_stop
from tests.core.robots.stop_model.clock import SimulatedClock
from tests.core.robots.stop_model.network import SimulatedNetwork, SimulatedNode

TURN_S = 1.0
WITHIN_S = 0.3
WATCHDOG_S = 1.0


class Rover:
    """Robot body that can drive until it is stopped, and turn for a second."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.is_driving = self.is_turning = False
        self.brake_fails = False
        self.stops = 0

    @property
    def is_moving(self) -> bool:
        return self.is_driving or self.is_turning

    @action("drive %speed m/s", category="Movement", icon="move", uses=("base",), on_busy="replace",
            risk="locomotes", cancellable=False, repeat_s=0.2)  # fmt: skip
    def drive(self, call: Call, speed: Annotated[float, Range(-1, 1, 0.1, "m/s")] = 0.2) -> None:
        """Keep driving until the next drive or stop."""
        self.is_driving = speed != 0

    @action("turn %angle degrees", category="Movement", icon="move", uses=("base",), on_busy="queue",
            risk="locomotes", timeout_s=5)  # fmt: skip
    def turn(self, call: Call, angle: Annotated[float, Range(-90, 90, 5, "deg")] = 45) -> None:
        """Turn for a second."""
        self.is_turning = True
        try:
            call.wait(TURN_S)
        finally:
            self.is_turning = False

    @safe_stop(watchdog_s=WATCHDOG_S, within_s=WITHIN_S)
    def stop(self) -> None:
        """Stand still."""
        if self.brake_fails:
            raise Failed("the brake is stuck")
        self.stops += 1
        self.is_driving = False


ROVER = Kind(model="rover", title="Rover", body=Rover)


class RobotClock(MonotonicClock):
    """Clock of one robot's process; its waits don't end while the process is frozen or dead."""

    def __init__(self, clock: SimulatedClock, node: SimulatedNode) -> None:
        self._clock, self._node = clock, node

    def now(self) -> float:
        return self._clock.now()

    def wait(self, event: Any, timeout_s: float | None) -> bool:
        return self._clock.wait(event, timeout_s, lambda: not self._node.is_running)


class SimulatedRobot:
    """Robot process; several processes can have the same robot name."""

    def __init__(
        self, network: SimulatedNetwork, clock: SimulatedClock, name: str, *, connects_late: bool
    ) -> None:
        self.name, self.clock = name, clock
        clock.follow(f"{name} ")
        self.node = network.node(f"{name} driver")
        self.node.is_connecting = connects_late
        self.driver = Driver(ROVER, name, cast("Any", self.node), clock=RobotClock(clock, self.node))
        self.driver.start()

    @property
    def body(self) -> Rover:
        body = self.driver.body
        assert isinstance(body, Rover)
        return body

    @property
    def id(self) -> str:
        return self.node.id

    @property
    def is_deciding(self) -> bool:
        """Return whether the robot's command and stop threads are alive."""
        names = {thread.name for thread in threading.enumerate()}
        return names >= {f"{self.name} commands", f"{self.name} stop"}

    def thaw(self) -> None:
        """Resume the frozen process (SIGCONT) and register its node again if its lease has ended."""
        self.node.is_frozen = False
        if self.node.is_unlisted:
            self.node.register()
        self.clock.wake_all()

    def __repr__(self) -> str:
        state = "dead" if self.node.is_dead else "frozen" if self.node.is_frozen else "running"
        body = self.driver.body
        is_moving = isinstance(body, Rover) and body.is_moving
        return f"<{self.name} {self.id[-3:]} {state}{' moving' if is_moving else ''}>"


class Stranger:
    """Hostile program that forges replies, sends deeply nested values and announces nonexistent robots."""

    def __init__(self, network: SimulatedNetwork) -> None:
        self.network = network
        self.node = network.node("stranger")
        self._made: dict[str, Any] = {}

    def _publisher(self, topic: str, msg_type: str) -> Any:
        if topic not in self._made:
            self._made[topic] = self.node.new_pub(topic, msg_type, latched=msg_type == DESCRIPTION_TYPE)
        self.network.connect()
        return self._made[topic]

    def announce(self, name: str) -> None:
        """Announce a nonexistent robot without ever sending its description."""
        self.node.new_pub(f"/{name}/description", DESCRIPTION_TYPE, latched=True)

    def answer(self, name: str, ids: list[str], *, times: int) -> None:
        """Forge the robot's reply to each of these stops, `times` times."""
        publisher = self._publisher(f"/{name}/answer", "robot/answer")
        for _each in range(times):
            for id in ids or ["stop-none"]:
                publisher.publish({"id": id, "op": "stop", "state": "succeeded"})

    def send_deep(self, topic: str, depth: int) -> None:
        """Publish a deeply nested value on a topic that expects a command or a reply."""
        value = b"[" * depth + b"]" * depth
        message = b'{"op":"invoke","id":"z","from":"e","state":"succeeded","action":' + value + b"}"
        self._publisher(topic, "robot/command" if topic.endswith("command") else "json").send(message)

    def send_many_keys(self, topic: str, count: int) -> None:
        value = {
            "op": "invoke",
            "id": "z",
            "from": "e",
            "action": "drive",
            "input": {f"k{n}": n for n in range(count)},
        }
        self._publisher(topic, "robot/command").send(orjson.dumps(value))
