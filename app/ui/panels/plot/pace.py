"""Frame rate control of plots: redraw as often as data moves, within a share of a processor core."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

DRAW_INTERVAL_TICKS = (2, 8)
"""Minimum and maximum interval between drawings, in refreshes at 30 Hz."""
MAX_CPU_SHARE = 0.08
"""Maximum share of a processor core for drawing."""
AVERAGE_WEIGHT = 0.1
"""Weight of a new measurement in the moving average. Thread clocks can have a resolution of only 16 ms."""


class TimedWidget(Protocol):
    """Widget that is painted after drawing; `painted_s` accumulates its processor time in s."""

    painted_s: float


class DrawThrottle:
    """Measures the cost of drawing and computes the interval until the next drawing."""

    def __init__(self) -> None:
        self.drawing_s = 0.0
        self._painted_s = 0.0

    @contextmanager
    def measure(self, painted: TimedWidget) -> Iterator[None]:
        """Measure one drawing, including the painting since the last one."""
        began = time.thread_time()
        yield
        self.add_sample(time.thread_time() - began + painted.painted_s - self._painted_s)
        self._painted_s = painted.painted_s

    def add_sample(self, seconds: float) -> None:
        """Add a measurement of drawing and painting (processor time in s)."""
        self.drawing_s += AVERAGE_WEIGHT * (seconds - self.drawing_s)

    def interval_ticks(self, pixel_s: float) -> int:
        """Return the interval in refreshes: at least the time in which data moves by a pixel (`pixel_s`)."""
        least, most = DRAW_INTERVAL_TICKS
        return round(min(most, max(least, pixel_s * 30, self.drawing_s / MAX_CPU_SHARE * 30)))
