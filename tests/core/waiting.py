"""Helper that ticks a session until a condition is true."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from app.core.session import Session
from tests.blocks.wire_robot import usual_time_limits

_TICK_INTERVAL_S = 1 / 30  # as in Studio


def tick_until(session: Session, true: Callable[[], object], timeout_s: float = 60.0) -> None:
    """Tick the session until ``true()`` is truthy; fail after ``timeout_s`` seconds."""
    pause = threading.Event()
    end = time.monotonic() + timeout_s
    session.tick()
    while not true():
        assert time.monotonic() < end, "it never came true"
        pause.wait(_TICK_INTERVAL_S)
        session.tick()


def stop_unanswered(session: Session) -> None:
    """Press Stop and wait until the run bar shows that a robot did not confirm it."""
    with usual_time_limits():
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "unanswered")
