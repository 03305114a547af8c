"""How the clocks of two computers differ, and how surely that is known."""

from __future__ import annotations

import time
from dataclasses import dataclass

__all__ = [
    "NOT_COMPARED",
    "OFFSET_MAX_NS",
    "OWN_CLOCK",
    "SAME_CLOCK",
    "UNCERTAINTY_MAX_NS",
    "ClockDifference",
    "PublisherClock",
    "drift_ns",
    "is_clock",
]

OFFSET_MAX_NS = 2**62
"""No clock is wrong by more: 146 years."""
UNCERTAINTY_MAX_NS = 10_000_000_000
"""What is not known to ten seconds is not known."""
_DRIFT_PARTS = 20_000
"""Two clocks that nobody sets drift apart by one part of so many at most: 50 microseconds a second."""


def drift_ns(elapsed_ns: float) -> int:
    """How far two clocks may have drifted apart within so long."""
    return int(max(0.0, elapsed_ns)) // _DRIFT_PARTS


def is_clock(offset_ns: int, uncertainty_ns: int) -> bool:
    """Whether a clock can be so wrong, known so surely: what strangers tell may be any number."""
    return abs(offset_ns) <= OFFSET_MAX_NS and 0 <= uncertainty_ns <= UNCERTAINTY_MAX_NS


@dataclass(frozen=True)
class ClockDifference:
    """Add `add_ns` to a time of the other computer's clock, and it is one of this computer's.

    `uncertainty_ns` as of `known_at_ns` (`time.monotonic_ns`); None: both are the same clock.
    """

    add_ns: int
    uncertainty_ns: int
    known_at_ns: int | None = None

    def uncertainty_at(self, now_ns: int) -> int:
        """How surely it is known now: clocks drift."""
        if self.known_at_ns is None:
            return self.uncertainty_ns
        return self.uncertainty_ns + drift_ns(now_ns - self.known_at_ns)


SAME_CLOCK = ClockDifference(0, 0)


class PublisherClock:
    """The clock of one publisher as its subscriber knows it: `difference` changes while messages are kept."""

    __slots__ = ("difference",)

    def __init__(self, difference: ClockDifference | None = None) -> None:
        self.difference = difference
        """None: nobody has compared it with the clock of this computer."""

    def seconds(self) -> tuple[float, float] | None:
        """What to add to its times (s), and how surely that is known (s, to both sides); None: not known."""
        known = self.difference
        if known is None:
            return None
        return known.add_ns / 1e9, known.uncertainty_at(time.monotonic_ns()) / 1e9


NOT_COMPARED = PublisherClock()
"""For publishers whose back end compares no clocks. It stays as it is,"""
OWN_CLOCK = PublisherClock(SAME_CLOCK)
"""and so does this one, for publishers of this very computer."""
