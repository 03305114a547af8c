"""Rates from counters that are read now and then."""

from __future__ import annotations

from collections import deque

__all__ = ["Meter"]

_WINDOW_S = 10.0
_ENOUGH = 10
_SHORTEST_S = 0.5


class Meter:
    """Messages and bytes a second, from counts that only grow.

    The window is as short as holds ten messages, ten seconds at most: fast topics show changes at once, slow
    ones do not flicker between 0 and 1.
    """

    def __init__(self) -> None:
        self._samples: deque[tuple[float, int, int]] = deque()

    def add(self, now: float, count: int, size_bytes: int) -> None:
        """The counters stood so at `now` (seconds, monotonic)."""
        samples = self._samples
        if samples and count < samples[-1][1]:
            samples.clear()  # the counter began anew
        samples.append((now, count, size_bytes))
        while now - samples[0][0] > _WINDOW_S and len(samples) > 2:
            samples.popleft()

    def rates(self) -> tuple[float, float] | None:
        """(messages a second, bytes a second); None before there are two readings half a second apart."""
        if not self._samples:
            return None
        end, end_count, end_bytes = self._samples[-1]
        found: tuple[float, float] | None = None
        for start, count, size_bytes in reversed(self._samples):
            span = end - start
            if span < _SHORTEST_S:
                continue
            found = (end_count - count) / span, (end_bytes - size_bytes) / span
            if end_count - count >= _ENOUGH:
                break
        return found
