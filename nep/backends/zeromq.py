"""The back end `zeromq`: the native wire, and direct connections in the original one."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import zmq

from nep.backends.base import HANDSHAKE_S, Backend, Inlet, Outlet, PublisherSpec, SubscriberSpec
from nep.backends.native.direct import OriginalInlet, OriginalOutlet, OriginalSub, attach
from nep.backends.native.inlet import NativeInlet
from nep.backends.native.io import IoThread
from nep.backends.native.link import MasterLink
from nep.backends.native.outlet import NativeOutlet
from nep.backends.native.reading import SocketInlet
from nep.backends.native.sockets import Socket
from nep.backends.native.subsocket import SubSocket
from nep.configuration import Configuration, Direct
from nep.errors import NepError
from nep.records import NodeRecord, PublisherRecord, SubscriberRecord
from nep.views import GraphView
from nep.waker import Waker
from nep.wire import SUBSCRIPTION_MAX_BYTES

__all__ = ["BACKEND", "ZeromqCarrier"]

DIRECT_WAIT_S = 0.3
"""Without a master nobody knows whether there is another side: it gets so long to connect."""
_LEAVE_S = 0.3

_Outlet = NativeOutlet | OriginalOutlet
_Inlet = NativeInlet | OriginalInlet


class ZeromqCarrier:
    """One node's context, thread, links and sockets."""

    def __init__(self, node: NodeRecord) -> None:
        self._node = node
        self._context: zmq.Context[Socket] = zmq.Context()
        self._context.set(zmq.MAX_SOCKETS, 16_384)
        self._io = IoThread(f"nep-io-{node.name}")
        self._io.start()
        self._lock = threading.Lock()
        self._links: dict[str, MasterLink] = {}
        self._outlets: dict[int, _Outlet] = {}
        self._inlets: dict[int, _Inlet] = {}
        self._idle_wakers: list[Waker] = []
        self._busy_wakers: list[Waker] = []
        self._is_closed = False

    # ---- publishers

    def publisher(self, spec: PublisherSpec) -> Outlet:
        """A new publisher. See `Carrier.publisher`."""
        if isinstance(spec.configuration, Direct):
            return self._direct_publisher(spec, spec.configuration)
        link = self._link(spec.configuration.master)
        socket = self._xpub()
        # Made before the socket is bound: what it sets applies to connections of later binds only.
        closer = self._outlet_closer(lambda: link.remove_publisher(spec.id, outlet.count))
        outlet = NativeOutlet(socket, spec, closer, self._io.serve_soon)
        with _closed_on_error(socket):
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
        except BaseException:
            outlet.close(0.0)
            raise
        outlet.expect((*reply.expected, *reply.hung))
        absent = outlet.wait_for(reply.expected, HANDSHAKE_S)
        if absent:
            link.report_missing(spec.id, absent)
        return outlet

    def _direct_publisher(self, spec: PublisherSpec, direct: Direct) -> Outlet:
        closer = self._outlet_closer(lambda: None)
        outlet: _Outlet
        if direct.wire == "native":
            socket = self._xpub()
            outlet = NativeOutlet(socket, spec, closer, self._io.serve_soon)
        else:
            socket = self._socket(zmq.XPUB)
            outlet = OriginalOutlet(socket, spec, direct, closer)
        with _closed_on_error(socket):
            attach(socket, direct, is_publisher=True)
        self._hold(outlet)
        outlet.wait_for_any(DIRECT_WAIT_S)
        return outlet

    def _xpub(self) -> Socket:
        socket = self._socket(zmq.XPUB)
        socket.setsockopt(zmq.XPUB_VERBOSE, 1)  # a hello may come twice when a subscriber reconnects
        socket.setsockopt(zmq.MAXMSGSIZE, SUBSCRIPTION_MAX_BYTES)  # of what it receives
        return socket

    def _hold(self, outlet: _Outlet) -> None:
        with self._lock:
            self._outlets[outlet.spec.id] = outlet
        self._io.add(outlet)

    def _outlet_closer(self, unregister: Callable[[], None]) -> Callable[[_Outlet, float], None]:
        def close(outlet: _Outlet, timeout_s: float) -> None:
            with self._lock:
                self._outlets.pop(outlet.spec.id, None)
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

        def forget(subscriber: int) -> None:
            self._forget_inlet(subscriber)
            link.remove_subscriber(subscriber)

        inlet = NativeInlet(SubSocket(self._sub(), spec), self._io, spec, forget)
        with self._lock:
            self._inlets[spec.id] = inlet
        try:
            reply = link.add_subscriber(
                SubscriberRecord(spec.id, spec.topic, spec.msg_type, spec.number), inlet, spec.wait_s
            )
        except BaseException:
            inlet.close()
            raise
        inlet.connect(reply.publishers)
        self._io.add(inlet)
        with self._waker() as waker:
            inlet.wait_for((each.publisher.id for each in reply.publishers), HANDSHAKE_S, waker)
        return inlet

    def _direct_subscriber(self, spec: SubscriberSpec, direct: Direct) -> Inlet:
        socket = self._sub()
        inlet: _Inlet
        if direct.wire == "native":
            inlet = NativeInlet(SubSocket(socket, spec), self._io, spec, self._forget_inlet)
        else:
            inlet = SocketInlet(OriginalSub(socket, spec), self._io, spec, self._forget_inlet)
        with _closed_on_error(socket):
            attach(socket, direct, is_publisher=False)
        with self._lock:
            self._inlets[spec.id] = inlet
        self._io.add(inlet)
        if isinstance(inlet, NativeInlet):
            with self._waker() as waker:
                inlet.wait_for_any(DIRECT_WAIT_S, waker)
        return inlet

    def _sub(self) -> Socket:
        socket = self._socket(zmq.SUB)
        socket.setsockopt(zmq.RECONNECT_IVL, 50)
        socket.setsockopt(zmq.RECONNECT_IVL_MAX, 1000)
        return socket

    def _forget_inlet(self, subscriber: int) -> None:
        with self._lock:
            self._inlets.pop(subscriber, None)

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
        """A waker of its own for each thread that waits; they are kept for the next."""
        with self._lock:
            waker = self._idle_wakers.pop() if self._idle_wakers else Waker()
            self._busy_wakers.append(waker)
        try:
            yield waker
        finally:
            waker.clear()
            with self._lock:
                self._busy_wakers.remove(waker)
                if self._is_closed:
                    waker.close()
                else:
                    self._idle_wakers.append(waker)

    # ---- the master, and the end

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:
        """Who is there. See `Carrier.graph`."""
        if isinstance(configuration, Direct):
            raise NepError("a direct connection has no master; ask with a hybrid one")
        return self._link(configuration.master).look(timeout_s)

    def close(self, timeout_s: float) -> None:
        """Close all. See `Carrier.close`."""
        deadline = time.monotonic() + timeout_s
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
            links = list(self._links.values())
            outlets = list(self._outlets.values())
            inlets = list(self._inlets.values())
        for link in links:
            link.leave(_LEAVE_S)
        for outlet in outlets:
            outlet.say_bye()
        for inlet in inlets:
            inlet.close()
        for outlet in outlets:
            outlet.finish(deadline)
            self._io.remove(outlet)
            outlet.release()
        for link in links:
            link.close()
        self._io.close()
        self._context.term()
        with self._lock:
            for waker in self._idle_wakers:
                waker.close()

    def _link(self, address: str) -> MasterLink:
        with self._lock:
            link = self._links.get(address)
            if link is None:
                link = MasterLink(self._socket(zmq.DEALER), self._io, self._node, address)
                self._links[address] = link
                self._io.add(link)
            return link

    def _socket(self, kind: int) -> Socket:
        socket = self._context.socket(kind)
        socket.setsockopt(zmq.LINGER, 0)
        return socket


@contextmanager
def _closed_on_error(socket: Socket) -> Iterator[None]:
    try:
        yield
    except NepError:
        socket.close(0)
        raise


BACKEND = Backend("zeromq", ZeromqCarrier, aliases=("zmq",))
