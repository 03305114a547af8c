"""Subscribers that are connected to a publisher."""

from __future__ import annotations

import logging
from collections.abc import Callable

from nep.backends.bases.rejections import RejectionCounter
from nep.backends.zeromq.byte_window import SendWindow
from nep.backends.zeromq.shared.payloads import SharedPayloads
from nep.backends.zeromq.sockets import RemoteConnection
from nep.protocol.wire import Hello, parse_acceptance, parse_acknowledgement, parse_hello, topic_part

_logger = logging.getLogger("nep")
MAX_SUBSCRIBERS = 10_000
"""Maximum number of subscribers with a hello. Further subscribers are treated as if without a hello."""


class Subscriptions:
    """Subscribers of a publisher, determined from its socket's subscription events. Performs no I/O.

    Tracks subscribers that have sent a hello to this publisher, and the plain filters of all others.
    Guarded by the publisher's lock.

    Args:
        topic: Name of the topic.
        publisher: Id of the publisher.
    """

    def __init__(self, topic: str, publisher: int) -> None:
        self.counts_at_hello: dict[int, int] = {}
        """Number of messages published before the hello of each connected subscriber, by id."""
        self.hellos: dict[int, bytes] = {}
        """First part of messages addressed to one subscriber alone, by its id."""
        self.legacy_filters: dict[bytes, int] = {}
        """Number of subscribers by plain filter, of those that don't accept messages of one part."""
        self._without_batches: set[int] = set()
        self.windows: dict[int, SendWindow] = {}
        """Send windows of subscribers that acknowledge messages, by id."""
        self._remote_connections: dict[int, RemoteConnection] = {}
        """Connections of subscribers on other computers, by id."""
        self.shared: SharedPayloads | None = None
        self.rejections = RejectionCounter()
        self._id = publisher
        self._topic_name = topic
        self._topic = topic_part(topic)

    @property
    def has_subscribers(self) -> bool:
        """True if any subscriber is connected."""
        return bool(self.counts_at_hello or self.legacy_filters)

    @property
    def all_accept_batches(self) -> bool:
        """True if all current subscribers accept batches."""
        return not self.legacy_filters and not self._without_batches

    @property
    def all_acknowledge(self) -> bool:
        """True if all current subscribers acknowledge messages."""
        return not self.legacy_filters and len(self.windows) == len(self.counts_at_hello)

    def clear(self) -> None:
        """Remove all subscribers that have sent a hello."""
        self.counts_at_hello.clear()
        self.hellos.clear()
        self.windows.clear()
        self._remote_connections.clear()
        self._without_batches.clear()

    def handle_event(
        self, event: bytes, count: int, get_connection: Callable[[], RemoteConnection | None] = lambda: None
    ) -> bytes | None:
        """Handle a subscription event.

        Args:
            event: Event from the XPUB socket.
            count: Number of messages published so far.
            get_connection: Returns the connection that delivered the event; None if the peer is on this
                computer.

        Returns:
            Topic frame for the echo if the event is the hello of a new subscriber, else None.
        """
        is_subscribe, subscription = event[:1] == b"\1", event[1:]
        hello = parse_hello(subscription)
        if hello is None:
            if not self._handle_reply(subscription, is_subscribe=is_subscribe):
                self._update_filters(subscription, is_subscribe=is_subscribe)
            return None
        if hello.topic != self._topic_name:
            return None  # a subscriber of another publisher that had this port before
        if is_subscribe:
            topic_frame = self._add_subscriber(hello, subscription, count)
            if topic_frame is not None:
                self._update_connection(hello.subscriber, get_connection())
            return topic_frame
        self._remove_subscriber(hello.subscriber)
        return None

    def _handle_reply(self, subscription: bytes, *, is_subscribe: bool) -> bool:
        # Handles acknowledgements and replies to offers. Returns True for these.
        ack, acceptance = parse_acknowledgement(subscription), parse_acceptance(subscription)
        if ack is not None:
            if is_subscribe and ack.publisher == self._id and ack.subscriber in self.windows:
                self.windows[ack.subscriber].acknowledge(ack.seq, ack.bound_bytes)
        elif acceptance is not None:
            is_own = acceptance.publisher == self._id and acceptance.subscriber in self.windows
            if is_subscribe and is_own and self.shared is not None:
                self.shared.confirm(acceptance)
        return ack is not None or acceptance is not None

    def _add_subscriber(self, hello: Hello, subscription: bytes, count: int) -> bytes | None:
        if len(self.counts_at_hello) >= MAX_SUBSCRIBERS and hello.subscriber not in self.counts_at_hello:
            self._reject(f"a hello beyond the limit of {MAX_SUBSCRIBERS} subscribers")
            return None
        if hello.reads_one_part:  # its plain filter was counted before
            remaining = self.legacy_filters.pop(self._topic, 0) - 1
            if remaining > 0:
                self.legacy_filters[self._topic] = remaining
        self.counts_at_hello[hello.subscriber] = count
        self.hellos[hello.subscriber] = subscription
        self.windows.pop(hello.subscriber, None)
        if self.shared is not None:
            self.shared.discard(hello.subscriber)
        self._without_batches.discard(hello.subscriber)
        if not hello.reads_batches:
            self._without_batches.add(hello.subscriber)
        if hello.acknowledges_echoes:
            self.windows[hello.subscriber] = SendWindow()  # a new connection: nothing is in flight
        return subscription

    def _update_connection(self, subscriber: int, connection: RemoteConnection | None) -> None:
        # A hello over a new connection means that the previous connection is abandoned.
        previous = self._remote_connections.pop(subscriber, None)
        if connection is not None:
            self._remote_connections[subscriber] = connection
            if previous is not None and previous != connection:
                previous.close()

    def close_silent(self) -> None:
        """Close connections to computers that have vanished; libzmq then removes their subscribers."""
        for connection in self._remote_connections.values():
            if connection.is_silent():
                connection.close()

    def _remove_subscriber(self, subscriber: int) -> None:
        self.counts_at_hello.pop(subscriber, None)
        self.hellos.pop(subscriber, None)
        self.windows.pop(subscriber, None)
        self._remote_connections.pop(subscriber, None)
        self._without_batches.discard(subscriber)
        if self.shared is not None:
            self.shared.discard(subscriber)

    def _update_filters(self, subscription: bytes, *, is_subscribe: bool) -> None:
        # XPUB_VERBOSE reports every subscribe, but only the last unsubscribe.
        if not self._topic.startswith(subscription):
            self._reject(f"an invalid subscription of {len(subscription)} bytes")
            return
        if is_subscribe:
            self.legacy_filters[subscription] = self.legacy_filters.get(subscription, 0) + 1
        else:
            self.legacy_filters.pop(subscription, None)

    def _reject(self, reason: str) -> None:
        if self.rejections.add(reason):
            _logger.info("'%s' received %s", self._topic_name, self.rejections.recent_message())
