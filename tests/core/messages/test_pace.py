"""Tests of the limiter for updates of displayed text."""

from __future__ import annotations

from app.core.messages.pace import MAX_BURST, MAX_UPDATE_HZ, UpdateLimiter


def let_through(pace: UpdateLimiter, begin_s: float, seconds: float, hz: float = 30.0) -> int:
    """Return how many updates at ``hz`` pass the limiter within ``seconds``."""
    return sum(pace.try_acquire(begin_s + turn / hz) for turn in range(round(seconds * hz)))


def test_first_updates_pass_in_a_burst_and_later_updates_are_throttled() -> None:
    pace = UpdateLimiter()
    assert [pace.try_acquire(100.0) for _turn in range(MAX_BURST + 1)] == [True] * MAX_BURST + [False]
    assert MAX_UPDATE_HZ * 10 - 2 <= let_through(pace, 100.0, 10.0) <= MAX_UPDATE_HZ * 10 + 2
    assert [pace.try_acquire(200.0) for _turn in range(MAX_BURST + 1)] == [True] * MAX_BURST + [
        False
    ]  # the full burst after a pause


def test_throttle_can_be_reset_and_external_updates_count() -> None:
    pace = UpdateLimiter(burst=1, hz=5.0)
    assert pace.try_acquire(1.0)
    assert not pace.try_acquire(1.1)
    pace.reset()
    assert pace.try_acquire(1.1)
    pace.drain(9.0)
    assert not pace.try_acquire(9.1)
    assert pace.try_acquire(9.21)


def test_backward_clock_step_does_not_bypass_the_throttle() -> None:
    pace = UpdateLimiter(burst=1)
    assert pace.try_acquire(50.0)
    assert not pace.try_acquire(10.0)
    assert pace.try_acquire(10.2)
