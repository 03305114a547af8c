"""Tests of waiting for a busy robot, and of the error for a robot whose heartbeat stops."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime import robot_handle
from app.clock import VirtualClock
from app.robots.client.limits import MIN_SILENCE_S
from tests.blocks.fakes import FakeLink, Play, until
from tests.blocks.samples import robot, say, started, text, workspace, write


def begin(link: FakeLink, clock: VirtualClock, beat_s: float | None = None) -> Play:
    pepper = replace(robot(), heartbeat_interval_s=beat_s)
    blocks = workspace(started(say("Hi") | {"id": "x"}, write(text("after"))))
    return Play(compile_behaviour(blocks, [pepper]), (pepper,), link, clock=clock).start()


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock(advances_alone=False)


@pytest.fixture
def checked_s(clock: VirtualClock, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Times at which the program has checked whether its robot is silent."""
    times_s: list[float] = []
    is_silent = robot_handle.is_silent

    def recorded(*arguments: object) -> bool:
        times_s.append(clock.now())
        return is_silent(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(robot_handle, "is_silent", recorded)
    return times_s


def advance_until(clock: VirtualClock, ready: Callable[[], bool]) -> None:
    """Advance the time in small steps, because the program may still be about to wait."""

    def advanced() -> bool:
        clock.advance(0.02)
        return ready()

    until(advanced)


class Queued(FakeLink):
    """Fake link whose robots accept an action and queue it behind a running one."""

    def invoke(self, robot: str, action: str, input: dict[str, object]):  # type: ignore[no-untyped-def, override]
        self.held.add(action)
        call = super().invoke(robot, action, input)
        call.state, call.waits_for = "accepted", ("look", "look")
        return call


def test_queued_action_shows_the_awaited_action_and_then_its_own_activity(
    clock: VirtualClock, checked_s: list[float]
) -> None:
    link = Queued()
    run = begin(link, clock)
    until(lambda: bool(link.calls))
    said = lambda: run.runtime.status_text.text(("x",))  # noqa: E731
    until(lambda: said() == "Pepper is waiting for “look”")
    for _ in range(3):  # longer than the time limit of 30 s, which hasn't started
        count = len(checked_s)
        clock.advance(20.0)
        advance_until(clock, lambda count=count: len(checked_s) > count)  # type: ignore[misc]
    assert not run.runtime.finished.is_set()
    link.calls[0].has_started = True
    link.calls[0].state = "running"
    advance_until(clock, lambda: said() == "Pepper says “Hi”")
    link.answer(link.calls[0], "succeeded")
    assert run.end().lines == ["after"]


def test_robot_whose_heartbeat_stops_is_an_error_at_the_block(
    clock: VirtualClock, checked_s: list[float]
) -> None:
    link = FakeLink()
    link.held = {"say"}
    run = begin(link, clock, beat_s=0.05)
    until(lambda: bool(link.calls))

    def is_long_heard() -> bool:
        link.calls[0].last_reply_s = clock.now()
        return bool(checked_s) and checked_s[-1] - checked_s[0] > 2 * MIN_SILENCE_S

    advance_until(clock, is_long_heard)
    assert not run.runtime.finished.is_set()  # heartbeats arrive, so there is no error
    advance_until(clock, run.runtime.finished.is_set)
    run.end()
    error = run.runtime.error
    assert error is not None
    assert (error.block, error.sentence) == (
        "x",
        "Pepper stopped responding. Start the virtual robot again.",
    )
    assert link.canceled == link.calls  # in case the robot responds again
