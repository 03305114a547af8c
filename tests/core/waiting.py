"""Ticking a session until something is true."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from app.core.session import Session


def tick_until(session: Session, true: Callable[[], object], timeout_s: float = 60.0) -> None:
    """Tick 30 times a second, as the window does; fails when it never comes true."""
    pause = threading.Event()
    end = time.monotonic() + timeout_s
    session.tick()
    while not true():
        assert time.monotonic() < end, "it never came true"
        pause.wait(0.01)
        session.tick()
