"""Tests of the measured share of a CPU core that a program uses."""

from __future__ import annotations

import time

import pytest

from nep.system.cpu import CpuLoad


class Hand:
    """Fake clock and counter of CPU time that the test moves."""

    def __init__(self) -> None:
        self.now = 100.0
        self.used: float | None = 3.0

    def load(self) -> CpuLoad:
        return CpuLoad(lambda: self.used, lambda: self.now)


def test_cpu_share_is_unknown_at_the_first_reading_and_then_covers_the_last_interval() -> None:
    hand = Hand()
    load = hand.load()
    assert load.ratio() is None
    hand.now, hand.used = 101.0, 3.25
    assert load.ratio() == pytest.approx(0.25)
    hand.now, hand.used = 103.0, 6.25
    assert load.ratio() == pytest.approx(1.5)


def test_frequent_readings_repeat_the_last_cpu_share() -> None:
    hand = Hand()
    load = hand.load()
    load.ratio()
    hand.now, hand.used = 101.0, 3.5
    assert load.ratio() == pytest.approx(0.5)
    hand.now, hand.used = 101.1, 3.6
    assert load.ratio() == pytest.approx(0.5)
    hand.now, hand.used = 102.0, 3.8
    assert load.ratio() == pytest.approx(0.3)


def test_failed_reading_makes_the_cpu_share_unknown_until_two_new_readings() -> None:
    hand = Hand()
    load = hand.load()
    load.ratio()
    hand.now, hand.used = 101.0, None
    assert load.ratio() is None
    hand.now, hand.used = 102.0, 9.0
    assert load.ratio() is None
    hand.now, hand.used = 103.0, 9.5
    assert load.ratio() == pytest.approx(0.5)


def test_decreased_cpu_counter_gives_a_share_of_zero() -> None:
    hand = Hand()
    load = hand.load()
    load.ratio()
    hand.now, hand.used = 101.0, 1.0
    assert load.ratio() == 0.0


def test_cpu_share_of_this_process_is_measured() -> None:
    ticks = iter([0.0, 1.0])
    load = CpuLoad(clock=lambda: next(ticks))
    load.ratio()
    end = time.process_time() + 0.02
    while time.process_time() < end:  # 20 ms of CPU time, independent of other load
        pass
    found = load.ratio()
    assert found is not None
    assert found >= 0.02
