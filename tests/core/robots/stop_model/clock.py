"""Virtual time for the threads of the code under test."""

from __future__ import annotations

import heapq
import itertools
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field

SETTLE_LIMIT_S = 30.0
"""Real time in seconds after which a simulation is assumed to be deadlocked."""
_END = float("inf")
_MIN_S = 1e-6
_LOOK_S = 0.0005  # real seconds between checks that all threads are idle
_AFTER_END_S = 0.05  # real seconds, to keep closing threads from spinning


def _never() -> bool:
    return False


@dataclass(eq=False)
class _Waiter:
    thread: threading.Thread
    deadline: float
    is_ready: Callable[[], bool]
    wake: Callable[[], None]
    is_frozen: Callable[[], bool]


@dataclass(order=True)
class _Timer:
    due: float
    number: int
    call: Callable[[], None] = field(compare=False)


class SimulatedClock:
    """Virtual clock that advances only in `advance`, and only while every simulated thread waits.

    A thread is simulated when its name begins with one of the prefixes given to `follow`.
    """

    def __init__(self) -> None:
        self._now = 1000.0
        self._changed = threading.Condition()
        self._waiters: dict[int, _Waiter] = {}
        self._timers: list[_Timer] = []
        self._numbers = itertools.count()
        self._prefixes: list[str] = []
        self._has_ended = False

    def now(self) -> float:
        return self._now

    def follow(self, prefix: str) -> None:
        if prefix not in self._prefixes:
            self._prefixes.append(prefix)

    def call_at(self, due: float, call: Callable[[], None]) -> None:
        """Schedule a call in the thread of `advance` at the virtual time `due`."""
        heapq.heappush(self._timers, _Timer(due, next(self._numbers), call))

    def end(self) -> None:
        """End the simulation: pending waits return soon, and every deadline has passed."""
        with self._changed:
            self._has_ended = True
            self._now += 1e6
        self.wake_all()

    def join(self) -> None:
        """Join every simulated thread after `end`."""
        for thread in self._simulated():
            thread.join(SETTLE_LIMIT_S)
            assert not thread.is_alive(), self._where()

    # -- waiting, in the threads of the code under test

    def wait(
        self, event: threading.Event, timeout_s: float | None, is_frozen: Callable[[], bool] = _never
    ) -> bool:
        """Wait for the event; return True if it is set, or False after the timeout.

        Same interface as `app.clock.Clock`. While `is_frozen` returns true, neither ends
        the wait, because the process is halted.
        """
        condition = event._cond  # type: ignore[attr-defined]  # the only way to wake one wait without setting it

        def wake() -> None:
            with condition:
                condition.notify_all()

        return self._wait(event.is_set, condition, timeout_s, wake, is_frozen)

    def condition(self) -> SimulatedCondition:
        return SimulatedCondition(self)

    def _wait(
        self,
        is_ready: Callable[[], bool],
        condition: threading.Condition,
        timeout_s: float | None,
        wake: Callable[[], None],
        is_frozen: Callable[[], bool] = _never,
        *,
        is_held: bool = False,
    ) -> bool:
        # Rounded up: a timeout too small to change the time would never expire.
        deadline = _END if timeout_s is None else self._now + max(_MIN_S, timeout_s)
        me = threading.current_thread()
        waiter = _Waiter(me, deadline, is_ready, wake, is_frozen)
        if not is_held:
            condition.acquire()
        try:
            if self._has_ended and not is_ready():
                condition.wait(_AFTER_END_S)
            while True:
                ready = is_ready()
                with self._changed:  # the test changes the state before it notifies waiting threads
                    is_over = not is_frozen() and (ready or self._now >= deadline)
                    if self._has_ended or is_over:
                        break
                    self._waiters[id(waiter)] = waiter
                    self._changed.notify_all()
                condition.wait()
                with self._changed:
                    self._waiters.pop(id(waiter), None)
            return is_ready()
        finally:
            with self._changed:
                self._waiters.pop(id(waiter), None)
            if not is_held:
                condition.release()

    # -- time, in the thread of the test

    def wake_all(self) -> None:
        """Wake every waiting thread to check its condition again, as after its process resumed."""
        with self._changed:
            waiters = list(self._waiters.values())
        for waiter in waiters:
            waiter.wake()

    def settle(self) -> None:
        """Block until every simulated thread waits for an event that has not occurred."""
        limit = time.monotonic() + SETTLE_LIMIT_S
        while not self._is_settled():
            if time.monotonic() > limit:
                raise AssertionError(f"threads do not come to rest: {self._where()}")
            with self._changed:
                self._changed.wait(_LOOK_S)

    def _where(self) -> str:
        frames = sys._current_frames()
        stacks = [(each.name, frames.get(each.ident or 0)) for each in self._simulated()]
        return "\n".join(f"{name}:\n{''.join(traceback.format_stack(frame))}" for name, frame in stacks)

    def _simulated(self) -> list[threading.Thread]:
        prefixes = tuple(self._prefixes)
        return [thread for thread in threading.enumerate() if thread.name.startswith(prefixes)]

    def _is_settled(self) -> bool:
        with self._changed:
            waiters = list(self._waiters.values())
        awake = [each for each in waiters if not each.is_frozen()]
        if any(each.deadline <= self._now or each.is_ready() for each in awake):
            return False
        resting = {each.thread for each in waiters}
        return all(thread in resting for thread in self._simulated())

    def next_due(self) -> float:
        """Return the virtual time at which the next thread or timer is due."""
        with self._changed:
            due = [each.deadline for each in self._waiters.values() if not each.is_frozen()]
        return min([*due, *(timer.due for timer in self._timers[:1])], default=_END)

    def move_to(self, now: float) -> None:
        """Set the virtual time; wake the threads and call the timers that are due."""
        with self._changed:
            self._now = max(self._now, now)
            due = [each for each in self._waiters.values() if each.deadline <= self._now]
        for waiter in due:
            waiter.wake()
        while self._timers and self._timers[0].due <= self._now:
            heapq.heappop(self._timers).call()


class SimulatedCondition(threading.Condition):
    """Condition whose waits take virtual time."""

    def __init__(self, clock: SimulatedClock) -> None:
        super().__init__()
        self._clock = clock

    def wait_for(self, predicate: Callable[[], object], timeout: float | None = None) -> bool:
        def wake() -> None:
            with self:
                self.notify_all()

        return self._clock._wait(lambda: bool(predicate()), self, timeout, wake, is_held=True)
