"""What happened, line by line: the newest 5000 records."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

CAPACITY = 5000
TEXT_LIMIT = 2000


@dataclass(frozen=True, slots=True)
class LogRecord:
    """One line: epoch seconds, level (``info``, ``warn``, ``error``), who says it, and the text."""

    stamp_s: float
    level: str
    origin: str
    text: str


class Console:
    """A ring of log records, oldest first. One thread uses it (the window's)."""

    def __init__(self, clock: Callable[[], float] = time.time, capacity: int = CAPACITY) -> None:
        """Keep at most ``capacity`` records; ``clock`` gives epoch seconds."""
        self._clock = clock
        self._records: deque[LogRecord] = deque(maxlen=capacity)
        self.revision = 0

    @property
    def records(self) -> Sequence[LogRecord]:
        """The records, oldest first."""
        return self._records

    def add(self, level: str, origin: str, text: str) -> None:
        """Add one line; a very long text is cut and says so."""
        if len(text) > TEXT_LIMIT:
            text = f"{text[:TEXT_LIMIT]}… ({len(text)} characters)"
        self._records.append(LogRecord(self._clock(), level, origin, text))
        self.revision += 1

    def clear(self) -> None:
        """Forget all records."""
        self._records.clear()
        self.revision += 1
