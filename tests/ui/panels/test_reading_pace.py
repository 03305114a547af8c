"""How often what a person reads may change."""

from __future__ import annotations

from app.ui.panels.inspector.pace import BURST, HZ, ReadingPace


def let_through(pace: ReadingPace, begin_s: float, seconds: float, hz: float = 30.0) -> int:
    """How many of so many a second came through."""
    return sum(pace.may(begin_s + turn / hz) for turn in range(round(seconds * hz)))


def test_first_updates_pass_in_a_burst_and_later_ones_are_throttled() -> None:
    pace = ReadingPace()
    assert [pace.may(100.0) for _turn in range(BURST + 1)] == [True] * BURST + [False]
    assert HZ * 10 - 2 <= let_through(pace, 100.0, 10.0) <= HZ * 10 + 2
    assert [pace.may(200.0) for _turn in range(BURST + 1)] == [True] * BURST + [False]  # after a pause


def test_throttle_can_be_reset_and_external_updates_count() -> None:
    pace = ReadingPace(burst=1, hz=5.0)
    assert pace.may(1.0)
    assert not pace.may(1.1)
    pace.begin_anew()
    assert pace.may(1.1)
    pace.spend(9.0)
    assert not pace.may(9.1)
    assert pace.may(9.21)


def test_clock_set_back_does_not_bypass_the_throttle() -> None:
    pace = ReadingPace(burst=1)
    assert pace.may(50.0)
    assert not pace.may(10.0)
    assert pace.may(10.2)
