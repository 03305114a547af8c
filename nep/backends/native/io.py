"""IoThread: the one thread of a node that serves its sockets.

A ZeroMQ socket may be used by any thread that holds its owner's lock, so this thread never polls sockets. It
polls their raw descriptors, and an owner then takes its lock and works until its socket has nothing more. A
descriptor tells of a change only once, and any use of the socket may swallow that; so whoever uses a socket
in another thread either empties it or asks for `serve_soon`.
"""

from __future__ import annotations

import heapq
import itertools
import logging
import selectors
import threading
import time
from collections import deque
from typing import NamedTuple, Protocol

from nep.waker import Waker

__all__ = ["IoThread", "Rest", "Served"]

_logger = logging.getLogger("nep.io")
_RETRY_S = 1.0


class Rest(NamedTuple):
    """What an owner wants next: to be served at `due`; with `is_quiet` not to be polled until then."""

    is_quiet: bool = False
    due: float | None = None


class Served(Protocol):
    """An owner of a socket."""

    @property
    def fd(self) -> int:
        """The socket's descriptor."""

    def serve(self, now: float) -> Rest:
        """Work until the socket has nothing more. Takes the owner's lock; does not wait."""


class IoThread:
    """See the module. `add` may be called before `start`."""

    def __init__(self, name: str) -> None:
        self._waker = Waker()
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._waker.fd, selectors.EVENT_READ)
        self._orders: deque[tuple[str, Served, threading.Event | None]] = deque()
        self._served: set[Served] = set()
        self._polled: dict[Served, int] = {}
        self._due: dict[Served, float] = {}
        self._heap: list[tuple[float, int, Served]] = []
        self._numbers = itertools.count()
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

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
        """Let go of it; when this returns its descriptor is polled no more and its socket may be closed."""
        if threading.current_thread() is self._thread or not self._thread.is_alive():
            self._forget(served)
            return
        done = threading.Event()
        self._order("remove", served, done)
        done.wait(timeout_s)

    def close(self) -> None:
        """End the thread."""
        self._is_closing = True
        self._waker.wake()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(5.0)
        self._selector.close()
        self._waker.close()

    @property
    def is_current(self) -> bool:
        """Whether the caller is this thread."""
        return threading.current_thread() is self._thread

    def _order(self, what: str, served: Served, done: threading.Event | None) -> None:
        self._orders.append((what, served, done))
        self._waker.wake()

    # ---- in the thread

    def _run(self) -> None:
        while not self._is_closing:
            ready = self._selector.select(self._timeout())
            self._waker.clear()
            self._obey()
            for key, _events in ready:
                if isinstance(key.data, tuple) and key.data[0] in self._served:
                    self._serve(key.data[0])
            self._serve_due()
        for _what, _served, done in self._orders:
            if done is not None:
                done.set()

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
        if served not in self._served:
            return  # it was removed while it was served
        self._poll(served, not rest.is_quiet)
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

    def _poll(self, served: Served, wanted: bool) -> None:
        polled = self._polled.get(served)
        if wanted and polled is None:
            self._polled[served] = served.fd
            self._selector.register(served.fd, selectors.EVENT_READ, (served,))
        elif not wanted and polled is not None:
            del self._polled[served]
            self._selector.unregister(polled)

    def _forget(self, served: Served) -> None:
        self._served.discard(served)
        self._due.pop(served, None)
        if served in self._polled:
            self._poll(served, wanted=False)
