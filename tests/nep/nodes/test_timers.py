"""Tests of timers with a fake clock: when they are due, and how long spin waits for them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

import nep
from nep.nodes.timer import Timer, next_due


class Clock:
    """Fake clock that the test advances; times in seconds."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Waiting:
    """Wrapper of a node's transport that advances the fake clock instead of waiting."""

    def __init__(self, real: Any, clock: Clock) -> None:
        self._real = real
        self._clock = clock
        self.waits: list[float] = []

    def wait(self, _subscribers: object, timeout_s: float) -> None:
        self.waits.append(timeout_s)
        self._clock.now += timeout_s

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def node(clock: Clock) -> Iterator[nep.Node]:
    with nep.node("timers", "memory", master="timers") as made:
        made._work.clock = clock
        made._work.transport = Waiting(made._transport, clock)  # type: ignore[assignment]
        yield made


def test_late_timer_fires_once_and_keeps_its_schedule(clock: Clock) -> None:
    calls: list[float] = []
    timer = Timer(0.5, lambda: calls.append(clock.now), clock)
    assert not timer.run_if_due()
    clock.now = 103.25
    assert [timer.run_if_due(), timer.run_if_due()] == [True, False]
    assert (calls, timer.due) == ([103.25], 103.5)
    clock.now = 103.5
    assert timer.run_if_due()
    assert timer.due == 104.0


def test_timer_fires_once_per_period_with_two_spinning_threads() -> None:
    both = threading.Barrier(2)
    calls: list[int] = []
    now = 0.0

    def clock() -> float:
        """Return the time; both threads read it before either checks whether the timer is due."""
        if threading.current_thread() is not threading.main_thread():
            both.wait(30.0)
        return now

    timer = Timer(1.0, lambda: calls.append(1), clock)

    for _ in range(2):
        now += 1.0
        threads = [threading.Thread(target=timer.run_if_due) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30.0)
    assert len(calls) == 2


def test_next_due_time_is_that_of_the_earliest_timer() -> None:
    clock = Clock()
    assert next_due([Timer(2.0, print, clock), Timer(0.5, print, clock)]) == 100.5
    assert next_due([]) == float("inf")


def test_spin_waits_until_the_next_timer(node: nep.Node, clock: Clock) -> None:
    calls: list[float] = []
    node.new_timer(0.03125, lambda: calls.append(clock.now))
    node.spin(0.125)
    assert calls == [100.03125, 100.0625, 100.09375]
    assert node._work.transport.waits == [0.03125] * 4  # type: ignore[attr-defined]


def test_slow_callback_delays_a_timer_without_extra_calls(node: nep.Node, clock: Clock) -> None:
    calls: list[str] = []

    def slow() -> None:
        calls.append("slow")
        clock.now += 10.0

    node.new_timer(1.0, slow)
    node.new_timer(0.5, lambda: calls.append("quick"))
    node.spin(11.0)
    assert calls == ["quick", "slow", "quick"]


def test_timer_exception_propagates_from_spin_and_timer_stays_scheduled(node: nep.Node, clock: Clock) -> None:
    def fail() -> None:
        raise ZeroDivisionError

    timer = node.new_timer(0.5, fail)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            node.spin(10.0)
    assert (clock.now, timer.due) == (101.0, 101.5)


def test_timer_cancelled_by_another_timer_does_not_fire(node: nep.Node) -> None:
    calls: list[str] = []

    def first() -> None:
        calls.append("first")
        second.cancel()
        second.cancel()

    node.new_timer(0.5, first)
    second = node.new_timer(0.5, lambda: calls.append("second"))
    node.spin(0.75)
    assert calls == ["first"]


def test_no_callback_runs_after_a_timer_stops_spin(node: nep.Node) -> None:
    got: list[object] = []
    node.new_callback("t", "json", got.append)
    pub = node.new_pub("t")

    def stop() -> None:
        pub.publish(1)
        node.stop_spin()

    node.new_timer(0.5, stop)
    node.spin(10.0)
    assert got == []


def test_timer_that_is_always_due_does_not_starve_callbacks(node: nep.Node) -> None:
    got: list[object] = []

    def callback(payload: object) -> None:
        got.append(payload)
        if len(got) == 3:
            node.stop_spin()

    node.new_callback("t", "json", callback)
    pub = node.new_pub("t")
    for n in range(3):
        pub.publish(n)
    node.new_timer(1e-320, lambda: None)
    node.spin()
    assert got == [0, 1, 2]
