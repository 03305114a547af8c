"""Tests of the fake clock: a wait ends even if its thread starts it after the clock was advanced."""

from __future__ import annotations

import threading

from app.clock import VirtualClock


def test_fake_clock_wait_ends_if_its_time_passed_before_the_wait_started(clock: VirtualClock) -> None:
    due = clock.now() + 0.5
    rest = due - clock.now()
    clock.advance(0.6)  # due time passes before the wait
    assert not clock.wait(threading.Event(), rest)
    assert clock.now() >= due
