"""Offset between the clocks of two computers, with its uncertainty."""

from __future__ import annotations

import time
from dataclasses import dataclass

MAX_OFFSET_NS = 2**62
"""Maximum plausible clock offset in nanoseconds: 146 years."""
MAX_UNCERTAINTY_NS = 10_000_000_000
"""Maximum uncertainty in nanoseconds with which an offset is still useful."""
_DRIFT_DIVISOR = 20_000
"""Reciprocal of the maximum drift between two clocks that aren't synchronized: 50 µs per second."""


def drift_ns(elapsed_ns: float) -> int:
    """Return the maximum drift in nanoseconds of two clocks within `elapsed_ns`."""
    return int(max(0.0, elapsed_ns)) // _DRIFT_DIVISOR


def is_plausible_clock(offset_ns: int, uncertainty_ns: int) -> bool:
    """Return True if an offset and uncertainty are plausible. Untrusted peers may send any number."""
    return abs(offset_ns) <= MAX_OFFSET_NS and 0 <= uncertainty_ns <= MAX_UNCERTAINTY_NS


@dataclass(frozen=True)
class ClockDifference:
    """Difference between the clock of another computer and this one.

    Attributes:
        offset_ns: Nanoseconds to add to a time of the other computer to get a time of this computer.
        uncertainty_ns: Uncertainty at the time `measured_at_ns`.
        measured_at_ns: Time of the comparison (`time.monotonic_ns`), or None if both computers are the
            same.
    """

    offset_ns: int
    uncertainty_ns: int
    measured_at_ns: int | None = None

    def uncertainty_at(self, now_ns: int) -> int:
        """Return the uncertainty in nanoseconds at `now_ns`. It grows with the drift of the clocks."""
        if self.measured_at_ns is None:
            return self.uncertainty_ns
        return self.uncertainty_ns + drift_ns(now_ns - self.measured_at_ns)


SAME_CLOCK = ClockDifference(0, 0)


class PublisherClock:
    """Clock of a publisher. `difference` is updated while messages refer to this object."""

    __slots__ = ("difference",)

    def __init__(self, difference: ClockDifference | None = None) -> None:
        self.difference = difference
        """Difference to this computer's clock, or None if unknown."""

    def difference_s(self) -> tuple[float, float] | None:
        """Return (offset, uncertainty) of the clock in seconds, or None if unknown.

        The offset is to be added to a time of the publisher; the error is at most the uncertainty in
        either direction.
        """
        difference = self.difference
        if difference is None:
            return None
        return difference.offset_ns / 1e9, difference.uncertainty_at(time.monotonic_ns()) / 1e9


UNKNOWN_CLOCK = PublisherClock()
"""Clock of publishers whose back end doesn't compare clocks. Immutable."""
OWN_CLOCK = PublisherClock(SAME_CLOCK)
"""Clock of publishers on this computer. Immutable."""
