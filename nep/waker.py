"""Waker: interrupts a thread that polls file descriptors."""

from __future__ import annotations

import contextlib
import socket

__all__ = ["Waker"]


class Waker:
    """A descriptor that becomes readable when another thread calls `wake`. Any thread may wake; one waits.

    Two connected sockets, because only sockets can be polled on every system.
    """

    def __init__(self) -> None:
        self._reader, self._writer = socket.socketpair()
        self._reader.setblocking(False)
        self._writer.setblocking(False)
        self.fd = self._reader.fileno()
        """What to poll for reading."""

    def wake(self) -> None:
        """Make `fd` readable. Never blocks; many wakes before a `clear` are one."""
        with contextlib.suppress(OSError):  # full: it is readable already; closed: nobody waits any more
            self._writer.send(b"\0")

    def clear(self) -> None:
        """Make `fd` unreadable again. To be called by the thread that waits, before it looks for work."""
        with contextlib.suppress(OSError):
            while self._reader.recv(4096):
                pass

    def close(self) -> None:
        """Give the descriptors back."""
        self._reader.close()
        self._writer.close()
