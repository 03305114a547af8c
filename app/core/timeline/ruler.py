"""Ruler of a timeline: ticks at round times, and labels that don't overlap."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil

from app.core.timeline.scale import TimeScale
from app.core.timeline.times import clock_text, duration_text, local_midnight_ns

STEPS_S = (
    0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0,
    600.0, 900.0, 1800.0, 3600.0, 7200.0, 21_600.0, 43_200.0, 86_400.0,
)  # fmt: skip
_DAY_S = 86_400.0


@dataclass(frozen=True, slots=True)
class RulerTick:
    """Tick of a ruler.

    Attributes:
        at_ns: Time.
        x: Distance from the left edge of the ruler in px.
        text: Label at the right of the tick, or "" if there is no room for it.
    """

    at_ns: int
    x: float
    text: str


@dataclass(frozen=True, slots=True)
class Ruler:
    """Ruler of the visible range.

    Attributes:
        scale: Visible range.
        width_px: Width of the ruler.
        spacing_px: Minimum distance of ticks if there is room for two of them.
        by_clock: True to align ticks to the local time of day and to label them with it; False to
            align them to the start of the contents.
    """

    scale: TimeScale
    width_px: float
    spacing_px: float
    by_clock: bool = False

    @property
    def interval_s(self) -> float:
        """Interval between ticks in seconds."""
        max_count = max(2, int(self.width_px / self.spacing_px))
        min_interval_s = self.scale.span_ns / 1e9 / max_count
        return next(
            (step for step in STEPS_S if step >= min_interval_s), _DAY_S * ceil(min_interval_s / _DAY_S)
        )

    def times(self) -> Iterator[int]:
        """Yield the times of the ticks in the visible range."""
        first_ns, start_ns = self.scale.first_ns, self.scale.start_ns
        step_ns = round(self.interval_s * 1e9)
        origin_ns = local_midnight_ns(first_ns) if self.by_clock else first_ns
        number = -((origin_ns - start_ns) // step_ns)
        while (at_ns := origin_ns + number * step_ns) <= self.scale.end_ns:
            yield at_ns
            number += 1

    def ticks(self, label_width: Callable[[str], float], gap_px: float) -> Iterator[RulerTick]:
        """Yield the ticks. A label that would overlap the previous one or the right edge is left out.

        Args:
            label_width: Returns the width of a label in px.
            gap_px: Distance between a tick and its label.
        """
        digits = 0 if self.interval_s >= 1 else 3
        free_x = 0.0
        for at_ns in self.times():
            x = self.scale.relative_position(at_ns) * self.width_px
            text = self.text(at_ns, digits=digits)
            label_end_x = x + gap_px + label_width(text)
            if x < free_x or label_end_x > self.width_px:
                yield RulerTick(at_ns, x, "")
            else:
                yield RulerTick(at_ns, x, text)
                free_x = label_end_x

    def text(self, at_ns: int, *, digits: int = 3) -> str:
        """Format a time as the ruler does: the time of day, or the time since the start of the contents.

        Args:
            at_ns: Time.
            digits: Number of decimals of the seconds.
        """
        if self.by_clock:
            return clock_text(at_ns, digits=digits)
        return duration_text(at_ns - self.scale.first_ns, digits=digits)
