"""Negotiation of shared memory between publishers and subscribers.

Both classes are guarded by their owner's lock. docs/wire.md describes the notices.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

from nep.backends.zeromq.shared.memory import MIN_SHARED_BYTES, SharedReader, SharedWriter
from nep.errors import WireError
from nep.i18n import _
from nep.protocol.wire import OfferAcceptance

_NUMBER = struct.Struct("<Q")
REFERENCE_BYTES = _NUMBER.size
"""Size in bytes of the part of a message that refers to a payload."""
_MAX_OFFERS = 4
"""Maximum number of offers to a subscriber. A subscriber that doesn't confirm any can't share memory."""
_OFFER_RETRY_S = 0.5
_RECLAIM_INTERVAL_S = 1.0


class SharedPayloads:
    """Shared memory of one publisher, and the subscribers that read from it.

    Args:
        publisher: Id of the publisher.
        offer: Offers the memory to a subscriber; called with the id of the subscriber and the generation.
    """

    def __init__(self, publisher: int, offer: Callable[[int, int], None]) -> None:
        self.readers: set[int] = set()
        """Ids of the subscribers that have opened the current memory."""
        self._offer = offer
        self._offers: dict[int, tuple[int, float]] = {}
        self._writer = SharedWriter(publisher)
        self._reclaimed_at = float("-inf")

    def confirm(self, acceptance: OfferAcceptance) -> None:
        """Handle a subscriber's confirmation that it has opened the offered memory."""
        if acceptance.generation == self._writer.generation:
            self.readers.add(acceptance.subscriber)

    def discard(self, subscriber: int) -> None:
        """Remove a subscriber that has disconnected or has sent another hello."""
        self.readers.discard(subscriber)
        self._offers.pop(subscriber, None)

    def write(self, data: bytes | memoryview, subscribers: Mapping[int, int], now: float) -> bytes | None:
        """Write a payload to shared memory; return the part of the message that refers to the payload.

        Returns None if the payload must be sent over the socket, because there is no reader or no free
        slot.

        Args:
            data: Encoded payload.
            subscribers: Connected subscribers; the keys are their ids.
            now: Current time (`time.monotonic`).
        """
        size = data.nbytes if isinstance(data, memoryview) else len(data)
        if not subscribers or not self._prepare_readers(size, subscribers, now):
            return None
        loan = self._writer.find_loan(data) if isinstance(data, memoryview) else None
        number = self._writer.copy(data, size) if loan is None else self._writer.send(loan)
        if number is None:
            if now >= self._reclaimed_at + _RECLAIM_INTERVAL_S:
                self._reclaimed_at = now
                self._writer.reclaim_slots()
            return None
        return _NUMBER.pack(number)

    def _prepare_slots(self, size: int) -> bool:
        # No reader has opened a new segment yet.
        generation = self._writer.generation
        is_prepared = self._writer.prepare(size)
        if generation != self._writer.generation:
            self.readers.clear()
            self._offers.clear()
        return is_prepared

    def _prepare_readers(self, size: int, subscribers: Mapping[int, int], now: float) -> bool:
        if not self._prepare_slots(size):
            return False
        for subscriber in subscribers if len(self.readers) < len(subscribers) else ():
            offer_count, offered_at = self._offers.get(subscriber, (0, float("-inf")))
            is_due = offer_count < _MAX_OFFERS and now >= offered_at + _OFFER_RETRY_S
            if subscriber not in self.readers and is_due:
                self._offers[subscriber] = (offer_count + 1, now)
                self._offer(subscriber, self._writer.generation)
        return bool(self.readers)

    def borrow_memory(self, size: int) -> memoryview | None:
        """Return writable memory for a payload of `size` bytes.

        Returns None if no subscriber shares memory, `size` is less than `MIN_SHARED_BYTES`, or no slot
        is free.
        """
        if not self.readers or size < MIN_SHARED_BYTES or not self._prepare_slots(size) or not self.readers:
            return None
        loan = self._writer.loan(size)
        return None if loan is None else loan.buffer

    def close(self) -> None:
        """Stop sharing memory."""
        self.readers.clear()
        self._writer.close()


class SharedSources:
    """Shared memory of the publishers that one subscriber reads from.

    Args:
        subscriber: Id of the subscriber.
        send_acceptance: Sends the confirmation of an offer.
    """

    def __init__(self, subscriber: int, send_acceptance: Callable[[OfferAcceptance], None]) -> None:
        self._subscriber = subscriber
        self._send_acceptance = send_acceptance
        self._readers: dict[int, SharedReader] = {}

    def open(self, publisher: int, generation: int) -> None:
        """Open the memory that a publisher offers; send a confirmation on success.

        Args:
            publisher: Id of the publisher.
            generation: Number of the memory segment.
        """
        reader = self._readers.get(publisher)
        if reader is None or reader.generation != generation:
            try:
                self._readers[publisher] = SharedReader(publisher, generation)
            except LookupError:
                return
        self._send_acceptance(OfferAcceptance(self._subscriber, publisher, generation))

    def read(
        self, publisher: int, part: bytes | memoryview, *, may_copy: bool = False
    ) -> bytes | memoryview | None:
        """Return the payload that a message's part refers to.

        Args:
            publisher: Id of the publisher.
            part: Part of the message.
            may_copy: True to copy small payloads, which frees their slots.

        Returns:
            Read-only payload; None if it was overwritten or the publisher's memory isn't open.

        Raises:
            WireError: The part is malformed.
        """
        reader = self._readers.get(publisher)
        if len(part) != REFERENCE_BYTES:
            raise WireError(
                _("the message doesn't refer to a payload in shared memory"), len(part), code="shared-memory"
            )
        return None if reader is None else reader.read(_NUMBER.unpack(part)[0], may_copy=may_copy)

    def close_publisher(self, publisher: int) -> None:
        """Close the memory of a publisher. Payloads that are still used remain valid."""
        self._readers.pop(publisher, None)

    def close(self) -> None:
        """Close the memory of all publishers."""
        self._readers.clear()
