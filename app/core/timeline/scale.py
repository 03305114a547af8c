"""Visible time range of a timeline: zooming, panning, and conversion between times and positions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite
from operator import index

MIN_SPAN_NS = 1_000_000


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Scale of a timeline. All times are integers in ns from any origin, such as 1970.

    Attributes:
        first_ns: Start of the contents.
        last_ns: End of the contents.
        start_ns: Start of the visible range.
        end_ns: End of the visible range.
    """

    first_ns: int
    last_ns: int
    start_ns: int
    end_ns: int

    @classmethod
    def full(cls, first_ns: int, last_ns: int) -> TimeScale:
        """Return the scale that shows the whole contents, or one millisecond if they are shorter.

        Raises:
            TypeError: A time isn't an integer.
        """
        first_ns = index(first_ns)
        last_ns = max(index(last_ns), first_ns + MIN_SPAN_NS)
        return cls(first_ns, last_ns, first_ns, last_ns)

    @property
    def span_ns(self) -> int:
        """Length of the visible range."""
        return self.end_ns - self.start_ns

    @property
    def is_full(self) -> bool:
        """True if the scale shows the whole contents."""
        return (self.start_ns, self.end_ns) == (self.first_ns, self.last_ns)

    def relative_position(self, at_ns: int) -> float:
        """Return the position of a time in the visible range: 0 at the left edge, 1 at the right edge."""
        return (at_ns - self.start_ns) / self.span_ns

    def time(self, position: float) -> int:
        """Return the time at a position, limited to the contents.

        Args:
            position: 0 at the left edge, 1 at the right edge.

        Raises:
            ValueError: The position isn't finite.
        """
        if not isfinite(position):
            raise ValueError(f"a position in a timeline must be finite, not {position}")
        at_ns = self.start_ns + round(position * self.span_ns)
        return max(self.first_ns, min(self.last_ns, at_ns))

    def zoomed(self, factor: float, at_ns: int) -> TimeScale:
        """Return a zoomed scale in which ``at_ns`` stays at the same position, unless an end is reached.

        Args:
            factor: Ratio of the new to the current visible range; above 1 zooms out.
            at_ns: Fixed time.

        Raises:
            ValueError: The factor isn't a positive, finite number.
        """
        if not (isfinite(factor) and factor > 0):
            raise ValueError(f"a zoom factor must be a positive number, not {factor}")
        total_span_ns = self.last_ns - self.first_ns
        span_ns = round(max(MIN_SPAN_NS, min(total_span_ns, self.span_ns * factor)))
        return self._with_start(at_ns - round(self.relative_position(at_ns) * span_ns), span_ns)

    def moved(self, by_ns: int) -> TimeScale:
        """Return the scale shifted by a duration in ns."""
        return self._with_start(self.start_ns + by_ns, self.span_ns)

    def with_time(self, at_ns: int) -> TimeScale:
        """Return the scale, shifted as far as necessary to make a time visible."""
        if self.start_ns <= at_ns <= self.end_ns:
            return self
        return self._with_start(at_ns - self.span_ns // 8, self.span_ns)

    def _with_start(self, begin_ns: int, span_ns: int) -> TimeScale:
        begin_ns = max(self.first_ns, min(begin_ns, self.last_ns - span_ns))
        return replace(self, start_ns=begin_ns, end_ns=begin_ns + span_ns)
