"""Visible time range of a plot: the latest seconds, everything, or a fixed range."""

from __future__ import annotations

from dataclasses import dataclass

MIN_SPAN_S, MAX_SPAN_S = 1e-4, 1e8
SPANS: tuple[tuple[str, float], ...] = (("12", 12.0), ("60", 60.0), ("300", 300.0), ("all", 0.0))
"""Available lengths of the range, by choice, in s; 0 shows everything."""


@dataclass(slots=True)
class TimeView:
    """Time range of `span_s` seconds that ends at the newest message or at `held_s`.

    If `is_all` is True, it contains all data.
    """

    span_s: float = 60.0
    is_all: bool = False
    paused_end_s: float | None = None

    @property
    def is_following(self) -> bool:
        """True if the range follows new data."""
        return self.paused_end_s is None

    def visible_range(self, oldest_s: float, newest_s: float) -> tuple[float, float]:
        """Return the visible range, given the range of available data."""
        end_s = newest_s if self.paused_end_s is None else self.paused_end_s
        if self.is_all:
            return min(oldest_s, end_s - MIN_SPAN_S), end_s
        return end_s - self.span_s, end_s

    def pause(self, shown: tuple[float, float]) -> None:
        """Fix the range at `shown` while data continues to arrive."""
        self.span_s, self.is_all, self.paused_end_s = _bounded(shown[1] - shown[0]), False, shown[1]

    def resume(self) -> None:
        """Follow new data with the current length of the range."""
        self.paused_end_s = None

    def set_span(self, span_s: float) -> None:
        """Set the length in s, 0 for everything. A fixed range keeps its end."""
        self.is_all = span_s <= 0
        if span_s > 0:
            self.span_s = span_s

    def zoom(self, factor: float, at_s: float, shown: tuple[float, float]) -> None:
        """Scale the range by `factor` around `at_s`, or around its end while it follows new data."""
        span_s = _bounded((shown[1] - shown[0]) * factor)
        share = (shown[1] - at_s) / max(MIN_SPAN_S, shown[1] - shown[0])
        self.span_s, self.is_all = span_s, False
        if self.paused_end_s is not None:
            self.paused_end_s = at_s + share * span_s

    def move(self, by_s: float, shown: tuple[float, float]) -> None:
        """Shift the range by seconds and fix it there."""
        self.pause((shown[0] + by_s, shown[1] + by_s))

    def selected_span(self) -> str:
        """Return the key of the choice in `SPANS` that equals the current range, or ""."""
        if self.is_all:
            return "all"
        return next((value for value, span_s in SPANS if span_s == self.span_s), "")


def _bounded(span_s: float) -> float:
    return min(MAX_SPAN_S, max(MIN_SPAN_S, span_s))
