"""What Ctrl+C may not cut short: who presses it again and again still hears whether the robots stopped."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["without_interrupts"]


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Ctrl+C does nothing meanwhile; what is done here must end by itself."""
    if threading.current_thread() is not threading.main_thread():
        yield  # no signal is handled in this thread
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler if before is None else before)
