"""Inbox: messages that wait for their reader, bounded in number and in bytes, and how many it gets."""

from __future__ import annotations

from collections import deque
from typing import Literal

from nep.messages.message import Message

__all__ = ["AHEAD_MOST", "MAX_BYTES", "MAX_MESSAGES", "Inbox", "Keep", "ReadAhead"]

Keep = Literal["all", "latest"]
"""What a subscriber wants: every message as long as there is room, or only the newest."""

MAX_MESSAGES = 10_000
MAX_BYTES = 256 * 2**20
_BRISK_S = 10e-6
"""A reader that comes back sooner than this after a message gets several at once: twice as many each time."""
AHEAD_MOST = 64


class Inbox:
    """A queue that drops its oldest message when it is full. It lives under its owner's lock."""

    def __init__(self, keep: Keep, max_messages: int = MAX_MESSAGES, max_bytes: int = MAX_BYTES) -> None:
        self._keeps_all = keep == "all"
        self._max_messages = max_messages if self._keeps_all else 1
        self._max_bytes = max_bytes
        self.messages: deque[Message] = deque()
        """What waits, oldest first. Only to be looked at."""
        self._bytes = 0

    def put(self, message: Message) -> int:
        """Add a message; how many others were dropped for it. Replacing the latest is no drop."""
        self.messages.append(message)
        self._bytes += message.size_bytes
        dropped = 0
        # The newest stays even when it alone is larger than the bound.
        while len(self.messages) > self._max_messages or (
            self._bytes > self._max_bytes and len(self.messages) > 1
        ):
            self._bytes -= self.messages.popleft().size_bytes
            dropped += self._keeps_all
        return dropped

    def take(self) -> Message | None:
        """The oldest message, None when there is none."""
        if not self.messages:
            return None
        message = self.messages.popleft()
        self._bytes -= message.size_bytes
        return message

    def move(self, into: deque[Message], most: int, most_bytes: int) -> None:
        """Move the oldest messages, `most` of them at most and no more when they are `most_bytes`."""
        messages = self.messages
        while messages and most > 0 and most_bytes > 0:
            message = messages.popleft()
            into.append(message)
            size = message.size_bytes
            self._bytes -= size
            most_bytes -= size
            most -= 1

    def take_all(self, most_bytes: int | None = None) -> list[Message]:
        """All messages, oldest first; no more when they are `most_bytes` together."""
        if most_bytes is None or self._bytes <= most_bytes:
            messages = list(self.messages)
            self.messages.clear()
            self._bytes = 0
            return messages
        messages = []
        while self.messages and most_bytes > 0:
            messages.append(self.messages.popleft())
            most_bytes -= messages[-1].size_bytes
            self._bytes -= messages[-1].size_bytes
        return messages

    def __len__(self) -> int:
        return len(self.messages)


class ReadAhead:
    """How many messages a reader gets at once.

    Reading one message when there are no more costs a failed read: only brisk readers read ahead.
    """

    def __init__(self, max_messages: int) -> None:
        self._most = max(1, min(AHEAD_MOST, max_messages))
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
