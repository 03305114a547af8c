"""Registrations of a node at one master, renewed periodically.

All registrations are stored, so that a restarted master receives them again immediately. `RenewalTimer`
schedules the renewals.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Protocol

from msgspec.structs import replace

from nep.backends.zeromq.bindings import has_room_for_unix_sockets, select_endpoint
from nep.backends.zeromq.io_thread import IoThread, PollState
from nep.backends.zeromq.native_subscriber import NativeSubscriber
from nep.backends.zeromq.rpc import PendingRequest, RpcClient
from nep.backends.zeromq.sockets import CONNECT_TIMEOUT_MS, Socket, local_address_towards
from nep.errors import (
    AddressInUseError,
    ClosedError,
    MasterUnreachable,
    RequestRefusedError,
    TooManyFilesError,
)
from nep.i18n import _
from nep.messages.clocks import ClockDifference, is_plausible_clock
from nep.protocol.clock_samples import ClockSamples, Moment
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    RENEW_INTERVAL_S,
    AddedReply,
    AddPublisher,
    AddSubscriber,
    FoundReply,
    GraphReply,
    Join,
    Leave,
    NodeRecord,
    PublisherAdded,
    PublisherCount,
    PublisherRecord,
    PublisherRemoved,
    Push,
    QueryGraph,
    RemotePublisher,
    RemovePublisher,
    RemoveSubscriber,
    Renew,
    RenewedReply,
    Reply,
    ReportMissing,
    SubscriberCount,
    SubscriberRecord,
)
from nep.protocol.topic_pattern import matches
from nep.system.addresses import LOOPBACK, MasterNameResolver, is_endpoint, is_loopback, resolve_host
from nep.system.cpu import CpuLoad

_MAX_RENEW_INTERVAL_S = 30.0
"""Longest renewal interval in seconds that is accepted from a master."""

_logger = logging.getLogger("nep")

_ADDRESS_CHECK_INTERVAL_S = 1.0
"""Interval in seconds for checking whether the publishers must bind other addresses."""
_JOIN_RETRY_S = 0.5
_RECONNECT_S, _RECONNECT_REMOTE_S = 2.0, 2 * CONNECT_TIMEOUT_MS / 1000
"""Reconnection intervals in seconds for a master on this and on another computer.

libzmq gives up after a failed handshake, for example with a PUB socket at the master's address.
"""


class SessionPublisher(Protocol):
    """Interface of a publisher to its master session."""

    @property
    def is_local(self) -> bool:
        """True if programs of this computer can connect without TCP. See `bindings`."""

    def counts(self) -> PublisherCount:
        """Return the statistics that a renewal reports."""

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:
        """Bind these addresses of this computer and unbind all others; return the endpoints."""

    def unbind_local(self) -> None:
        """Stop accepting connections other than TCP."""


class SessionSubscriber(Protocol):
    """Interface of a subscriber to its master session."""

    def counts(self) -> SubscriberCount:
        """Return the statistics that a renewal reports."""

    def connect(self, remotes: Iterable[RemotePublisher]) -> None:
        """Connect to publishers in addition to the existing ones."""

    def handle_publisher_removed(self, publisher: int, last_seq: int, *, is_closed: bool) -> None:
        """Handle the removal of a publisher.

        Args:
            publisher: Id of the publisher.
            last_seq: Sequence number of its last message, 0 if unknown.
            is_closed: True if the publisher unregistered, False if its node doesn't respond.
        """

    def reconcile(self, remotes: Iterable[RemotePublisher], topic: str = "") -> None:
        """Replace the list of publishers.

        Args:
            remotes: All publishers.
            topic: Topic of the publishers; "" for all topics of the subscriber.
        """

    def handle_renewal(self, now: float, last_seqs: Mapping[int, int]) -> None:
        """Handle a renewal.

        Args:
            now: Current time (`time.monotonic`).
            last_seqs: Newest sequence number known to the master of each publisher, by id.
        """

    def reconnect_remote(self) -> None:
        """Reconnect to publishers on other computers, because the address of this computer has changed."""


class RenewalTimer:
    """Schedule of renewals: every second, unless the master requests another interval.

    Attributes:
        due_at: Time of the next renewal (`time.monotonic`).
    """

    def __init__(self) -> None:
        self.due_at = 0.0
        self._interval_s = RENEW_INTERVAL_S

    def start(self, now: float) -> None:
        """Record a renewal sent at `now` (`time.monotonic`) and schedule the next one.

        The next renewal takes place even if the master doesn't reply.
        """
        self.due_at = now + self._interval_s

    def set_interval(self, interval_s: float, now: float) -> None:
        """Set the interval that the master requests.

        Args:
            interval_s: Interval in seconds.
            now: Current time (`time.monotonic`).
        """
        self._interval_s = min(_MAX_RENEW_INTERVAL_S, max(RENEW_INTERVAL_S, interval_s))
        self.due_at = now + self._interval_s


class MasterSession:
    """Registrations of a node at one master.

    Args:
        socket: DEALER socket for the connection.
        io: Thread that serves the socket.
        node: Record of the node.
        address: Address of the master.
        look_up: Resolves a host name to an address.
    """

    def __init__(
        self,
        socket: Socket,
        io: IoThread,
        node: NodeRecord,
        address: str,
        look_up: Callable[[str], str] = resolve_host,
    ) -> None:
        self.address = address
        self._node = node
        self._io = io
        self._client = RpcClient(socket, address, after_use=lambda: io.serve_soon(self))
        self._lock = threading.Lock()
        self._publishers: dict[int, tuple[PublisherRecord, SessionPublisher]] = {}
        self._subscribers: dict[int, tuple[SubscriberRecord, SessionSubscriber]] = {}
        self._confirmed_ids: set[int] = set()
        self._epoch, self._revision = 0, 0
        self._join_retry_at = 0.0
        self._renewal_timer = RenewalTimer()
        self._address_check_at = 0.0
        self._was_connected = False
        self._is_closed = False
        self._leave_request: PendingRequest | None = None
        self._leave_sent_at = 0.0
        self._is_master_local = is_loopback(address)
        self._reconnect_s = _RECONNECT_S if self._is_master_local else _RECONNECT_REMOTE_S
        self._reconnect_at = time.monotonic() + self._reconnect_s
        self._served_hosts: tuple[str, ...] = ()
        self._own_host = LOOPBACK
        self._resolver = MasterNameResolver(address, self._set_address, look_up)
        if self._resolver.address:
            self._set_address(self._resolver.address)
        self._resolver.resolve(time.monotonic())
        self._bound_hosts = self.hosts
        self._connected_host = self._own_host
        self._load = CpuLoad()
        self._clock = ClockSamples()
        self._read_at = self._clock.now()
        self._clock_differences: Mapping[str, ClockDifference] = {}
        self.fd = self._client.fd

    @property
    def endpoint(self) -> str:
        """Endpoint of the connection; "" until the master's address is resolved."""
        return self._client.endpoint

    @property
    def hosts(self) -> tuple[str, ...]:
        """Addresses of this computer that publishers bind.

        On the master's computer, these are the loopback address and the addresses at which the master
        serves other computers. On other computers, it is the address of the interface that reaches the
        master.
        """
        return (LOOPBACK, *self._served_hosts) if self._is_master_local else (self._own_host,)

    # ---- for the transport, in any thread

    @property
    def is_idle(self) -> bool:
        """True if nothing is registered and no request is pending."""
        with self._lock:
            return not self._publishers and not self._subscribers and not self._client.has_waiting_requests

    def wait_for_address(self, wait_s: float | None) -> None:
        """Wait up to `wait_s` seconds until the master's address is resolved; None waits forever.

        Raises `MasterUnreachable` on timeout.
        """
        if not self._resolver.wait(wait_s) and wait_s is not None:
            raise MasterUnreachable(self.address, wait_s, is_known=False)

    def _set_address(self, address: str) -> None:
        if not self._is_master_local:
            self._own_host = local_address_towards(address) or self._own_host
        self._client.connect(address)

    def add_publisher(
        self, record: PublisherRecord, publisher: SessionPublisher, wait_s: float | None
    ) -> AddedReply:
        """Register a publisher and return the master's reply with the subscribers to wait for.

        Args:
            record: Record of the publisher.
            publisher: Publisher, which binds the addresses that the master returns.
            wait_s: Seconds to wait for each reply; None waits forever.

        Raises the same errors as `RpcClient.request`.
        """
        with self._lock:
            self._publishers[record.id] = (record, publisher)
        try:
            reply = self._client.request(AddPublisher(self._node, record), wait_s)
        except BaseException:
            self.remove_publisher(record.id, 0)
            raise
        with self._lock:
            self._confirmed_ids.add(record.id)
        added = reply if isinstance(reply, AddedReply) else AddedReply(reply.epoch, reply.revision)
        # the first registration returns the addresses that the master serves
        self._served_hosts = added.hosts
        endpoints = publisher.move(self.hosts)
        if endpoints == record.endpoints or not endpoints:
            return added
        moved_record = replace(record, endpoints=endpoints, local=publisher.is_local)
        return self.add_publisher(moved_record, publisher, wait_s)

    def add_subscriber(
        self,
        record: SubscriberRecord,
        subscriber: SessionSubscriber,
        wait_s: float | None,
    ) -> FoundReply:
        """Register a subscriber and return the master's reply with the publishers to connect to.

        Raises the same errors as `RpcClient.request`.
        """
        with self._lock:
            self._subscribers[record.id] = (record, subscriber)
        try:
            reply = self._client.request(AddSubscriber(self._node, record), wait_s)
        except BaseException:
            self.remove_subscriber(record.id)
            raise
        with self._lock:
            self._confirmed_ids.add(record.id)
        if not isinstance(reply, FoundReply):
            return FoundReply(reply.epoch, reply.revision)
        return replace(reply, publishers=self._select_endpoints(reply.publishers))

    def remove_publisher(self, publisher: int, last_seq: int) -> None:
        """Unregister a publisher, without waiting.

        Args:
            publisher: Id of the publisher.
            last_seq: Sequence number of its last message.
        """
        with self._lock:
            removed = self._publishers.pop(publisher, None)
            self._confirmed_ids.discard(publisher)
        if removed is not None:
            self._client.notify(RemovePublisher(self._node.id, publisher, last_seq))

    def remove_subscriber(self, subscriber: int) -> None:
        """Unregister a subscriber by its id, without waiting."""
        with self._lock:
            removed = self._subscribers.pop(subscriber, None)
            self._confirmed_ids.discard(subscriber)
        if removed is not None:
            self._client.notify(RemoveSubscriber(self._node.id, subscriber))

    def report_missing(self, publisher: int, subscribers: Iterable[int]) -> None:
        """Report the ids of subscribers that have not completed the handshake with a publisher."""
        self._client.notify(ReportMissing(self._node.id, publisher, tuple(subscribers)))

    def query_graph(self, timeout_s: float) -> GraphView:
        """Request the graph from the master. Raises the same errors as `RpcClient.request`."""
        self.wait_for_address(timeout_s)
        reply = self._client.request(QueryGraph(), timeout_s)
        if not isinstance(reply, GraphReply):
            raise RequestRefusedError(
                _("the master at '{address}' didn't reply with its graph").format(address=self.address)
            )
        return reply.view

    def start_leave(self) -> None:
        """Unregister the node if the master is connected, without waiting for the reply."""
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True  # prevents joining again
        if self._client.is_connected:
            self._renew()  # subscribers that miss the bye learn the last sequence numbers from the master
        with self._lock:
            self._publishers.clear()
            self._subscribers.clear()
            self._confirmed_ids.clear()
        if self._epoch != 0 and self._client.is_connected:
            self._leave_request = self._client.send_request(Leave(self._node.id))
            self._leave_sent_at = time.monotonic()

    def finish_leave(self, timeout_s: float) -> None:
        """Wait for the reply to the request of `start_leave`, until `timeout_s` seconds after it was sent."""
        if self._leave_request is None:
            return
        remaining_s = timeout_s + self._leave_sent_at - time.monotonic()
        try:
            self._client.wait(self._leave_request, max(0.0, remaining_s))
        except (MasterUnreachable, RequestRefusedError, ClosedError):
            _logger.debug("no reply from the master at '%s' while leaving", self.address)

    def close(self) -> None:
        """Close the connection."""
        self._client.stop()
        self._io.remove(self)
        self._client.release()

    # ---- in the I/O thread

    def serve(self, now: float) -> PollState:
        """Process replies; renew when a renewal is due, and immediately after a reconnection."""
        messages = self._client.read()
        self._read_at = self._clock.now() if messages else self._read_at
        for message in messages:
            self._handle_reply(message.content, now)
            if message.callback is not None and not isinstance(message.content, Push):
                message.callback(message.content)
        if self._is_closed:
            return PollState()
        is_connected = self._client.is_connected
        if is_connected and not self._was_connected:
            self._renewal_timer.due_at = now
        self._was_connected = is_connected
        if is_connected:
            self._reconnect_at = now + self._reconnect_s
        else:
            self._resolver.resolve(now)
            self._reconnect_if_due(now)
        is_due = now >= self._renewal_timer.due_at
        if is_due or now >= self._address_check_at:
            self._address_check_at = now + _ADDRESS_CHECK_INTERVAL_S
            self._update_addresses()
        if is_due:
            self._renewal_timer.start(now)
            self._renew()
        due = min(self._renewal_timer.due_at, self._address_check_at)
        return PollState(due=now if self._client.has_more else due)

    def _reconnect_if_due(self, now: float) -> None:
        if now >= self._reconnect_at:
            self._reconnect_at = now + self._reconnect_s
            self._client.reconnect()

    def _update_addresses(self) -> None:
        # Rebinds the publishers when this computer's address or the master changes, or descriptors run out.
        if not self._is_master_local and self._resolver.address:
            self._own_host = local_address_towards(self._resolver.address) or self._own_host
            self._reconnect_from(self._own_host)
        is_short_of_descriptors = not has_room_for_unix_sockets()
        if self.hosts == self._bound_hosts and not is_short_of_descriptors:
            return
        self._bound_hosts = self.hosts
        with self._lock:
            for member_id, (record, publisher) in self._publishers.items():
                if is_short_of_descriptors:
                    publisher.unbind_local()
                try:
                    moved_record = replace(
                        record, endpoints=publisher.move(self.hosts), local=publisher.is_local
                    )
                except (AddressInUseError, TooManyFilesError):
                    self._bound_hosts = ()  # try again at the next renewal
                    continue
                if moved_record != record and moved_record.endpoints:
                    self._publishers[member_id] = (moved_record, publisher)
                    if member_id in self._confirmed_ids:
                        self._client.notify(AddPublisher(self._node, moved_record))

    def _reconnect_from(self, host: str) -> None:
        # Connections from the old address would stay silent for many seconds.
        old_host, self._connected_host = self._connected_host, host
        if old_host in {host, LOOPBACK}:  # `LOOPBACK`: not known before
            return
        self._client.reconnect()
        self._was_connected = False
        for _record, subscriber in self._all_subscribers():
            subscriber.reconnect_remote()

    def _select_endpoints(self, remotes: Iterable[RemotePublisher]) -> tuple[RemotePublisher, ...]:
        return tuple(select_endpoint(remote, self._resolver.address or self.address) for remote in remotes)

    def _handle_reply(self, reply: Reply | Push, now: float) -> None:
        if isinstance(reply, AddedReply | FoundReply | RenewedReply) and reply.hosts != self._served_hosts:
            self._served_hosts = reply.hosts
            self._renewal_timer.due_at = now
        if isinstance(reply, PublisherAdded):
            self._handle_publisher_added(reply)
        elif isinstance(reply, PublisherRemoved):
            self._handle_publisher_removed(reply)
        elif isinstance(reply, RenewedReply):
            self._handle_renewed(reply, now)
        elif isinstance(reply, AddedReply | FoundReply) and self._epoch == 0:
            self._epoch = reply.epoch
        if self._epoch not in {0, reply.epoch}:
            self._join(now)

    def _handle_publisher_added(self, added: PublisherAdded) -> None:
        remotes = self._select_endpoints((added.publisher,))
        has_valid_endpoint = any(
            is_endpoint(each) for remote in remotes for each in remote.publisher.endpoints
        )
        for subscriber in self._subscribers_of(added.publisher.publisher.topic):
            if added.is_new and has_valid_endpoint and isinstance(subscriber, NativeSubscriber):
                subscriber.expect_all_messages(added.publisher)
            subscriber.connect(remotes)

    def _handle_publisher_removed(self, removed: PublisherRemoved) -> None:
        for subscriber in self._subscribers_of(removed.topic):
            subscriber.handle_publisher_removed(removed.id, removed.last_seq, is_closed=removed.is_closed)

    def _renew(self) -> None:
        if self._epoch == 0:
            return
        offset = self._clock.offset()
        if offset is None:
            self._update_clocks({})  # also after the clock of this computer was set
        with self._lock:
            publishers = [
                publisher for each, (_, publisher) in self._publishers.items() if each in self._confirmed_ids
            ]
            subscribers = [
                subscriber
                for each, (_, subscriber) in self._subscribers.items()
                if each in self._confirmed_ids
            ]
            request = Renew(
                self._node.id,
                self._epoch,
                self._revision,
                tuple(publisher.counts() for publisher in publishers),
                tuple(subscriber.counts() for subscriber in subscribers),
                self._load.ratio(),
                offset or (),
            )
            self._client.notify(request, callback=partial(self._add_clock_sample, self._clock.now()))

    def _add_clock_sample(self, sent_at: Moment, reply: Reply) -> None:
        # Compares this computer's clock with the master's by the times of a renewal and its reply.
        if not isinstance(reply, RenewedReply) or reply.epoch != self._epoch or not reply.times:
            return
        was_known = self._clock.offset() is not None
        if len(reply.times) != 2:
            self._client.rejections.add(_("a reply to a renewal must have two times"))
        elif self._clock.add(sent_at, *reply.times, self._read_at) and not was_known:
            self._renewal_timer.due_at = self._read_at.steady_ns / 1e9  # other nodes wait for it

    def _handle_renewed(self, reply: RenewedReply, now: float) -> None:
        if reply.again:
            self._join(now)
            return
        self._revision = reply.revision
        self._renewal_timer.set_interval(reply.next_s, now)
        for topic in reply.topics:
            for subscriber in self._subscribers_of(topic.topic):
                subscriber.reconcile(self._select_endpoints(topic.publishers), topic.topic)
        self._update_clocks(self._parse_clock_differences(reply))
        for _record, session_subscriber in self._all_subscribers():
            session_subscriber.handle_renewal(now, reply.last_seqs)

    def _parse_clock_differences(self, reply: RenewedReply) -> Mapping[str, ClockDifference]:
        known_at_ns = time.monotonic_ns()
        differences = {
            node_id: ClockDifference(*clock_times, known_at_ns)
            for node_id, clock_times in reply.clocks.items()
            if len(clock_times) == 2 and is_plausible_clock(clock_times[0] // 2, clock_times[1] // 2)
        }
        if len(differences) < len(reply.clocks):
            self._client.rejections.add(_("a reported clock difference is impossible"))
        return differences

    def _update_clocks(self, clocks: Mapping[str, ClockDifference]) -> None:
        if clocks or self._clock_differences:
            self._clock_differences = clocks
            for _record, subscriber in self._all_subscribers():
                # replies of servers have no time stamps
                if isinstance(subscriber, NativeSubscriber):
                    subscriber.set_clock_differences(clocks)

    def _join(self, now: float) -> None:
        # Registers everything again, at most once per `_JOIN_RETRY_S`.
        # the new master hasn't requested an interval yet
        self._renewal_timer.set_interval(RENEW_INTERVAL_S, now)
        if now < self._join_retry_at:
            return
        self._join_retry_at = now + _JOIN_RETRY_S
        with self._lock:
            if self._is_closed:  # a join after the leave would register the node again
                return
            publishers = tuple(record for record, _ in self._publishers.values())
            subscribers = tuple(record for record, _ in self._subscribers.values())
            request = Join(self._node, self._epoch, publishers, subscribers)
            ids = {record.id for record in publishers} | {record.id for record in subscribers}
            self._client.notify(request, callback=lambda reply: self._handle_joined(reply, ids))

    def _handle_joined(self, reply: Reply, ids: set[int]) -> None:
        if not isinstance(reply, FoundReply):
            return
        self._epoch, self._revision = reply.epoch, reply.revision
        self._clock.clear()  # the master may run on another computer now
        self._join_retry_at = 0.0
        with self._lock:
            self._confirmed_ids = ids & (self._publishers.keys() | self._subscribers.keys())
        publishers_by_topic: dict[str, list[RemotePublisher]] = {}
        for remote in self._select_endpoints(reply.publishers):
            publishers_by_topic.setdefault(remote.publisher.topic, []).append(remote)
        for record, subscriber in self._all_subscribers():
            topics = (
                [each for each in publishers_by_topic if matches(record.topic, each)]
                if record.pattern
                else [record.topic]
            )
            subscriber.reconcile(
                [remote for topic in topics for remote in publishers_by_topic.get(topic, ())]
            )

    def _subscribers_of(self, topic: str) -> list[SessionSubscriber]:
        return [
            subscriber
            for record, subscriber in self._all_subscribers()
            if (matches(record.topic, topic) if record.pattern else record.topic == topic)
        ]

    def _all_subscribers(self) -> list[tuple[SubscriberRecord, SessionSubscriber]]:
        with self._lock:
            return list(self._subscribers.values())
