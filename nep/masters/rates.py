"""Message and byte rates from counters that are sampled at irregular intervals."""

from __future__ import annotations

from collections import deque

_WINDOW_S = 10.0
_MIN_MESSAGES = 10
_MIN_SPAN_S = 0.5


class TrafficMeter:
    """Calculator of messages and bytes per second from increasing counters.

    The window covers ten messages, but at most ten seconds, so that fast topics show changes
    immediately and the rates of slow topics don't flicker.
    """

    def __init__(self) -> None:
        self._samples: deque[tuple[float, int, int]] = deque()

    def add(self, now: float, count: int, size_bytes: int) -> None:
        """Add a sample of the counters at `now` (monotonic seconds)."""
        samples = self._samples
        if samples and count < samples[-1][1]:
            samples.clear()  # the counter was reset
        samples.append((now, count, size_bytes))
        while now - samples[0][0] > _WINDOW_S and len(samples) > 2:
            samples.popleft()

    def rates(self) -> tuple[float, float] | None:
        """Return (messages, bytes) per second, or None without two samples at least 0.5 s apart."""
        if not self._samples:
            return None
        end, end_count, end_bytes = self._samples[-1]
        result: tuple[float, float] | None = None
        for start, count, size_bytes in reversed(self._samples):
            span = end - start
            if span < _MIN_SPAN_S:
                continue
            result = (end_count - count) / span, (end_bytes - size_bytes) / span
            if end_count - count >= _MIN_MESSAGES:
                break
        return result
