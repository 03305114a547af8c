"""Offset between the clocks of two computers, and its uncertainty."""

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
"""Maximum plausible offset of a clock: 146 years."""
UNCERTAINTY_MAX_NS = 10_000_000_000
"""Maximum useful uncertainty of an offset."""
_DRIFT_DIVISOR = 20_000
"""Reciprocal of the maximum drift between two free-running clocks: 50 µs per second."""


def drift_ns(elapsed_ns: float) -> int:
    """Return the maximum drift of two clocks within a time."""
    return int(max(0.0, elapsed_ns)) // _DRIFT_DIVISOR


def is_clock(offset_ns: int, uncertainty_ns: int) -> bool:
    """Return True for a plausible offset and uncertainty; untrusted peers may send any number."""
    return abs(offset_ns) <= OFFSET_MAX_NS and 0 <= uncertainty_ns <= UNCERTAINTY_MAX_NS


@dataclass(frozen=True)
class ClockDifference:
    """Difference between the clock of another computer and this one.

    Attributes:
        add_ns: Added to a time of the other computer, it gives a time of this computer.
        uncertainty_ns: Uncertainty at the time `known_at_ns`.
        known_at_ns: Time of the comparison (`time.monotonic_ns`), or None for one and the same clock.
    """

    add_ns: int
    uncertainty_ns: int
    known_at_ns: int | None = None

    def uncertainty_at(self, now_ns: int) -> int:
        """Return the uncertainty at a time: it grows with the drift of the clocks."""
        if self.known_at_ns is None:
            return self.uncertainty_ns
        return self.uncertainty_ns + drift_ns(now_ns - self.known_at_ns)


SAME_CLOCK = ClockDifference(0, 0)


class PublisherClock:
    """Clock of one publisher; `difference` is updated while messages refer to it."""

    __slots__ = ("difference",)

    def __init__(self, difference: ClockDifference | None = None) -> None:
        self.difference = difference
        """Difference to this computer's clock, or None if it is unknown."""

    def seconds(self) -> tuple[float, float] | None:
        """Return the offset to add to its times and its uncertainty (±), in seconds; None if unknown."""
        known = self.difference
        if known is None:
            return None
        return known.add_ns / 1e9, known.uncertainty_at(time.monotonic_ns()) / 1e9


NOT_COMPARED = PublisherClock()
"""Clock of publishers whose back end does not compare clocks. Immutable."""
OWN_CLOCK = PublisherClock(SAME_CLOCK)
"""Clock of publishers on this computer. Immutable."""
