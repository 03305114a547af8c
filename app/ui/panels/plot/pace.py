"""How often a plot that follows what comes is drawn: as it moves on, within a share of a processor core."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

DRAW_EVERY = (2, 8)
"""Refreshes of 30 a second: nothing is drawn more often than the first, or more seldom than the last."""
DRAWING_SHARE = 0.08
"""Drawings take no more of a processor core: where one takes long, there are fewer."""
MIXED = 0.1
"""What a drawing takes is a mean over ten or so: the clock of a thread can be as coarse as 16 ms."""


class Painted(Protocol):
    """What is painted after it was drawn; ``painted_s`` (s of processor time) counts up."""

    painted_s: float


class DrawingPace:
    """Learns what a drawing takes, and says after how many refreshes the next one comes."""

    def __init__(self) -> None:
        self.drawing_s = 0.0
        self._painted_s = 0.0

    @contextmanager
    def drawing(self, painted: Painted) -> Iterator[None]:
        """One drawing; what was painted of the one before counts, too."""
        began = time.thread_time()
        yield
        self.took(time.thread_time() - began + painted.painted_s - self._painted_s)
        self._painted_s = painted.painted_s

    def took(self, seconds: float) -> None:
        """One drawing with its painting took so long (s of processor time)."""
        self.drawing_s += MIXED * (seconds - self.drawing_s)

    def every(self, pixel_s: float) -> int:
        """After how many refreshes it is drawn again: not before it has moved on by a pixel (s) or so."""
        least, most = DRAW_EVERY
        return round(min(most, max(least, pixel_s * 30, self.drawing_s / DRAWING_SHARE * 30)))
