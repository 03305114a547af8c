"""The clock of the tests: no span that a test lets pass is missed, whatever thread is late."""

from __future__ import annotations

import threading

from tests.robots.conftest import FakeClock


def test_a_span_that_passes_between_the_question_and_the_wait_has_passed(clock: FakeClock) -> None:
    due = clock.now() + 0.5
    rest = due - clock.now()
    clock.advance(0.6)  # the waiting thread had no turn yet
    assert not clock.wait(threading.Event(), rest)
    assert clock.now() >= due
