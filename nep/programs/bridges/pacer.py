"""Rate limit and timer thread for the routes of a bridge."""

from __future__ import annotations

import heapq
import itertools
import threading
import time
from collections.abc import Callable

_MAX_CATCH_UP_PERIODS = 0.1


class RateLimit:
    """Rate limit with evenly spaced slots.

    A message that is late by up to a tenth of the period does not delay the next slot.

    Args:
        rate_hz: Maximum number of messages per second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self.next_at = float("-inf")
        """Time of the next free slot."""

    def try_acquire(self, now: float) -> bool:
        """Take the next slot and return True, or return False if it is too early."""
        if now < self.next_at:
            return False
        self.next_at = max(self.next_at, now - _MAX_CATCH_UP_PERIODS * self._period_s) + self._period_s
        return True


class Pacer:
    """Timer thread that calls functions at given times (monotonic, s).

    The thread starts with the first `call_at`.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._call_numbers = itertools.count()
        self._scheduled_calls: list[tuple[float, int, Callable[[], None]]] = []
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_closed = False

    def call_at(self, due: float, callback: Callable[[], None]) -> None:
        """Schedule a call without blocking. Does nothing after `close`.

        Args:
            due: Time of the call (monotonic, s).
            callback: Function to call in the timer thread.
        """
        with self._changed:
            if self._is_closed:
                return
            heapq.heappush(self._scheduled_calls, (due, next(self._call_numbers), callback))
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()
            self._changed.notify()

    def close(self, timeout_s: float = 2.0) -> None:
        """Stop the thread and discard pending calls.

        Args:
            timeout_s: Maximum time in seconds to wait for the thread.
        """
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._is_closed and (remaining_s := self._remaining_s()) != 0.0:
                    self._changed.wait(remaining_s)
                if self._is_closed:
                    return
                callback = heapq.heappop(self._scheduled_calls)[2]
            callback()

    def _remaining_s(self) -> float | None:
        return max(0.0, self._scheduled_calls[0][0] - time.monotonic()) if self._scheduled_calls else None
