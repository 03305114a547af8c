"""Counter that a robot's driver reports in its heartbeats, and the time of its last increase."""

from __future__ import annotations

from dataclasses import dataclass

GROWTH_WINDOW_S = 30.0
"""Time without an increase after which the problem counts as resolved. Heartbeats are sent only during
actions.
"""
MAX_COUNT = 2**53


@dataclass(slots=True)
class ReportedCount:
    """Newest value, and the time of the last increase (monotonic seconds; None before the first one)."""

    value: int = 0
    grew_s: float | None = None

    def update(self, reported: object, now_s: float) -> None:
        """Apply a reported value; anything but an integer from 0 to `MAX_COUNT` is ignored.

        A smaller value than before means that the driver was restarted.
        """
        if type(reported) is not int or not 0 <= reported <= MAX_COUNT:
            return
        if reported > self.value:
            self.grew_s = now_s
        self.value = reported

    def is_growing(self, now_s: float) -> bool:
        """Return True if the counter increased within the last `GROWING_S` seconds."""
        return self.value > 0 and self.grew_s is not None and now_s - self.grew_s < GROWTH_WINDOW_S
