"""What all native sockets need: marks, free ports, addresses, waits in slices, counts of what was refused."""

from __future__ import annotations

import errno
import logging
import os
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import zmq

from nep.errors import AddressInUseError, NepError
from nep.i18n import _
from nep.system.addresses import endpoint_of, host_of, in_numbers, is_endpoint, is_loopback
from nep.system.descriptors import check_room
from nep.system.log_rarely import is_logged

__all__ = [
    "CONNECT_MS",
    "LOOPBACK",
    "ORIGINAL_PORTS",
    "SHORT_WAIT_S",
    "SILENT_MS",
    "FarConnection",
    "Part",
    "Refusals",
    "bind",
    "bind_free_port",
    "connect",
    "host_towards",
    "is_far",
    "keep_alive",
    "receive_mark",
    "send_mark",
    "sendable",
    "wait_shortly",
    "wait_until",
]

_logger = logging.getLogger("nep")
_TOLD_S = 5.0

Socket = zmq.Socket[bytes]
Part = bytes | memoryview | zmq.Frame
LOOPBACK = "127.0.0.1"
SHORT_WAIT_S = 0.005
"""How long a reader may wait in a subscriber's socket, holding its lock. A shorter time is not quicker: a
timer that ends before the kernel's next tick costs more than the wait."""
_SLICE_S = 0.1
_HELD = frozenset({errno.EADDRINUSE, zmq.EADDRINUSE, errno.EACCES, errno.EMFILE, errno.ENFILE})
"""What binding an own address may fail with."""
_MOST = 50_000
_LEAST = 32
_PORT_FILES = 2
SILENT_MS = 15_000
"""When another computer has taken nothing for so long of what was sent there, the connection ends."""
CONNECT_MS = 3000
"""For an attempt to connect to another computer; the system alone would try ever more rarely."""
ORIGINAL_PORTS = frozenset({7000, 7777, 7780, 12345, 50000, *range(9000, 10000)})
"""Ports that programs of the original NEP expect to find something else on."""

_TcpInfo = struct.Struct("=2xBB52xI")
"""Of Linux's `tcp_info`: how often it was sent again, how often asked for room, and when it last answered."""
_TRIES = 3
_SRCFD = int(zmq.SRCFD)


class Refusals:
    """What came on a port and could not be understood: counted, and named for some seconds.

    Not thread-safe: it lives under its socket's lock.
    """

    def __init__(self) -> None:
        self.count = 0
        self._reason = ""
        self._last_at = 0.0

    def add(self, reason: str) -> bool:
        """One more, and why. Whether to log it: the first, the tenth, the hundredth, ..."""
        self.count += 1
        self._reason = reason
        self._last_at = time.monotonic()
        return is_logged(self.count)

    def told(self) -> str:
        """The newest reason and how many there were; empty when there was none in the last seconds."""
        if not self.count or time.monotonic() - self._last_at > _TOLD_S:
            return ""
        return _("{reason} ({count} so far)").format(reason=self._reason, count=self.count)


def send_mark(owner: Socket) -> None:
    """Let libzmq queue so many messages for each connection. Their bytes are bounded by `byte_window`.

    Before it is bound: libzmq does not stand another mark while there are connections.
    """
    owner.setsockopt(zmq.SNDHWM, _MOST)


def receive_mark(codec: str) -> int:
    """The high-water mark of a subscriber. The node's thread empties its socket, so a small one will do."""
    return _LEAST if codec == "image" else 1000


def wait_shortly(owner: Socket) -> None:
    """Let receiving without DONTWAIT wait for `SHORT_WAIT_S` seconds."""
    owner.setsockopt(zmq.RCVTIMEO, round(SHORT_WAIT_S * 1000))


def bind_free_port(owner: Socket, host: str) -> str:
    """Bind to a free port of `host`, none of the original NEP's; the endpoint. Raises `AddressInUseError`."""
    for _port in range(100):
        endpoint = bind(owner, f"{host}:*")
        if int(endpoint.rpartition(":")[2]) not in ORIGINAL_PORTS:
            return endpoint
        owner.unbind(endpoint)
    raise AddressInUseError(f"{host}:*")


def bind(owner: Socket, address: str) -> str:
    """Bind to an address; the endpoint. Raises `AddressInUseError`, `TooManyFilesError`."""
    check_room(_PORT_FILES, f"a port of '{host_of(address)}'")
    try:
        owner.bind(endpoint_of(address))
    except zmq.ZMQError as error:
        raise AddressInUseError(address, is_own=error.errno in _HELD) from error
    return owner.getsockopt_string(zmq.LAST_ENDPOINT)


def connect(owner: Socket, address: str) -> str:
    """Connect to an address, whether something is there yet or not; the endpoint. Raises `NepError`."""
    endpoint = endpoint_of(address)
    if not is_endpoint(endpoint):
        raise NepError(
            _("'{address}' cannot be connected to; use a computer's address and a port up to 65535").format(
                address=address
            )
        )
    endpoint = endpoint_of(in_numbers(address))
    owner.connect(endpoint)
    return endpoint


def host_towards(address: str) -> str | None:
    """The address of this computer under which a master at `address` sees it; None without a way to it."""
    if is_loopback(address):
        return LOOPBACK
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect((host_of(address), 9))  # sends nothing: it only chooses the way
            return str(probe.getsockname()[0])
    except OSError:
        return None


def is_far(endpoint: str) -> bool:
    """Whether it is on another computer, or may be reached from there."""
    return endpoint.startswith("tcp://") and not is_loopback(endpoint.removeprefix("tcp://"))


def keep_alive(owner: Socket, endpoint: str, *, is_watched: bool = False) -> None:
    """Notice within a dozen seconds when a computer behind the connections of the next endpoint has vanished.

    The endpoint may be one to connect to or one to bind; "*" is any port. While nothing is under way the
    kernel asks the other one's, which answers for a program that a debugger holds; a heartbeat of ZeroMQ
    would cut it off. What is under way it sends again and again, for a quarter of an hour and ever more
    rarely: hence a limit. A held program to which a lot is sent would reach that as well, so whoever sends a
    lot looks himself (`is_watched`, see `FarConnection`), where he can. Only for other computers: on this one
    the kernel tells of every end.
    """
    far = is_far(endpoint)
    owner.setsockopt(zmq.TCP_KEEPALIVE, 1 if far else -1)
    owner.setsockopt(zmq.TCP_MAXRT, SILENT_MS if far and not is_watched else 0)
    owner.setsockopt(zmq.CONNECT_TIMEOUT, CONNECT_MS if far else 0)
    if far:
        owner.setsockopt(zmq.TCP_KEEPALIVE_IDLE, 4)
        owner.setsockopt(zmq.TCP_KEEPALIVE_INTVL, 2)
        owner.setsockopt(zmq.TCP_KEEPALIVE_CNT, 4)


def wait_until(changed: threading.Condition, is_met: Callable[[], bool], timeout_s: float) -> bool:
    """Wait, holding `changed`, until `is_met()`; whether it is. In slices, for Ctrl+C on Windows."""
    deadline = time.monotonic() + timeout_s
    while not is_met():
        left = deadline - time.monotonic()
        if left <= 0.0:
            return False
        changed.wait(min(left, _SLICE_S))
    return True


def sendable(data: bytes | memoryview) -> Part:
    """What can be sent as it lies: a received message itself; of what can still change a copy."""
    if isinstance(data, bytes):
        return data
    if not (data.readonly and data.c_contiguous):
        return bytes(data)
    origin: object = data.obj
    if isinstance(origin, zmq.Frame) and data.nbytes == len(origin):
        return origin
    return data if data.itemsize == data.ndim == 1 else data.cast("B")


@dataclass(frozen=True)
class FarConnection:
    """The connection over which a subscriber on another computer said hello.

    Its number in this process, which the next one may get, and the other end, which tells them apart.

    A computer that gets another address, or wakes up in another network, connects anew, and its old
    connection says nothing of its end. What libzmq sends to the new one it would queue there, too, until the
    system gives up.
    """

    fd: int
    peer: tuple[str, int]

    can_tell: ClassVar[bool] = sys.platform == "linux"
    """Whether `is_silent` can tell."""

    @classmethod
    def of(cls, received: zmq.Frame) -> FarConnection | None:
        """The one over which this came; None where that is on this computer, or cannot be told."""
        try:
            host = str(received.get("Peer-Address"))
            if os.name != "posix" or not host or host.startswith("127."):
                return None
            fd = int(received.get(_SRCFD))
            peer = _peer_of(fd)
        except (zmq.ZMQError, OSError):  # it has ended already
            return None
        return None if peer is None else cls(fd, peer)

    def is_silent(self) -> bool:
        """Whether its other end has answered nothing for long, though it was asked again and again.

        The kernel answers for a program that a debugger holds: that it takes nothing more now.
        """
        if not self.can_tell:
            return False
        try:
            with _same(self.fd) as connection:
                if connection.getpeername() != self.peer:
                    return False
                told = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _TcpInfo.size)
            resent, asked, last_answer_ms = _TcpInfo.unpack(told)
        except (OSError, struct.error):
            return False
        return bool(max(resent, asked) >= _TRIES and last_answer_ms >= SILENT_MS)

    def end(self) -> None:
        """End it, if it is still there: libzmq notices and lets go of what it holds for it."""
        try:
            with _same(self.fd) as connection:
                if connection.getpeername() == self.peer:
                    connection.shutdown(socket.SHUT_RDWR)
        except OSError as error:
            _logger.debug("the connection to %s:%d had ended: %s", *self.peer, error)


def _peer_of(fd: int) -> tuple[str, int] | None:
    with _same(fd) as connection:
        peer = connection.getpeername()
    return (str(peer[0]), int(peer[1])) if connection.family == socket.AF_INET else None


def _same(fd: int) -> socket.socket:
    """The same connection by a number of our own: libzmq may close its number at any moment."""
    own = os.dup(fd)
    try:
        return socket.socket(fileno=own)
    except OSError:  # it is none
        os.close(own)
        raise
