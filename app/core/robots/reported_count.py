"""A count that a robot's driver reports in its signs of life, and whether it still grows."""

from __future__ import annotations

from dataclasses import dataclass

GROWING_S = 30.0
"""Without an increase for this long, whatever went wrong is over. Signs of life come only during actions."""
MAX_COUNT = 2**53


@dataclass(slots=True)
class ReportedCount:
    """Newest value, and when it grew last (monotonic seconds), None before the first increase."""

    value: int = 0
    grew_s: float | None = None

    def take(self, reported: object, now_s: float) -> None:
        """Take over a reported value. Anything but a whole number from 0 to `MAX_COUNT` is ignored.

        A smaller value comes from a driver that was restarted.
        """
        if type(reported) is not int or not 0 <= reported <= MAX_COUNT:
            return
        if reported > self.value:
            self.grew_s = now_s
        self.value = reported

    def is_growing(self, now_s: float) -> bool:
        """Return whether it grew in the last `GROWING_S` seconds."""
        return self.value > 0 and self.grew_s is not None and now_s - self.grew_s < GROWING_S
