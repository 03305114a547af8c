"""Ahead: how many messages a reader gets at once."""

from __future__ import annotations

__all__ = ["ROOM_BYTES", "Ahead"]

ROOM_BYTES = 2**18
_BRISK_S = 10e-6
"""A reader that comes back sooner than this after a message gets several at once: twice as many each time."""
_MOST = 64


class Ahead:
    """Reading one message when there are no more costs a failed read: only brisk readers read ahead."""

    def __init__(self, max_messages: int) -> None:
        self._most = max(1, min(_MOST, max_messages))
        self.now = 1
        """How many it reads at once now."""
        self.span_s = _BRISK_S
        """Whoever comes back sooner than this is brisk."""

    def more(self) -> int:
        """How many messages to read for a brisk reader."""
        self.now = min(2 * self.now, self._most)
        self.span_s = self.now * _BRISK_S
        return self.now

    def begin(self) -> None:
        """There were not as many, or the reader takes its time: begin with one again."""
        self.now = 1
        self.span_s = _BRISK_S
