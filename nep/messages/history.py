"""History: a publisher's newest messages, for subscribers that come late. Bounded in number and in bytes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

__all__ = ["HISTORY_BYTES", "MAX_HISTORY", "History"]

MAX_HISTORY = 1_000
"""So many messages a publisher keeps at most: every back end takes them for a new subscriber at once."""
HISTORY_BYTES = 64 * 2**20

T = TypeVar("T")


class History(Generic[T]):
    """The newest `most` messages, oldest first, of `max_bytes` together; the newest in any case.

    Without messages to keep it is empty for ever. It lives under its publisher's lock.
    """

    def __init__(self, most: int, max_bytes: int = HISTORY_BYTES) -> None:
        self._most = most
        self._max_bytes = max_bytes
        self._kept: deque[tuple[T, int]] = deque()
        self.size_bytes = 0
        """Of all payloads."""

    def add(self, message: T, size_bytes: int) -> None:
        """Keep it, and as many of those before as there is room for."""
        if not self._most:
            return
        self._kept.append((message, size_bytes))
        self.size_bytes += size_bytes
        while len(self._kept) > self._most or (self.size_bytes > self._max_bytes and len(self._kept) > 1):
            self.size_bytes -= self._kept.popleft()[1]

    def __iter__(self) -> Iterator[T]:
        return (message for message, _size_bytes in tuple(self._kept))

    def __len__(self) -> int:
        return len(self._kept)
