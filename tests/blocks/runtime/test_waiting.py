"""Tests of waiting for a busy robot, and of the error for a robot whose heartbeat stops."""

from __future__ import annotations

import time
from dataclasses import replace

from app.blocks.compiler.compiler import compile_behaviour
from tests.blocks.fakes import FakeLink, Play, until
from tests.blocks.samples import robot, say, started, text, workspace, write


def begin(link: FakeLink, beat_s: float | None = None) -> Play:
    pepper = replace(robot(), heartbeat_interval_s=beat_s)
    blocks = workspace(started(say("Hi") | {"id": "x"}, write(text("after"))))
    return Play(compile_behaviour(blocks, [pepper]), (pepper,), link).start()


class Queued(FakeLink):
    """Fake link whose robots accept an action and queue it behind a running one."""

    def invoke(self, robot: str, action: str, input: dict[str, object]):  # type: ignore[no-untyped-def, override]
        self.held.add(action)
        call = super().invoke(robot, action, input)
        call.state, call.waits_for = "accepted", ("look", "look")
        return call


def test_queued_action_shows_the_awaited_action_and_then_its_own_activity(monkeypatch) -> None:
    monkeypatch.setattr("app.robots.client.limits.ACTION_MARGIN_S", -29.5)  # time limit of 0.5 s
    link = Queued()
    run = begin(link)
    until(lambda: bool(link.calls))
    said = lambda: run.runtime.status_text.text(("x",))  # noqa: E731
    until(lambda: said() == "Pepper is waiting for “look”")
    begun = time.monotonic()
    until(lambda: time.monotonic() > begun + 0.7)  # longer than the time limit, which hasn't started
    assert not run.runtime.finished.is_set()
    link.calls[0].has_started = True
    link.calls[0].state = "running"
    until(lambda: said() == "Pepper says “Hi”")
    link.answer(link.calls[0], "succeeded")
    assert run.end().lines == ["after"]


def test_robot_whose_heartbeat_stops_is_an_error_at_the_block(monkeypatch) -> None:
    monkeypatch.setattr("app.robots.client.limits.MIN_SILENCE_S", 0.3)
    link = FakeLink()
    link.held = {"say"}
    run = begin(link, beat_s=0.05)
    until(lambda: bool(link.calls))
    heard_until = time.monotonic() + 0.8
    while time.monotonic() < heard_until:  # heartbeats arrive, so there is no error
        link.calls[0].last_reply_s = time.monotonic()
        assert not run.runtime.finished.wait(0.02)
    run.end(3.0)
    error = run.runtime.error
    assert error is not None
    assert (error.block, error.sentence) == (
        "x",
        "Pepper stopped responding. Start the virtual robot again.",
    )
    assert link.canceled == link.calls  # in case the robot responds again
