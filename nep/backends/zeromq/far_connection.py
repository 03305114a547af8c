"""FarConnection: the connection over which a subscriber on another computer said hello.

A computer that gets another address, or wakes up in another network, connects anew, and its old connection
says nothing of its end. What libzmq sends to the new one it would queue there, too, until the system gives
up.
"""

from __future__ import annotations

import logging
import os
import socket
import struct
import sys
from dataclasses import dataclass
from typing import ClassVar

import zmq

from nep.backends.zeromq.sockets import SILENT_MS

__all__ = ["FarConnection"]

_logger = logging.getLogger("nep")
_TcpInfo = struct.Struct("=2xBB52xI")
"""Of Linux's `tcp_info`: how often it was sent again, how often asked for room, and when it last answered."""
_TRIES = 3
_SRCFD = int(zmq.SRCFD)


@dataclass(frozen=True)
class FarConnection:
    """Its number in this process, which the next one may get, and the other end, which tells them apart."""

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
