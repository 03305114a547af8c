"""Rate limit of display updates: a burst, then ten per second."""

from __future__ import annotations

BURST = 3
"""Updates allowed at once after a pause, so that messages sent by hand appear immediately."""
HZ = 10.0
"""Maximum readable rate; each update may also make the graphics driver redraw the whole window."""


class ReadingPace:
    """Token bucket: allows `burst` updates at once, then `hz` per second."""

    def __init__(self, burst: int = BURST, hz: float = HZ) -> None:
        self._most, self._hz = float(burst), hz
        self.begin_anew()

    def begin_anew(self) -> None:
        """Refill the bucket, so that the next update is immediate."""
        self._left, self._asked_s = self._most, 0.0

    def may(self, now_s: float) -> bool:
        """Return True and consume a token if an update is allowed at `now_s` (monotonic)."""
        grown = max(0.0, now_s - self._asked_s) * self._hz
        self._left, self._asked_s = min(self._most, self._left + grown), now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True

    def spend(self, now_s: float) -> None:
        """Empty the bucket, because an update took place without asking."""
        self._left, self._asked_s = 0.0, now_s
