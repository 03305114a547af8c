"""Waiting for a condition, never for a fixed time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")
LONG_S = 60.0  # matters only if something is broken, also on a busy computer
LOOK_S, MAX_CHECK_S = 0.05, 0.2
"""How often somebody asks: what is soon is seen soon, and what takes long is not disturbed by the asking."""


def until(true: Callable[[], T], what: str | Callable[[], str], within_s: float = LONG_S) -> T:
    """Call ``true`` until its result is truthy and return it; fail with ``what`` after a timeout."""
    pause = threading.Event()
    end, look_s = time.monotonic() + within_s, LOOK_S
    while not (found := true()):
        if time.monotonic() >= end:
            raise AssertionError(f"not within {within_s:g} s: {what if isinstance(what, str) else what()}")
        pause.wait(look_s)
        look_s = min(look_s * 1.2, MAX_CHECK_S)
    return found
