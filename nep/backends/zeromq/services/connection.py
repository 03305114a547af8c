"""Connection to one server that reports when it opens and ends.

Replies received before the end can still be read. With `IMMEDIATE` or a `RECONNECT_IVL` of -1, libzmq
would discard these replies, and a reconnected socket couldn't report which connection has ended.
Therefore each connection has a separate socket, which never reconnects, and a monitor.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable, Sequence

import zmq

from nep.backends.zeromq.io_thread import IoThread, PollState, SharedContext
from nep.backends.zeromq.sockets import Part, Socket, enable_keep_alive
from nep.protocol.service_wire import MAX_PAYLOAD_BYTES

FDS_PER_CONNECTION = 4
"""Number of file descriptors per connection, including the descriptors that libzmq opens."""

_LARGE_BYTES = 65_536
"""Minimum size in bytes of calls that are sent without a copy."""
_NO_RECONNECT_MS = 24 * 3600 * 1000
_EVENT_HEADER = struct.Struct("=hi")
_monitor_numbers = itertools.count(1)


class ServerConnection:
    """Connection to a server. The constructor starts connecting. Guarded by the client's lock.

    Args:
        shared: ZeroMQ context of the process.
        service: Name of the service.
        endpoint: Endpoint of the server.
        serve: Called in the I/O thread on events of the connection.
    """

    def __init__(
        self, shared: SharedContext, service: str, endpoint: str, serve: Callable[[float], PollState]
    ) -> None:
        self.endpoint = endpoint
        self.is_open = self.has_ended = False
        self.reconnect_delay_s = 0.0
        self._io: IoThread = shared.io
        owner = f"a client of '{service}'"
        self._socket = shared.socket(zmq.DEALER, owner)
        self._polled_sockets: tuple[_PolledSocket, ...] = ()
        self._monitor: Socket | None = None
        try:
            self._monitor = monitor = shared.socket(zmq.PAIR, owner)
            self._connect(monitor)
            polled_sockets = (_PolledSocket(self._socket, serve), _PolledSocket(monitor, serve))
        except BaseException:
            self.close()
            raise
        self._polled_sockets = polled_sockets
        for polled_socket in self._polled_sockets:
            self._io.add(polled_socket)

    def _connect(self, monitor: Socket) -> None:
        self._socket.setsockopt(zmq.RECONNECT_IVL, _NO_RECONNECT_MS)
        self._socket.setsockopt(zmq.SNDHWM, 0)  # the client limits its calls
        self._socket.setsockopt(zmq.MAXMSGSIZE, MAX_PAYLOAD_BYTES)
        self._socket.copy_threshold = _LARGE_BYTES
        enable_keep_alive(self._socket, self.endpoint)
        name = f"inproc://nep-service-{next(_monitor_numbers)}"
        self._socket.monitor(name, zmq.EVENT_HANDSHAKE_SUCCEEDED | zmq.EVENT_DISCONNECTED)
        monitor.connect(name)
        self._socket.connect(self.endpoint)

    def update(self) -> None:
        """Update `is_open` and `has_ended` from the monitor's events."""
        while self._monitor is not None and _has_input(self._monitor):
            event, _value = _EVENT_HEADER.unpack(self._monitor.recv_multipart(zmq.DONTWAIT)[0])
            self.has_ended = self.has_ended or event == zmq.EVENT_DISCONNECTED
            self.is_open = not self.has_ended

    @property
    def has_input(self) -> bool:
        """True if a reply can be read."""
        return _has_input(self._socket)

    def send(self, parts: Sequence[Part]) -> None:
        """Send a call."""
        self._socket.send(parts[0], zmq.DONTWAIT | zmq.SNDMORE)
        self._socket.send(parts[1], zmq.DONTWAIT, copy=len(parts[1]) < _LARGE_BYTES)

    def receive(self) -> list[bytes] | None:
        """Return the parts of the next reply, or None if no reply is available."""
        try:
            return self._socket.recv_multipart(zmq.DONTWAIT)
        except zmq.Again:
            return None

    def close(self) -> None:
        """Close the sockets and discard unread replies."""
        polled_sockets, self._polled_sockets = self._polled_sockets, ()
        for polled_socket in polled_sockets:
            self._io.remove(polled_socket)
        self.is_open, self.has_ended = False, True
        if not self._socket.closed:
            self._socket.disable_monitor()
            self._socket.close(0)
        if self._monitor is not None:
            self._monitor.close(0)
            self._monitor = None


class _PolledSocket:
    def __init__(self, socket: Socket, serve: Callable[[float], PollState]) -> None:
        self.fd = int(socket.getsockopt(zmq.FD))
        self._serve = serve

    def serve(self, now: float) -> PollState:
        return self._serve(now)


def _has_input(socket: Socket) -> bool:
    return bool(int(socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN)
