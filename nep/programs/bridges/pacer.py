"""Pace: how many messages a second a route may carry, and a thread that calls when a turn has come."""

from __future__ import annotations

import heapq
import itertools
import threading
import time
from collections.abc import Callable

__all__ = ["Limit", "Pacer"]

_LATE = 0.1


class Limit:
    """`rate_hz` messages a second, evenly: what is late by a tenth of the time between two is caught up."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self.next_at = float("-inf")
        """When there is room for one more."""

    def has_room(self, now: float) -> bool:
        """Whether one may go now; it is taken as gone."""
        if now < self.next_at:
            return False
        self.next_at = max(self.next_at, now - _LATE * self._period_s) + self._period_s
        return True


class Pacer:
    """Calls functions at their time (monotonic, s) in a thread of its own, which the first one starts."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._order = itertools.count()
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_closed = False

    def call_at(self, due: float, call: Callable[[], None]) -> None:
        """Call it once, then. Never waits."""
        with self._changed:
            if self._is_closed:
                return
            heapq.heappush(self._due, (due, next(self._order), call))
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()
            self._changed.notify()

    def close(self, timeout_s: float = 2.0) -> None:
        """Call nothing any more."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._is_closed and (left := self._left_s()) != 0.0:
                    self._changed.wait(left)
                if self._is_closed:
                    return
                call = heapq.heappop(self._due)[2]
            call()

    def _left_s(self) -> float | None:
        return max(0.0, self._due[0][0] - time.monotonic()) if self._due else None
