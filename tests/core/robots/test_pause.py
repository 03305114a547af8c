"""Tests of Pause while a robot drives: it stops at once, its heartbeat goes on, Resume ends the walk.

The virtual robot and the program are real processes with a real network between them.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence

import pytest

import nep
from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.events import ProgramEnded, ProgramPaused
from app.core.run.runner import Runner
from app.robots.client.discovery import find_robots
from nep.messages.message import Message
from tests.blocks.samples import block, number, started, workspace
from tests.core.run.test_runner import Heard

pytestmark = pytest.mark.timeout(240)
WAY_M = 0.7  # a person stands 0.9 m ahead
SPEED_M_S = 0.1  # slow, so that the pause takes effect before the end also on a busy computer
LONG_S = 60.0
HELD_S = 1.6  # longer than the robot's watchdog timeout (1 s)


class Pose:
    """Poses that the robot reports, with the time at which each was received."""

    def __init__(self, node: nep.Node) -> None:
        self.changed = threading.Condition()
        self.seen: list[tuple[float, float, float]] = []
        node.new_sub("/Pepper/pose", sink=self._take)

    def _take(self, messages: Sequence[Message]) -> None:
        with self.changed:
            for message in messages:
                value = message.payload
                assert isinstance(value, dict)
                value = value.get("value", value)
                self.seen.append((time.monotonic(), float(value["x"]), float(value["y"])))
            self.changed.notify_all()

    def until(self, ready: Callable[[], bool], within_s: float) -> None:
        with self.changed:
            assert self.changed.wait_for(ready, within_s), self.seen[-3:]

    def until_still(self) -> None:
        """Wait until several consecutive poses are equal; the robot reports eight poses per second."""
        now = len(self.seen)
        self.until(
            lambda: (
                len(self.seen) >= now + 5
                and max(math.dist(each[1:], self.seen[-1][1:]) for each in self.seen[-4:]) < 0.002
            ),
            LONG_S,
        )

    def far(self) -> float:
        """Return the distance in metres between the first and the newest pose."""
        if not self.seen:
            return 0.0
        return math.dist(self.seen[0][1:], self.seen[-1][1:])


@pytest.fixture
def pepper(master) -> Iterator[None]:
    command = [sys.executable, "-m", "app.robots.simulated", "--name", "Pepper"]
    process = subprocess.Popen(
        [*command, "--owner-pid", str(os.getpid())], env={**os.environ, "NEP_MASTER": master.address}
    )
    yield
    process.terminate()
    process.wait(LONG_S)


@pytest.fixture
def node(master) -> Iterator[nep.Node]:
    with nep.node("looker", master=master.address) as made:
        yield made


def test_pause_interrupts_walk_and_resume_completes_it(master, pepper, node) -> None:
    (robot,) = find_robots(node, LONG_S, expected=("Pepper",)).robots
    walk = block("robot_pepper_do_walk", ROBOT="Pepper", DISTANCE=number(WAY_M), SPEED=number(SPEED_M_S))
    program = compile_behaviour(workspace(started(walk)), (robot,), name="Walk")
    assert not program.errors, program.problems
    pose, heard = Pose(node), Heard()
    pose.until(lambda: bool(pose.seen), LONG_S)
    runner = Runner(heard)
    try:
        runner.start(program, [robot.source], master.address)
        pose.until(lambda: pose.far() > 0.1, LONG_S)
        runner.pause()
        held = heard.until(ProgramPaused)
        assert held.block, "the block at which it is held"
        pose.until_still()
        before = pose.far()
        assert before < WAY_M - 0.05, "it stands still before it has arrived"
        threading.Event().wait(HELD_S)  # the robot must not move during this time
        assert pose.far() == pytest.approx(before, abs=0.002), "it stands still"
        runner.resume()
        ended = heard.until(ProgramEnded)
        assert ended.is_ok, [event.text for event in heard.events]
        assert pose.far() == pytest.approx(WAY_M, abs=0.03), "no step more than asked for"
    finally:
        runner.close()


def test_step_completes_a_paused_action(master, pepper, node) -> None:
    (robot,) = find_robots(node, LONG_S, expected=("Pepper",)).robots
    slowly = {"DISTANCE": number(0.4), "SPEED": number(SPEED_M_S)}
    walks = [block("robot_pepper_do_walk", ROBOT="Pepper", **slowly) for _ in range(2)]
    program = compile_behaviour(workspace(started(*walks)), (robot,), name="Walk")
    pose, heard = Pose(node), Heard()
    pose.until(lambda: bool(pose.seen), LONG_S)
    runner = Runner(heard)
    try:
        runner.start(program, [robot.source], master.address)
        pose.until(lambda: pose.far() > 0.05, LONG_S)
        runner.pause()
        heard.until(ProgramPaused)
        heard.events.clear()
        runner.step()
        pose.until(lambda: pose.far() > 0.39, LONG_S)
        heard.until(ProgramPaused)
        pose.until_still()
        before = pose.far()
        threading.Event().wait(0.5)  # the second block must wait for its own step
        assert pose.far() == pytest.approx(before, abs=0.002)
        assert before == pytest.approx(0.4, abs=0.03)
    finally:
        runner.close()
