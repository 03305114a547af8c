"""IoThread: a thread that serves sockets: one for all nodes of a process, and one for the sinks of a node.

A ZeroMQ socket may be used by any thread that holds its owner's lock, so this thread never polls sockets. It
polls their raw descriptors, and an owner then takes its lock and works until its socket has nothing more. A
descriptor tells of a change only once, and any use of the socket may swallow that; so whoever uses a socket
in another thread either empties it or asks for `serve_soon`.

Nothing ends this thread but `close`: an owner that fails is tried again each second, and when the system
cannot poll (a descriptor was closed under it), it polls anew without those that are broken.

`SharedContext` is the one ZeroMQ context of this process with the thread for all its nodes. It is made with
the first node that needs it and ends with the last. A context of its own would cost every node three threads
and a dozen descriptors.
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
"""libzmq's highest limit: what bounds a program is how many files it may open."""
_CONTEXT_FILES = 12
_SOCKET_FILES = 4
"""A socket, its port, its local name, and a connection."""
_IDLE_WAKERS = 8
_LOOKS, _LOOK_S = 10, 0.01
_Ready = tuple[selectors.SelectorKey, int]
_ROUNDED_S = 0.001
_ROUNDING = getattr(selectors, "EpollSelector", ())
_SELECT_MOST = 1024
"""`select` takes descriptors below this."""


class Rest(NamedTuple):
    """What an owner wants next: to be served at `due`; with `is_quiet` not to be polled for input until then.

    With `sends` it is served, too, as soon as its descriptor can be written: never said of ZeroMQ's.
    """

    is_quiet: bool = False
    due: float | None = None
    sends: bool = False


class Served(Protocol):
    """An owner of a socket."""

    @property
    def fd(self) -> int:
        """The socket's descriptor."""

    def serve(self, now: float) -> Rest:
        """Work until the socket has nothing more. Takes the owner's lock; does not wait."""


class IoThread:
    """See the module. `add` may be called before `start`. `new_selector` makes what polls."""

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
        """The descriptor of each, and what it is polled for."""
        self._doubtful: set[Served] = set()
        """Those that may be what could not be polled: tried alone before they are polled with the others."""
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
        """Serve this one from now on, at once for the first time."""
        self._order("add", served, None)

    def serve_soon(self, served: Served) -> None:
        """Serve it again, whatever its descriptor says."""
        self._order("soon", served, None)

    def remove(self, served: Served, timeout_s: float = 2.0) -> None:
        """Let go of it; when this returns its descriptor is polled no more and its socket may be closed.

        A thread that is held up (in a sink that does not return) is waited for only once.
        """
        if threading.current_thread() is self._thread or not self._thread.is_alive():
            self._forget(served)
            return
        done = threading.Event()
        self._order("remove", served, done)
        if self._stuck_in != self._turns and not done.wait(timeout_s):
            self._stuck_in = self._turns

    def close(self, timeout_s: float = 5.0) -> None:
        """End the thread; wait for that at most so long."""
        self._is_closing = True
        self._pause.set()
        self._waker.wake()
        if not self._thread.is_alive():
            self._release()
        elif threading.current_thread() is not self._thread:
            self._thread.join(timeout_s)

    def forked(self) -> None:
        """In a child: the thread is not there; what polls belongs to the parent, too, and is not changed."""
        self._is_closing = True
        self._pause = threading.Event()
        self._served.clear()
        self._orders.clear()
        self._selector.close()

    def _order(self, what: str, served: Served, done: threading.Event | None) -> None:
        self._orders.append((what, served, done))
        self._waker.wake()

    # ---- in the thread

    def _run(self) -> None:
        while not self._is_closing:
            self._turns += 1
            try:
                self._turn()
            except Exception:
                if not self._is_closing:
                    _logger.exception("the sockets of this program could not be polled; they are polled anew")
                    self._begin_anew()
        self._release()
        for _what, _served, done in self._orders:
            if done is not None:
                done.set()

    def _turn(self) -> None:
        timeout_s = self._timeout()
        ready = _ready(self._selector, timeout_s)
        # Each system call lets another thread go on, and waits for it: so none without need.
        if any(key.data is None for key, _events in ready):
            self._waker.clear()
        self._obey()
        for key, _events in ready:
            if isinstance(key.data, tuple) and key.data[0] in self._served:
                self._serve(key.data[0])
        self._serve_due()

    def _begin_anew(self) -> None:
        """Another poll for all that is served; whoever cannot be polled is served each second."""
        while not self._is_closing:
            with suppress(Exception):  # it may be what is broken
                self._selector.close()
            try:
                self._selector = self._new_selector()
                self._polled.clear()
                self._selector.register(self._waker.fd, selectors.EVENT_READ)
            except Exception:
                _logger.exception("the sockets of this program cannot be polled; trying again")
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
        except Exception:  # one broken socket must not silence the others
            _logger.exception("a socket could not be served")
            rest = Rest(is_quiet=True, due=now + _RETRY_S)
        if served not in self._served or self._is_closing:
            return  # it was removed while it was served
        try:
            self._poll(served, _events(rest))
        except (OSError, ValueError, KeyError) as error:
            _logger.error("a socket cannot be polled, it is served each second: %s", error)  # noqa: TRY400
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
            if self._due.get(served) == due:  # else it was put off since
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
        """Raises OSError or ValueError when it can't be polled.

        Windows' select says so only while it polls, and then serves none of all sockets.
        """
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
            with suppress(OSError, ValueError, KeyError):  # the poll is closed, or was begun anew without it
                self._poll(served, 0)

    def _release(self) -> None:
        self._selector.close()
        self._waker.close()


def _events(rest: Rest) -> int:
    return (0 if rest.is_quiet else selectors.EVENT_READ) | (selectors.EVENT_WRITE if rest.sends else 0)


def _ready(selector: selectors.BaseSelector, timeout_s: float | None) -> Sequence[_Ready]:
    """Those that are ready within this time, also where epoll alone would wait for a whole millisecond."""
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
    """See the module. `shared_context` gives it out; whoever got it calls `leave` once."""

    def __init__(self) -> None:
        check_room(_CONTEXT_FILES, "a node")
        self._context: zmq.Context[Socket] = zmq.Context()
        # libzmq refuses more than it was made for, which on Windows is 16383.
        self._context.set(zmq.MAX_SOCKETS, min(_MAX_SOCKETS, self._context.get(zmq.SOCKET_LIMIT)))
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

    def join(self) -> None:
        """Count one more user of a context that has one: it is not terminated before `leave`."""
        with _lock:
            self.users += 1

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


def shared_context() -> SharedContext:
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
