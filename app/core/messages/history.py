"""Recent messages of one topic, limited in number and bytes. Evicted messages are counted."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from copy import copy

from app.core.network.mailbox import Batch
from nep.messages.message import UNDECODED, Message

MAX_BYTES = 32_000_000
MAX_MESSAGES = 2000


class MessageHistory:
    """Recent messages of one topic, oldest first. Messages are numbered from 0; numbers never change.

    The newest message is stored regardless of its size. Messages are stored encoded, as copies that no
    publisher can modify.
    """

    def __init__(self, max_bytes: int = MAX_BYTES, max_messages: int = MAX_MESSAGES) -> None:
        self._max_bytes, self._max_messages = max_bytes, max(1, max_messages)
        self._messages: deque[Message] = deque()
        self.size_bytes = 0
        self.first = 0
        """Number of the oldest stored message; equals the number of evicted ones."""
        self.dropped_count = 0
        """Number of messages dropped before they reached this history."""

    def __len__(self) -> int:
        return len(self._messages)

    def __iter__(self) -> Iterator[Message]:
        # Oldest first; not to be decoded.
        return iter(self._messages)

    @property
    def end(self) -> int:
        """Number that the next message will have."""
        return self.first + len(self._messages)

    def at(self, number: int) -> Message | None:
        """Return a copy of the message with this number; None if the message is not stored."""
        if not self.first <= number < self.end:
            return None
        return copy(self._messages[number - self.first])

    def nearest(self, number: int) -> int:
        """Return the number of the nearest stored message. Don't call it while the history is empty."""
        return min(max(number, self.first), self.end - 1)

    def add(self, message: Message) -> None:
        """Append a message; evict the oldest messages beyond the limits."""
        message.latency_s  # noqa: B018  caches the latency at arrival
        stored = copy(message)
        stored.decoded = UNDECODED
        if not isinstance(stored.raw, bytes):
            stored.raw = bytes(stored.raw)
        self._messages.append(stored)
        self.size_bytes += stored.size_bytes
        while len(self._messages) > 1 and (
            len(self._messages) > self._max_messages or self.size_bytes > self._max_bytes
        ):
            self.size_bytes -= self._messages.popleft().size_bytes
            self.first += 1

    def process(self, batch: Batch, _now_ns: int) -> None:
        """Append the messages received since the last tick. Implements `SeriesReceiver`."""
        self.dropped_count += batch.dropped
        for message in batch.messages:
            self.add(message)

    def reset(self) -> None:
        """Remove all messages. Called when the source seeks to another time."""
        self._messages.clear()
        self.size_bytes = self.first = self.dropped_count = 0
