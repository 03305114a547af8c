"""Newest messages of a publisher for later subscribers, limited in number and bytes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

MAX_HISTORY = 1_000
"""Maximum length of a history; every back end can send this many messages at once to a new subscriber."""
MAX_HISTORY_BYTES = 64 * 2**20

T = TypeVar("T")


class History(Generic[T]):
    """Newest messages, oldest first, limited in number and total bytes.

    The newest message is stored even if it alone exceeds the limit of bytes. A history of length 0 stays
    empty. Not thread-safe: guarded by the publisher's lock.
    """

    def __init__(self, max_messages: int, max_bytes: int = MAX_HISTORY_BYTES) -> None:
        self._max_messages = max_messages
        self._max_bytes = max_bytes
        self._messages: deque[tuple[T, int]] = deque()
        self.size_bytes = 0
        """Total size of the payloads."""

    def add(self, message: T, size_bytes: int) -> None:
        """Append a message; evict the oldest messages beyond the limits."""
        if not self._max_messages:
            return
        self._messages.append((message, size_bytes))
        self.size_bytes += size_bytes
        while len(self._messages) > self._max_messages or (
            self.size_bytes > self._max_bytes and len(self._messages) > 1
        ):
            self.size_bytes -= self._messages.popleft()[1]

    def __iter__(self) -> Iterator[T]:
        return (message for message, _size_bytes in tuple(self._messages))

    def __len__(self) -> int:
        return len(self._messages)
