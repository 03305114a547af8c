"""Load: how much of a processor core a program uses, from its own clock of work."""

from __future__ import annotations

import time
from collections.abc import Callable

__all__ = ["CpuLoad"]

_SHORTEST_S = 0.5


class CpuLoad:
    """The share of one core that a program used between two readings: 1.0 is a whole core, 2.0 are two.

    `used_s` tells the seconds of work so far, None when nobody knows (default: this process's own);
    `clock` is monotonic, in seconds.
    """

    def __init__(
        self,
        used_s: Callable[[], float | None] = time.process_time,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._used_s = used_s
        self._clock = clock
        self._before: tuple[float, float] | None = None
        self._ratio: float | None = None

    def ratio(self) -> float | None:
        """Since the reading before; the same again within half a second. None before there are two."""
        now = self._clock()
        if self._before is not None and now - self._before[0] < _SHORTEST_S:
            return self._ratio
        used = self._used_s()
        if used is None:
            self._before = self._ratio = None
            return None
        if self._before is not None:
            then, before = self._before
            self._ratio = max(0.0, used - before) / (now - then)
        self._before = (now, used)
        return self._ratio
