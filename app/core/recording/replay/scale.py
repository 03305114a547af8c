"""Visible time range of a timeline, and formatting of times. The functions have no side effects."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil

MIN_SPAN_NS = 1_000_000
STEPS_S = (
    0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0,
    600.0, 900.0, 1800.0, 3600.0, 7200.0, 21_600.0, 43_200.0, 86_400.0,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Scale of a timeline. All times are in ns since 1970.

    Attributes:
        first_ns: Start of the recording.
        last_ns: End of the recording.
        start_ns: Start of the visible range.
        end_ns: End of the visible range.
    """

    first_ns: int
    last_ns: int
    start_ns: int
    end_ns: int

    @classmethod
    def full(cls, first_ns: int, last_ns: int) -> TimeScale:
        """Return the scale that shows a whole recording, or one millisecond if the recording is shorter."""
        last_ns = max(last_ns, first_ns + MIN_SPAN_NS)
        return cls(first_ns, last_ns, first_ns, last_ns)

    @property
    def span_ns(self) -> int:
        """Length of the visible range."""
        return self.end_ns - self.start_ns

    @property
    def is_full(self) -> bool:
        """True if the scale shows the whole recording."""
        return (self.start_ns, self.end_ns) == (self.first_ns, self.last_ns)

    def relative_position(self, at_ns: int) -> float:
        """Return the position of a time in the visible range: 0 at the left edge, 1 at the right edge."""
        return (at_ns - self.start_ns) / self.span_ns

    def time(self, position: float) -> int:
        """Return the time at a position (0 at the left edge, 1 at the right), limited to the recording."""
        at_ns = self.start_ns + round(position * self.span_ns)
        return max(self.first_ns, min(self.last_ns, at_ns))

    def zoomed(self, factor: float, at_ns: int) -> TimeScale:
        """Return a zoomed scale in which ``at_ns`` stays at the same position.

        Args:
            factor: Ratio of the new to the current visible range; above 1 zooms out.
            at_ns: Fixed time.
        """
        total_span_ns = self.last_ns - self.first_ns
        span_ns = max(MIN_SPAN_NS, min(total_span_ns, round(self.span_ns * factor)))
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

    def mark_interval_s(self, max_marks: int) -> float:
        """Return the interval between ruler marks in seconds.

        Args:
            max_marks: Maximum number of marks.
        """
        min_interval_s = self.span_ns / 1e9 / max(1, max_marks)
        return next(
            (step for step in STEPS_S if step >= min_interval_s), 86_400.0 * ceil(min_interval_s / 86_400.0)
        )

    def marks(self, max_marks: int, *, by_clock: bool = False) -> Iterator[int]:
        """Yield the times of the ruler marks.

        Args:
            max_marks: Maximum number of marks.
            by_clock: True to align the marks to the local time of day, False to the recording's start.
        """
        step_ns = round(self.mark_interval_s(max_marks) * 1e9)
        origin_ns = local_midnight_ns(self.first_ns) if by_clock else self.first_ns
        number = -((origin_ns - self.start_ns) // step_ns)
        while (at_ns := origin_ns + number * step_ns) <= self.end_ns:
            yield at_ns
            number += 1


def local_midnight_ns(at_ns: int) -> int:
    """Return a time (ns since 1970) at which a local day starts, from which ruler marks are counted.

    Args:
        at_ns: Time that determines the UTC offset.
    """
    return -(time.localtime(at_ns // 1_000_000_000).tm_gmtoff or 0) * 1_000_000_000


def duration_text(ns: int, *, digits: int = 3) -> str:
    """Format a duration, such as "7:26.412", "0:00" or "1:02:03".

    Args:
        ns: Duration in ns.
        digits: Number of decimals of the seconds.
    """
    sign, ns = ("-", -ns) if ns < 0 else ("", ns)
    unit = 10 ** (9 - digits)
    total_s, fraction = divmod(ns // unit, 10**digits)
    minutes, seconds = divmod(total_s, 60)
    hours, minutes = divmod(minutes, 60)
    text = f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"
    return f"{sign}{text}.{fraction:0{digits}d}" if digits else f"{sign}{text}"


def clock_text(at_ns: int, *, digits: int = 3) -> str:
    """Format a local time of day, such as "15:09:37.412".

    Args:
        at_ns: Time in ns since 1970.
        digits: Number of decimals of the seconds.
    """
    seconds, fraction = divmod(at_ns, 1_000_000_000)
    local_time = time.localtime(seconds)
    text = f"{local_time.tm_hour}:{local_time.tm_min:02d}:{local_time.tm_sec:02d}"
    return f"{text}.{fraction // 10 ** (9 - digits):0{digits}d}" if digits else text


def date_text(at_ns: int) -> str:
    """Format a local date, such as "2026-11-17"."""
    return time.strftime("%Y-%m-%d", time.localtime(at_ns // 1_000_000_000))
