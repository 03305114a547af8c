"""Waker: interrupts a thread that polls file descriptors."""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import threading

from nep.errors import TooManyFilesError
from nep.system.descriptors import is_lack, limit, opened
from nep.system.forks import watch

__all__ = ["Waker"]

_HAS_EVENTS = sys.platform == "linux" and hasattr(os, "eventfd")


class Waker:
    """A descriptor that becomes readable when another thread calls `wake`. Any thread may wake; one waits.

    Linux has descriptors for this; elsewhere it is two connected sockets, because only sockets can be polled
    on every system. Raises `TooManyFilesError`.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()  # a descriptor that was closed may be somebody else's file already
        self._event = -1
        self._ends: tuple[socket.socket, ...] = ()
        try:
            if _HAS_EVENTS:
                self._event = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
            else:
                self._ends = socket.socketpair()
        except OSError as error:
            if is_lack(error.errno):
                raise TooManyFilesError("a thread that waits", opened(), limit()) from error
            raise
        for end in self._ends:
            end.setblocking(False)
        self.fd = self._ends[0].fileno() if self._ends else self._event
        """What to poll for reading."""
        watch(self)

    def wake(self) -> None:
        """Make `fd` readable. Never blocks; many wakes before a `clear` are one."""
        with self._lock, contextlib.suppress(OSError):  # full: it is readable already
            if self._event >= 0:
                os.eventfd_write(self._event, 1)
            elif self._ends:
                self._ends[1].send(b"\0")

    def clear(self) -> None:
        """Make `fd` unreadable again. To be called by the thread that waits, before it looks for work."""
        with self._lock, contextlib.suppress(OSError):
            if self._event >= 0:
                os.eventfd_read(self._event)
            elif self._ends:
                while self._ends[0].recv(4096):
                    pass

    def close(self) -> None:
        """Give the descriptors back. May be called twice."""
        with self._lock:
            self._close()

    def forked(self) -> None:
        """In a child: its descriptors are the parent's, too; closing them here does nothing there."""
        self._lock = threading.RLock()
        self._close()

    def __del__(self) -> None:
        self._close()

    def _close(self) -> None:
        event, self._event = self._event, -1
        ends, self._ends = self._ends, ()
        if event >= 0:
            os.close(event)
        for end in ends:
            end.close()
