"""Waking of a thread that polls file descriptors."""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import threading

from nep.errors import TooManyFilesError
from nep.i18n import _
from nep.system.descriptors import descriptor_limit, is_descriptor_shortage, open_descriptor_count
from nep.system.forks import call_in_child

_HAS_EVENTFD = sys.platform == "linux" and hasattr(os, "eventfd")


class Waker:
    """File descriptor that becomes readable when another thread calls `wake`.

    Thread-safe for one waiting thread. Uses an eventfd on Linux, and elsewhere a socket pair, because Windows
    can only poll sockets. The constructor raises `TooManyFilesError`.
    """

    _event = -1
    _sockets: tuple[socket.socket, ...] = ()

    def __init__(self) -> None:
        self._lock = threading.RLock()  # the number of a closed descriptor may already belong to another file
        try:
            if _HAS_EVENTFD:
                self._event = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
            else:
                self._sockets = socket.socketpair()
        except OSError as error:
            if is_descriptor_shortage(error.errno):
                raise TooManyFilesError(
                    _("a waiting thread"), open_descriptor_count(), descriptor_limit()
                ) from error
            raise
        for end in self._sockets:
            end.setblocking(False)
        self.fd = self._sockets[0].fileno() if self._sockets else self._event
        """File descriptor to poll for reading."""
        call_in_child(self._close_in_child)

    def wake(self) -> None:
        """Make `fd` readable. Never blocks; several wakes before a `clear` count as one."""
        with self._lock, contextlib.suppress(OSError):  # full: already readable
            if self._event >= 0:
                os.eventfd_write(self._event, 1)
            elif self._sockets:
                self._sockets[1].send(b"\0")

    def clear(self) -> None:
        """Make `fd` unreadable. The waiting thread calls this before it checks for work."""
        with self._lock, contextlib.suppress(OSError):
            if self._event >= 0:
                os.eventfd_read(self._event)
            elif self._sockets:
                while self._sockets[0].recv(4096):
                    pass

    def close(self) -> None:
        """Close the descriptors. Idempotent."""
        with self._lock:
            self._close()

    def _close_in_child(self) -> None:
        # The parent's descriptors stay open.
        self._lock = threading.RLock()
        self._close()

    def __del__(self) -> None:
        self._close()

    def _close(self) -> None:
        event, self._event = self._event, -1
        sockets, self._sockets = self._sockets, ()
        if event >= 0:
            os.close(event)
        for end in sockets:
            end.close()
