"""Clocks: the current time and waits for it, in real or virtual time.

Code that waits takes a `Clock`, and code that starts threads a `ThreadClock`, so that tests and rehearsals
can run the same code in virtual time.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Protocol

_POLL_INTERVAL_S = 0.001  # real time between checks of an event that isn't made by the clock


class Clock(Protocol):
    """Monotonic clock and the waits on it. Thread-safe."""

    def now(self) -> float:
        """Return the monotonic time in seconds."""
        ...

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait until the event is set; return False on timeout.

        Args:
            event: Event to wait for.
            timeout_s: Timeout in seconds; None for no limit.
        """
        ...


class ThreadClock(Clock, Protocol):
    """Clock that also starts the threads that wait on it."""

    def event(self) -> threading.Event:
        """Return a new event. In virtual time, waiting for it needs no polling."""
        ...

    def start_thread(self, target: Callable[[], object], name: str) -> threading.Thread:
        """Start a daemon thread and return it. Virtual time stands still while it works.

        Args:
            target: Function that the thread calls.
            name: Name of the thread.
        """
        ...

    def hold(self) -> AbstractContextManager[None]:
        """Return a context manager in which virtual time doesn't advance by itself."""
        ...


def poll(clock: ThreadClock, condition: Callable[[], bool], timeout_s: float, interval_s: float) -> bool:
    """Poll a condition until it is true; return False on timeout.

    Args:
        clock: Clock of the waits.
        condition: Condition.
        timeout_s: Timeout in seconds.
        interval_s: Interval in seconds between two polls.
    """
    deadline_s, never_set = clock.now() + timeout_s, clock.event()
    while not condition():
        if clock.now() >= deadline_s:
            return False
        clock.wait(never_set, interval_s)
    return True


class MonotonicClock:
    """Monotonic clock of the computer."""

    def now(self) -> float:
        """Return the monotonic time in seconds."""
        return time.monotonic()

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait until the event is set; return False on timeout."""
        return event.wait(timeout_s)

    def event(self) -> threading.Event:
        """Return a new event."""
        return threading.Event()

    def start_thread(self, target: Callable[[], object], name: str) -> threading.Thread:
        """Start a daemon thread and return it."""
        thread = threading.Thread(target=target, name=name, daemon=True)
        thread.start()
        return thread

    def hold(self) -> AbstractContextManager[None]:
        """Return a context manager without effect."""
        return nullcontext()


class _Waiter:
    """Wait of one thread."""

    def __init__(self, event: threading.Event, deadline_s: float | None, thread_number: int) -> None:
        self.event, self.deadline_s, self.thread_number = event, deadline_s, thread_number
        self.released = threading.Lock()
        self.released.acquire()


class _VirtualEvent(threading.Event):
    """Event that tells its clock when it is set."""

    def __init__(self, on_set: Callable[[threading.Event], None]) -> None:
        super().__init__()
        self._on_set = on_set

    def set(self) -> None:
        super().set()
        self._on_set(self)


class VirtualClock:
    """Clock of simulated time.

    While every thread started with `start_thread` waits, time advances to the next deadline, and the threads
    whose waits end at the same time continue one after the other, in the order of their start. The same
    program therefore runs in the same order and at the same times whenever it is run.

    Args:
        start_s: First time in seconds.
        advances_alone: False for time that only advances by `advance`.
    """

    def __init__(self, start_s: float = 100.0, *, advances_alone: bool = True) -> None:
        self._now, self._advances_alone = start_s, advances_alone
        self._lock = threading.Lock()
        self._working_count = 0  # threads of this clock that don't wait, and holds
        self._waiters: list[_Waiter] = []
        self._thread_numbers = itertools.count(1)
        self._local = threading.local()

    def now(self) -> float:
        """Return the virtual time in seconds."""
        # A thread reads the time and then waits for the rest: `advance` may come in between.
        self._local.read_s = self._now
        return self._now

    def advance(self, seconds: float) -> None:
        """Advance the time and end the waits whose time has come.

        Args:
            seconds: Duration in seconds.
        """
        with self._lock:
            self._now += seconds
            for waiter in self._due_waiters_locked():
                self._release_locked(waiter)

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait until the event is set; return False on timeout, in seconds of virtual time."""
        began_s = self._local.__dict__.pop("read_s", self._now)
        deadline_s = None if timeout_s is None else began_s + timeout_s
        waiter = _Waiter(event, deadline_s, self._thread_number)
        with self._lock:
            if event.is_set() or (deadline_s is not None and deadline_s <= self._now):
                return event.is_set()
            self._waiters.append(waiter)
            if waiter.thread_number:
                self._end_work_locked()
        if isinstance(event, _VirtualEvent):
            waiter.released.acquire()
        else:
            while not waiter.released.acquire(timeout=_POLL_INTERVAL_S):
                if event.is_set():
                    with self._lock:
                        self._release_locked(waiter)
        return event.is_set()

    def event(self) -> threading.Event:
        """Return a new event."""
        return _VirtualEvent(self._on_set)

    def start_thread(self, target: Callable[[], object], name: str) -> threading.Thread:
        """Start a daemon thread, during whose work time stands still, and return it."""
        number = next(self._thread_numbers)

        def run() -> None:
            self._local.number = number
            try:
                target()
            finally:
                with self._lock:
                    self._end_work_locked()

        thread = threading.Thread(target=run, name=name, daemon=True)
        with self._lock:
            self._working_count += 1
        try:
            thread.start()
        except BaseException:
            with self._lock:
                self._end_work_locked()
            raise
        return thread

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Return a context manager in which time doesn't advance by itself."""
        with self._lock:
            self._working_count += 1
        try:
            yield
        finally:
            with self._lock:
                self._end_work_locked()

    @property
    def _thread_number(self) -> int:
        # 0 for threads that weren't started by this clock.
        return int(getattr(self._local, "number", 0))

    def _on_set(self, event: threading.Event) -> None:
        with self._lock:
            for waiter in [each for each in self._waiters if each.event is event]:
                self._release_locked(waiter)

    def _end_work_locked(self) -> None:
        self._working_count -= 1
        while self._working_count == 0 and self._advances_alone and self._waiters:
            # Events of other origin may have been set without the clock's knowledge.
            ready = next((each for each in self._waiters if each.event.is_set()), None)
            if ready is None:
                deadlines_s = [each.deadline_s for each in self._waiters if each.deadline_s is not None]
                if not deadlines_s:
                    return
                self._now = max(self._now, min(deadlines_s))
                ready = self._due_waiters_locked()[0]
            self._release_locked(ready)

    def _due_waiters_locked(self) -> list[_Waiter]:
        due = [
            (each.deadline_s, each.thread_number, index, each)
            for index, each in enumerate(self._waiters)
            if each.deadline_s is not None and each.deadline_s <= self._now
        ]
        return [each for *_order, each in sorted(due)]

    def _release_locked(self, waiter: _Waiter) -> None:
        if waiter in self._waiters:
            self._waiters.remove(waiter)
            if waiter.thread_number:
                self._working_count += 1
            waiter.released.release()
