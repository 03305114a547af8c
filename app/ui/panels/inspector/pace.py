"""Rate limit of display updates: a burst, then ten per second."""

from __future__ import annotations

BURST = 3
"""Updates allowed at once after a pause, so that messages sent by hand appear immediately."""
MAX_UPDATE_HZ = 10.0
"""Updates per second.

More would be unreadable, and each may make the graphics driver redraw the whole window.
"""


class UpdateLimiter:
    """Rate limiter for display updates (token bucket): `burst` updates at once, then `hz` per second."""

    def __init__(self, burst: int = BURST, hz: float = MAX_UPDATE_HZ) -> None:
        self._most, self._hz = float(burst), hz
        self.reset()

    def reset(self) -> None:
        """Refill the bucket, so that the next update is allowed immediately."""
        self._left, self._asked_s = self._most, 0.0

    def try_acquire(self, now_s: float) -> bool:
        """Return True and take a token if an update is allowed at `now_s` (monotonic time)."""
        grown = max(0.0, now_s - self._asked_s) * self._hz
        self._left, self._asked_s = min(self._most, self._left + grown), now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True

    def drain(self, now_s: float) -> None:
        """Empty the bucket after an update that was done without calling `may`."""
        self._left, self._asked_s = 0.0, now_s
