"""A script of a running program, and what all of them do at one moment."""

from __future__ import annotations

import threading
from dataclasses import dataclass


class Stopped(BaseException):
    """Raised inside a script when the program ends; nothing in a program catches it."""


@dataclass(frozen=True)
class Snapshot:
    """What the scripts do now. ``paused`` is True once every script stands still."""

    blocks: tuple[str, ...]
    next_block: str | None
    paused: bool


class Script:
    """One script: a thread, where it is, and how it is woken."""

    def __init__(self, name: str, lock: threading.Lock) -> None:
        self.name = name
        self.wake = threading.Condition(lock)
        self.block: str | None = None
        self.idle = True  # waits for its event: it does nothing now
        self.busy = False  # waits for something that goes on while paused: a robot's answer
        self.frozen = False  # waits for time or a condition, and stands while paused
