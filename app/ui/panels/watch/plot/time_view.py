"""Visible time range of a plot: the last seconds, all data, or a fixed range."""

from __future__ import annotations

from dataclasses import dataclass

MIN_SPAN_S, MAX_SPAN_S = 1e-4, 1e8
SPANS: tuple[tuple[str, float], ...] = (("12", 12.0), ("60", 60.0), ("300", 300.0), ("all", 0.0))
"""Key and length in s of the ranges that the user can choose; 0 stands for all data."""


@dataclass(slots=True)
class TimeView:
    """Visible time range, which ends at the newest message or at a fixed time.

    Attributes:
        span_s: Length of the range in s.
        is_all: True if the range starts at the oldest message, whatever `span_s` is.
        paused_end_s: Fixed end of the range in s; None to follow new data.
    """

    span_s: float = 60.0
    is_all: bool = False
    paused_end_s: float | None = None

    @property
    def is_following(self) -> bool:
        """True if the range follows new data."""
        return self.paused_end_s is None

    def visible_range(self, oldest_s: float, newest_s: float) -> tuple[float, float]:
        """Return start and end of the visible range in s.

        Args:
            oldest_s: Time of the oldest message in s.
            newest_s: Time of the newest message in s.
        """
        end_s = newest_s if self.paused_end_s is None else self.paused_end_s
        if self.is_all:
            return min(oldest_s, end_s - MIN_SPAN_S), end_s
        return end_s - self.span_s, end_s

    def pause(self, visible_range: tuple[float, float]) -> None:
        """Fix the range, so that it no longer follows new data.

        Args:
            visible_range: Start and end of the range in s.
        """
        self.span_s, self.is_all, self.paused_end_s = (
            _clamp_span(visible_range[1] - visible_range[0]),
            False,
            visible_range[1],
        )

    def resume(self) -> None:
        """Follow new data again. The length of the range stays the same."""
        self.paused_end_s = None

    def set_span(self, span_s: float) -> None:
        """Set the length of the range; a fixed end stays the same.

        Args:
            span_s: Length in s; 0 for all data.
        """
        self.is_all = span_s <= 0
        if span_s > 0:
            self.span_s = span_s

    def zoom(self, factor: float, at_s: float, visible_range: tuple[float, float]) -> None:
        """Scale the length of the range.

        Args:
            factor: Factor by which the length is multiplied.
            at_s: Time in s that stays at its place. While the range follows new data, this is the end
                instead.
            visible_range: Start and end of the visible range in s.
        """
        span_s = _clamp_span((visible_range[1] - visible_range[0]) * factor)
        fraction = (visible_range[1] - at_s) / max(MIN_SPAN_S, visible_range[1] - visible_range[0])
        self.span_s, self.is_all = span_s, False
        if self.paused_end_s is not None:
            self.paused_end_s = at_s + fraction * span_s

    def move(self, by_s: float, visible_range: tuple[float, float]) -> None:
        """Shift the range and fix it.

        Args:
            by_s: Shift in s.
            visible_range: Start and end of the visible range in s.
        """
        self.pause((visible_range[0] + by_s, visible_range[1] + by_s))

    def selected_span(self) -> str:
        """Return the key in `SPANS` for the current length, or "" if the length is not one of them."""
        if self.is_all:
            return "all"
        return next((value for value, span_s in SPANS if span_s == self.span_s), "")


def _clamp_span(span_s: float) -> float:
    return min(MAX_SPAN_S, max(MIN_SPAN_S, span_s))
