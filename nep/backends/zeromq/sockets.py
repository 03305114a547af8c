"""Helpers for sockets of the native wire: high-water marks, ports, keep-alive, waits, rejected input."""

from __future__ import annotations

import errno
import logging
import os
import socket
import struct
import sys
from dataclasses import dataclass
from typing import ClassVar

import zmq

from nep.errors import AddressInUseError, NepError
from nep.i18n import _
from nep.messages.codecs import Codec
from nep.system.addresses import (
    LOOPBACK,
    ORIGINAL_PORTS,
    endpoint_of,
    host_of,
    is_endpoint,
    is_loopback,
    resolve_address,
)
from nep.system.descriptors import check_free_descriptors

_logger = logging.getLogger("nep")

Socket = zmq.Socket[bytes]
Part = bytes | memoryview | zmq.Frame
SHORT_WAIT_S = 0.005
"""Maximum time in seconds that a reader waits in a socket while holding its lock.

Shorter waits are no faster, because a timer that ends before the kernel's next tick costs more than the
rest of the wait.
"""
_IN_USE_ERRORS = frozenset({errno.EADDRINUSE, zmq.EADDRINUSE, errno.EACCES, errno.EMFILE, errno.ENFILE})
"""Error numbers of bind which mean that the address is valid but can't be used now."""
_SEND_HIGH_WATER_MARK = 50_000
_RECEIVE_HIGH_WATER_MARK = 1000
_FDS_PER_PORT = 2
SILENCE_TIMEOUT_MS = 15_000
"""Time in milliseconds without acknowledgement after which a connection to another computer is closed."""
CONNECT_TIMEOUT_MS = 3000
"""Timeout in milliseconds for a connection attempt to another computer.

Needed because the system's own retries take place at growing intervals.
"""

_TCP_INFO = struct.Struct("=2xBB52xI")
"""Layout of Linux's `tcp_info`: retransmissions, window probes and time since the last acknowledgement.

The time is in milliseconds.
"""
_MIN_RETRIES = 3
_SRCFD = int(zmq.SRCFD)


def set_send_high_water_mark(zmq_socket: Socket) -> None:
    """Set the high-water mark for sending. Call before bind, because it applies only to new connections.

    `byte_window` limits the bytes.
    """
    zmq_socket.setsockopt(zmq.SNDHWM, _SEND_HIGH_WATER_MARK)


def receive_high_water_mark(codec: Codec) -> int:
    """Return the high-water mark for receiving messages of a codec.

    The value can be small, because the I/O thread empties the socket.
    """
    return min(_RECEIVE_HIGH_WATER_MARK, codec.queue_length or _RECEIVE_HIGH_WATER_MARK)


def set_receive_timeout(zmq_socket: Socket) -> None:
    """Set the timeout of a blocking receive to `SHORT_WAIT_S` seconds."""
    zmq_socket.setsockopt(zmq.RCVTIMEO, round(SHORT_WAIT_S * 1000))


def bind_free_port(zmq_socket: Socket, host: str) -> str:
    """Bind to a free port of `host` that the original NEP doesn't use; return the endpoint.

    Raises `AddressInUseError` if `host` can't be bound or no such port is found, and
    `TooManyFilesError` if the process is out of file descriptors.
    """
    for _port in range(100):
        endpoint = bind(zmq_socket, f"{host}:*")
        if int(endpoint.rpartition(":")[2]) not in ORIGINAL_PORTS:
            return endpoint
        zmq_socket.unbind(endpoint)
    raise AddressInUseError(f"{host}:*")


def bind(zmq_socket: Socket, address: str) -> str:
    """Bind to an address and return the endpoint.

    Raises `AddressInUseError` if the address can't be bound, and `TooManyFilesError` if the process is
    out of file descriptors.
    """
    check_free_descriptors(_FDS_PER_PORT, f"a port of '{host_of(address)}'")
    try:
        zmq_socket.bind(endpoint_of(address))
    except zmq.ZMQError as error:
        raise AddressInUseError(address, is_own=error.errno in _IN_USE_ERRORS) from error
    return zmq_socket.getsockopt_string(zmq.LAST_ENDPOINT)


def connect(zmq_socket: Socket, address: str) -> str:
    """Connect to an address and return the endpoint. Raises `NepError` for an invalid address.

    The peer may bind the address later.
    """
    endpoint = endpoint_of(address)
    if not is_endpoint(endpoint):
        raise NepError(
            _("can't connect to '{address}'; use a computer's address and a port up to 65535").format(
                address=address
            )
        )
    endpoint = endpoint_of(resolve_address(address))
    zmq_socket.connect(endpoint)
    return endpoint


def local_address_towards(address: str) -> str | None:
    """Return the address of this computer from which `address` is reached.

    Returns None if there is no route or the host name can't be resolved.
    """
    if is_loopback(address):
        return LOOPBACK
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect((host_of(address), 9))  # sends nothing: only selects the route
            return str(probe.getsockname()[0])
    except OSError:
        return None


def is_remote(endpoint: str) -> bool:
    """Return True if an endpoint is on another computer, or is reachable from other computers."""
    return endpoint.startswith("tcp://") and not is_loopback(endpoint.removeprefix("tcp://"))


def enable_keep_alive(zmq_socket: Socket, endpoint: str, *, has_silence_check: bool = False) -> None:
    """Set socket options that detect within a dozen seconds that a peer's computer has vanished.

    Call before connecting or binding. Only needed for other computers, because on the same computer the
    kernel reports the end of every connection.

    TCP keep-alive probes idle connections. The kernel also answers the probes for a program stopped in a
    debugger, which a ZeroMQ heartbeat would disconnect. Unacknowledged data would be resent for a quarter
    of an hour, so the time for resending is limited, too (TCP_MAXRT). A stopped program could exceed this
    limit as well; publishers therefore check their connections themselves where the system supports it (see
    `RemoteConnection`).

    Args:
        zmq_socket: Socket of zmq.
        endpoint: Endpoint to connect to or to bind; the port may be "*".
        has_silence_check: True if the owner itself closes connections that don't respond.
    """
    has_remote_peer = is_remote(endpoint)
    zmq_socket.setsockopt(zmq.TCP_KEEPALIVE, 1 if has_remote_peer else -1)
    resend_timeout_ms = SILENCE_TIMEOUT_MS if has_remote_peer and not has_silence_check else 0
    zmq_socket.setsockopt(zmq.TCP_MAXRT, resend_timeout_ms)
    zmq_socket.setsockopt(zmq.CONNECT_TIMEOUT, CONNECT_TIMEOUT_MS if has_remote_peer else 0)
    if has_remote_peer:
        zmq_socket.setsockopt(zmq.TCP_KEEPALIVE_IDLE, 4)
        zmq_socket.setsockopt(zmq.TCP_KEEPALIVE_INTVL, 2)
        zmq_socket.setsockopt(zmq.TCP_KEEPALIVE_CNT, 4)


def to_sendable(data: bytes | memoryview) -> Part:
    """Return `data` in a form that libzmq can send without another copy.

    Mutable or non-contiguous data is copied. Other data is returned unchanged, as a view of bytes, or
    as the `zmq.Frame` that contains it.
    """
    if isinstance(data, bytes):
        return data
    if not (data.readonly and data.c_contiguous):
        return bytes(data)
    origin: object = data.obj
    if isinstance(origin, zmq.Frame) and data.nbytes == len(origin):
        return origin
    return data if data.itemsize == data.ndim == 1 else data.cast("B")


@dataclass(frozen=True)
class RemoteConnection:
    """Connection that delivered the hello of a subscriber on another computer.

    Identified by its file descriptor, which the system may reuse, and the peer's address. When a computer
    changes its address or network, the subscriber reconnects, but the old connection isn't closed. Without
    this class, messages would be queued for both connections until the system gives up.
    """

    fd: int
    peer: tuple[str, int]

    can_detect_silence: ClassVar[bool] = sys.platform == "linux"
    """True if `is_silent` is supported on this system."""

    @classmethod
    def from_frame(cls, frame: zmq.Frame) -> RemoteConnection | None:
        """Return the connection that delivered `frame`.

        Returns None if the peer is on this computer or can't be determined.
        """
        try:
            host = str(frame.get("Peer-Address"))
            if os.name != "posix" or not host or host.startswith("127."):
                return None
            fd = int(frame.get(_SRCFD))
            peer = _peer_of(fd)
        except (zmq.ZMQError, OSError):  # closed already
            return None
        return None if peer is None else cls(fd, peer)

    def is_silent(self) -> bool:
        """Return True if the peer acknowledged nothing for `SILENCE_TIMEOUT_MS` in spite of several retries.

        A program stopped in a debugger isn't silent, because its kernel still acknowledges window probes.
        """
        if not self.can_detect_silence:
            return False
        try:
            with _duplicate_socket(self.fd) as connection:
                if connection.getpeername() != self.peer:
                    return False
                tcp_info = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _TCP_INFO.size)
            retransmissions, probes, last_ack_ms = _TCP_INFO.unpack(tcp_info)
        except (OSError, struct.error):
            return False
        return bool(max(retransmissions, probes) >= _MIN_RETRIES and last_ack_ms >= SILENCE_TIMEOUT_MS)

    def close(self) -> None:
        """Close the connection if it is still open; libzmq then releases its queue."""
        try:
            with _duplicate_socket(self.fd) as connection:
                if connection.getpeername() == self.peer:
                    connection.shutdown(socket.SHUT_RDWR)
        except OSError as error:
            _logger.debug("the connection to %s:%d was already closed: %s", *self.peer, error)


def _peer_of(fd: int) -> tuple[str, int] | None:
    with _duplicate_socket(fd) as connection:
        peer = connection.getpeername()
    return (str(peer[0]), int(peer[1])) if connection.family == socket.AF_INET else None


def _duplicate_socket(fd: int) -> socket.socket:
    # Duplicates the descriptor, because libzmq may close the original at any moment.
    duplicate = os.dup(fd)
    try:
        return socket.socket(fileno=duplicate)
    except OSError:  # not a socket
        os.close(duplicate)
        raise
