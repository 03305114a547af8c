"""IoThread: event loop for sockets.

One thread serves all nodes of a process; each node has one for its sinks.

A ZeroMQ socket may be used by any thread that holds its owner's lock, so this thread never polls sockets,
only their file descriptors. When one is readable, its owner takes the lock and works until the socket is
empty. ZMQ_FD is edge-triggered and any use of the socket may consume the edge; a thread that uses a socket
therefore must either empty it or call `serve_soon`.

Only `close` ends the thread: an owner that raises is served again after a second, and when polling itself
fails (a descriptor was closed under it), the poller is rebuilt without the broken descriptors.

`SharedContext` is the ZeroMQ context of the process and its I/O thread, created with the first node and
terminated with the last. A context per node would cost three threads and a dozen descriptors each.
"""

from __future__ import annotations

import heapq
import itertools
import logging
import select
import selectors
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple, Protocol

import zmq
from zmq.utils import garbage

from nep.backends.zeromq.sockets import Socket
from nep.errors import ClosedError, TooManyFilesError
from nep.system import forks
from nep.system.descriptors import SPARE, check_room, has_room, is_lack, limit, opened
from nep.system.forks import watch
from nep.system.wakeup import Waker

__all__ = ["IoThread", "Rest", "Served", "SharedContext", "shared_context"]

_logger = logging.getLogger("nep.io")
_RETRY_S = 1.0

_MAX_SOCKETS = 65_535
"""libzmq's upper limit; the limit on open files is reached first."""
_CONTEXT_FILES = 12
_SOCKET_FILES = 4
"""Descriptors per socket: the socket, its port, its Unix socket name and a connection."""
_IDLE_WAKERS = 8
_LOOKS, _LOOK_S = 10, 0.01
_Ready = tuple[selectors.SelectorKey, int]
_ROUNDED_S = 0.001
_ROUNDING = getattr(selectors, "EpollSelector", ())
_SELECT_MOST = 1024
"""`select` supports descriptors below this number."""


class Rest(NamedTuple):
    """Next wake-up condition of a socket's owner.

    Attributes:
        is_quiet: True to pause reading until `due`.
        due: Time (`time.monotonic`) at which to serve it again; None to wait for input only.
        sends: True to serve it also when its descriptor is writable. Not for ZeroMQ sockets.
    """

    is_quiet: bool = False
    due: float | None = None
    sends: bool = False


class Served(Protocol):
    """Owner of a socket that an `IoThread` serves."""

    @property
    def fd(self) -> int:
        """File descriptor of the socket."""

    def serve(self, now: float) -> Rest:
        """Process input until the socket is empty. Takes the owner's lock; doesn't block."""


class IoThread:
    """Event loop thread; see the module.

    `add` may be called before `start`. `new_selector` creates the poller.
    """

    def __init__(
        self, name: str, new_selector: Callable[[], selectors.BaseSelector] = selectors.DefaultSelector
    ) -> None:
        self._waker = Waker()
        self._new_selector = new_selector
        self._selector = new_selector()
        self._selector.register(self._waker.fd, selectors.EVENT_READ)
        self._orders: deque[tuple[str, Served, threading.Event | None]] = deque()
        self._served: set[Served] = set()
        self._polled: dict[Served, tuple[int, int]] = {}
        """Registered descriptor and event mask of each owner."""
        self._doubtful: set[Served] = set()
        """Owners that may have broken the poller: each is polled alone before it is registered again."""
        self._due: dict[Served, float] = {}
        self._heap: list[tuple[float, int, Served]] = []
        self._numbers = itertools.count()
        self._turns = 0
        self._stuck_in: int | None = None
        self._is_closing = False
        self._pause = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        watch(self)

    # ---- from other threads

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def add(self, served: Served) -> None:
        """Start serving `served`; its first call follows at once."""
        self._order("add", served, None)

    def serve_soon(self, served: Served) -> None:
        """Serve `served` again, whether its descriptor is ready or not."""
        self._order("soon", served, None)

    def remove(self, served: Served, timeout_s: float = 2.0) -> None:
        """Stop serving `served`; afterwards its socket may be closed.

        While the thread is blocked (by a sink that doesn't return), only the first call waits for
        `timeout_s`.
        """
        if threading.current_thread() is self._thread or not self._thread.is_alive():
            self._forget(served)
            return
        done = threading.Event()
        self._order("remove", served, done)
        if self._stuck_in != self._turns and not done.wait(timeout_s):
            self._stuck_in = self._turns

    def close(self, timeout_s: float = 5.0) -> None:
        """Stop the thread and join it for up to `timeout_s` seconds."""
        self._is_closing = True
        self._pause.set()
        self._waker.wake()
        if not self._thread.is_alive():
            self._release()
        elif threading.current_thread() is not self._thread:
            self._thread.join(timeout_s)

    def forked(self) -> None:
        """Become closed in a forked child, which has no such thread and shares the parent's poller."""
        self._is_closing = True
        self._pause = threading.Event()
        self._served.clear()
        self._orders.clear()
        self._selector.close()

    def _order(self, what: str, served: Served, done: threading.Event | None) -> None:
        self._orders.append((what, served, done))
        self._waker.wake()

    # ---- in the I/O thread

    def _run(self) -> None:
        while not self._is_closing:
            self._turns += 1
            try:
                self._turn()
            except Exception:
                if not self._is_closing:
                    _logger.exception("polling failed; rebuilding the poller")
                    self._begin_anew()
        self._release()
        for _what, _served, done in self._orders:
            if done is not None:
                done.set()

    def _turn(self) -> None:
        timeout_s = self._timeout()
        ready = _ready(self._selector, timeout_s)
        # Each system call releases the GIL and then waits for it, so avoid needless ones.
        if any(key.data is None for key, _events in ready):
            self._waker.clear()
        self._obey()
        for key, _events in ready:
            if isinstance(key.data, tuple) and key.data[0] in self._served:
                self._serve(key.data[0])
        self._serve_due()

    def _begin_anew(self) -> None:
        while not self._is_closing:
            with suppress(Exception):  # the selector itself may be broken
                self._selector.close()
            try:
                self._selector = self._new_selector()
                self._polled.clear()
                self._selector.register(self._waker.fd, selectors.EVENT_READ)
            except Exception:
                _logger.exception("can't poll the sockets of this program; retrying")
                self._pause.wait(_RETRY_S)
                continue
            self._doubtful = set(self._served)
            for served in tuple(self._served):
                self._serve(served)
            return

    def _obey(self) -> None:
        while self._orders:
            what, served, done = self._orders.popleft()
            if what == "remove":
                self._forget(served)
            else:
                if what == "add":
                    self._served.add(served)
                if served in self._served:
                    self._serve(served)
            if done is not None:
                done.set()

    def _serve(self, served: Served) -> None:
        now = time.monotonic()
        try:
            rest = served.serve(now)
        except Exception:  # one broken socket must not block the others
            _logger.exception("error while serving a socket; retrying")
            rest = Rest(is_quiet=True, due=now + _RETRY_S)
        if served not in self._served or self._is_closing:
            return  # removed while it was served
        try:
            self._poll(served, _events(rest))
        except (OSError, ValueError, KeyError) as error:
            _logger.error("can't poll a socket, serving it every second instead: %s", error)  # noqa: TRY400
            self._polled.pop(served, None)
            self._doubtful.add(served)
            rest = Rest(is_quiet=True, due=now + _RETRY_S)
        if rest.due is None:
            self._due.pop(served, None)
        elif self._due.get(served) != rest.due:
            self._due[served] = rest.due
            heapq.heappush(self._heap, (rest.due, next(self._numbers), served))

    def _serve_due(self) -> None:
        now = time.monotonic()
        late: list[Served] = []
        while self._heap and self._heap[0][0] <= now:
            due, _number, served = heapq.heappop(self._heap)
            if self._due.get(served) == due:  # otherwise it was rescheduled
                del self._due[served]
                late.append(served)
        for served in late:
            if served in self._served:
                self._serve(served)

    def _timeout(self) -> float | None:
        while self._heap and self._due.get(self._heap[0][2]) != self._heap[0][0]:
            heapq.heappop(self._heap)
        return max(0.0, self._heap[0][0] - time.monotonic()) if self._heap else None

    def _try_alone(self, served: Served, wanted: int) -> None:
        # Windows' select reports a broken descriptor only while polling, and then for the whole set.
        with self._new_selector() as trial:
            trial.register(served.fd, wanted)
            trial.select(0)
        self._doubtful.discard(served)

    def _poll(self, served: Served, wanted: int) -> None:
        polled = self._polled.get(served)
        if polled is None:
            if wanted:
                if served in self._doubtful:
                    self._try_alone(served, wanted)
                self._selector.register(served.fd, wanted, (served,))
                self._polled[served] = (served.fd, wanted)
        elif not wanted:
            del self._polled[served]
            self._selector.unregister(polled[0])
        elif wanted != polled[1]:
            self._selector.modify(polled[0], wanted, (served,))
            self._polled[served] = (polled[0], wanted)

    def _forget(self, served: Served) -> None:
        self._served.discard(served)
        self._doubtful.discard(served)
        self._due.pop(served, None)
        if served in self._polled:
            with suppress(OSError, ValueError, KeyError):  # the poller is closed or was rebuilt
                self._poll(served, 0)

    def _release(self) -> None:
        self._selector.close()
        self._waker.close()


def _events(rest: Rest) -> int:
    return (0 if rest.is_quiet else selectors.EVENT_READ) | (selectors.EVENT_WRITE if rest.sends else 0)


def _ready(selector: selectors.BaseSelector, timeout_s: float | None) -> Sequence[_Ready]:
    # epoll rounds timeouts up to a whole millisecond.
    if (
        timeout_s
        and timeout_s < _ROUNDED_S
        and isinstance(selector, _ROUNDING)
        and selector.fileno() < _SELECT_MOST
    ):
        if not select.select((selector.fileno(),), (), (), timeout_s)[0]:
            return ()
        timeout_s = 0.0
    return selector.select(timeout_s)


class SharedContext:
    """ZeroMQ context of the process; see the module. Each `shared_context` call needs one `leave` call."""

    def __init__(self) -> None:
        check_room(_CONTEXT_FILES, "a node")
        self._context: zmq.Context[Socket] = zmq.Context()
        # libzmq rejects values above its compile-time limit, which is 16383 on Windows
        self._context.set(zmq.MAX_SOCKETS, min(_MAX_SOCKETS, self._context.get(zmq.SOCKET_LIMIT)))
        self.io = IoThread("nep-io")
        self._lock = threading.Lock()
        self._idle_wakers: list[Waker] = []
        self._pause = threading.Event()
        self._is_over = False
        self.users = 0
        """Number of users. Guarded by the module's lock."""
        try:
            self.io.start()
        except BaseException:
            self.io.close()
            raise

    def socket(self, kind: int, what: str) -> Socket:
        """Create a socket with a linger of 0. Raises `TooManyFilesError`, which names `what`."""
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
        # libzmq closes sockets asynchronously, so recently closed ones may still hold descriptors.
        for _ in range(_LOOKS):
            if has_room(_SOCKET_FILES + SPARE):
                return
            self._pause.wait(_LOOK_S)
        check_room(_SOCKET_FILES, what)

    def take_waker(self) -> Waker:
        """Return a waker for a waiting thread. Raises `TooManyFilesError`."""
        with self._lock:
            return self._idle_wakers.pop() if self._idle_wakers else Waker()

    def give_waker(self, waker: Waker) -> None:
        """Return a waker to the pool."""
        waker.clear()
        with self._lock:
            if not self._is_over and len(self._idle_wakers) < _IDLE_WAKERS:
                self._idle_wakers.append(waker)
                return
        waker.close()

    def join(self) -> None:
        """Add a user, so that the context isn't terminated before the matching `leave`."""
        with _lock:
            self.users += 1

    def leave(self) -> None:
        """Remove a user that has closed all its sockets.

        The last one stops the thread and terminates the context.
        """
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


"""Contexts inherited by a forked child. They are kept because destroying them would affect the parent."""


def shared_context() -> SharedContext:
    """Return the context of this process; create it if needed. Raises `TooManyFilesError`."""
    global _shared  # noqa: PLW0603 - one per process
    with _lock:
        if _shared is None:
            _shared = SharedContext()
        _shared.users += 1
        return _shared


def _forget(ended: SharedContext) -> None:
    global _shared  # noqa: PLW0603 - one per process
    if _shared is ended:
        _shared = None


def _forked() -> None:
    global _lock, _shared  # noqa: PLW0603 - one per process
    _lock = threading.Lock()
    if _shared is not None:
        _inherited.append(_shared)
        _shared = None
    # pyzmq starts its garbage-collection thread under this lock; a fork at that moment leaves it locked.
    garbage.gc._lock = threading.Lock()  # noqa: SLF001


forks.in_child(_forked)
