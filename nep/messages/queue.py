"""Bounded queue of received messages."""

from __future__ import annotations

from collections import deque
from typing import Literal

from nep.messages.message import Message

QueuePolicy = Literal["all", "latest"]
"""Queue policy of a subscriber: all messages while there is room, or only the newest."""

MAX_MESSAGES = 10_000
MAX_BYTES = 256 * 2**20
MAX_READ_AHEAD = 64
"""Maximum number of messages that a reader takes from the socket at once."""


class Inbox:
    """Queue that drops its oldest message when it is full. Not thread-safe: guarded by its owner's lock."""

    def __init__(
        self, keep: QueuePolicy, max_messages: int = MAX_MESSAGES, max_bytes: int = MAX_BYTES
    ) -> None:
        self._keeps_all = keep == "all"
        self._max_messages = max_messages if self._keeps_all else 1
        self._max_bytes = max_bytes
        self.messages: deque[Message] = deque()
        """Queued messages, oldest first. Read-only."""
        self._size_bytes = 0

    def put(self, message: Message) -> int:
        """Append a message; return the number of dropped messages.

        With the policy "latest", a replaced message is not counted as dropped.
        """
        self.messages.append(message)
        self._size_bytes += message.size_bytes
        dropped = 0
        # the newest is kept even if it exceeds the limit alone
        while len(self.messages) > self._max_messages or (
            self._size_bytes > self._max_bytes and len(self.messages) > 1
        ):
            self._size_bytes -= self.messages.popleft().size_bytes
            dropped += self._keeps_all
        return dropped

    def pop(self) -> Message | None:
        """Remove and return the oldest message, or None if the queue is empty."""
        if not self.messages:
            return None
        message = self.messages.popleft()
        self._size_bytes -= message.size_bytes
        return message

    def move(self, target: deque[Message], max_messages: int, max_bytes: int) -> None:
        """Move the oldest messages to another queue.

        Args:
            target: Queue to append to.
            max_messages: Maximum number of messages.
            max_bytes: Stop after the message with which this total size is reached.
        """
        messages = self.messages
        while messages and max_messages > 0 and max_bytes > 0:
            message = messages.popleft()
            target.append(message)
            size = message.size_bytes
            self._size_bytes -= size
            max_bytes -= size
            max_messages -= 1

    def pop_all(self, max_bytes: int | None = None) -> list[Message]:
        """Remove and return all messages, oldest first.

        Args:
            max_bytes: Stop after the message with which this total size is reached; None for no limit.
        """
        if max_bytes is None or self._size_bytes <= max_bytes:
            messages = list(self.messages)
            self.messages.clear()
            self._size_bytes = 0
            return messages
        messages = []
        while self.messages and max_bytes > 0:
            messages.append(self.messages.popleft())
            max_bytes -= messages[-1].size_bytes
            self._size_bytes -= messages[-1].size_bytes
        return messages

    def __len__(self) -> int:
        return len(self.messages)
