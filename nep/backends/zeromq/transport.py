"""Transport of the back end `zeromq`, for the native wire and the wire of the original NEP."""

from __future__ import annotations

import select
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol
from weakref import WeakSet

import zmq

from nep.backends.base import (
    HANDSHAKE_TIMEOUT_S,
    PublisherSpec,
    PublisherTransport,
    SubscriberSpec,
    SubscriberTransport,
)
from nep.backends.connection import Configuration, Direct, Hybrid
from nep.backends.services import (
    CallQueue,
    ClientSpec,
    ClientTransport,
    ServerSpec,
    ServerTransport,
    SurveyTransport,
)
from nep.backends.zeromq.checked_sub_socket import CHECKED_TYPES, CheckedSubSocket
from nep.backends.zeromq.io_thread import IoThread, Pollable, SharedContext, shared_context
from nep.backends.zeromq.legacy import OriginalPublisher, OriginalSubscriber, OriginalSubSocket, attach
from nep.backends.zeromq.master_session import MasterSession, SessionPublisher
from nep.backends.zeromq.native_subscriber import NativeSubscriber
from nep.backends.zeromq.publisher import NativePublisher
from nep.backends.zeromq.services.node_services import ZeromqServices
from nep.backends.zeromq.sockets import Socket
from nep.backends.zeromq.sub_socket import SubSocket
from nep.backends.zeromq.subscriber import NativeReadable, Readable, SocketSubscriber
from nep.backends.zeromq.topic_sockets import TopicSockets
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import ExpectedSubscriber, NodeRecord, PublisherRecord, SubscriberRecord
from nep.protocol.wire import MAX_SUBSCRIPTION_BYTES
from nep.system.descriptors import check_free_descriptors
from nep.system.forks import call_in_child, close_in_child
from nep.system.wakeup import Waker

DIRECT_WAIT_S = 0.3
"""Maximum time in seconds to wait for the peer of a direct connection, which may not exist."""
_LEAVE_TIMEOUT_S = 0.3
_FDS_PER_THREAD = 4
_MAX_IDLE_SESSIONS = 8
"""Maximum number of open sessions without registrations."""
_Subscriber = SocketSubscriber[Readable] | NativeSubscriber | OriginalSubscriber


class OwnedPublisher(PublisherTransport, Pollable, Protocol):
    """Interface of a publisher to its transport."""

    spec: PublisherSpec

    def send_bye(self) -> None:
        """Send the bye and stop accepting messages."""

    def finish(self, deadline: float) -> None:
        """Wait until all messages are delivered, or until `deadline` (`time.monotonic`)."""

    def release(self) -> None:
        """Release the socket. The I/O thread must have stopped serving it."""


class MasterPublisher(OwnedPublisher, SessionPublisher, Protocol):
    """Interface of a publisher that is registered at a master."""

    def expect(self, expected: Iterable[ExpectedSubscriber]) -> None:
        """Add registered subscribers whose hellos are expected."""

    def wait_for(self, expected: Iterable[ExpectedSubscriber], timeout_s: float) -> tuple[int, ...]:
        """Wait up to `timeout_s` seconds for the hellos of these subscribers; return the missing ids."""


class ThreadWait:
    """Waker and poller of one waiting thread. If woken before a wait, the wait returns immediately."""

    def __init__(self) -> None:
        self.waker = Waker()
        self.is_busy = False
        """True while its thread waits or is about to wait."""
        self._fds: list[int] | None = None
        self._poll: Callable[[int], Sequence[tuple[int, int]]]

    def wait(self, fds: list[int], timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds until one of `fds` is readable or the waker is woken."""
        if fds != self._fds:
            self._poll, self._fds = _poll_function((*fds, self.waker.fd)), fds
        for fd, _events in self._poll(int(timeout_s * 1000) + 1):
            if fd == self.waker.fd:
                self.waker.clear()


def _poll_function(fds: tuple[int, ...]) -> Callable[[int], Sequence[tuple[int, int]]]:
    # Negative descriptors are ignored.
    fds = tuple(fd for fd in fds if fd >= 0)
    if not hasattr(select, "poll"):  # Windows
        polled = [(fd, zmq.POLLIN) for fd in fds]
        return lambda timeout_ms: zmq.zmq_poll(polled, timeout_ms)
    poller = select.poll()
    for fd in fds:
        poller.register(fd, select.POLLIN)
    return poller.poll


class ZeromqTransport:
    """Sockets and master sessions of one node, in the ZeroMQ context and I/O thread of the process.

    Sinks run in a separate thread per node. They therefore can't block other nodes, and may send requests
    to the master and create publishers and subscribers.
    """

    def __init__(self, node: NodeRecord) -> None:
        self._node = node
        self._shared: SharedContext = shared_context()
        self._io = self._shared.io
        self._sink_io: IoThread | None = None
        self._lock = threading.Lock()
        self._sessions: dict[str, MasterSession] = {}
        self._publishers: set[OwnedPublisher] = set()
        self._subscribers: dict[int, _Subscriber] = {}
        self._busy_wakers: list[Waker] = []
        self._threads = threading.local()
        self._thread_waits: WeakSet[ThreadWait] = WeakSet()
        self._is_closed = False
        self._is_terminated = False
        self._services = ZeromqServices(self._shared, self._session, node.name)
        self._direct_endpoints: dict[int, str] = {}
        """Endpoints of direct connections, by the id of their publisher or subscriber."""
        call_in_child(self._give_up_in_child)

    # ---- publishers

    def create_publisher(self, spec: PublisherSpec) -> PublisherTransport:
        """Create a publisher. See `Transport.create_publisher`."""
        with self._acquired_context():
            if isinstance(spec.configuration, Direct):
                return self._create_direct_publisher(spec, spec.configuration)
            return self._create_native_publisher(spec, spec.configuration)

    def _create_native_publisher(self, spec: PublisherSpec, configuration: Hybrid) -> MasterPublisher:
        session = self._session(configuration.master)
        session.wait_for_address(spec.wait_s)
        closer = self._publisher_closer(lambda: session.remove_publisher(spec.id, publisher.count))
        # before bind, because socket options apply only to connections of later binds
        publisher = self._new_publisher(spec, closer)
        with close_on_error(publisher.release):
            endpoints = publisher.move(session.hosts)
            self._add_publisher(publisher)
        record = PublisherRecord(
            spec.id,
            spec.topic,
            spec.msg_type,
            spec.codec.name,
            endpoints,
            spec.is_latched,
            publisher.is_local,
            spec.number,
            spec.history,
        )
        try:
            reply = session.add_publisher(record, publisher, spec.wait_s)
            publisher.expect((*reply.expected, *reply.hung))
            missing_ids = publisher.wait_for(reply.expected, HANDSHAKE_TIMEOUT_S)
            if missing_ids:
                session.report_missing(spec.id, missing_ids)
        except BaseException:  # also Ctrl+C: the caller has no object to close yet
            publisher.close(0.0)
            raise
        return publisher

    def _new_publisher(
        self, spec: PublisherSpec, closer: Callable[[OwnedPublisher, float], None]
    ) -> MasterPublisher:
        return NativePublisher(self._new_xpub_socket(spec), spec, closer, self._io.serve_soon)

    def _create_direct_publisher(self, spec: PublisherSpec, direct: Direct) -> PublisherTransport:
        closer = self._publisher_closer(lambda: None)
        publisher: NativePublisher | OriginalPublisher
        if direct.wire == "native":
            socket = self._new_xpub_socket(spec)
            publisher = NativePublisher(socket, spec, closer, self._io.serve_soon)
        else:
            socket = self._shared.socket(zmq.XPUB, f"a publisher of '{spec.topic}'")
            publisher = OriginalPublisher(socket, spec, direct, closer)
        with close_on_error(publisher.release):
            self._direct_endpoints[spec.id] = attach(socket, direct, is_publisher=True)
            self._add_publisher(publisher)
        try:
            publisher.wait_for_any(DIRECT_WAIT_S)
        except BaseException:
            publisher.close(0.0)
            raise
        return publisher

    def _new_xpub_socket(self, spec: PublisherSpec) -> Socket:
        socket = self._shared.socket(zmq.XPUB, f"a publisher of '{spec.topic}'")
        socket.setsockopt(zmq.XPUB_VERBOSE, 1)  # a reconnecting subscriber repeats its hello
        socket.setsockopt(zmq.MAXMSGSIZE, MAX_SUBSCRIPTION_BYTES)  # applies to received messages
        return socket

    def _add_publisher(self, publisher: OwnedPublisher) -> None:
        with self._lock:
            self._check_open_locked()
            self._publishers.add(publisher)
            self._io.add(publisher)  # before `close` can remove the publisher, which acquires this lock first

    def _publisher_closer(self, unregister: Callable[[], None]) -> Callable[[OwnedPublisher, float], None]:
        def close(publisher: OwnedPublisher, timeout_s: float) -> None:
            deadline = time.monotonic() + timeout_s
            with self._shared.removed(publisher, self._discard_publisher) as is_removed:
                if is_removed:
                    unregister()
                    publisher.send_bye()
                    self._release_publisher(publisher, deadline)

        return close

    def _discard_publisher(self, publisher: OwnedPublisher) -> bool:
        with self._lock:
            is_open = publisher in self._publishers
            self._publishers.discard(publisher)
            return is_open

    def _release_publisher(self, publisher: OwnedPublisher, deadline: float) -> None:
        publisher.finish(deadline)
        self._io.remove(publisher)
        publisher.release()
        with self._lock:
            self._direct_endpoints.pop(publisher.spec.id, None)

    # ---- subscribers

    def create_subscriber(self, spec: SubscriberSpec) -> SubscriberTransport:
        """Create a subscriber. See `Transport.create_subscriber`."""
        with self._acquired_context():
            if isinstance(spec.configuration, Direct):
                return self._create_direct_subscriber(spec, spec.configuration)
            return self._create_native_subscriber(spec, spec.configuration)

    def _create_native_subscriber(self, spec: SubscriberSpec, configuration: Hybrid) -> NativeSubscriber:
        session = self._session(configuration.master)
        session.wait_for_address(spec.wait_s)

        def unregister(subscriber: int) -> None:
            self._discard_subscriber(subscriber)
            session.remove_subscriber(subscriber)

        io = self._io_for(spec)
        readable = TopicSockets(self._new_readable, spec) if spec.is_pattern else self._new_readable(spec)
        subscriber = NativeSubscriber(readable, io, spec, unregister)
        with close_on_error(readable.close):
            self._add_subscriber(subscriber)
        record = SubscriberRecord(spec.id, spec.topic, spec.msg_type, spec.number, spec.is_pattern)
        try:
            reply = session.add_subscriber(record, subscriber, spec.wait_s)
            if spec.is_pattern and not reply.pattern:
                raise NepError(
                    _("the master at '{address}' is too old to support wildcards; update it").format(
                        address=session.address
                    )
                )
            subscriber.connect_listed(reply.publishers)
            self._start_serving(io, subscriber)
            with self._waker() as waker:
                subscriber.wait_for(
                    (each.publisher.id for each in reply.publishers), HANDSHAKE_TIMEOUT_S, waker
                )
        except BaseException:
            subscriber.close()
            raise
        return subscriber

    def _new_readable(self, spec: SubscriberSpec) -> NativeReadable:
        socket_class = CheckedSubSocket if spec.msg_type in CHECKED_TYPES else SubSocket
        return socket_class(self._new_sub_socket(spec), spec)

    def _create_direct_subscriber(self, spec: SubscriberSpec, direct: Direct) -> SubscriberTransport:
        io = self._io_for(spec)
        socket = self._new_sub_socket(spec)
        subscriber: _Subscriber
        if direct.wire == "native":
            subscriber = NativeSubscriber(SubSocket(socket, spec), io, spec, self._discard_subscriber)
        else:
            subscriber = SocketSubscriber(OriginalSubSocket(socket, spec), io, spec, self._discard_subscriber)
        with close_on_error(socket.close):
            self._direct_endpoints[spec.id] = attach(socket, direct, is_publisher=False)
            self._add_subscriber(subscriber)
        try:
            self._start_serving(io, subscriber)
            if isinstance(subscriber, NativeSubscriber):
                with self._waker() as waker:
                    subscriber.wait_for_any(DIRECT_WAIT_S, waker)
        except BaseException:
            subscriber.close()
            raise
        return subscriber

    def _io_for(self, spec: SubscriberSpec) -> IoThread:
        if spec.sink is None:
            return self._io
        with self._lock:
            self._check_open_locked()
            if self._sink_io is None:
                check_free_descriptors(_FDS_PER_THREAD, f"a subscriber of '{spec.topic}'")
                self._sink_io = IoThread(f"nep-sinks-{self._node.name}")
                self._sink_io.start()
            return self._sink_io

    def _add_subscriber(self, subscriber: _Subscriber) -> None:
        with self._lock:
            self._check_open_locked()
            self._subscribers[subscriber.spec.id] = subscriber

    def _start_serving(self, io: IoThread, subscriber: SocketSubscriber[Any]) -> None:
        # Raises `ClosedError` if the subscriber was closed meanwhile.
        with self._lock:
            if subscriber.spec.id not in self._subscribers:
                raise ClosedError(f"node '{self._node.name}'")
            io.add(subscriber)  # before `close` can remove the subscriber, which acquires this lock first

    @contextmanager
    def _acquired_context(self) -> Iterator[None]:
        # Keeps the context while sockets are opened, also if `close` ends the last node meanwhile. Raises
        # `ClosedError`.
        with self._lock:
            self._check_open_locked()
            self._shared.acquire()
        try:
            yield
        finally:
            self._shared.release()

    def _check_open_locked(self) -> None:
        if self._is_closed:
            raise ClosedError(f"node '{self._node.name}'")

    def _new_sub_socket(self, spec: SubscriberSpec) -> Socket:
        socket = self._shared.socket(zmq.SUB, f"a subscriber of '{spec.topic}'")
        socket.setsockopt(zmq.RECONNECT_IVL, 50)
        socket.setsockopt(zmq.RECONNECT_IVL_MAX, 1000)
        return socket

    def _discard_subscriber(self, subscriber: int) -> None:
        with self._lock:
            self._subscribers.pop(subscriber, None)
            self._direct_endpoints.pop(subscriber, None)

    # ---- services

    def create_server(self, spec: ServerSpec) -> ServerTransport:
        """Create a server. See `ServiceTransport.create_server`."""
        with self._acquired_context():
            return self._services.create_server(spec)

    def create_client(self, spec: ClientSpec) -> ClientTransport:
        """Create a client. See `ServiceTransport.create_client`."""
        with self._acquired_context():
            return self._services.create_client(spec)

    def create_surveyor(self, spec: ClientSpec) -> SurveyTransport:
        """Create a surveyor. See `ServiceTransport.create_surveyor`."""
        with self._acquired_context():
            return self._services.create_surveyor(spec)

    # ---- waiting

    def wait(
        self,
        subscribers: Sequence[SubscriberTransport],
        timeout_s: float,
        calls: Sequence[CallQueue] = (),
    ) -> None:
        """Wait up to `timeout_s` seconds for a message in `subscribers`, a call in `calls`, or `wake`."""
        thread_wait = self._thread_wait()
        entered: list[_Subscriber] = []
        entered_calls: list[CallQueue] = []
        fds: list[int] = []
        thread_wait.is_busy = True
        try:
            if self._is_terminated:
                return
            for queue in calls:
                if not queue.enter_wait(thread_wait.waker.wake):
                    return
                entered_calls.append(queue)
            for subscriber in subscribers:
                if isinstance(subscriber, SocketSubscriber):
                    if not subscriber.enter_wait(thread_wait.waker):
                        return
                    entered.append(subscriber)
                    fds.append(subscriber.fd)
            thread_wait.wait(fds, timeout_s)
        finally:
            for subscriber in entered:
                subscriber.leave_wait(thread_wait.waker)
            for queue in entered_calls:
                queue.leave_wait(thread_wait.waker.wake)
            thread_wait.is_busy = False
            if self._is_terminated:  # `close` left a busy waker open
                thread_wait.waker.close()

    def _wake_waits_locked(self) -> None:
        # Call after setting `_is_terminated`.
        for thread_wait in self._thread_waits:
            thread_wait.waker.wake()
            if not thread_wait.is_busy:
                thread_wait.waker.close()

    def _thread_wait(self) -> ThreadWait:
        thread_wait: ThreadWait | None = getattr(self._threads, "waits", None)
        if thread_wait is None:
            thread_wait = self._threads.waits = ThreadWait()
            with self._lock:
                self._thread_waits.add(thread_wait)
        return thread_wait

    def wake(self) -> None:
        """End all waits in progress."""
        with self._lock:
            for waker in self._busy_wakers:
                waker.wake()
            for thread_wait in self._thread_waits:
                thread_wait.waker.wake()

    @contextmanager
    def _waker(self) -> Iterator[Waker]:
        waker = self._shared.acquire_waker()
        with self._lock:
            self._busy_wakers.append(waker)
        try:
            yield waker
        finally:
            with self._lock:
                self._busy_wakers.remove(waker)
            self._shared.release_waker(waker)

    # ---- master and closing

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:
        """Return the current graph. See `Transport.graph`."""
        if isinstance(configuration, Direct):
            raise NepError(
                _("a direct connection has no master, so there is no graph; use a node with a master")
            )
        with self._acquired_context():
            return self._session(configuration.master).query_graph(timeout_s)

    def begin_close(self) -> None:
        """Notify all peers that the node is closing, without waiting. See `Transport.begin_close`."""
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
            sessions = list(self._sessions.values())
            publishers = list(self._publishers)
        for session in sessions:
            session.start_leave()
        self._services.begin_close()
        for publisher in publishers:
            publisher.send_bye()

    def close(self, timeout_s: float) -> None:
        """Close all sockets, sessions and threads. See `Transport.close`."""
        deadline = time.monotonic() + timeout_s
        self.begin_close()
        with self._lock:
            if self._is_terminated:
                return
            self._is_terminated = True
            self._wake_waits_locked()
            sessions = list(self._sessions.values())
            publishers = list(self._publishers)
            subscribers = list(self._subscribers.values())
            sink_io = self._sink_io
        for publisher in publishers:
            if isinstance(publisher, OriginalPublisher):
                # flush while the others wait for their subscribers
                self._io.remove(publisher)
                publisher.flush(deadline)
        for session in sessions:
            session.finish_leave(min(_LEAVE_TIMEOUT_S, timeout_s))
        for subscriber in subscribers:
            subscriber.close()
        self._services.close(max(0.0, deadline - time.monotonic()))
        for publisher in publishers:
            with self._shared.removed(publisher, self._discard_publisher) as is_removed:
                if is_removed:
                    self._release_publisher(publisher, deadline)
        for session in sessions:
            session.close()
        if sink_io is not None:
            sink_io.close(max(_LEAVE_TIMEOUT_S, deadline - time.monotonic()))
        self._shared.release()

    def _close_idle_sessions_locked(self) -> None:
        # Closes idle sessions when there are many.
        for address, session in list(self._sessions.items()):
            if len(self._sessions) < _MAX_IDLE_SESSIONS:
                return
            if session.is_idle:
                del self._sessions[address]
                session.start_leave()
                session.close()

    def _give_up_in_child(self) -> None:
        close_in_child(*self._direct_endpoints.values(), *self._services.endpoints)
        for session in self._sessions.values():
            close_in_child(session.endpoint)
        for endpoint_owner in (*self._publishers, *self._subscribers.values()):
            if isinstance(endpoint_owner, NativePublisher | NativeSubscriber):
                close_in_child(*endpoint_owner.endpoints)

    def _session(self, address: str) -> MasterSession:
        with self._lock:
            self._check_open_locked()
            session = self._sessions.get(address)
            if session is None:
                self._close_idle_sessions_locked()
                socket = self._shared.socket(zmq.DEALER, f"a connection to the master at '{address}'")
                with close_on_error(socket.close):
                    session = MasterSession(socket, self._io, self._node, address)
                self._sessions[address] = session
                self._io.add(session)
            return session


@contextmanager
def close_on_error(close: Callable[[], object]) -> Iterator[None]:
    """Call `close` if the body raises, because an open socket would block the end of the program."""
    try:
        yield
    except BaseException:
        close()
        raise
