"""Counter that a robot's driver reports in its heartbeats, with the time of its last increase."""

from __future__ import annotations

from dataclasses import dataclass

GROWTH_WINDOW_S = 30.0
"""Time in seconds without an increase after which the problem is resolved.

Heartbeats are sent only during actions.
"""
MAX_COUNT = 2**53


@dataclass(slots=True)
class ReportedCount:
    """Newest value of a reported counter, and the time of its last increase.

    The time is in monotonic seconds, or None before the first increase.
    """

    value: int = 0
    last_increase_s: float | None = None

    def update(self, reported: object, now_s: float) -> None:
        """Apply a reported value. Anything other than an integer from 0 to `MAX_COUNT` is ignored.

        A decrease means that the driver was restarted.
        """
        if type(reported) is not int or not 0 <= reported <= MAX_COUNT:
            return
        if reported > self.value:
            self.last_increase_s = now_s
        self.value = reported

    def is_growing(self, now_s: float) -> bool:
        """Return True if the counter has increased in the last `GROWTH_WINDOW_S` seconds."""
        return (
            self.value > 0
            and self.last_increase_s is not None
            and now_s - self.last_increase_s < GROWTH_WINDOW_S
        )
