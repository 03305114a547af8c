"""Frame rate control of plots: draw as often as the data moves, within a share of a processor core."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

DRAW_INTERVAL_TICKS = (2, 8)
"""Minimum and maximum interval between drawings, in ticks at 30 Hz."""
MAX_CPU_SHARE = 0.08
"""Maximum share of a processor core that drawing may use."""
AVERAGE_WEIGHT = 0.1
"""Weight of a new measurement in the moving average.

The average is necessary because thread clocks can have a resolution of only 16 ms.
"""


class TimedWidget(Protocol):
    """Widget that is painted some time after each drawing.

    Attributes:
        paint_time_s: Accumulated processor time of painting in s.
    """

    paint_time_s: float


class DrawThrottle:
    """Controller of the interval between drawings, which depends on their measured cost.

    Attributes:
        draw_time_s: Moving average of the cost of a drawing, as processor time in s.
    """

    def __init__(self) -> None:
        self.draw_time_s = 0.0
        self._last_paint_time_s = 0.0

    @contextmanager
    def measure(self, widget: TimedWidget) -> Iterator[None]:
        """Measure one drawing within a ``with`` block, and the painting since the previous drawing."""
        start_s = time.thread_time()
        yield
        self.add_sample(time.thread_time() - start_s + widget.paint_time_s - self._last_paint_time_s)
        self._last_paint_time_s = widget.paint_time_s

    def add_sample(self, seconds: float) -> None:
        """Add a measured cost to the moving average.

        Args:
            seconds: Processor time of drawing and painting in s.
        """
        self.draw_time_s += AVERAGE_WEIGHT * (seconds - self.draw_time_s)

    def interval_ticks(self, pixel_s: float) -> int:
        """Return the interval until the next drawing, in ticks at 30 Hz.

        The interval is limited to the range `DRAW_INTERVAL_TICKS`.

        Args:
            pixel_s: Time in s in which the data moves by one pixel, which is the minimum interval.
        """
        min_ticks, max_ticks = DRAW_INTERVAL_TICKS
        return round(min(max_ticks, max(min_ticks, pixel_s * 30, self.draw_time_s / MAX_CPU_SHARE * 30)))
