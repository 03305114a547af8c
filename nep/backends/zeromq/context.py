"""SharedContext: the one ZeroMQ context and I/O thread of this process, for all its nodes.

It is made with the first node that needs it and ends with the last. A context of its own would cost every
node three threads and a dozen descriptors.
"""

from __future__ import annotations

import threading

import zmq
from zmq.utils import garbage

from nep.backends.zeromq.io_thread import IoThread
from nep.backends.zeromq.sockets import Socket
from nep.errors import ClosedError, TooManyFilesError
from nep.system import forks
from nep.system.descriptors import SPARE, check_room, has_room, is_lack, limit, opened
from nep.system.wakeup import Waker

__all__ = ["SharedContext", "join"]

_MAX_SOCKETS = 65_535
"""libzmq's highest limit: what bounds a program is how many files it may open."""
_CONTEXT_FILES = 12
_SOCKET_FILES = 4
"""A socket, its port, its local name, and a connection."""
_IDLE_WAKERS = 8
_LOOKS, _LOOK_S = 10, 0.01


class SharedContext:
    """See the module. `join` gives it out; whoever got it calls `leave` once."""

    def __init__(self) -> None:
        check_room(_CONTEXT_FILES, "a node")
        self._context: zmq.Context[Socket] = zmq.Context()
        self._context.set(zmq.MAX_SOCKETS, _MAX_SOCKETS)
        self.io = IoThread("nep-io")
        self._lock = threading.Lock()
        self._idle_wakers: list[Waker] = []
        self._pause = threading.Event()
        self._is_over = False
        self.users = 0
        """How many joined and have not left; under the lock of this module."""
        try:
            self.io.start()
        except BaseException:
            self.io.close()
            raise

    def socket(self, kind: int, what: str) -> Socket:
        """A socket that drops what it has when it is closed. Raises `TooManyFilesError`, for `what`."""
        self._wait_for_room(what)
        try:
            made = self._context.socket(kind)
        except zmq.ZMQError as error:
            if is_lack(error.errno):
                raise TooManyFilesError(what, opened(), limit()) from error
            if self._context.closed:
                raise ClosedError("the node") from error
            raise
        made.setsockopt(zmq.LINGER, 0)
        return made

    def _wait_for_room(self, what: str) -> None:
        """For a moment: libzmq closes sockets in its own time, and some may just have been closed."""
        for _ in range(_LOOKS):
            if has_room(_SOCKET_FILES + SPARE):
                return
            self._pause.wait(_LOOK_S)
        check_room(_SOCKET_FILES, what)

    def take_waker(self) -> Waker:
        """A waker for a thread that begins to wait. Raises `TooManyFilesError`."""
        with self._lock:
            return self._idle_wakers.pop() if self._idle_wakers else Waker()

    def give_waker(self, waker: Waker) -> None:
        """It waits no more; the waker is kept for the next."""
        waker.clear()
        with self._lock:
            if not self._is_over and len(self._idle_wakers) < _IDLE_WAKERS:
                self._idle_wakers.append(waker)
                return
        waker.close()

    def leave(self) -> None:
        """Whoever joined has closed all its sockets. The last one ends thread and context."""
        with _lock:
            self.users -= 1
            if self.users:
                return
            _forget(self)
        self.io.close()
        self._context.term()
        with self._lock:
            self._is_over = True
            for waker in self._idle_wakers:
                waker.close()
            self._idle_wakers.clear()


_lock = threading.Lock()
_shared: SharedContext | None = None
_inherited: list[SharedContext] = []
"""Those of the processes that this one was forked from: kept, because nothing of them may be touched."""


def join() -> SharedContext:
    """The context of this process, made when there is none. Raises `TooManyFilesError`."""
    global _shared  # noqa: PLW0603 - there is one a process
    with _lock:
        if _shared is None:
            _shared = SharedContext()
        _shared.users += 1
        return _shared


def _forget(ended: SharedContext) -> None:
    global _shared  # noqa: PLW0603 - there is one a process
    if _shared is ended:
        _shared = None


def _forked() -> None:
    global _lock, _shared  # noqa: PLW0603 - there is one a process
    _lock = threading.Lock()
    if _shared is not None:
        _inherited.append(_shared)
        _shared = None
    # pyzmq makes its thread for what is sent without a copy under this lock: a fork just then leaves it held.
    garbage.gc._lock = threading.Lock()  # noqa: SLF001


forks.in_child(_forked)
