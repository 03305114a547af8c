"""Rate limit for display updates: a short burst, then ten per second."""

from __future__ import annotations

MAX_BURST = 3
"""Number of updates allowed at once after a pause, so that single messages appear immediately."""
MAX_UPDATE_HZ = 10.0
"""Maximum number of updates per second after the burst.

More would be unreadable, and each update may make the graphics driver redraw the whole window.
"""


class UpdateLimiter:
    """Rate limiter for display updates (token bucket).

    Args:
        burst: Number of updates allowed at once.
        hz: Number of updates allowed per second after the burst.
    """

    def __init__(self, burst: int = MAX_BURST, hz: float = MAX_UPDATE_HZ) -> None:
        self._capacity, self._hz = float(burst), hz
        self.reset()

    def reset(self) -> None:
        """Refill the bucket, so that the next update is allowed immediately."""
        self._tokens, self._refilled_s = self._capacity, 0.0

    def try_acquire(self, now_s: float) -> bool:
        """Return True and take a token if an update is allowed.

        Args:
            now_s: Monotonic time in s.
        """
        refill = max(0.0, now_s - self._refilled_s) * self._hz
        self._tokens, self._refilled_s = min(self._capacity, self._tokens + refill), now_s
        if self._tokens < 1:
            return False
        self._tokens -= 1
        return True

    def drain(self, now_s: float) -> None:
        """Empty the bucket after an update for which `try_acquire` was not called.

        Args:
            now_s: Monotonic time in s.
        """
        self._tokens, self._refilled_s = 0.0, now_s
