"""Queue for messages that arrive before the publisher's reply to the hello. Performs no I/O.

A publisher's history and its new messages arrive on different paths. New messages that arrive first are
queued until the history is complete.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from operator import itemgetter
from typing import Generic, TypeVar

from nep.backends.bases.loss import PublisherTracker
from nep.messages.history import MAX_HISTORY_BYTES
from nep.protocol.wire import Header

T = TypeVar("T")
_MAX_QUEUED_S = 15.0
"""Maximum time in seconds that a message is queued. A publisher replies to a hello within ten seconds."""


class EarlyMessages(Generic[T]):
    """Queue for the early messages of one subscriber. Guarded by the subscriber's lock.

    Args:
        sources: Publishers that the subscriber receives from.
        max_messages: Maximum number of queued messages per publisher.
        clock: Returns a monotonic time in seconds.
    """

    def __init__(
        self, sources: PublisherTracker, max_messages: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._sources = sources
        self._max_messages = max_messages
        self._clock = clock
        self._queued: dict[int, list[tuple[int, T, int]]] = {}
        self._deadlines: dict[int, float] = {}
        self._bytes = 0

    def queue_if_early(self, header: Header, message: T, size_bytes: int) -> bool:
        """Queue a message that arrived too early; return False if it can be delivered now.

        Args:
            header: Header of the message.
            message: Object to queue.
            size_bytes: Size of the message in bytes.
        """
        source = self._sources.find(header.publisher)
        if source is None or source.remote is None or source.has_echoed:
            return False
        now = self._clock()
        deadline = self._deadlines.setdefault(header.publisher, now + _MAX_QUEUED_S)
        if now >= deadline or not self._has_room(header):
            return False
        self._queued.setdefault(header.publisher, []).append((header.seq, message, size_bytes))
        self._bytes += size_bytes
        return True

    def _has_room(self, header: Header) -> bool:
        count = len(self._queued.get(header.publisher, ()))
        return count < self._max_messages and self._bytes < MAX_HISTORY_BYTES

    def pop(self, publisher: int) -> list[T]:
        """Remove a publisher's queued messages and return them in order of their sequence numbers.

        Messages that the history contained as well are left out.
        """
        self._deadlines.pop(publisher, None)
        queued_messages = self._queued.pop(publisher, [])
        self._bytes -= sum(size_bytes for _seq, _message, size_bytes in queued_messages)
        source = self._sources.find(publisher)
        last_seq = 0 if source is None or source.last is None else source.last
        return [
            message for seq, message, _size in sorted(queued_messages, key=itemgetter(0)) if seq > last_seq
        ]
