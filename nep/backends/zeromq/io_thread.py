"""Event loop thread for the sockets of all nodes in a process, or for the sinks of one node.

One thread serves all nodes; each node with sinks has another thread for its sinks.

A ZeroMQ socket may be used by any thread that holds its owner's lock, so the event loop polls only file
descriptors, never sockets. When a descriptor is readable, the owner takes the lock and processes input
until the socket is empty. ZMQ_FD is edge-triggered, and any use of the socket may consume the edge; a
thread that uses a socket must therefore either empty the socket or call `serve_soon`.

Only `close` ends the thread. An owner that raises is served again after a second. If polling itself
fails because a descriptor was closed while being polled, the poller is rebuilt without the broken
descriptors.

`SharedContext` holds the process's ZeroMQ context and its I/O thread, created with the first node and
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
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import NamedTuple, Protocol, TypeVar

import zmq
from zmq.utils import garbage

from nep.backends.zeromq.sockets import Socket
from nep.errors import ClosedError, TooManyFilesError
from nep.system import forks
from nep.system.descriptors import (
    RESERVED_DESCRIPTORS,
    check_free_descriptors,
    descriptor_limit,
    has_free_descriptors,
    is_descriptor_shortage,
    open_descriptor_count,
)
from nep.system.wakeup import Waker

_logger = logging.getLogger("nep.io")
T = TypeVar("T")
_RETRY_S = 1.0

_MAX_SOCKETS = 65_535
"""Maximum number of sockets per context, which is the upper limit of libzmq.

The limit on open files is reached earlier.
"""
_FDS_PER_CONTEXT = 12
_FDS_PER_SOCKET = 4
"""Number of descriptors per socket: the socket, its port, its Unix socket and a connection."""
_MAX_IDLE_WAKERS = 8
_MAX_ROOM_CHECKS, _ROOM_CHECK_INTERVAL_S = 10, 0.01
_ReadyKey = tuple[selectors.SelectorKey, int]
_EPOLL_TICK_S = 0.001
_EPOLL_SELECTOR = getattr(selectors, "EpollSelector", ())
_MAX_SELECT_FD = 1024
"""Limit of `select`, which supports only file descriptors below this number."""


class PollState(NamedTuple):
    """Conditions under which the I/O thread serves an owner again.

    Attributes:
        is_reading_paused: True to ignore input until `due`.
        due: Time (`time.monotonic`) at which to serve the owner; None to wait for input only.
        wants_write: True to serve the owner also when its descriptor is writable. Not for ZeroMQ sockets.
    """

    is_reading_paused: bool = False
    due: float | None = None
    wants_write: bool = False


class Pollable(Protocol):
    """Interface of a socket's owner to the `IoThread` that serves it."""

    @property
    def fd(self) -> int:
        """File descriptor of the socket."""

    def serve(self, now: float) -> PollState:
        """Process input until the socket is empty. Acquires the owner's lock; doesn't block."""


class IoThread:
    """Thread with an event loop. See the module docstring.

    Args:
        name: Name of the thread.
        new_selector: Creates the poller.
    """

    def __init__(
        self, name: str, new_selector: Callable[[], selectors.BaseSelector] = selectors.DefaultSelector
    ) -> None:
        self._waker = Waker()
        self._new_selector = new_selector
        self._selector = new_selector()
        self._selector.register(self._waker.fd, selectors.EVENT_READ)
        self._commands: deque[tuple[str, Pollable, threading.Event | None]] = deque()
        self._pollables: set[Pollable] = set()
        self._polled: dict[Pollable, tuple[int, int]] = {}
        """Registered descriptor and event mask of each owner."""
        self._suspects: set[Pollable] = set()
        """Owners that may have broken the poller; each is polled alone before being registered again."""
        self._wake_times: dict[Pollable, float] = {}
        self._timers: list[tuple[float, int, Pollable]] = []
        self._numbers = itertools.count()
        self._iteration = 0
        self._stuck_iteration: int | None = None
        self._is_closing = False
        self._pause = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._generation = forks.current_generation()
        forks.call_in_child(self._close_in_child)

    # ---- from other threads

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def add(self, pollable: Pollable) -> None:
        """Start serving `pollable`: once immediately, then on input. May be called before `start`."""
        self._queue_command("add", pollable, None)

    def serve_soon(self, pollable: Pollable) -> None:
        """Serve `pollable` again as soon as possible, even if its descriptor is not ready."""
        self._queue_command("soon", pollable, None)

    def remove(self, pollable: Pollable, timeout_s: float = 2.0) -> None:
        """Stop serving `pollable`, whose socket may be closed afterwards.

        Waits up to `timeout_s` seconds for the thread. If a sink blocks the thread, only the first call
        waits.
        """
        if threading.current_thread() is self._thread or not self._thread.is_alive():
            self._unregister(pollable)
            return
        done = threading.Event()
        self._queue_command("remove", pollable, done)
        if self._stuck_iteration != self._iteration and not done.wait(timeout_s):
            self._stuck_iteration = self._iteration

    def close(self, timeout_s: float = 5.0) -> None:
        """Stop the thread and wait up to `timeout_s` seconds for it to end."""
        self._is_closing = True
        self._pause.set()
        self._waker.wake()
        if not self._thread.is_alive():
            self._release()
        elif threading.current_thread() is not self._thread:
            self._thread.join(timeout_s)

    def _close_in_child(self) -> None:
        self._selector.close()

    @property
    def _should_end(self) -> bool:
        return self._is_closing or self._generation.is_inherited  # the latter after a sink has forked

    def _queue_command(self, command: str, pollable: Pollable, done: threading.Event | None) -> None:
        self._commands.append((command, pollable, done))
        self._waker.wake()

    # ---- in the I/O thread

    def _run(self) -> None:
        while not self._should_end:
            self._iteration += 1
            try:
                self._run_once()
            except Exception:
                if not self._should_end:
                    _logger.exception("polling failed; rebuilding the poller")
                    self._rebuild_poller()
        if self._generation.is_inherited:
            return
        self._release()
        for _command, _pollable, done in self._commands:
            if done is not None:
                done.set()

    def _run_once(self) -> None:
        timeout_s = self._timeout()
        ready = _select(self._selector, timeout_s)
        # Each system call releases the GIL and then waits for it, so avoid needless ones.
        if any(key.data is None for key, _events in ready):
            self._waker.clear()
        self._run_commands()
        for key, _events in ready:
            if isinstance(key.data, tuple) and key.data[0] in self._pollables:
                self._serve(key.data[0])
        self._serve_due()

    def _rebuild_poller(self) -> None:
        while not self._should_end:
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
            self._suspects = set(self._pollables)
            for pollable in tuple(self._pollables):
                self._serve(pollable)
            return

    def _run_commands(self) -> None:
        while self._commands:
            command, pollable, done = self._commands.popleft()
            if command == "remove":
                self._unregister(pollable)
            else:
                if command == "add":
                    self._pollables.add(pollable)
                if pollable in self._pollables:
                    self._serve(pollable)
            if done is not None:
                done.set()

    def _serve(self, pollable: Pollable) -> None:
        if self._should_end:
            return
        now = time.monotonic()
        try:
            state = pollable.serve(now)
        except Exception:  # one broken socket must not block the others
            _logger.exception("error while serving a socket; retrying")
            state = PollState(is_reading_paused=True, due=now + _RETRY_S)
        if pollable not in self._pollables or self._should_end:
            return  # removed while it was served
        try:
            self._update_registration(pollable, _event_mask(state))
        except (OSError, ValueError, KeyError) as error:
            _logger.error("can't poll a socket, serving it every second instead: %s", error)  # noqa: TRY400
            self._polled.pop(pollable, None)
            self._suspects.add(pollable)
            state = PollState(is_reading_paused=True, due=now + _RETRY_S)
        if state.due is None:
            self._wake_times.pop(pollable, None)
        elif self._wake_times.get(pollable) != state.due:
            self._wake_times[pollable] = state.due
            heapq.heappush(self._timers, (state.due, next(self._numbers), pollable))

    def _serve_due(self) -> None:
        now = time.monotonic()
        due_pollables: list[Pollable] = []
        while self._timers and self._timers[0][0] <= now:
            due, _number, pollable = heapq.heappop(self._timers)
            if self._wake_times.get(pollable) == due:  # otherwise it was rescheduled
                del self._wake_times[pollable]
                due_pollables.append(pollable)
        for pollable in due_pollables:
            if pollable in self._pollables:
                self._serve(pollable)

    def _timeout(self) -> float | None:
        while self._timers and self._wake_times.get(self._timers[0][2]) != self._timers[0][0]:
            heapq.heappop(self._timers)
        return max(0.0, self._timers[0][0] - time.monotonic()) if self._timers else None

    def _probe(self, pollable: Pollable, mask: int) -> None:
        # Windows' select reports a broken descriptor only while polling, and then for all descriptors.
        with self._new_selector() as selector:
            selector.register(pollable.fd, mask)
            selector.select(0)
        self._suspects.discard(pollable)

    def _update_registration(self, pollable: Pollable, mask: int) -> None:
        polled = self._polled.get(pollable)
        if polled is None:
            if mask:
                if pollable in self._suspects:
                    self._probe(pollable, mask)
                self._selector.register(pollable.fd, mask, (pollable,))
                self._polled[pollable] = (pollable.fd, mask)
        elif not mask:
            del self._polled[pollable]
            self._selector.unregister(polled[0])
        elif mask != polled[1]:
            self._selector.modify(polled[0], mask, (pollable,))
            self._polled[pollable] = (polled[0], mask)

    def _unregister(self, pollable: Pollable) -> None:
        self._pollables.discard(pollable)
        self._suspects.discard(pollable)
        self._wake_times.pop(pollable, None)
        if pollable in self._polled:
            with suppress(OSError, ValueError, KeyError):  # the poller is closed or was rebuilt
                self._update_registration(pollable, 0)

    def _release(self) -> None:
        self._selector.close()
        self._waker.close()


def _event_mask(state: PollState) -> int:
    return (0 if state.is_reading_paused else selectors.EVENT_READ) | (
        selectors.EVENT_WRITE if state.wants_write else 0
    )


def _select(selector: selectors.BaseSelector, timeout_s: float | None) -> Sequence[_ReadyKey]:
    # epoll rounds timeouts up to a whole millisecond.
    if (
        timeout_s
        and timeout_s < _EPOLL_TICK_S
        and isinstance(selector, _EPOLL_SELECTOR)
        and selector.fileno() < _MAX_SELECT_FD
    ):
        if not select.select((selector.fileno(),), (), (), timeout_s)[0]:
            return ()
        timeout_s = 0.0
    return selector.select(timeout_s)


class SharedContext:
    """ZeroMQ context of the process. Match each call of `shared_context` with a call of `release`."""

    def __init__(self) -> None:
        check_free_descriptors(_FDS_PER_CONTEXT, "a node")
        self._context: zmq.Context[Socket] = zmq.Context()
        # libzmq rejects values above its compile-time limit, which is 16383 on Windows
        self._context.set(zmq.MAX_SOCKETS, min(_MAX_SOCKETS, self._context.get(zmq.SOCKET_LIMIT)))
        self.io = IoThread("nep-io")
        self._lock = threading.Lock()
        self._idle_wakers: list[Waker] = []
        self._pause = threading.Event()
        self._is_terminated = False
        self.user_count = 0
        """Number of users. Guarded by the module's lock."""
        try:
            self.io.start()
        except BaseException:
            self.io.close()
            raise

    def socket(self, socket_type: int, owner: str) -> Socket:
        """Create a socket with a linger of 0.

        Args:
            socket_type: Socket type of zmq.
            owner: Owner of the socket, for error messages.

        Raises:
            TooManyFilesError: The process is out of file descriptors.
            ClosedError: The context was terminated.
        """
        self._wait_for_room(owner)
        try:
            socket = self._context.socket(socket_type)
        except zmq.ZMQError as error:
            if is_descriptor_shortage(error.errno):
                raise TooManyFilesError(owner, open_descriptor_count(), descriptor_limit()) from error
            if self._context.closed:
                raise ClosedError("the node") from error
            raise
        socket.setsockopt(zmq.LINGER, 0)
        return socket

    def _wait_for_room(self, owner: str) -> None:
        # libzmq closes sockets asynchronously, so recently closed ones may still hold descriptors.
        for _ in range(_MAX_ROOM_CHECKS):
            if has_free_descriptors(_FDS_PER_SOCKET + RESERVED_DESCRIPTORS):
                return
            self._pause.wait(_ROOM_CHECK_INTERVAL_S)
        check_free_descriptors(_FDS_PER_SOCKET, owner)

    def acquire_waker(self) -> Waker:
        """Return a waker for a waiting thread, from the pool if possible.

        Raises `TooManyFilesError` if the process is out of file descriptors.
        """
        with self._lock:
            return self._idle_wakers.pop() if self._idle_wakers else Waker()

    def release_waker(self, waker: Waker) -> None:
        """Return a waker to the pool for reuse."""
        waker.clear()
        with self._lock:
            if not self._is_terminated and len(self._idle_wakers) < _MAX_IDLE_WAKERS:
                self._idle_wakers.append(waker)
                return
        waker.close()

    @contextmanager
    def removed(self, owner: T, discard: Callable[[T], bool]) -> Iterator[bool]:
        """Remove an owner of sockets from the open ones of its node, to close its sockets in the context.

        Yields False if it was removed already, so that only one thread closes the sockets. Until they are
        closed, the context isn't terminated: their use would raise an error, and a socket left open would
        block the termination forever.

        Args:
            owner: Owner to remove.
            discard: Removes an owner; returns False if it was removed already.
        """
        with _lock:
            is_in_use = self.user_count > 0  # otherwise the node has closed everything
            if is_in_use:
                self.user_count += 1
        try:
            yield is_in_use and discard(owner)
        finally:
            if is_in_use:
                self.release()

    def acquire(self) -> None:
        """Add a user, so that the context isn't terminated before the matching `release`."""
        with _lock:
            self.user_count += 1

    def release(self) -> None:
        """Remove a user, which must have closed all its sockets before.

        The last user stops the thread and terminates the context.
        """
        with _lock:
            self.user_count -= 1
            if self.user_count:
                return
            _discard_shared(self)
        self.io.close()
        self._context.term()
        with self._lock:
            self._is_terminated = True
            for waker in self._idle_wakers:
                waker.close()
            self._idle_wakers.clear()


_lock = threading.Lock()
_shared_context: SharedContext | None = None


def shared_context() -> SharedContext:
    """Add a user to the ZeroMQ context of this process and return the context; create it if needed.

    Raises `TooManyFilesError` if the process is out of file descriptors.
    """
    global _shared_context  # noqa: PLW0603 - one per process
    with _lock:
        if _shared_context is None:
            _shared_context = SharedContext()
        _shared_context.user_count += 1
        return _shared_context


def _discard_shared(context: SharedContext) -> None:
    global _shared_context  # noqa: PLW0603 - one per process
    if _shared_context is context:
        _shared_context = None


def _forked() -> None:
    global _lock, _shared_context  # noqa: PLW0603 - one per process
    _lock = threading.Lock()
    forks.prevent_finalization(_shared_context)  # destroying it would affect the parent process
    _shared_context = None
    # pyzmq starts its garbage-collection thread under this lock; a fork at that moment leaves it locked.
    garbage.gc._lock = threading.Lock()  # noqa: SLF001


forks.call_in_child(_forked)
