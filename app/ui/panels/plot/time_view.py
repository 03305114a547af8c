"""Which time a plot shows: the newest so many seconds, everything, or what a person holds."""

from __future__ import annotations

from dataclasses import dataclass

LEAST_S, MOST_S = 1e-4, 1e8
SPANS: tuple[tuple[str, float], ...] = (("12", 12.0), ("60", 60.0), ("300", 300.0), ("all", 0.0))
"""What the segments offer, by their values in s; 0 is everything."""


@dataclass(slots=True)
class TimeView:
    """``span_s`` seconds up to the newest message, all of it while ``is_all``, or up to ``held_s``."""

    span_s: float = 60.0
    is_all: bool = False
    held_s: float | None = None

    @property
    def follows(self) -> bool:
        """Whether it goes on with what comes."""
        return self.held_s is None

    def shown(self, oldest_s: float, newest_s: float) -> tuple[float, float]:
        """From when to when, for numbers between these."""
        end_s = newest_s if self.held_s is None else self.held_s
        if self.is_all:
            return min(oldest_s, end_s - LEAST_S), end_s
        return end_s - self.span_s, end_s

    def hold(self, shown: tuple[float, float]) -> None:
        """Stay with what is shown; the data go on."""
        self.span_s, self.is_all, self.held_s = _bounded(shown[1] - shown[0]), False, shown[1]

    def go_on(self) -> None:
        """Follow what comes again, as much of it as is shown now."""
        self.held_s = None

    def choose(self, span_s: float) -> None:
        """Show so many seconds, 0 for everything; what is held stays at its end."""
        self.is_all = span_s <= 0
        if span_s > 0:
            self.span_s = span_s

    def zoom(self, factor: float, at_s: float, shown: tuple[float, float]) -> None:
        """Show ``factor`` times as much; what was at ``at_s`` stays there, or the end while it follows."""
        span_s = _bounded((shown[1] - shown[0]) * factor)
        share = (shown[1] - at_s) / max(LEAST_S, shown[1] - shown[0])
        self.span_s, self.is_all = span_s, False
        if self.held_s is not None:
            self.held_s = at_s + share * span_s

    def move(self, by_s: float, shown: tuple[float, float]) -> None:
        """Show later (or, below 0, earlier) times, and stay there."""
        self.hold((shown[0] + by_s, shown[1] + by_s))

    def chosen(self) -> str:
        """The segment that says what is shown; "" for none."""
        if self.is_all:
            return "all"
        return next((value for value, span_s in SPANS if span_s == self.span_s), "")


def _bounded(span_s: float) -> float:
    return min(MOST_S, max(LEAST_S, span_s))
