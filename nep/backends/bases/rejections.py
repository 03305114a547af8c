"""Counting of rejected inputs."""

from __future__ import annotations

import time

from nep.i18n import _
from nep.system.log_rarely import is_logged

_REPORT_DURATION_S = 5.0


class RejectionCounter:
    """Counter of rejected inputs that stores the newest reason.

    Not thread-safe: guarded by the owner's lock.
    """

    def __init__(self) -> None:
        self.count = 0
        self._reason = ""
        self._rejected_at = 0.0

    def add(self, reason: str) -> bool:
        """Count a rejected input; return True if it should be logged (the 1st, 10th, 100th, ...)."""
        self.count += 1
        self._reason = reason
        self._rejected_at = time.monotonic()
        return is_logged(self.count)

    def recent_message(self) -> str:
        """Return the newest reason with the count; "" if nothing was rejected in the last seconds."""
        if not self.count or time.monotonic() - self._rejected_at > _REPORT_DURATION_S:
            return ""
        return _("{reason} ({count} so far)").format(reason=self._reason, count=self.count)
