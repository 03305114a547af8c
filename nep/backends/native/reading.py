"""SocketInlet: a subscriber's socket with its lock, its inbox and its readers.

Whoever reads takes a lease on the socket for a moment, and the node's thread leaves it alone as long: a loop
of `listen` gets its messages straight from the socket, in its own thread. When nobody reads, the node's
thread moves messages into the inbox, which is bounded in bytes.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

import zmq

from nep.backends.base import SubscriberSpec
from nep.backends.native.io import IoThread, Rest
from nep.backends.native.sockets import wait_until
from nep.inbox import Inbox
from nep.message import Message
from nep.records import SubscriberCount
from nep.waker import Waker

__all__ = ["Readable", "SocketInlet"]

_logger = logging.getLogger("nep")

LEASE_S = 0.02
_WAITING_S = 0.1
"""How often the node's thread looks whether a reader still waits."""
_BATCH_S = 0.005
"""Sinks and inboxes are filled 200 times a second at most."""
_BATCH_MESSAGES = 10_000
_BATCH_BYTES = 64 * 2**20


class Readable(Protocol):
    """A socket that turns what comes into messages. It is used under the inlet's lock only."""

    fd: int
    problem: str

    @property
    def received(self) -> int:
        """Messages that arrived."""

    @property
    def lost(self) -> int | None:
        """Messages that did not; None when nobody can know."""

    @property
    def has_input(self) -> bool:
        """Whether something can be read. Also takes note of connections that came and went."""

    def read(self) -> Message | None:
        """The next message; None when there is nothing more."""

    def dropped(self, count: int) -> None:
        """So many messages that had been received were dropped for lack of room."""

    def close(self) -> None:
        """Close the socket."""


R = TypeVar("R", bound=Readable)


class SocketInlet(Generic[R]):
    """Reads from `readable`. `on_close` unregisters; it is called once, without the lock."""

    def __init__(
        self, readable: R, io: IoThread, spec: SubscriberSpec, on_close: Callable[[int], None]
    ) -> None:
        self.spec = spec
        self.is_closed = False
        self.fd = readable.fd
        self._readable = readable
        self._io = io
        self._on_close = on_close
        self._inbox = Inbox(spec.keep, spec.max_messages, spec.max_bytes)
        self._problem = ""
        self._leased_until = 0.0
        self._io_comes = False
        self._waiters: list[Waker] = []
        self._waker: Waker | None = None
        self._woken: set[Waker] = set()
        self._lock = threading.Condition(threading.Lock())

    # ---- what the reader sees

    @property
    def received(self) -> int:
        """Messages that arrived."""
        return self._readable.received

    @property
    def lost(self) -> int | None:
        """Messages that did not arrive, or were dropped here for lack of room."""
        return self._readable.lost

    def report(self, problem: str) -> None:
        """The reader's trouble with a message, for the next renewal."""
        self._problem = problem

    def counts(self) -> SubscriberCount:
        """The statistics for a renewal."""
        problem = self._problem or self._readable.problem
        return SubscriberCount(self.spec.id, self.received, self.lost, problem)

    def poll(self) -> Message | None:
        """The next message if one is there, read in the caller's thread."""
        with self._lock:
            return None if self.is_closed else self._next()

    def receive(self, timeout_s: float) -> Message | None:
        """The next message, read in the caller's thread; waits at most `timeout_s` seconds."""
        with self._lock:
            if self.is_closed:
                return None
            message = self._next()
            if message is not None:
                return message
            # Under the same lock: the socket was empty, so its descriptor tells of what comes next.
            waker, self._waker = self._waker or Waker(), None
            self._waiters.append(waker)
        try:
            polled = [(self.fd, zmq.POLLIN), (waker.fd, zmq.POLLIN)]
            zmq.zmq_poll(polled, int(timeout_s * 1000) + 1)
        finally:
            message = self._waited(waker)
        return message

    def _waited(self, waker: Waker) -> Message | None:
        with self._lock:
            self._waiters = [each for each in self._waiters if each is not waker]
            if self._waker is not None or self.is_closed:
                waker.close()
            else:
                self._waker = waker
            if self.is_closed:
                self._lock.notify_all()
                return None
            if waker in self._woken:
                self._woken.discard(waker)
                waker.clear()
            return self._next()

    # ---- waiting

    def enter_wait(self, waker: Waker) -> bool:
        """Before its descriptor is polled: False when there is something to read already."""
        with self._lock:
            if self.is_closed or len(self._inbox):
                return False
            if self._readable.has_input:
                return False
            self._waiters.append(waker)
            return True

    def leave_wait(self, waker: Waker) -> None:
        """After its descriptor was polled."""
        with self._lock:
            self._waiters = [each for each in self._waiters if each is not waker]
            self._woken.discard(waker)
            self._lock.notify_all()

    def read_until(self, is_met: Callable[[], bool], timeout_s: float, waker: Waker) -> bool:
        """Read into the inbox, in the caller's thread, until `is_met()`; whether it is."""
        deadline = time.monotonic() + timeout_s
        with self._lock:
            self._waiters.append(waker)
        try:
            while True:
                with self._lock:
                    if not self.is_closed:
                        self._fill()
                    left = deadline - time.monotonic()
                    if is_met() or left <= 0.0 or self.is_closed:
                        return is_met()
                polled = [(self.fd, zmq.POLLIN), (waker.fd, zmq.POLLIN)]
                zmq.zmq_poll(polled, int(min(left, 0.1) * 1000) + 1)
                waker.clear()
        finally:
            self.leave_wait(waker)
            self._io.serve_soon(self)

    # ---- in the node's thread

    def serve(self, now: float) -> Rest:
        """Move what is there into the inbox or the sink, unless somebody reads."""
        sink = self.spec.sink
        with self._lock:
            if self.is_closed:
                return Rest(is_quiet=True)
            if self._waiters:
                self._io_comes = False
                return Rest(is_quiet=True, due=now + _WAITING_S)
            if now < self._leased_until:
                return Rest(is_quiet=True, due=self._leased_until)
            self._io_comes = False
            count = self._fill()
            batch = self._inbox.take_all() if sink is not None else []
            if count and sink is None:
                self._wake_waiters()
        if sink is not None and batch:
            try:
                sink(batch)
            except Exception:  # a sink that fails gets the next batch all the same
                _logger.exception("the sink of '%s' failed", self.spec.topic)
        return Rest(is_quiet=True, due=now + _BATCH_S) if count or batch else Rest()

    # ---- closing

    def close(self) -> None:
        """Unregister and forget what was not read."""
        with self._lock:
            if self.is_closed:
                return
            self.is_closed = True
            self._wake_waiters()
        self._on_close(self.spec.id)
        self._io.remove(self)
        with self._lock:
            wait_until(self._lock, lambda: not self._waiters, 1.0)  # they poll its descriptor
            self._readable.close()
            if self._waker is not None:
                self._waker.close()
                self._waker = None

    # ---- with the lock held

    def _next(self) -> Message | None:
        self._leased_until = time.monotonic() + LEASE_S
        if not self._io_comes:
            # Reading one message and not the rest leaves the descriptor silent for those that follow:
            # the node's thread has to look when the lease is over.
            self._io_comes = True
            self._io.serve_soon(self)
        if self.spec.keep == "latest":
            self._fill()
        return self._inbox.take() or self._readable.read()

    def _fill(self) -> int:
        """Read into the inbox until the socket has nothing more, or a batch is full; how many."""
        count = size = 0
        while count < _BATCH_MESSAGES and size < _BATCH_BYTES:
            message = self._readable.read()
            if message is None:
                break
            count += 1
            size += message.size_bytes
            dropped = self._inbox.put(message)
            if dropped:
                self._readable.dropped(dropped)
        return count

    def _after_use(self) -> None:
        """The socket was used without emptying it, which may have swallowed the descriptor's signal."""
        if self._readable.has_input:
            self._wake_waiters()
            self._io.serve_soon(self)

    def _wake_waiters(self) -> None:
        self._woken.update(self._waiters)
        for waker in self._waiters:
            waker.wake()
