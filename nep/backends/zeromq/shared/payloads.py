"""Payloads in shared memory: which subscribers read a publisher's, and which publishers' a subscriber reads.

Both live under the lock of their owner. What is said about it on the wire: docs/wire.md.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

from nep.backends.zeromq.shared.memory import SHARED_BYTES, SharedReader, SharedWriter
from nep.errors import WireError
from nep.i18n import _
from nep.protocol.wire import Shares

__all__ = ["SharedPayloads", "SharedSources"]

_NUMBER = struct.Struct("<Q")
_OFFERS = 4
"""So often a subscriber is offered the memory; whoever has not answered then cannot share it."""
_AGAIN_S = 0.5
_TIDY_S = 1.0


class SharedPayloads:
    """`offer(subscriber, generation)` sends one of them the notice."""

    def __init__(self, publisher: int, offer: Callable[[int, int], None]) -> None:
        self.readers: set[int] = set()
        """Who reads the memory there is now."""
        self._offer = offer
        self._offered: dict[int, tuple[int, float]] = {}
        self._writer = SharedWriter(publisher)
        self._tidied_at = float("-inf")

    def note(self, shares: Shares) -> None:
        """A subscriber has opened some memory."""
        if shares.generation == self._writer.generation:
            self.readers.add(shares.subscriber)

    def forget(self, subscriber: int) -> None:
        """It says hello anew, or has gone."""
        self.readers.discard(subscriber)
        self._offered.pop(subscriber, None)

    def place(self, data: bytes | memoryview, seen: Mapping[int, int], now: float) -> bytes | None:
        """Put a payload there, for those who read; what its part in the message is.

        None when it has to go through the socket to all: nobody shares, or no slot is free.
        """
        size = data.nbytes if isinstance(data, memoryview) else len(data)
        if not seen or not self._is_ready(size, seen, now):
            return None
        lent = self._writer.lent(data) if isinstance(data, memoryview) else None
        number = self._writer.copy(data, size) if lent is None else self._writer.send(lent)
        if number is None:
            if now >= self._tidied_at + _TIDY_S:
                self._tidied_at = now
                self._writer.tidy()
            return None
        return _NUMBER.pack(number)

    def _has_slots(self, size: int) -> bool:
        """Whether there are slots for payloads of this size. New memory nobody has opened yet."""
        generation = self._writer.generation
        is_there = self._writer.prepare(size)
        if generation != self._writer.generation:
            self.readers.clear()
            self._offered.clear()
        return is_there

    def _is_ready(self, size: int, seen: Mapping[int, int], now: float) -> bool:
        if not self._has_slots(size):
            return False
        for each in seen if len(self.readers) < len(seen) else ():
            times, at = self._offered.get(each, (0, float("-inf")))
            if each not in self.readers and times < _OFFERS and now >= at + _AGAIN_S:
                self._offered[each] = (times + 1, now)
                self._offer(each, self._writer.generation)
        return bool(self.readers)

    def lend(self, size: int) -> memoryview | None:
        """Memory for a payload of this size, to be written, then published; None where nobody shares it."""
        if not self.readers or size < SHARED_BYTES or not self._has_slots(size) or not self.readers:
            return None
        loan = self._writer.loan(size)
        return None if loan is None else loan.buffer

    def close(self) -> None:
        """Nothing is put there any more."""
        self.readers.clear()
        self._writer.close()


class SharedSources:
    """Of the subscriber `subscriber`; `answer` tells a publisher that its memory is open."""

    def __init__(self, subscriber: int, answer: Callable[[Shares], None]) -> None:
        self._subscriber = subscriber
        self._answer = answer
        self._readers: dict[int, SharedReader] = {}

    def open(self, publisher: int, generation: int) -> None:
        """A publisher offers its memory. Where it cannot be opened nothing is said."""
        known = self._readers.get(publisher)
        if known is None or known.generation != generation:
            try:
                self._readers[publisher] = SharedReader(publisher, generation)
            except LookupError:
                return
        self._answer(Shares(self._subscriber, publisher, generation))

    def take(
        self, publisher: int, part: bytes | memoryview, *, may_copy: bool = False
    ) -> bytes | memoryview | None:
        """The payload that a message's part names; None when it is there no more. Raises `WireError`.

        With `may_copy` small ones are copied out of their slot.
        """
        reader = self._readers.get(publisher)
        if len(part) != _NUMBER.size:
            raise WireError(_("it names no payload in shared memory"), len(part), code="shared-memory")
        return None if reader is None else reader.take(_NUMBER.unpack(part)[0], may_copy=may_copy)

    def leave(self, publisher: int) -> None:
        """Close its memory; payloads that somebody looks at stay."""
        self._readers.pop(publisher, None)

    def close(self) -> None:
        """Close all."""
        self._readers.clear()
