"""Fake link without a network, and helpers that run a program in this process."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.program import Program
from app.blocks.runtime.link import RobotCall
from app.blocks.runtime.questions import ProgramQuestion
from app.blocks.runtime.runtime import Runtime
from app.blocks.runtime.scheduler import ScriptGroup
from app.clock import ThreadClock, VirtualClock
from app.robots.description.description import Robot
from tests.blocks.samples import robot

LONG_S = 60.0


class FakeLink:
    """Fake link whose robots execute commands immediately, unless a test holds them back.

    Tests set the values of sensors and topics.
    """

    def __init__(self) -> None:
        self.invoked: list[tuple[str, str, dict[str, object]]] = []
        self.calls: list[RobotCall] = []
        self.canceled: list[RobotCall] = []
        self.groups: list[tuple[str, str]] = []
        self.published: list[tuple[str, object]] = []
        self.sensors: dict[tuple[str, str], object] = {}
        self.topics: dict[str, object] = {}
        self.answers: dict[str, tuple[str, dict[str, object], str]] = {}
        self.held: set[str] = set()
        self.told: dict[object, list[Callable[[object], None]]] = {}
        self.on_change: Callable[[], None] = lambda: None
        self.on_external_stop: Callable[[str], None] = lambda _: None

    def set_callbacks(self, on_change: Callable[[], None], on_external_stop: Callable[[str], None]) -> None:
        self.on_change, self.on_external_stop = on_change, on_external_stop

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> RobotCall:
        self.invoked.append((robot, action, dict(input)))
        call = RobotCall(f"c{len(self.calls)}", robot, action, started_s=time.monotonic())
        self.calls.append(call)
        if action in self.held:
            call.state = "running"
        else:
            self.answer(call, *self.answers.get(action, ("succeeded", {}, "")))
        return call

    def answer(
        self, call: RobotCall, state: str, output: Mapping[str, object] | None = None, error: str = ""
    ) -> None:
        call.output, call.error = output or {}, error
        call.state = state
        if call.action in self.held:
            self.on_change()

    def cancel(self, call: RobotCall) -> None:
        self.canceled.append(call)

    def hold_motions(self, group: ScriptGroup) -> None:
        self.groups.append(("hold", group.name))

    def resume_motions(self, group: ScriptGroup) -> None:
        self.groups.append(("resume", group.name))

    def end_motions(self, group: ScriptGroup) -> None:
        self.groups.append(("end", group.name))

    def sensor(self, robot: str, name: str) -> object:
        return self.sensors.get((robot, name))

    def newest(self, topic: str) -> object:
        return self.topics.get(topic)

    def publish(self, topic: str, payload: object) -> None:
        self.published.append((topic, payload))

    def on_sensor(self, robot: str, name: str, callback: Callable[[object], None]) -> None:
        self.told.setdefault((robot, name), []).append(callback)

    def on_event(self, robot: str, name: str, callback: Callable[[object], None]) -> None:
        self.told.setdefault((robot, name), []).append(callback)

    def on_message(self, topic: str, callback: Callable[[object], None]) -> None:
        self.told.setdefault(topic, []).append(callback)

    def happen(self, where: object, data: object) -> None:
        """Simulate the arrival of an event, a sensor value or a message."""
        for told in self.told.get(where, ()):
            told(data)
        self.on_change()


class Play:
    """Program that runs in this process."""

    def __init__(
        self,
        program: Program,
        robots: tuple[Robot, ...] = (),
        link: FakeLink | None = None,
        *,
        asked: Callable[[ProgramQuestion | None], None] | None = None,
        clock: ThreadClock | None = None,
    ) -> None:
        self.program = program
        self.link = link or FakeLink()
        self.lines: list[str] = []
        self.runtime = Runtime(
            self.lines.append,
            labels=program.labels,
            readings=program.readings,
            on_question=asked,
            clock=clock,
        )
        self.robots = robots
        self.steps: list[str] = []

    def start(self, *, paused: bool = False) -> Play:
        self.names = self.runtime.namespace()
        exec(compile(self.program.runnable, "<behaviour>", "exec"), self.names)
        if paused:
            self.runtime.scheduler.pause()
        self.runtime.start(self.link, self.robots)
        return self

    def end(self, timeout_s: float = LONG_S) -> Play:
        assert self.runtime.finished.wait(timeout_s), "the program is still running"
        return self

    def stop(self) -> None:
        self.runtime.scheduler.stop()
        self.runtime.finished.set()


def play(workspace: Mapping[str, object], link: FakeLink | None = None) -> Play:
    """Compile a behaviour and run it to its end in virtual time with one robot, Pepper."""
    pepper = robot()
    program = compile_behaviour(workspace, [pepper])
    return Play(program, (pepper,), link, clock=VirtualClock()).start().end()


_MIN_POLL_INTERVAL_S, _MAX_POLL_INTERVAL_S = 0.002, 0.01


def until(ready: Callable[[], bool], timeout_s: float = LONG_S) -> None:
    """Wait until a condition holds; fail after `timeout_s` seconds."""
    waiting, deadline = threading.Event(), time.monotonic() + timeout_s
    interval_s = _MIN_POLL_INTERVAL_S
    while not ready():
        assert time.monotonic() < deadline, "it has not happened"
        waiting.wait(interval_s)
        interval_s = min(1.2 * interval_s, _MAX_POLL_INTERVAL_S)
