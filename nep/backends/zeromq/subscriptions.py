"""Subscriptions: who reads at a publisher's port."""

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
"""Whoever says hello after so many is not greeted: it gets messages as one who says no hello."""


class Subscriptions:
    """Who reads at a publisher's port, from the subscriptions that come in there. It has no sockets.

    Those who said hello to this publisher of `topic`, and the filters of others.

    It lives under its publisher's lock.
    """

    def __init__(self, topic: str, publisher: int) -> None:
        self.seen: dict[int, int] = {}
        """Subscribers that said hello and have not gone, and how many messages there had been then."""
        self.hellos: dict[int, bytes] = {}
        """Under which first part each of them is reached alone."""
        self.apart: dict[bytes, int] = {}
        """Filters by which somebody reads who did not say that it reads messages of one part; of how many."""
        self._without_batches: set[int] = set()
        self.windows: dict[int, SendWindow] = {}
        """What is under way to those that tell what they have read."""
        self._far: dict[int, FarConnection] = {}
        """Over which connection those on other computers said hello."""
        self.shared: SharedPayloads | None = None
        self.refusals = Refusals()
        self._id = publisher
        self._name = topic
        self._topic = topic_part(topic)

    @property
    def is_there(self) -> bool:
        """Whether anybody reads."""
        return bool(self.seen or self.apart)

    @property
    def reads_batches(self) -> bool:
        """Whether all who read take several messages in one part."""
        return not self.apart and not self._without_batches

    @property
    def tells_all(self) -> bool:
        """Whether all who read tell what they have read."""
        return not self.apart and len(self.windows) == len(self.seen)

    def forget(self) -> None:
        """Forget all who said hello."""
        self.seen.clear()
        self.hellos.clear()
        self.windows.clear()
        self._far.clear()
        self._without_batches.clear()

    def note(
        self, event: bytes, count: int, came_by: Callable[[], FarConnection | None] = lambda: None
    ) -> bytes | None:
        """Somebody came or went, after `count` messages; the first part under which to greet a subscriber.

        `came_by` tells over which connection, if that leads to another computer.
        """
        is_wanted, what = event[:1] == b"\1", event[1:]
        hello = parse_hello(what)
        if hello is None:
            if not self._is_answer(what, is_wanted=is_wanted):
                self._note_filter(what, is_wanted=is_wanted)
            return None
        if hello.topic != self._name:
            return None  # a subscriber of whoever had this port before
        if is_wanted:
            own = self._note_hello(hello, what, count)
            if own is not None:
                self._note_connection(hello.subscriber, came_by())
            return own
        self._leave(hello.subscriber)
        return None

    def _is_answer(self, what: bytes, *, is_wanted: bool) -> bool:
        """Whether it answers an echo or an offer; noted when it does."""
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
            self._refuse(f"the hello of one more than {MAX_SUBSCRIBERS} subscribers")
            return None
        if hello.one_part:  # its own filter came before
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
            self.windows[hello.subscriber] = SendWindow()  # a connection of its own: nothing is under way
        return what

    def _note_connection(self, subscriber: int, connection: FarConnection | None) -> None:
        """A subscriber has one: where it says hello over another one, nobody reads the first any more."""
        before = self._far.pop(subscriber, None)
        if connection is not None:
            self._far[subscriber] = connection
            if before is not None and before != connection:
                before.end()

    def end_silent(self) -> None:
        """End the connections to computers that have vanished. Their subscribers are gone soon after."""
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
        """Each filter that comes is told, and the last of its kind that goes."""
        if not self._topic.startswith(what):
            self._refuse(f"{len(what)} bytes that are no subscription of it")
            return
        if is_wanted:
            self.apart[what] = self.apart.get(what, 0) + 1
        else:
            self.apart.pop(what, None)

    def _refuse(self, reason: str) -> None:
        if self.refusals.add(reason):
            _logger.info("'%s' was sent %s", self._name, self.refusals.told())
