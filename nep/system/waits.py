"""Waiting for a condition, which Ctrl+C interrupts on every system."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

_WAIT_SLICE_S = 0.1


def wait_until(changed: threading.Condition, is_met: Callable[[], bool], timeout_s: float) -> bool:
    """Wait until `is_met()` returns True; return False on timeout. Call with `changed` held.

    Waits in slices, because on Windows Ctrl+C doesn't interrupt a wait.
    """
    deadline = time.monotonic() + timeout_s
    while not is_met():
        remaining_s = deadline - time.monotonic()
        if remaining_s <= 0.0:
            return False
        changed.wait(min(remaining_s, _WAIT_SLICE_S))
    return True
