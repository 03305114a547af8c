"""Subscriber on the native wire, to one topic or to all topics that match a pattern.

The master lists a pattern's subscriber once and reports the publishers of all matching topics to its node.
The hellos to all of them contain the subscriber's id, so these publishers wait for the subscriber as for any
other one, and their first messages aren't lost.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence

from nep.backends.base import SubscriberSpec
from nep.backends.bases.loss import TrackedPublisher
from nep.backends.zeromq.io_thread import IoThread
from nep.backends.zeromq.subscriber import NativeReadable, Readable, SocketSubscriber
from nep.backends.zeromq.topic_sockets import TopicSockets
from nep.messages.clocks import ClockDifference
from nep.protocol.requests import RemotePublisher
from nep.system.wakeup import Waker


class NativeSubscriber(SocketSubscriber[Readable]):
    """Subscriber on the native wire. The master session reports added and removed publishers.

    Args:
        readable: Socket of the topic, or the sockets of a pattern's topics.
        io: Thread that serves the subscriber.
        spec: Settings of the subscriber.
        on_close: Unregisters the subscriber with this id. Called once, without the lock.
    """

    def __init__(
        self,
        readable: NativeReadable | TopicSockets,
        io: IoThread,
        spec: SubscriberSpec,
        on_close: Callable[[int], None],
    ) -> None:
        super().__init__(readable, io, spec, on_close)
        self._topics = readable
        self._early_closed_ids: set[int] | None = set()
        """Ids of publishers that closed before `connect_listed`; None after `connect_listed`."""

    # ---- topics

    @property
    def _sockets(self) -> Sequence[NativeReadable]:
        return self._topics.sockets if isinstance(self._topics, TopicSockets) else (self._topics,)

    def _sockets_of(self, topic: str) -> Sequence[NativeReadable]:
        if not isinstance(self._topics, TopicSockets):
            return (self._topics,)
        socket = self._topics.find(topic)
        return () if socket is None else (socket,)

    def _sources(self) -> list[tuple[int, TrackedPublisher]]:
        return [each for socket in self._sockets for each in socket.sources.items()]

    def _socket_for_locked(self, remote: RemotePublisher) -> NativeReadable | None:
        # Returns None if it can't be created. Call `_recheck_locked` after using the socket.
        if isinstance(self._topics, TopicSockets):
            return self._topics.open(remote.publisher.topic)
        return self._topics

    def _recheck_locked(self, *sockets: NativeReadable) -> None:
        if isinstance(self._topics, TopicSockets):
            self._topics.recheck(*sockets)
        self._recheck_input_locked()

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Endpoints of all connections."""
        return tuple(source.endpoint for _each, source in self._sources() if source.endpoint)

    # ---- handshake

    def wait_for(self, publishers: Iterable[int], timeout_s: float, waker: Waker) -> bool:
        """Wait up to `timeout_s` seconds for the echo of these publishers; return False on timeout.

        Publishers that send a bye in the meantime, or to which connecting fails, are skipped.

        Args:
            publishers: Ids of the publishers.
            timeout_s: Maximum time in seconds.
            waker: Waker that ends a wait early, so that the condition is checked again.
        """
        expected = frozenset(publishers)
        return self.read_until(
            lambda: all(
                source.has_echoed or source.problem for each, source in self._sources() if each in expected
            ),
            timeout_s,
            waker,
        )

    def wait_for_any(self, timeout_s: float, waker: Waker) -> bool:
        """Wait up to `timeout_s` seconds for the echo of any publisher; return False on timeout."""
        return self.read_until(
            lambda: any(source.has_echoed for _each, source in self._sources()), timeout_s, waker
        )

    # ---- publishers

    def connect_listed(self, remotes: Iterable[RemotePublisher]) -> None:
        """Connect to the publishers listed at registration, except those that have closed in the meantime.

        The notification of a close and the reply to the registration are read in different threads, so the
        notification may be handled first.
        """
        with self._requested_lock():
            closed_ids, self._early_closed_ids = self._early_closed_ids or set(), None
            self._connect_locked(each for each in remotes if each.publisher.id not in closed_ids)

    def expect_all_messages(self, remote: RemotePublisher) -> None:
        """Count losses from the first message of a publisher that was created after this subscriber."""
        with self._requested_lock():
            is_registered = self._early_closed_ids is None
            socket = self._socket_for_locked(remote) if is_registered and not self.is_closed else None
            if socket is not None:
                socket.sources.expect_all_messages(remote.publisher.id)

    def connect(self, remotes: Iterable[RemotePublisher]) -> None:
        """Connect to publishers. Idempotent."""
        with self._requested_lock():
            self._connect_locked(remotes)

    def _connect_locked(self, remotes: Iterable[RemotePublisher]) -> None:
        if self.is_closed:
            return
        used_sockets: list[NativeReadable] = []
        for remote in remotes:
            socket = self._socket_for_locked(remote)
            if socket is not None:
                socket.connect(remote)
                used_sockets.append(socket)
        self._recheck_locked(*used_sockets)

    def reconnect_remote(self) -> None:
        """Reconnect to publishers on other computers, because the address of this computer has changed."""
        with self._requested_lock():
            if not self.is_closed:
                self._fill_locked()
                self._wake_waiters_locked()
                for socket in self._sockets:
                    socket.reconnect_remote()
                self._recheck_locked(*self._sockets)

    def reconcile(self, remotes: Iterable[RemotePublisher], topic: str = "") -> None:
        """Replace the list of publishers: connect to new ones, and mark unlisted ones as silent.

        Args:
            remotes: All publishers.
            topic: Topic of the publishers; "" for all topics.
        """
        publishers = tuple(remotes)
        self.connect(publishers)
        listed_ids = {remote.publisher.id for remote in publishers}
        with self._requested_lock():
            for socket in self._sockets_of(topic) if topic else self._sockets:
                for publisher_id, source in socket.sources.items():
                    if publisher_id not in listed_ids and source.remote is not None:
                        source.is_silent = True

    def handle_publisher_removed(self, publisher: int, last_seq: int, *, is_closed: bool) -> None:
        """Handle the removal of a publisher. See `SessionSubscriber.handle_publisher_removed`.

        The connection stays open until the publisher's bye, or until the publisher is replaced.
        """
        with self._requested_lock():
            if is_closed and self._early_closed_ids is not None:
                self._early_closed_ids.add(publisher)
            for socket in self._sockets:
                if is_closed:
                    socket.sources.mark_closing(publisher, last_seq, time.monotonic())
                else:
                    socket.sources.mark_silent(publisher, last_seq)

    def set_clock_differences(self, clocks: Mapping[str, ClockDifference]) -> None:
        """Set the clock differences of other computers, given by node id."""
        with self._requested_lock():
            for socket in self._sockets:
                socket.sources.set_clock_differences(clocks)

    def handle_renewal(self, now: float, last_seqs: Mapping[int, int]) -> None:
        """Handle a renewal: remove publishers that closed without a bye, and update the losses.

        Args:
            now: Current time (`time.monotonic`).
            last_seqs: Newest sequence number known to the master of each publisher, by id.
        """
        with self._requested_lock():
            if self.is_closed:
                return
            for socket in self._sockets:
                _handle_renewal(socket, now, last_seqs)
            if isinstance(self._topics, TopicSockets):
                self._topics.close_unused()
            self._recheck_locked(*self._sockets)


def _handle_renewal(socket: NativeReadable, now: float, last_seqs: Mapping[int, int]) -> None:
    sources = socket.sources
    for publisher in sources.expired_publishers(now):
        sources.count_missing(publisher)
        socket.disconnect(publisher)
    if not socket.has_input:
        # libzmq never connects again after a failed handshake, as with another program's PULL.
        for publisher in sources.unresponsive_publishers(now):
            socket.reconnect(publisher)
        for publisher in sources.by_id.keys() & last_seqs.keys():
            sources.expect_up_to(publisher, last_seqs[publisher])
