"""Tests of programs with a virtual robot in virtual time: a minute of a behaviour without waiting."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nep
from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.network import Network
from app.blocks.runtime.runtime import CallStack, Runtime
from app.blocks.runtime.scheduler import Scheduler
from app.blocks.runtime.trace import AnyRecord, BlockBegan, BlockEnded
from app.clock import VirtualClock
from app.robots import simulated, turtle
from app.robots.driver.declare import Kind
from app.robots.driver.driver import Driver
from app.robots.virtual.motion import TURN_ACCELERATION
from tests.blocks.direct_network import DirectNetwork
from tests.blocks.samples import block, boolean, number, stack, started, text, workspace, write

LONG_S = 100.0  # real seconds; the programs take longer in virtual time
TURN_SPEED = 40.0  # °/s; default of the action
SNAP_S = 0.15  # a motion ends early, because it snaps to its target


@pytest.fixture(scope="module", autouse=True)
def _raised_recursion_limit() -> Iterator[None]:
    """Raise the recursion limit as a program does, because Hypothesis rejects a change during its test."""
    limit = sys.getrecursionlimit()
    CallStack(Scheduler()).raise_recursion_limit()
    yield
    sys.setrecursionlimit(limit)


class Rehearsal:
    """Program and virtual robot on one virtual clock, and a log of what the program wrote."""

    def __init__(self, kind: Kind, behaviour: Mapping[str, object]) -> None:
        self.clock, network = VirtualClock(0.0), DirectNetwork()
        self.driver = Driver(kind, "Robo", cast("nep.Node", network.node("Robo")), clock=self.clock)
        self.lines: list[tuple[float, str]] = []
        with self.clock.hold():
            self.driver.start()
            robots = (self.driver.robot,)
            program = compile_behaviour(behaviour, robots)
            self.runtime = Runtime(
                self._write, labels=program.labels, readings=program.readings, clock=self.clock
            )
            self.network = Network(
                network.node("program"),
                "program-1",
                robots,
                parts=(*program.sensors, *program.events),
                clock=self.clock,
            )
            exec(compile(program.runnable, "<behaviour>", "exec"), self.runtime.namespace())
            self.runtime.start(self.network, robots)

    def _write(self, line: str) -> None:
        self.lines.append((round(self.clock.now(), 3), line))

    def end(self) -> Sequence[AnyRecord]:
        """Wait until the program ends, and return its trace."""
        assert self.runtime.finished.wait(LONG_S)
        assert self.runtime.error is None
        return self.runtime.scheduler.take_trace()

    def close(self) -> None:
        self.runtime.scheduler.stop()
        self.network.close()
        self.driver.close()


@contextmanager
def rehearsed(kind: Kind, *scripts: Mapping[str, object]) -> Iterator[Rehearsal]:
    made = Rehearsal(kind, workspace(*scripts))
    try:
        yield made
    finally:
        made.close()


def wait(seconds: float, id: str | None = None) -> dict[str, object]:
    return block("control_wait", id, SECONDS=number(seconds))


def do(action: str, id: str | None = None, **values: object) -> dict[str, object]:
    return block(f"robot_pepper_do_{action}", id, ROBOT="Robo", **values)


def begun(records: Sequence[AnyRecord]) -> dict[str, float]:
    """Return the time at which each block began or the program ended."""
    times = {each.block: each.time_s for each in records if isinstance(each, BlockBegan)}
    times["end"] = next(each.time_s for each in reversed(records) if isinstance(each, BlockEnded))
    return times


def test_motions_waits_and_sensors_run_in_order_at_their_virtual_times() -> None:
    distance = block("robot_pepper_get_distance", ROBOT="Robo")
    scripts = (
        started(
            wait(20, "first"),
            do("walk", "walk", DISTANCE=number(0.6), SPEED=number(0.3)),
            write(distance) | {"id": "near"},
            wait(30, "second"),
            do("show_emotion", "smile", EMOTION="happy", SECONDS=number(10)),
            do("walk", "back", DISTANCE=number(-0.6), SPEED=number(0.3)),
            write(distance) | {"id": "far"},
            block("control_stop_program"),
        ),
        stack(
            block("robot_pepper_passes", ROBOT="Robo", SENSOR="distance", SIDE="below", LIMIT=0.6),
            write(text("close")),
        ),
    )
    runs = []
    for _ in range(2):
        with rehearsed(simulated.ROBOT, *scripts) as rehearsal:
            runs.append((begun(rehearsal.end()), rehearsal.lines))
    times, lines = runs[0]
    assert runs[1] == runs[0]
    assert times["walk"] == 20.0
    assert times["near"] == pytest.approx(20.0 + 0.6 / 0.3 + 0.3 / 0.5, abs=SNAP_S)
    assert times["smile"] == times["near"] + 30.0
    assert times["back"] == pytest.approx(times["smile"] + 10.0)
    (close_s, close), (_near_s, near), (_far_s, far) = lines
    assert close == "close"
    assert times["walk"] + 1.0 < close_s < times["near"]
    assert float(far) - float(near) == pytest.approx(0.6, abs=0.02)


def test_heartbeats_keep_a_robot_in_motion_until_the_program_ends_in_virtual_time() -> None:
    drive = block("robot_diffdrive_do_drive", "drive", ROBOT="Robo", SPEED=number(0.05), TURN=number(25))
    with rehearsed(turtle.ROBOT, started(drive, wait(20, "wait"))) as rehearsal:
        rehearsal.end()
        assert rehearsal.network.stop_robots() == ()
        body = rehearsal.driver.body
        assert isinstance(body, turtle.VirtualTurtle)
        assert body.wheels.is_still()
        assert body.wheels.driven_m() >= 0.05 * 19


def test_stop_ends_an_endless_rehearsal_and_its_robot_confirms_it() -> None:
    endless = block("control_while", CONDITION=boolean(True), BODY=[do("turn", ANGLE=number(360))])
    with rehearsed(simulated.ROBOT, started(endless)) as rehearsal:
        rehearsal.runtime.scheduler.stop()
        assert rehearsal.network.stop_robots() == ()


STEPS = st.one_of(
    st.tuples(st.just("wait"), st.integers(1, 12)),
    st.tuples(st.just("turn"), st.integers(20, 180)),
    st.tuples(st.just("smile"), st.integers(1, 12)),
)


def duration_s(step: tuple[str, int]) -> float:
    """Return the expected duration of a step, without the snap at the end of a motion."""
    kind, amount = step
    return amount / TURN_SPEED + TURN_SPEED / TURN_ACCELERATION if kind == "turn" else float(amount)


@settings(max_examples=5, deadline=None)
@given(st.lists(STEPS, min_size=1, max_size=5))
def test_random_behaviour_takes_the_virtual_time_of_its_steps(steps: list[tuple[str, int]]) -> None:
    blocks = {
        "wait": wait,
        "turn": lambda amount, id: do("turn", id, ANGLE=number(amount)),
        "smile": lambda amount, id: do("show_emotion", id, EMOTION="happy", SECONDS=number(amount)),
    }
    script = started(*(blocks[kind](amount, f"s{index}") for index, (kind, amount) in enumerate(steps)))
    with rehearsed(simulated.ROBOT, script) as rehearsal:
        times = begun(rehearsal.end())
    ends_s = [*(times[f"s{index}"] for index in range(1, len(steps))), times["end"]]
    now_s = 0.0
    for index, (step, end_s) in enumerate(zip(steps, ends_s, strict=True)):
        assert times[f"s{index}"] == pytest.approx(now_s)
        snap_s = SNAP_S if step[0] == "turn" else 1e-5
        assert end_s - now_s == pytest.approx(duration_s(step), abs=snap_s)
        now_s = end_s
