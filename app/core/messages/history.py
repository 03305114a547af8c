"""The messages of one topic that came lately, bounded in number and bytes; what left is counted."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from copy import copy

from app.core.network.mailbox import Batch
from nep.messages.message import UNDECODED, Message

MOST_BYTES = 32_000_000
MOST_MESSAGES = 2000


class MessageHistory:
    """Messages by their numbers from 0, the oldest first; a number stays a message's as long as it is kept.

    The newest one is kept however large it is. What is kept is not decoded, and its bytes are its own: none
    that a publisher wants back.
    """

    def __init__(self, most_bytes: int = MOST_BYTES, most_messages: int = MOST_MESSAGES) -> None:
        """Keep so much at most."""
        self._most_bytes, self._most_messages = most_bytes, max(1, most_messages)
        self._kept: deque[Message] = deque()
        self.size_bytes = 0
        self.first = 0
        """The number of the oldest one that is kept: so many have left."""
        self.missed = 0
        """Messages that came too fast to be kept, or to be seen at all."""

    def __len__(self) -> int:
        """How many are kept."""
        return len(self._kept)

    def __iter__(self) -> Iterator[Message]:
        """Those that are kept, the oldest first; not to be decoded."""
        return iter(self._kept)

    @property
    def end(self) -> int:
        """The number that the next message will have."""
        return self.first + len(self._kept)

    def at(self, number: int) -> Message | None:
        """A message to look at, made anew with each question; None when it is not kept (any more)."""
        if not self.first <= number < self.end:
            return None
        return copy(self._kept[number - self.first])

    def nearest(self, number: int) -> int:
        """The number of a message that is kept, this one if it is. Undefined while nothing is."""
        return min(max(number, self.first), self.end - 1)

    def add(self, message: Message) -> None:
        """Keep it as the newest; older ones may leave."""
        message.latency_s  # noqa: B018  asked now, it stays what it was when the message came
        kept = copy(message)
        kept.decoded = UNDECODED
        if not isinstance(kept.raw, bytes):
            kept.raw = bytes(kept.raw)
        self._kept.append(kept)
        self.size_bytes += kept.size_bytes
        while len(self._kept) > 1 and (
            len(self._kept) > self._most_messages or self.size_bytes > self._most_bytes
        ):
            self.size_bytes -= self._kept.popleft().size_bytes
            self.first += 1

    def take(self, batch: Batch, _now_ns: int) -> None:
        """Keep what arrived since the last tick; see `SeriesTaker`."""
        self.missed += batch.dropped
        for message in batch.messages:
            self.add(message)

    def rewind(self) -> None:
        """What comes next is of another time: nothing that was there counts any more."""
        self._kept.clear()
        self.size_bytes = self.first = self.missed = 0
