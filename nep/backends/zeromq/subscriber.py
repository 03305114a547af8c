"""Subscriber over a socket, with a lock, an inbox and readers.

`SocketSubscriber` reads from any `Readable`, a socket that returns messages.

A reader leases the socket for a moment, in which the I/O thread doesn't read: a `listen` loop receives
messages directly from the socket in its own thread. Without a reader, the I/O thread moves messages
into the inbox, whose size in bytes is limited.

A reader that receives in quick succession waits in the socket itself, which shortens the round trip of
small messages by a fifth to a third compared to polling the file descriptor. The reader holds the lock
for up to `SHORT_WAIT_S`, and doesn't wait in the socket while another thread requests the lock. After
that time the reader polls the file descriptor without the lock.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Generic, Protocol, TypeVar

import zmq

from nep.backends.base import SubscriberSpec, Wakeable
from nep.backends.bases.loss import PublisherTracker
from nep.backends.bases.message_parser import MessageBuffer
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.zeromq.io_thread import IoThread, PollState
from nep.backends.zeromq.sockets import SHORT_WAIT_S
from nep.messages.message import Message
from nep.messages.queue import MAX_READ_AHEAD, Inbox
from nep.protocol.requests import RemotePublisher, SubscriberCount, clamp_count
from nep.system.waits import wait_until
from nep.system.wakeup import Waker

_READ_AHEAD_BYTES = 2**18

_logger = logging.getLogger("nep")
_POLLIN = int(zmq.POLLIN)
_INFINITE = math.inf
LEASE_S = 0.02
_WAITER_CHECK_INTERVAL_S = 0.1
"""Interval in seconds at which the I/O thread checks whether a reader still waits."""
_MAX_IO_DELAY_S = _WAITER_CHECK_INTERVAL_S + LEASE_S
"""Maximum time in seconds until the next check by the I/O thread.

A read wakes the I/O thread only if the next check is later.
"""
_BATCH_INTERVAL_S = 0.005
"""Minimum interval in seconds between two calls of a sink, or two transfers to the inbox."""
_BATCH_MESSAGES = 10_000
_BATCH_BYTES = 64 * 2**20
_HANDSHAKE_BATCH = 50


class Readable(Protocol):
    """Interface of a socket that returns messages. Guarded by the subscriber's lock."""

    fd: int
    rejections: RejectionCounter
    """Counter of rejected messages."""

    @property
    def received(self) -> int:
        """Number of messages received."""

    @property
    def lost(self) -> int | None:
        """Number of messages lost; None if unknown."""

    @property
    def problem(self) -> str:
        """Reason why messages can't be received; "" if there is none."""

    @property
    def has_input(self) -> bool:
        """True if a message can be read. Reading this property also processes connects and disconnects."""

    def read_into(
        self, buffer: MessageBuffer, max_messages: int, max_bytes: int, *, may_wait: bool = False
    ) -> int:
        """Read messages until the socket is empty or a limit is reached; return their number.

        Args:
            buffer: Container to which messages are appended.
            max_messages: Maximum number of messages.
            max_bytes: Maximum number of bytes.
            may_wait: True to wait up to `SHORT_WAIT_S` for the first message.
        """

    def count_dropped(self, count: int) -> None:
        """Add received messages that were dropped from a full queue to the losses."""

    def close(self) -> None:
        """Close the socket."""


class UnbatchedReader:
    """Base class that implements `Readable.read_into` for sockets without batches."""

    def read(self, *, may_wait: bool = False) -> Message | None:
        """Return the next message, or None if there is none.

        Args:
            may_wait: True to wait up to `SHORT_WAIT_S` for a message.
        """
        raise NotImplementedError

    def read_into(
        self, buffer: MessageBuffer, max_messages: int, max_bytes: int, *, may_wait: bool = False
    ) -> int:
        """Read messages one by one. See `Readable.read_into`."""
        count = 0
        while count < max_messages and max_bytes > 0:
            message = self.read(may_wait=may_wait and not count)
            if message is None:
                break
            buffer.append(message)
            count += 1
            max_bytes -= message.size_bytes
        return count


class NativeReadable(Readable, Protocol):
    """Interface of a socket that connects to the publishers that the master lists."""

    sources: PublisherTracker
    """Publishers of the topic."""

    def connect(self, remote: RemotePublisher) -> None:
        """Connect to a publisher. Idempotent."""

    def disconnect(self, publisher: int) -> None:
        """Disconnect from a publisher and remove it."""

    def reconnect_remote(self) -> None:
        """Reconnect to publishers on other computers, which discards their unread messages."""

    def reconnect(self, publisher: int) -> None:
        """Disconnect from the endpoint of a known publisher and connect to it again."""


R = TypeVar("R", bound=Readable)


class SocketSubscriber(Generic[R]):
    """Subscriber that reads from a socket.

    Args:
        readable: Socket.
        io: Thread that serves the subscriber.
        spec: Settings of the subscriber.
        on_close: Unregisters the subscriber with this id. Called once, without the lock.
    """

    def __init__(
        self, readable: R, io: IoThread, spec: SubscriberSpec, on_close: Callable[[int], None]
    ) -> None:
        self.spec = spec
        self.is_closed = False
        self.fd = readable.fd
        self._io = io
        self._on_close = on_close
        self._readable = readable
        self._read_into = readable.read_into
        self._is_keeping_all = spec.keep == "all"
        self.ready: deque[Message] = deque()
        """Messages read ahead, which precede those of the inbox. Pop from the left, without the lock."""
        self._reads_ahead = self._is_keeping_all and spec.max_messages >= 10 * MAX_READ_AHEAD
        """True if the queue may exceed its limit by a few messages, because the limit is high."""
        self._inbox = Inbox(spec.keep, spec.max_messages, spec.max_bytes)
        self._leased_until = 0.0
        self._io_check_at = _INFINITE
        self._should_wait_in_socket = False
        self._lock_requests: deque[None] = deque()
        self._waiters: list[Wakeable] = []
        self._waker: Waker | None = None
        self._woken_waiters: set[Wakeable] = set()
        self._problem = ""
        # entering the lock is three times faster than entering the condition
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)

    # ---- reading

    def poll(self) -> Message | None:
        """Return the next message, or None if there is none. Reads the socket in the calling thread."""
        self._lock_requests.append(None)
        with self._lock:
            self._lock_requests.pop()
            return None if self.is_closed else self._next_locked()

    def receive(self, timeout_s: float) -> Message | None:
        """Wait up to `timeout_s` seconds for the next message; return None on timeout.

        Reads the socket in the calling thread.
        """
        with self._lock:
            if self.is_closed:
                return None
            may_wait = self._should_wait_in_socket and not self._lock_requests and timeout_s >= SHORT_WAIT_S
            message = self._next_locked(may_wait=may_wait)
            if message is not None:
                self._should_wait_in_socket = True
                return message
            self._should_wait_in_socket = False
            # Under the same lock: the socket is empty, so its descriptor signals the next message.
            waker, self._waker = self._waker or Waker(), None
            self._waiters.append(waker)
        started_s = time.monotonic()
        try:
            zmq.zmq_poll([(self.fd, _POLLIN), (waker.fd, _POLLIN)], int(timeout_s * 1000) + 1)
        finally:
            message = self._finish_wait(waker, started_s)
        return message

    def _finish_wait(self, waker: Waker, started_s: float) -> Message | None:
        with self._lock:
            self._waiters.remove(waker)
            if waker in self._woken_waiters:
                self._woken_waiters.discard(waker)
                waker.clear()
            if self._waker is not None or self.is_closed:
                waker.close()
            else:
                self._waker = waker
            if self.is_closed:
                self._changed.notify_all()
                return None
            message = self._next_locked()
            # after a longer wait the short one would only delay each message
            self._should_wait_in_socket = message is not None and time.monotonic() - started_s < SHORT_WAIT_S
            return message

    # ---- statistics

    @property
    def received(self) -> int:
        """Number of messages received."""
        return self._readable.received

    @property
    def lost(self) -> int | None:
        """Number of messages lost in transit or dropped from the full queue; None if unknown."""
        return self._readable.lost

    @property
    def refused(self) -> int:
        """Number of received frames rejected because they are not valid messages."""
        return self._readable.rejections.count

    def report(self, problem: str) -> None:
        """Set the reason why messages can't be decoded; the next renewal reports it."""
        self._problem = problem

    def counts(self) -> SubscriberCount:
        """Return the statistics that a renewal reports."""
        problem = self._problem or self._readable.rejections.recent_message() or self._readable.problem
        lost = None if self.lost is None else clamp_count(self.lost)
        return SubscriberCount(self.spec.id, clamp_count(self.received), lost, problem)

    # ---- waiting

    def enter_wait(self, waker: Wakeable) -> bool:
        """Prepare to poll `fd`; return False if a message is available or the subscriber is closed."""
        self._lock_requests.append(None)  # as `_requested_lock` does, but faster
        try:
            with self._lock:
                if self.is_closed or self.ready or self._inbox.messages or self._readable.has_input:
                    return False
                self._waiters.append(waker)
                return True
        finally:
            self._lock_requests.pop()

    def leave_wait(self, waker: Wakeable) -> None:
        """End the wait that `enter_wait` prepared."""
        with self._lock:
            self._waiters.remove(waker)
            if waker in self._woken_waiters:
                self._woken_waiters.discard(waker)
            if self.is_closed:  # `close` waits for this
                self._changed.notify_all()

    def read_until(self, is_met: Callable[[], bool], timeout_s: float, waker: Waker) -> bool:
        """Read messages into the inbox until a condition is met; return False on timeout or after `close`.

        Args:
            is_met: Returns True when the condition is met. Called with the lock held.
            timeout_s: Maximum time in seconds.
            waker: Waker that ends a wait early, so that the condition is checked again.
        """
        deadline = time.monotonic() + timeout_s
        with self._lock:
            self._waiters.append(waker)
        try:
            while True:
                with self._lock:
                    count = 0 if self.is_closed else self._fill_locked(_HANDSHAKE_BATCH)
                    remaining_s = deadline - time.monotonic()
                    if is_met() or remaining_s <= 0.0 or self.is_closed:
                        return is_met()
                if count == _HANDSHAKE_BATCH:
                    continue  # the awaited notice is behind the messages of a busy publisher
                polled = [(self.fd, _POLLIN), (waker.fd, _POLLIN)]
                zmq.zmq_poll(polled, int(min(remaining_s, 0.1) * 1000) + 1)
                waker.clear()
        finally:
            self.leave_wait(waker)
            self._io.serve_soon(self)

    # ---- in the I/O thread

    def serve(self, now: float) -> PollState:
        """Move available messages to the inbox or the sink, unless a reader has leased the socket.

        See `Pollable.serve`.
        """
        sink = self.spec.sink
        if now < self._leased_until and not self.is_closed:
            # without the lock, which a waiting reader holds; a stale value is harmless
            self._io_check_at = due = now + _WAITER_CHECK_INTERVAL_S if self._waiters else self._leased_until
            return PollState(is_reading_paused=True, due=due)
        with self._requested_lock():
            if self.is_closed:
                return PollState(is_reading_paused=True)
            if self._waiters or now < self._leased_until:
                # a reader in a long wait needs fewer checks than one that may stop at any moment
                self._io_check_at = max(self._leased_until, now + LEASE_S)
                if self._waiters and now >= self._leased_until:
                    self._io_check_at = now + _WAITER_CHECK_INTERVAL_S
                return PollState(is_reading_paused=True, due=self._io_check_at)
            self._io_check_at = _INFINITE
            batch: list[Message] = []
            if sink is None:
                count = self._fill_locked()
                if count:
                    self._wake_waiters_locked()
            else:
                count = self._fill_batch_locked(batch)
        if sink is not None and batch:
            try:
                sink(batch)
            except BaseException:  # also SystemExit: the sink thread continues with the next batch
                _logger.exception("the sink of '%s' failed", self.spec.topic)
        if count or batch:
            return PollState(is_reading_paused=True, due=now + _BATCH_INTERVAL_S)
        return PollState()

    # ---- closing

    def close(self) -> None:
        """Unregister the subscriber and discard its unread messages."""
        with self._requested_lock():
            if self.is_closed:
                return
            self.is_closed = True
            self.ready.clear()
            self._inbox.pop_all()
            self._wake_waiters_locked()
        self._on_close(self.spec.id)
        self._io.remove(self)
        with self._lock:
            wait_until(self._changed, lambda: not self._waiters, 1.0)  # readers poll its descriptor
            self._readable.close()
            if self._waker is not None:
                self._waker.close()
                self._waker = None

    @contextmanager
    def _requested_lock(self) -> Iterator[None]:
        # Takes the lock for all but readers; no reader waits in the socket while the lock is wanted.
        self._lock_requests.append(None)
        try:
            with self._lock:
                yield
        finally:
            self._lock_requests.pop()

    # ---- with the lock held

    def _next_locked(self, *, may_wait: bool = False) -> Message | None:
        now = time.monotonic()
        self._leased_until = now + LEASE_S
        if self._io_check_at > now + _MAX_IO_DELAY_S:
            # After reading one message of several the descriptor may not signal the others, so the I/O thread
            # must check when the lease ends. It is asked once for many reads.
            self._io_check_at = self._leased_until
            self._io.serve_soon(self)
        if not self._reads_ahead:
            self._fill_locked(may_wait=may_wait)
            return self._inbox.pop()
        if not self.ready:
            if self._inbox.messages:
                self._inbox.move(self.ready, MAX_READ_AHEAD, _READ_AHEAD_BYTES)
            else:
                self._read_into(self.ready, MAX_READ_AHEAD, _READ_AHEAD_BYTES, may_wait=may_wait)
        return self.ready.popleft() if self.ready else None

    def _fill_locked(self, max_messages: int = _BATCH_MESSAGES, *, may_wait: bool = False) -> int:
        # Reads into the inbox until the socket is empty or a batch is full; returns the number of messages.
        messages: list[Message] = []
        may_wait = may_wait and not self._inbox.messages
        count = self._read_into(messages, max_messages, _BATCH_BYTES, may_wait=may_wait)
        dropped = sum(map(self._inbox.put, messages))
        if dropped:
            self._readable.count_dropped(dropped)
        return count

    def _fill_batch_locked(self, batch: list[Message]) -> int:
        if self._is_keeping_all and self.spec.max_messages >= _BATCH_MESSAGES and not self._inbox.messages:
            return self._read_into(batch, _BATCH_MESSAGES, _BATCH_BYTES)
        count = self._fill_locked()
        batch += self._inbox.pop_all()
        return count

    def _recheck_input_locked(self) -> None:
        # Call after using the socket without emptying it, which may have consumed the edge of ZMQ_FD.
        if self._readable.has_input:
            self._wake_waiters_locked()
            self._io.serve_soon(self)

    def _wake_waiters_locked(self) -> None:
        self._woken_waiters.update(self._waiters)
        for waker in self._waiters:
            waker.wake()
