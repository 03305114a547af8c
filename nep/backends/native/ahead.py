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
        self._now = 1
        self._read_at = 0.0

    def count(self, now: float) -> int:
        """How many messages to read at `now`, 1 or more."""
        is_brisk = now - self._read_at < self._now * _BRISK_S
        self._read_at = now
        self._now = min(2 * self._now, self._most) if is_brisk else 1
        return self._now

    def begin(self) -> None:
        """There were not as many: begin with one again."""
        self._now = 1
