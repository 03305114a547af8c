"""The back end `zeromq`: the native wire, and direct connections in the original one."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import zmq

from nep.backends.base import HANDSHAKE_S, Inlet, Outlet, PublisherSpec, SubscriberSpec
from nep.backends.connection import Configuration, Direct
from nep.backends.zeromq.io_thread import IoThread, SharedContext, shared_context
from nep.backends.zeromq.legacy import OriginalInlet, OriginalOutlet, OriginalSub, attach
from nep.backends.zeromq.master_session import MasterLink
from nep.backends.zeromq.publisher import NativeOutlet
from nep.backends.zeromq.sockets import Socket
from nep.backends.zeromq.sub_socket import SubSocket
from nep.backends.zeromq.subscriber import NativeInlet, SocketInlet
from nep.errors import ClosedError, NepError
from nep.protocol.graph_view import GraphView
from nep.protocol.records import NodeRecord, PublisherRecord, SubscriberRecord
from nep.protocol.wire import SUBSCRIPTION_MAX_BYTES
from nep.system.descriptors import check_room
from nep.system.forks import give_up, watch
from nep.system.wakeup import Waker

__all__ = ["ZeromqCarrier"]

DIRECT_WAIT_S = 0.3
"""Without a master nobody knows whether there is another side: it gets so long to connect."""
_LEAVE_S = 0.3
_THREAD_FILES = 4
_MOST_LINKS = 8
"""So many masters' connections are kept though nothing is registered with them."""
_Outlet = NativeOutlet | OriginalOutlet
_Inlet = NativeInlet | OriginalInlet


class ZeromqCarrier:
    """One node's links and sockets, in the context and the thread of its process.

    Sinks are called in a thread of the node's own, so that they hold up nobody else, and may ask the master
    and make publishers and subscribers.
    """

    def __init__(self, node: NodeRecord) -> None:
        self._node = node
        self._shared: SharedContext = shared_context()
        self._io = self._shared.io
        self._sinks: IoThread | None = None
        self._lock = threading.Lock()
        self._links: dict[str, MasterLink] = {}
        self._outlets: dict[int, _Outlet] = {}
        self._inlets: dict[int, _Inlet] = {}
        self._busy_wakers: list[Waker] = []
        self._is_closed = False
        self._is_over = False
        self._attached: dict[int, str] = {}
        """The endpoints of direct connections, by the id of their publisher or subscriber."""
        watch(self)

    # ---- publishers

    def publisher(self, spec: PublisherSpec) -> Outlet:
        """A new publisher. See `Carrier.publisher`."""
        if isinstance(spec.configuration, Direct):
            return self._direct_publisher(spec, spec.configuration)
        link = self._link(spec.configuration.master)
        link.wait_for_name(spec.wait_s)
        socket = self._xpub(spec)
        # Made before the socket is bound: what it sets applies to connections of later binds only.
        closer = self._outlet_closer(lambda: link.remove_publisher(spec.id, outlet.count))
        outlet = NativeOutlet(socket, spec, closer, self._io.serve_soon)
        with _closed_on_error(outlet.release):
            endpoints = outlet.move(link.hosts)
            self._hold(outlet)
        record = PublisherRecord(
            spec.id,
            spec.topic,
            spec.msg_type,
            spec.codec.name,
            endpoints,
            spec.is_latched,
            outlet.is_local,
            spec.number,
        )
        try:
            reply = link.add_publisher(record, outlet, spec.wait_s)
            outlet.expect((*reply.expected, *reply.hung))
            absent = outlet.wait_for(reply.expected, HANDSHAKE_S)
            if absent:
                link.report_missing(spec.id, absent)
        except BaseException:  # also Ctrl+C: nobody has it, so nobody could close it
            outlet.close(0.0)
            raise
        return outlet

    def _direct_publisher(self, spec: PublisherSpec, direct: Direct) -> Outlet:
        closer = self._outlet_closer(lambda: None)
        outlet: _Outlet
        if direct.wire == "native":
            socket = self._xpub(spec)
            outlet = NativeOutlet(socket, spec, closer, self._io.serve_soon)
        else:
            socket = self._shared.socket(zmq.XPUB, f"a publisher of '{spec.topic}'")
            outlet = OriginalOutlet(socket, spec, direct, closer)
        with _closed_on_error(outlet.release):
            self._attached[spec.id] = attach(socket, direct, is_publisher=True)
            self._hold(outlet)
        try:
            outlet.wait_for_any(DIRECT_WAIT_S)
        except BaseException:
            outlet.close(0.0)
            raise
        return outlet

    def _xpub(self, spec: PublisherSpec) -> Socket:
        socket = self._shared.socket(zmq.XPUB, f"a publisher of '{spec.topic}'")
        socket.setsockopt(zmq.XPUB_VERBOSE, 1)  # a hello may come twice when a subscriber reconnects
        socket.setsockopt(zmq.MAXMSGSIZE, SUBSCRIPTION_MAX_BYTES)  # of what it receives
        return socket

    def _hold(self, outlet: _Outlet) -> None:
        with self._lock:
            self._check_open()
            self._outlets[outlet.spec.id] = outlet
        self._io.add(outlet)

    def _outlet_closer(self, unregister: Callable[[], None]) -> Callable[[_Outlet, float], None]:
        def close(outlet: _Outlet, timeout_s: float) -> None:
            with self._lock:
                self._outlets.pop(outlet.spec.id, None)
                self._attached.pop(outlet.spec.id, None)
            unregister()
            outlet.say_bye()
            outlet.finish(time.monotonic() + timeout_s)
            self._io.remove(outlet)
            outlet.release()

        return close

    # ---- subscribers

    def subscriber(self, spec: SubscriberSpec) -> Inlet:
        """A new subscriber. See `Carrier.subscriber`."""
        if isinstance(spec.configuration, Direct):
            return self._direct_subscriber(spec, spec.configuration)
        link = self._link(spec.configuration.master)
        link.wait_for_name(spec.wait_s)

        def forget(subscriber: int) -> None:
            self._forget_inlet(subscriber)
            link.remove_subscriber(subscriber)

        io = self._io_for(spec)
        socket = self._sub(spec)
        inlet = NativeInlet(SubSocket(socket, spec), io, spec, forget)
        with _closed_on_error(socket.close):
            self._keep(inlet)
        try:
            reply = link.add_subscriber(
                SubscriberRecord(spec.id, spec.topic, spec.msg_type, spec.number), inlet, spec.wait_s
            )
            inlet.connect(reply.publishers)
            io.add(inlet)
            with self._waker() as waker:
                inlet.wait_for((each.publisher.id for each in reply.publishers), HANDSHAKE_S, waker)
        except BaseException:
            inlet.close()
            raise
        return inlet

    def _direct_subscriber(self, spec: SubscriberSpec, direct: Direct) -> Inlet:
        io = self._io_for(spec)
        socket = self._sub(spec)
        inlet: _Inlet
        if direct.wire == "native":
            inlet = NativeInlet(SubSocket(socket, spec), io, spec, self._forget_inlet)
        else:
            inlet = SocketInlet(OriginalSub(socket, spec), io, spec, self._forget_inlet)
        with _closed_on_error(socket.close):
            self._attached[spec.id] = attach(socket, direct, is_publisher=False)
            self._keep(inlet)
        io.add(inlet)
        try:
            if isinstance(inlet, NativeInlet):
                with self._waker() as waker:
                    inlet.wait_for_any(DIRECT_WAIT_S, waker)
        except BaseException:
            inlet.close()
            raise
        return inlet

    def _io_for(self, spec: SubscriberSpec) -> IoThread:
        """The thread that serves a subscriber."""
        if spec.sink is None:
            return self._io
        with self._lock:
            self._check_open()
            if self._sinks is None:
                check_room(_THREAD_FILES, f"a subscriber of '{spec.topic}'")
                self._sinks = IoThread(f"nep-sinks-{self._node.name}")
                self._sinks.start()
            return self._sinks

    def _keep(self, inlet: _Inlet) -> None:
        with self._lock:
            self._check_open()
            self._inlets[inlet.spec.id] = inlet

    def _check_open(self) -> None:
        """With the lock held. Raises `ClosedError`."""
        if self._is_closed:
            raise ClosedError(f"node '{self._node.name}'")

    def _sub(self, spec: SubscriberSpec) -> Socket:
        socket = self._shared.socket(zmq.SUB, f"a subscriber of '{spec.topic}'")
        socket.setsockopt(zmq.RECONNECT_IVL, 50)
        socket.setsockopt(zmq.RECONNECT_IVL_MAX, 1000)
        return socket

    def _forget_inlet(self, subscriber: int) -> None:
        with self._lock:
            self._inlets.pop(subscriber, None)
            self._attached.pop(subscriber, None)

    # ---- waiting

    def wait(self, inlets: Sequence[Inlet], timeout_s: float) -> None:
        """Wait for a message in one of `inlets`, or for `wake`."""
        mine = [each for each in inlets if isinstance(each, SocketInlet)]
        with self._waker() as waker:
            entered: list[_Inlet] = []
            try:
                for inlet in mine:
                    if not inlet.enter_wait(waker):
                        return
                    entered.append(inlet)
                polled = [(inlet.fd, zmq.POLLIN) for inlet in entered]
                zmq.zmq_poll([*polled, (waker.fd, zmq.POLLIN)], int(timeout_s * 1000) + 1)
            finally:
                for inlet in entered:
                    inlet.leave_wait(waker)

    def wake(self) -> None:
        """End all waits."""
        with self._lock:
            for waker in self._busy_wakers:
                waker.wake()

    @contextmanager
    def _waker(self) -> Iterator[Waker]:
        """A waker of its own for each thread that waits."""
        waker = self._shared.take_waker()
        with self._lock:
            self._busy_wakers.append(waker)
        try:
            yield waker
        finally:
            with self._lock:
                self._busy_wakers.remove(waker)
            self._shared.give_waker(waker)

    # ---- the master, and the end

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:
        """Who is there. See `Carrier.graph`."""
        if isinstance(configuration, Direct):
            raise NepError("a direct connection has no master; ask with a hybrid one")
        return self._link(configuration.master).look(timeout_s)

    def begin_close(self) -> None:
        """Say that all ends here, and wait for nothing. See `Carrier.begin_close`."""
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
            links = list(self._links.values())
            outlets = list(self._outlets.values())
        for link in links:
            link.begin_leave()
        for outlet in outlets:
            outlet.say_bye()

    def close(self, timeout_s: float) -> None:
        """Close all. See `Carrier.close`."""
        deadline = time.monotonic() + timeout_s
        self.begin_close()
        with self._lock:
            if self._is_over:
                return
            self._is_over = True
            links = list(self._links.values())
            outlets = list(self._outlets.values())
            inlets = list(self._inlets.values())
            sinks = self._sinks
        for outlet in outlets:
            if isinstance(outlet, OriginalOutlet):  # they flush while the others wait for their subscribers
                self._io.remove(outlet)
                outlet.flush(deadline)
        for link in links:
            link.leave(min(_LEAVE_S, timeout_s))
        for inlet in inlets:
            inlet.close()
        for outlet in outlets:
            outlet.finish(deadline)
            self._io.remove(outlet)
            outlet.release()
        for link in links:
            link.close()
        if sinks is not None:
            sinks.close(max(_LEAVE_S, deadline - time.monotonic()))
        self._shared.leave()

    def _forget_links(self) -> None:
        """With the lock held: close what leads to masters that nobody needs any more, when there are many."""
        for address, link in list(self._links.items()):
            if len(self._links) < _MOST_LINKS:
                return
            if link.is_idle:
                del self._links[address]
                link.begin_leave()
                link.close()

    def forked(self) -> None:
        """In a child: its ports and connections are the parent's. See `nep.system.forks`."""
        give_up(*self._attached.values())
        for link in self._links.values():
            give_up(link.endpoint)
        for each in (*self._outlets.values(), *self._inlets.values()):
            if isinstance(each, NativeOutlet | NativeInlet):
                give_up(*each.endpoints)

    def _link(self, address: str) -> MasterLink:
        with self._lock:
            self._check_open()
            link = self._links.get(address)
            if link is None:
                self._forget_links()
                socket = self._shared.socket(zmq.DEALER, f"a connection to the master at '{address}'")
                with _closed_on_error(socket.close):
                    link = MasterLink(socket, self._io, self._node, address)
                self._links[address] = link
                self._io.add(link)
            return link


@contextmanager
def _closed_on_error(close: Callable[[], object]) -> Iterator[None]:
    """A socket that is left open would hold up the end of the program."""
    try:
        yield
    except BaseException:
        close()
        raise
