"""CPU usage of a process."""

from __future__ import annotations

import time
from collections.abc import Callable

__all__ = ["CpuLoad"]

_MIN_INTERVAL_S = 0.5


class CpuLoad:
    """Meter of CPU usage between two readings, in cores: 1.0 is one core, 2.0 are two.

    Args:
        used_s: Returns the CPU time so far in seconds, or None if unknown. Default: this process's.
        clock: Monotonic clock in seconds.
    """

    def __init__(
        self,
        used_s: Callable[[], float | None] = time.process_time,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._used_s = used_s
        self._clock = clock
        self._last_reading: tuple[float, float] | None = None
        self._ratio: float | None = None

    def ratio(self) -> float | None:
        """Return the usage since the last reading, or None at the first; cached for half a second."""
        now = self._clock()
        if self._last_reading is not None and now - self._last_reading[0] < _MIN_INTERVAL_S:
            return self._ratio
        used = self._used_s()
        if used is None:
            self._last_reading = self._ratio = None
            return None
        if self._last_reading is not None:
            then, before = self._last_reading
            self._ratio = max(0.0, used - before) / (now - then)
        self._last_reading = (now, used)
        return self._ratio
