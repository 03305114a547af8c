"""Calls and replies over plain TCP, as length-prefixed pairs of header and payload.

For programs without ZeroMQ. docs/services.md specifies the format.
"""

from __future__ import annotations

import socket
import struct
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress

from nep.backends.zeromq.io_thread import IoThread, PollState
from nep.errors import WireError
from nep.i18n import _
from nep.protocol.service_wire import HEADER_BYTES, MAX_PAYLOAD_BYTES
from nep.system.addresses import host_of, is_loopback

_SIZE = struct.Struct("<I")
_CHUNK_BYTES, _MAX_BYTES_PER_TURN = 262_144, 1_048_576
_SMALL_BYTES = 65_536
"""Size in bytes below which a copy is cheaper than another system call."""
_KEEPALIVE_IDLE_S, _KEEPALIVE_INTERVAL_S, _KEEPALIVE_PROBES = 4, 2, 4


class TcpStream:
    """Stream of pairs (header and payload) over a non-blocking socket.

    Not thread-safe: guarded by the owner's lock.
    """

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self.fd = connection.fileno()
        self.has_ended = False
        """True if no more data will be received."""
        self.is_broken = False
        """True if no more data can be sent."""
        self._input = bytearray()
        self._start = 0
        self._output: deque[memoryview] = deque()
        self.backlog_bytes = 0
        """Number of bytes that are not sent yet."""
        with suppress(OSError):  # it may have ended already
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    # ---- receiving

    def read(self) -> bool:
        """Receive a limited amount of the available data; return True if there was any."""
        old_size = len(self._input)
        while not self.has_ended and len(self._input) - old_size < _MAX_BYTES_PER_TURN:
            try:
                data = self._socket.recv(_CHUNK_BYTES)
            except (BlockingIOError, InterruptedError):
                break
            except OSError:
                data = b""
                self._abort()
            if not data:
                self.has_ended = True
            self._input += data
        return len(self._input) > old_size

    def next(self) -> list[bytes] | None:
        """Remove and return the oldest complete pair, or None if there is none.

        Raises `WireError` for an invalid size, or for an incomplete pair at the end of the stream. The
        stream has then ended.
        """
        available = len(self._input) - self._start
        if available < _SIZE.size:
            self._check_end(available)
            return None
        (size,) = _SIZE.unpack_from(self._input, self._start)
        if not HEADER_BYTES <= size <= HEADER_BYTES + MAX_PAYLOAD_BYTES:
            self._clear_input()
            self.has_ended = True
            self._abort()
            reason = _("invalid call size: {size} bytes").format(size=size)
            raise WireError(reason, code="call-size")
        if available < _SIZE.size + size:
            self._check_end(available)
            return None
        start = self._start + _SIZE.size
        self._start = start + size
        with memoryview(self._input) as view:
            pair = [
                bytes(view[start : start + HEADER_BYTES]),
                bytes(view[start + HEADER_BYTES : self._start]),
            ]
        if self._start == len(self._input):
            self._clear_input()
        elif self._start > _MAX_BYTES_PER_TURN:
            del self._input[: self._start]
            self._start = 0
        return pair

    def _check_end(self, available: int) -> None:
        if self.has_ended and available:
            self._clear_input()
            raise WireError(_("the message is incomplete"), code="call-end")

    def _clear_input(self) -> None:
        self._input = bytearray()
        self._start = 0

    # ---- sending

    def send(self, parts: Sequence[bytes | memoryview]) -> None:
        """Queue a pair and send as much as the socket accepts immediately; `flush` sends the rest.

        The pair is discarded if the connection is broken.
        """
        if self.is_broken:
            return
        header, payload = parts
        prefix = _SIZE.pack(len(header) + len(payload)) + header
        pieces = [prefix + payload] if len(payload) < _SMALL_BYTES else [prefix, payload]
        self._output.extend(memoryview(each) for each in pieces)
        self.backlog_bytes += len(prefix) + len(payload)
        self.flush()

    def flush(self) -> None:
        """Send as much of the queued data as the socket accepts immediately."""
        while self._output:
            try:
                sent_bytes = self._socket.send(self._output[0])
            except (BlockingIOError, InterruptedError):
                return
            except OSError:  # earlier input can still be read
                self._abort()
                return
            self.backlog_bytes -= sent_bytes
            if sent_bytes == len(self._output[0]):
                self._output.popleft()
            else:
                self._output[0] = self._output[0][sent_bytes:]

    def _abort(self) -> None:
        self.is_broken = True
        self._output.clear()
        self.backlog_bytes = 0

    # ---- closing

    def shut_down_sending(self) -> None:
        """Shut down the sending side."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        """Close the socket. The I/O thread must have stopped serving it."""
        self.has_ended = True
        self._abort()
        self._socket.close()


class TcpConnection:
    """TCP connection of a client. The constructor starts connecting. Counterpart of `ServerConnection`.

    Not thread-safe: guarded by the client's lock.

    Args:
        io: Thread that serves the socket.
        address: Address of the server as `HOST:PORT`.
        serve: Called in the I/O thread on events of the connection.
    """

    def __init__(self, io: IoThread, address: str, serve: Callable[[float], PollState]) -> None:
        self.endpoint = f"tcp://{address}"
        self._io = io
        self._serve = serve
        self._is_dead = False
        """True if connecting failed or the connection was closed."""
        self.is_open = False
        # the system accepts connections for an ending program until its port is closed
        self.reconnect_delay_s = 0.1
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._socket.setblocking(False)
            enable_keep_alive(self._socket, address)
            self._stream = TcpStream(self._socket)
            self.fd = self._stream.fd
            self._socket.connect_ex((host_of(address), int(address.rpartition(":")[2])))
        except BaseException:
            self._socket.close()
            raise
        io.add(self)

    @property
    def has_ended(self) -> bool:
        """True if the connection was open and has ended."""
        return self.is_open and self._stream.has_ended

    @property
    def has_input(self) -> bool:
        """False, because the file descriptor is level-triggered and signals all input."""
        return False

    def update(self) -> None:
        """Update `is_open` from the state of the socket."""
        if self.is_open or self._is_dead:
            return
        if self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self._is_dead = True
            return
        with suppress(OSError):  # not connected yet
            peer_address = self._socket.getpeername()
            # a TCP self-connection: the ephemeral source port equals an unused target port
            self._is_dead = peer_address == self._socket.getsockname()
            self.is_open = not self._is_dead

    def serve(self, now: float) -> PollState:
        """Send queued calls and receive replies. See `Pollable.serve`."""
        state = self._serve(now)
        is_reading_paused = self._is_dead or self._stream.has_ended
        wants_write = not self.is_open or self._stream.backlog_bytes > 0
        return PollState(is_reading_paused, state.due, wants_write=wants_write)

    def send(self, parts: Sequence[bytes | memoryview]) -> None:
        """Send a call. Data that the socket doesn't accept immediately is sent by the I/O thread."""
        self._stream.send(parts)
        if self._stream.backlog_bytes:
            self._io.serve_soon(self)

    def receive(self) -> list[bytes] | None:
        """Return the parts of the next reply, or None if no complete reply is available.

        Raises `WireError` if the received data is malformed or ends within a reply.
        """
        if not self.is_open:
            return None
        self._stream.flush()
        pair = self._stream.next()
        if pair is None and self._stream.read():
            pair = self._stream.next()
        return pair

    def close(self) -> None:
        """Close the connection and discard unread replies."""
        self._io.remove(self)
        self._is_dead = True
        self._stream.close()


def enable_keep_alive(connection: socket.socket, address: str) -> None:
    """Set socket options that detect within a dozen seconds that the peer's computer has vanished.

    See `nep.backends.zeromq.sockets.enable_keep_alive`.
    """
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if is_loopback(address):
        return
    for name, value in (
        ("TCP_KEEPIDLE", _KEEPALIVE_IDLE_S),
        ("TCP_KEEPINTVL", _KEEPALIVE_INTERVAL_S),
        ("TCP_KEEPCNT", _KEEPALIVE_PROBES),
    ):
        option = getattr(socket, name, None)  # not every system has all options
        if option is not None:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)
