"""CPU usage of a process."""

from __future__ import annotations

import time
from collections.abc import Callable

_MIN_INTERVAL_S = 0.5


class CpuLoad:
    """Meter of CPU usage in cores: 1.0 means that one core was busy, 2.0 two cores.

    Args:
        used_s: Returns the CPU time used so far in seconds, or None if unknown. Default: CPU time of
            this process.
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
        """Return the average usage since the previous reading; None at the first reading or if unknown.

        A call within 0.5 s of the previous reading returns the same value.
        """
        now = self._clock()
        if self._last_reading is not None and now - self._last_reading[0] < _MIN_INTERVAL_S:
            return self._ratio
        used_s = self._used_s()
        if used_s is None:
            self._last_reading = self._ratio = None
            return None
        if self._last_reading is not None:
            previous_at, previous_used_s = self._last_reading
            self._ratio = max(0.0, used_s - previous_used_s) / (now - previous_at)
        self._last_reading = (now, used_s)
        return self._ratio
