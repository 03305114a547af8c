"""ServerConnection: a client's connection to one server, which tells when it begins and when it ends.

What came before the end can still be read. With `IMMEDIATE` or `RECONNECT_IVL` -1 libzmq would throw it
away as soon as a connection ends, and a socket that was connected again could not tell what ended. So every
connection has a socket of its own, which libzmq does not connect again, and a monitor.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable, Sequence

import zmq

from nep.backends.zeromq.io_thread import IoThread, Rest, SharedContext
from nep.backends.zeromq.sockets import Part, Socket, keep_alive
from nep.protocol.service_wire import PAYLOAD_MAX_BYTES

__all__ = ["CONNECTION_FILES", "ServerConnection"]

CONNECTION_FILES = 4
"""Descriptors that one needs, also those of libzmq."""

_LARGE_BYTES = 65_536
"""From here on calls are sent without a copy."""
_NEVER_MS = 24 * 3600 * 1000
_EVENT = struct.Struct("=hi")
_names = itertools.count(1)


class ServerConnection:
    """Connects at once. `serve` is called in the node's thread when there is something to see.

    Not thread-safe: it lives under its client's lock.
    """

    def __init__(
        self, shared: SharedContext, service: str, endpoint: str, serve: Callable[[float], Rest]
    ) -> None:
        self.endpoint = endpoint
        self.is_open = self.is_over = False
        self.again_s = 0.0
        self._io: IoThread = shared.io
        what = f"a client of '{service}'"
        self._socket = shared.socket(zmq.DEALER, what)
        self._sides: tuple[_Side, ...] = ()
        self._monitor: Socket | None = None
        try:
            self._monitor = monitor = shared.socket(zmq.PAIR, what)
            self._connect(monitor)
            sides = (_Side(self._socket, serve), _Side(monitor, serve))
        except BaseException:
            self.close()
            raise
        self._sides = sides
        for side in self._sides:
            self._io.add(side)

    def _connect(self, monitor: Socket) -> None:
        self._socket.setsockopt(zmq.RECONNECT_IVL, _NEVER_MS)
        self._socket.setsockopt(zmq.SNDHWM, 0)  # a client bounds its calls
        self._socket.setsockopt(zmq.MAXMSGSIZE, PAYLOAD_MAX_BYTES)
        self._socket.copy_threshold = _LARGE_BYTES
        keep_alive(self._socket, self.endpoint)
        name = f"inproc://nep-service-{next(_names)}"
        self._socket.monitor(name, zmq.EVENT_HANDSHAKE_SUCCEEDED | zmq.EVENT_DISCONNECTED)
        monitor.connect(name)
        self._socket.connect(self.endpoint)

    def look(self) -> None:
        """Read what the monitor says, so that `is_open` and `is_over` are true of now."""
        while self._monitor is not None and _has_input(self._monitor):
            event, _value = _EVENT.unpack(self._monitor.recv_multipart(zmq.DONTWAIT)[0])
            self.is_over = self.is_over or event == zmq.EVENT_DISCONNECTED
            self.is_open = not self.is_over

    @property
    def has_input(self) -> bool:
        """Whether there is an answer to read."""
        return _has_input(self._socket)

    def send(self, parts: Sequence[Part]) -> None:
        """Send a call."""
        self._socket.send(parts[0], zmq.DONTWAIT | zmq.SNDMORE)
        self._socket.send(parts[1], zmq.DONTWAIT, copy=len(parts[1]) < _LARGE_BYTES)

    def receive(self) -> list[bytes] | None:
        """The parts of the next answer."""
        try:
            return self._socket.recv_multipart(zmq.DONTWAIT)
        except zmq.Again:
            return None

    def forked(self) -> None:
        """In a child that was forked: nothing is touched, see `nep.system.forks`."""

    def close(self) -> None:
        """Close it; what was not read is dropped."""
        sides, self._sides = self._sides, ()
        for side in sides:
            self._io.remove(side)
        self.is_open, self.is_over = False, True
        if not self._socket.closed:
            self._socket.disable_monitor()
            self._socket.close(0)
        if self._monitor is not None:
            self._monitor.close(0)
            self._monitor = None


class _Side:
    """One of its two sockets, for the thread that polls."""

    def __init__(self, socket: Socket, serve: Callable[[float], Rest]) -> None:
        self.fd = int(socket.getsockopt(zmq.FD))
        self._serve = serve

    def serve(self, now: float) -> Rest:
        """See `Served`."""
        return self._serve(now)


def _has_input(socket: Socket) -> bool:
    return bool(int(socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN)
