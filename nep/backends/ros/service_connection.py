"""Single call of a ROS service over TCP, with a timeout, which rospy's own implementation lacks."""

from __future__ import annotations

import contextlib
import math
import socket
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

from nep.i18n import _
from nep.protocol.service_wire import MAX_PAYLOAD_BYTES

_LENGTH = struct.Struct("<I")
_MAX_HEADER_BYTES = 2**20
_HANDSHAKE_TIMEOUT_S = 5.0
_MAX_HANDSHAKES = 3
"""Maximum number of concurrent handshakes with one server.

rospy's listen backlog is five; further connections would be delayed for seconds.
"""
_CHECK_INTERVAL_S = 0.1


class ServiceConnectionError(OSError):
    """The server has disconnected or doesn't offer this service."""


class HandshakeLimiter:
    """Limiter of the concurrent handshakes with each server. Thread-safe."""

    def __init__(self) -> None:
        self._changed = threading.Condition(threading.Lock())
        self._counts: Counter[str] = Counter()

    @contextlib.contextmanager
    def acquire(self, uri: str, is_cancelled: Callable[[], bool], deadline: float) -> Iterator[None]:
        """Wait until a handshake with a server may start, and count it within the context.

        Args:
            uri: Address of the server.
            is_cancelled: Returns True if the call is no longer in flight.
            deadline: Time (`time.monotonic`) at which to stop waiting.

        Raises:
            TimeoutError: The deadline has passed.
            ServiceConnectionError: The call was cancelled.
        """
        with self._changed:
            while self._counts[uri] >= _MAX_HANDSHAKES:
                remaining_s = deadline - time.monotonic()
                if remaining_s <= 0.0:
                    raise TimeoutError
                if is_cancelled():
                    raise ServiceConnectionError(_("the call was cancelled or timed out"))
                self._changed.wait(min(_CHECK_INTERVAL_S, remaining_s))
            self._counts[uri] += 1
        try:
            yield
        finally:
            with self._changed:
                self._counts[uri] -= 1
                if not self._counts[uri]:
                    del self._counts[uri]
                self._changed.notify_all()


class ServiceConnection:
    """Connection to a ROS service. The constructor opens it within 5 seconds.

    The constructor and `call` raise `TimeoutError` at the deadline, and `OSError` if the connection fails.

    Args:
        uri: Address of the server.
        service: Name of the service.
        caller: Name of this process's ROS node.
        deadline: Time (`time.monotonic`) at which the call times out.
    """

    def __init__(self, uri: str, service: str, caller: str, deadline: float) -> None:
        parts = urlsplit(uri)
        try:
            host, port = parts.hostname, parts.port
        except ValueError:
            host = port = None
        if parts.scheme != "rosrpc" or not host or not port:
            raise ServiceConnectionError(_("the server has no valid address"))
        self._deadline = min(deadline, time.monotonic() + _HANDSHAKE_TIMEOUT_S)
        self._socket = socket.create_connection((host, port), max(0.001, self._remaining_s()))
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.header = self._handshake({"callerid": caller, "service": service, "md5sum": "*"})
            self._deadline = deadline
        except BaseException:
            self._socket.close()
            raise

    def _remaining_s(self) -> float:
        return self._deadline - time.monotonic()

    def _handshake(self, fields: dict[str, str]) -> dict[str, str]:
        encoded_fields = [f"{key}={value}".encode() for key, value in fields.items()]
        self._send(b"".join(_LENGTH.pack(len(each)) + each for each in encoded_fields))
        data = self._receive_sized(_MAX_HEADER_BYTES)
        header: dict[str, str] = {}
        offset = 0
        while offset + 4 <= len(data):
            (size,) = _LENGTH.unpack_from(data, offset)
            key, _equals, value = (
                data[offset + 4 : offset + 4 + size].decode("utf-8", "replace").partition("=")
            )
            header[key] = value
            offset += 4 + size
        if "error" in header or "type" not in header:
            raise ServiceConnectionError(header.get("error", ""))
        return header

    def call(self, body: bytes) -> tuple[bool, bytes]:
        """Send a request; return (True, response) or (False, error message)."""
        self._send(body)
        has_succeeded = self._receive_exactly(1) != b"\0"
        return has_succeeded, self._receive_sized(MAX_PAYLOAD_BYTES + 2**20)

    def _send(self, data: bytes) -> None:
        self._set_timeout()
        self._socket.sendall(_LENGTH.pack(len(data)) + data)

    def _receive_sized(self, max_bytes: int) -> bytes:
        (size,) = _LENGTH.unpack(self._receive_exactly(4))
        if size > max_bytes:
            raise ServiceConnectionError(_("the message is too large"))
        return self._receive_exactly(size)

    def _receive_exactly(self, size: int) -> bytes:
        data = bytearray(size)
        view = memoryview(data)
        while view:
            self._set_timeout()
            count = self._socket.recv_into(view)
            if not count:
                raise ServiceConnectionError(_("the other side closed the connection"))
            view = view[count:]
        return bytes(data)

    def _set_timeout(self) -> None:
        if self._deadline == math.inf:
            self._socket.settimeout(None)
            return
        remaining_s = self._remaining_s()
        if remaining_s <= 0.0:
            raise TimeoutError
        self._socket.settimeout(remaining_s)

    def interrupt(self) -> None:
        """Interrupt the thread that is using the connection. Thread-safe."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection. Call in the thread that uses the connection."""
        self._socket.close()
