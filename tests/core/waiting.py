"""Helper that ticks a session until a condition is true."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from app.core.session import Session


def tick_until(session: Session, true: Callable[[], object], timeout_s: float = 60.0) -> None:
    """Tick the session until ``true()`` is truthy; fail after ``timeout_s`` seconds."""
    pause = threading.Event()
    end = time.monotonic() + timeout_s
    session.tick()
    while not true():
        assert time.monotonic() < end, "it never came true"
        pause.wait(0.01)
        session.tick()
