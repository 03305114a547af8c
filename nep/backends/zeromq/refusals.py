"""Refusals: what came on a port and could not be understood: counted, and named for some seconds."""

from __future__ import annotations

import time

from nep.system.log_rarely import is_told

__all__ = ["Refusals"]

_TOLD_S = 5.0


class Refusals:
    """Not thread-safe: it lives under its socket's lock."""

    def __init__(self) -> None:
        self.count = 0
        self._reason = ""
        self._last_at = 0.0

    def add(self, reason: str) -> bool:
        """One more, and why. Whether to log it: the first, the tenth, the hundredth, ..."""
        self.count += 1
        self._reason = reason
        self._last_at = time.monotonic()
        return is_told(self.count)

    def told(self) -> str:
        """The newest reason and how many there were; empty when there was none in the last seconds."""
        if not self.count or time.monotonic() - self._last_at > _TOLD_S:
            return ""
        return f"{self._reason} ({self.count} so far)"
