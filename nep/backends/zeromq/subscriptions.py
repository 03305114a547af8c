"""Subscriptions: the subscribers connected to a publisher."""

from __future__ import annotations

import logging
from collections.abc import Callable

from nep.backends.zeromq.byte_window import SendWindow
from nep.backends.zeromq.shared.payloads import SharedPayloads
from nep.backends.zeromq.sockets import FarConnection, Refusals
from nep.protocol.wire import Hello, parse_hello, parse_read, parse_shares, topic_part

__all__ = ["MAX_SUBSCRIBERS", "Subscriptions"]

_logger = logging.getLogger("nep")
MAX_SUBSCRIBERS = 10_000
"""Maximum number of greeted subscribers. Further ones receive messages like subscribers without a hello."""


class Subscriptions:
    """Subscribers of a publisher, by the subscriptions that its socket receives. No sockets.

    Tracks subscribers that said hello to this publisher of `topic`, and the plain filters of others. Guarded
    by the publisher's lock.
    """

    def __init__(self, topic: str, publisher: int) -> None:
        self.seen: dict[int, int] = {}
        """Message counts at the hello, by the id of connected subscribers."""
        self.hellos: dict[int, bytes] = {}
        """First part that addresses one subscriber alone, by its id."""
        self.apart: dict[bytes, int] = {}
        """Number of subscribers by plain filter, for those that don't accept messages of one part."""
        self._without_batches: set[int] = set()
        self.windows: dict[int, SendWindow] = {}
        """Send windows of subscribers that acknowledge messages."""
        self._far: dict[int, FarConnection] = {}
        """Connections of subscribers on other computers."""
        self.shared: SharedPayloads | None = None
        self.refusals = Refusals()
        self._id = publisher
        self._name = topic
        self._topic = topic_part(topic)

    @property
    def is_there(self) -> bool:
        """True if any subscriber is connected."""
        return bool(self.seen or self.apart)

    @property
    def reads_batches(self) -> bool:
        """True if all current subscribers accept batches."""
        return not self.apart and not self._without_batches

    @property
    def tells_all(self) -> bool:
        """True if all current subscribers acknowledge messages."""
        return not self.apart and len(self.windows) == len(self.seen)

    def forget(self) -> None:
        """Remove all subscribers that said hello."""
        self.seen.clear()
        self.hellos.clear()
        self.windows.clear()
        self._far.clear()
        self._without_batches.clear()

    def note(
        self, event: bytes, count: int, came_by: Callable[[], FarConnection | None] = lambda: None
    ) -> bytes | None:
        """Process a subscription event after `count` messages.

        Args:
            event: Event from the XPUB socket.
            count: Number of messages published so far.
            came_by: Returns the connection of the event if it comes from another computer.

        Returns:
            First part that addresses a subscriber to greet, or None.
        """
        is_wanted, what = event[:1] == b"\1", event[1:]
        hello = parse_hello(what)
        if hello is None:
            if not self._is_answer(what, is_wanted=is_wanted):
                self._note_filter(what, is_wanted=is_wanted)
            return None
        if hello.topic != self._name:
            return None  # a subscriber of this port's previous owner
        if is_wanted:
            own = self._note_hello(hello, what, count)
            if own is not None:
                self._note_connection(hello.subscriber, came_by())
            return own
        self._leave(hello.subscriber)
        return None

    def _is_answer(self, what: bytes, *, is_wanted: bool) -> bool:
        # Returns True for acknowledgements and replies to offers, which it processes.
        read, shares = parse_read(what), parse_shares(what)
        if read is not None:
            if is_wanted and read.publisher == self._id and read.subscriber in self.windows:
                self.windows[read.subscriber].read(read.seq, read.bound_bytes)
        elif shares is not None:
            own = is_wanted and shares.publisher == self._id and shares.subscriber in self.windows
            if own and self.shared is not None:
                self.shared.note(shares)
        return read is not None or shares is not None

    def _note_hello(self, hello: Hello, what: bytes, count: int) -> bytes | None:
        if len(self.seen) >= MAX_SUBSCRIBERS and hello.subscriber not in self.seen:
            self._refuse(f"a hello beyond the limit of {MAX_SUBSCRIBERS} subscribers")
            return None
        if hello.one_part:  # its plain filter was counted before
            left = self.apart.pop(self._topic, 0) - 1
            if left > 0:
                self.apart[self._topic] = left
        self.seen[hello.subscriber] = count
        self.hellos[hello.subscriber] = what
        self.windows.pop(hello.subscriber, None)
        if self.shared is not None:
            self.shared.forget(hello.subscriber)
        self._without_batches.discard(hello.subscriber)
        if not hello.batches:
            self._without_batches.add(hello.subscriber)
        if hello.tells:
            self.windows[hello.subscriber] = SendWindow()  # a new connection: nothing is in flight
        return what

    def _note_connection(self, subscriber: int, connection: FarConnection | None) -> None:
        # After a hello over a new connection the previous one is abandoned.
        before = self._far.pop(subscriber, None)
        if connection is not None:
            self._far[subscriber] = connection
            if before is not None and before != connection:
                before.end()

    def end_silent(self) -> None:
        """End connections to computers that have vanished; their subscribers are removed soon after."""
        for connection in self._far.values():
            if connection.is_silent():
                connection.end()

    def _leave(self, subscriber: int) -> None:
        self.seen.pop(subscriber, None)
        self.hellos.pop(subscriber, None)
        self.windows.pop(subscriber, None)
        self._far.pop(subscriber, None)
        self._without_batches.discard(subscriber)
        if self.shared is not None:
            self.shared.forget(subscriber)

    def _note_filter(self, what: bytes, *, is_wanted: bool) -> None:
        # XPUB_VERBOSE reports every subscribe, but only the last unsubscribe.
        if not self._topic.startswith(what):
            self._refuse(f"an invalid subscription of {len(what)} bytes")
            return
        if is_wanted:
            self.apart[what] = self.apart.get(what, 0) + 1
        else:
            self.apart.pop(what, None)

    def _refuse(self, reason: str) -> None:
        if self.refusals.add(reason):
            _logger.info("'%s' received %s", self._name, self.refusals.told())
