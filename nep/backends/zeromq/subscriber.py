"""A subscriber's socket with its lock, its inbox and its readers.

`SocketSubscriber` reads from any `Readable`, a socket that turns parts into messages; `NativeSubscriber` is
the one of the native wire, which connects to publishers as they come.

Whoever reads takes a lease on the socket for a moment, and the node's thread leaves it alone as long: a loop
of `listen` gets its messages straight from the socket, in its own thread. When nobody reads, the node's
thread moves messages into the inbox, which is bounded in bytes.

A reader that gets one message after the other waits for the next one in the socket itself: a round trip of
small messages is a fifth to a third shorter than with polling the descriptor. It holds the lock then, for
`SHORT_WAIT_S` at most, and does not begin while somebody else wants the socket. After that it polls the
descriptor, without the lock.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Generic, Protocol, TypeVar

import zmq

from nep.backends.base import SubscriberSpec, Wakes
from nep.backends.zeromq.io_thread import IoThread, Rest
from nep.backends.zeromq.loss import HeardPublishers
from nep.backends.zeromq.sockets import SHORT_WAIT_S, Refusals, wait_until
from nep.backends.zeromq.sub_socket import Into, SubSocket
from nep.messages.clocks import ClockDifference
from nep.messages.message import Message
from nep.messages.queue import AHEAD_MOST, Inbox, ReadAhead
from nep.protocol.requests import RemotePublisher, SubscriberCount, as_count
from nep.system.wakeup import Waker

__all__ = ["NativeReadable", "NativeSubscriber", "ReadOneByOne", "Readable", "SocketSubscriber"]

_AHEAD_BYTES = 2**18

_logger = logging.getLogger("nep")
_POLLIN = int(zmq.POLLIN)
_NEVER = math.inf
LEASE_S = 0.02
_WAITING_S = 0.1
"""How often the node's thread looks whether a reader still waits."""
_LATE_S = _WAITING_S + LEASE_S
"""The node's thread is called when it would come later than this after a read: not for each message of a
reader that always waits again."""
_BATCH_S = 0.005
"""Sinks and inboxes are filled 200 times a second at most."""
_BATCH_MESSAGES = 10_000
_BATCH_BYTES = 64 * 2**20
_FEW = 50


class Readable(Protocol):
    """A socket that turns what comes into messages. It is used under the subscriber's lock only."""

    fd: int
    refusals: Refusals
    """Messages that could not be understood."""

    @property
    def received(self) -> int:
        """Messages that arrived."""

    @property
    def lost(self) -> int | None:
        """Messages that did not; None when nobody can know."""

    @property
    def problem(self) -> str:
        """What is wrong as long as nothing changes; empty when nothing is."""

    @property
    def has_input(self) -> bool:
        """Whether something can be read. Also takes note of connections that came and went."""

    def read_into(self, into: Into, most: int, room: int, *, may_wait: bool = False) -> int:
        """Read until there is nothing more, `most` are read, or `room` bytes are full; how many were.

        With `may_wait` the first is waited for, `SHORT_WAIT_S` at most.
        """

    def read(self, rest: Into, *, may_wait: bool = False) -> Message | None:
        """The next message; None when there is nothing more, with `may_wait` within `SHORT_WAIT_S`.

        Others that came with it go into `rest`.
        """

    def dropped(self, count: int) -> None:
        """So many messages that had been received were dropped for lack of room."""

    def close(self) -> None:
        """Close the socket."""


class ReadOneByOne:
    """The batches of a `Readable` whose library has none."""

    def read(self, rest: Into, *, may_wait: bool = False) -> Message | None:
        """The next message; see `Readable`."""
        raise NotImplementedError

    def read_into(self, into: Into, most: int, room: int, *, may_wait: bool = False) -> int:
        """Read until there is nothing more, `most` are read, or `room` bytes are full; how many were."""
        count = 0
        while count < most and room > 0:
            message = self.read(into, may_wait=may_wait and not count)
            if message is None:
                break
            into.append(message)
            count += 1
            room -= message.size_bytes
        return count


class NativeReadable(Readable, Protocol):
    """One that is connected to the publishers that the master lists."""

    sources: HeardPublishers
    """Those that it hears."""

    def connect(self, remote: RemotePublisher) -> None:
        """Connect to a publisher; twice is once."""

    def leave(self, publisher: int) -> None:
        """Disconnect from a publisher and forget it."""

    def connect_again(self) -> None:
        """Connect anew to the publishers on other computers. What was not read of them is dropped."""

    def reconnect(self, publisher: int) -> None:
        """Connect anew to a publisher that was connected to."""


R = TypeVar("R", bound=Readable)


class SocketSubscriber(Generic[R]):
    """Reads from `readable`. `on_close` unregisters; it is called once, without the lock."""

    def __init__(
        self, readable: R, io: IoThread, spec: SubscriberSpec, on_close: Callable[[int], None]
    ) -> None:
        self.spec = spec
        self.is_closed = False
        self.fd = readable.fd
        self._io = io
        self._on_close = on_close
        self._readable = readable
        self._read = readable.read
        self._read_into = readable.read_into
        self._keeps_all = spec.keep == "all"
        self.ready: deque[Message] = deque()
        """What was read ahead, in front of the inbox; anybody may take from its left without the lock."""
        self._source: SubSocket | None = readable if isinstance(readable, SubSocket) else None
        self.payloads: deque[Any] = deque() if self._source is None else self._source.payloads
        """See `nep.backends.base.GivesPayloads`."""
        self.wants_payloads = False
        self._ahead = ReadAhead(spec.max_messages)
        self._moves = spec.max_messages >= 10 * AHEAD_MOST
        """Whether a few messages more than that may wait for the reader."""
        self._read_at = 0.0
        self._inbox = Inbox(spec.keep, spec.max_messages, spec.max_bytes)
        self._leased_until = 0.0
        self._io_comes_at = _NEVER
        self._is_brisk = False
        self._wanted: deque[None] = deque()
        self._waiters: list[Wakes] = []
        self._waker: Waker | None = None
        self._woken: set[Wakes] = set()
        self._problem = ""
        # `with` is three times faster on the lock itself than on the condition over it.
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)

    # ---- what the reader sees

    def poll(self) -> Message | None:
        """The next message if one is there, read in the caller's thread."""
        self._wanted.append(None)
        with self._lock:
            self._wanted.pop()
            return None if self.is_closed else self._next()

    def receive(self, timeout_s: float) -> Message | None:
        """The next message, read in the caller's thread; waits at most `timeout_s` seconds."""
        with self._lock:
            if self.is_closed:
                return None
            may_wait = self._is_brisk and not self._wanted and timeout_s >= SHORT_WAIT_S
            message = self._next(may_wait=may_wait)
            if message is not None:
                self._is_brisk = True
                return message
            self._is_brisk = False
            # Under the same lock: the socket was empty, so its descriptor tells of what comes next.
            waker, self._waker = self._waker or Waker(), None
            self._waiters.append(waker)
        began = time.monotonic()
        try:
            zmq.zmq_poll([(self.fd, _POLLIN), (waker.fd, _POLLIN)], int(timeout_s * 1000) + 1)
        finally:
            message = self._waited(waker, began)
        return message

    def _waited(self, waker: Waker, began: float) -> Message | None:
        with self._lock:
            self._waiters.remove(waker)
            if waker in self._woken:
                self._woken.discard(waker)
                waker.clear()
            if self._waker is not None or self.is_closed:
                waker.close()
            else:
                self._waker = waker
            if self.is_closed:
                self._changed.notify_all()
                return None
            message = self._next()
            # Who waits longer than that would only wait twice for each message.
            self._is_brisk = message is not None and time.monotonic() - began < SHORT_WAIT_S
            return message

    # ---- what it tells

    @property
    def received(self) -> int:
        """Messages that arrived."""
        return self._readable.received

    @property
    def lost(self) -> int | None:
        """Messages that did not arrive, or were dropped here for lack of room."""
        return self._readable.lost

    @property
    def refused(self) -> int:
        """What came and was no message at all."""
        return self._readable.refusals.count

    def report(self, problem: str) -> None:
        """The reader's trouble with a message, for the next renewal."""
        self._problem = problem

    def counts(self) -> SubscriberCount:
        """The statistics for a renewal."""
        problem = self._problem or self._readable.refusals.told() or self._readable.problem
        lost = None if self.lost is None else as_count(self.lost)
        return SubscriberCount(self.spec.id, as_count(self.received), lost, problem)

    # ---- waiting

    def enter_wait(self, waker: Wakes) -> bool:
        """Before its descriptor is polled: False when there is something to read already."""
        self._wanted.append(None)  # as in `_turn`, which takes longer than all of this
        try:
            with self._lock:
                if (
                    self.is_closed
                    or self.payloads
                    or self.ready
                    or self._inbox.messages
                    or self._readable.has_input
                ):
                    return False
                self._waiters.append(waker)
                return True
        finally:
            self._wanted.pop()

    def leave_wait(self, waker: Wakes) -> None:
        """After its descriptor was polled."""
        with self._lock:
            self._waiters.remove(waker)
            if waker in self._woken:
                self._woken.discard(waker)
            if self.is_closed:  # who closes waits for this
                self._changed.notify_all()

    def read_until(self, is_met: Callable[[], bool], timeout_s: float, waker: Waker) -> bool:
        """Read into the inbox, in the caller's thread, until `is_met()`; whether it is."""
        deadline = time.monotonic() + timeout_s
        with self._lock:
            self._waiters.append(waker)
        try:
            while True:
                with self._lock:
                    count = 0 if self.is_closed else self._fill(_FEW)
                    left = deadline - time.monotonic()
                    if is_met() or left <= 0.0 or self.is_closed:
                        return is_met()
                if count == _FEW:
                    continue  # what it waits for comes behind what somebody publishes all the time
                polled = [(self.fd, _POLLIN), (waker.fd, _POLLIN)]
                zmq.zmq_poll(polled, int(min(left, 0.1) * 1000) + 1)
                waker.clear()
        finally:
            self.leave_wait(waker)
            self._io.serve_soon(self)

    # ---- in the node's thread

    def serve(self, now: float) -> Rest:
        """Move what is there into the inbox or the sink, unless somebody reads."""
        sink = self.spec.sink
        if now < self._leased_until and not self.is_closed:
            # Without the lock, which the reader may hold for a short wait; it may only be read too early.
            self._io_comes_at = due = now + _WAITING_S if self._waiters else self._leased_until
            return Rest(is_quiet=True, due=due)
        with self._turn():
            if self.is_closed:
                return Rest(is_quiet=True)
            if self._waiters or now < self._leased_until:
                # Whoever waits for long is not looked after as often as a reader who may stop any moment.
                self._io_comes_at = max(self._leased_until, now + LEASE_S)
                if self._waiters and now >= self._leased_until:
                    self._io_comes_at = now + _WAITING_S
                return Rest(is_quiet=True, due=self._io_comes_at)
            self._io_comes_at = _NEVER
            batch: list[Message] = []
            if sink is None:
                count = self._fill()
                if count:
                    self._wake_waiters()
            else:
                count = self._fill_batch(batch)
        if sink is not None and batch:
            try:
                sink(batch)
            except (
                BaseException
            ):  # also SystemExit, which would end all sinks' thread: it gets the next batch
                _logger.exception("the sink of '%s' failed", self.spec.topic)
        return Rest(is_quiet=True, due=now + _BATCH_S) if count or batch else Rest()

    # ---- closing

    def close(self) -> None:
        """Unregister and forget what was not read."""
        with self._turn():
            if self.is_closed:
                return
            self.is_closed = True
            self.payloads.clear()
            self.ready.clear()
            self._inbox.take_all()
            self._wake_waiters()
        self._on_close(self.spec.id)
        self._io.remove(self)
        with self._lock:
            wait_until(self._changed, lambda: not self._waiters, 1.0)  # they poll its descriptor
            self._readable.close()
            if self._waker is not None:
                self._waker.close()
                self._waker = None

    def forked(self) -> None:
        """In a child. See `SubscriberTransport.forked`."""
        self.is_closed = True
        self.payloads.clear()
        self.ready.clear()

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """The lock, for everybody but a reader: while somebody wants it, no reader waits with it."""
        self._wanted.append(None)
        try:
            with self._lock:
                yield
        finally:
            self._wanted.pop()

    def restore(self) -> None:
        """See `GivesPayloads`."""
        if self._source is not None:
            with self._turn():
                self._source.restore(self.ready)

    # ---- with the lock held

    def _next(self, *, may_wait: bool = False) -> Message | None:
        if self._source is not None:
            if self.payloads:
                self._source.restore(self.ready)
            self._source.wants_payloads = self.wants_payloads and self._moves
        try:
            return self._next_message(may_wait=may_wait)
        finally:
            if self._source is not None:
                self._source.wants_payloads = False  # it is only for who reads now

    def _next_message(self, *, may_wait: bool) -> Message | None:
        now = time.monotonic()
        self._leased_until = now + LEASE_S
        if self._io_comes_at > now + _LATE_S:
            # Reading one message and not the rest leaves the descriptor silent for those that follow:
            # the node's thread has to look when the lease is over. It is asked once for many reads.
            self._io_comes_at = self._leased_until
            self._io.serve_soon(self)
        if self._keeps_all and not self.ready and not self._inbox.messages:
            span, self._read_at = now - self._read_at, now
            if span > self._ahead.span_s:
                if self._ahead.now > 1:
                    self._ahead.begin()
                message = self._read(self.ready, may_wait=may_wait)
                return self._bounded(message) if self.ready else message
            most = self._ahead.more()
            if self._read_into(self.ready, most, _AHEAD_BYTES, may_wait=may_wait) < most:
                self._ahead.begin()
        if self.ready:
            return self._bounded(self.ready.popleft())
        if not self._keeps_all:
            self._fill()
        elif self._moves and self._inbox.messages:
            self._inbox.move(self.ready, AHEAD_MOST, _AHEAD_BYTES)
            return self.ready.popleft()
        return self._inbox.take()

    def _bounded(self, message: Message | None) -> Message | None:
        """The oldest that there is room for, of `message` and those that were read behind it."""
        over = 0
        while message is not None and len(self.ready) >= self.spec.max_messages:
            message = self.ready.popleft()
            over += 1
        if over:
            self._readable.dropped(over)
        return message

    def _fill(self, most: int = _BATCH_MESSAGES) -> int:
        """Read into the inbox until the socket has nothing more, or a batch is full; how many."""
        messages: list[Message] = []
        count = self._read_into(messages, most, _BATCH_BYTES)
        dropped = sum(map(self._inbox.put, messages))
        if dropped:
            self._readable.dropped(dropped)
        return count

    def _fill_batch(self, batch: list[Message]) -> int:
        """Read a batch for the sink; how many messages came."""
        if self._keeps_all and self.spec.max_messages >= _BATCH_MESSAGES and not self._inbox.messages:
            return self._read_into(batch, _BATCH_MESSAGES, _BATCH_BYTES)
        count = self._fill()
        batch += self._inbox.take_all()
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


class NativeSubscriber(SocketSubscriber[NativeReadable]):
    """See `SocketSubscriber`. The methods for publishers are called by the link to the master."""

    def __init__(
        self, readable: NativeReadable, io: IoThread, spec: SubscriberSpec, on_close: Callable[[int], None]
    ) -> None:
        super().__init__(readable, io, spec, on_close)
        self._closed_early: set[int] | None = set()
        """Publishers that closed before `begin`; None since."""

    @property
    def has_publishers(self) -> bool:
        """Whether it hears any, or remembers one that may only be silent."""
        with self._turn():
            return bool(self._readable.sources.by_id)

    def wait_for(self, publishers: Iterable[int], timeout_s: float, waker: Waker) -> bool:
        """Wait until these publishers have echoed.

        Who says bye meanwhile, or cannot be connected to, is not waited for.
        """
        wanted = frozenset(publishers)
        sources = self._readable.sources
        return self.read_until(
            lambda: all(
                source.has_echoed or source.problem for each, source in sources.items() if each in wanted
            ),
            timeout_s,
            waker,
        )

    def wait_for_any(self, timeout_s: float, waker: Waker) -> bool:
        """Wait until some publisher has echoed."""
        sources = self._readable.sources
        return self.read_until(
            lambda: any(source.has_echoed for _each, source in sources.items()), timeout_s, waker
        )

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Where it is connected."""
        return tuple(source.endpoint for _each, source in self._readable.sources.items() if source.endpoint)

    def begin(self, remotes: Iterable[RemotePublisher]) -> None:
        """Connect to the publishers that there were when it was registered, and have not closed since.

        The master's word of that is read in another thread than its list, and may be known before.
        """
        with self._turn():
            closed, self._closed_early = self._closed_early or set(), None
            self._connect(each for each in remotes if each.publisher.id not in closed)

    def expect_all_of(self, publisher: int) -> None:
        """Count losses from the first message of a publisher that was created after this subscriber."""
        with self._turn():
            is_registered = self._closed_early is None
            if is_registered and not self.is_closed:
                self._readable.sources.expect_all_of(publisher)

    def connect(self, remotes: Iterable[RemotePublisher]) -> None:
        """Connect to these publishers; twice is once."""
        with self._turn():
            self._connect(remotes)

    def _connect(self, remotes: Iterable[RemotePublisher]) -> None:
        """With the lock held."""
        if not self.is_closed:
            for remote in remotes:
                self._readable.connect(remote)
            self._after_use()

    def connect_again(self) -> None:
        """This computer has another address: connect to publishers on others anew."""
        with self._turn():
            if not self.is_closed:
                self._fill()
                self._wake_waiters()
                self._readable.connect_again()
                self._after_use()

    def reconcile(self, remotes: Iterable[RemotePublisher]) -> None:
        """These are all publishers of the topic: connect to new ones; others are silent."""
        known = tuple(remotes)
        self.connect(known)
        listed = {remote.publisher.id for remote in known}
        with self._turn():
            for each, source in self._readable.sources.items():
                if each not in listed and source.remote is not None:
                    source.is_lapsed = True

    def gone(self, publisher: int, final: int, *, is_closed: bool) -> None:
        """A publisher is unlisted. Its connection stays until its bye comes, or it is replaced."""
        with self._turn():
            if is_closed and self._closed_early is not None:
                self._closed_early.add(publisher)
            if is_closed:
                self._readable.sources.closing(publisher, final, time.monotonic())
            else:
                self._readable.sources.lapsed(publisher, final)

    def correct(self, clocks: Mapping[str, ClockDifference]) -> None:
        """By node, how the clocks of other computers differ from this one's: no others are known."""
        with self._turn():
            self._readable.sources.correct(clocks)

    def tick(self, now: float, last_seqs: Iterable[tuple[int, int]]) -> None:
        """Once a second: leave publishers that have closed without a bye; reconcile losses.

        `last_seqs` is the master's word on what publishers have sent.
        """
        with self._turn():
            if self.is_closed:
                return
            sources = self._readable.sources
            for publisher in sources.ended(now):
                sources.settle(publisher)
                self._readable.leave(publisher)
            if not self._readable.has_input:
                # libzmq never connects again after a failed handshake, as with another program's PULL.
                for publisher in sources.silent(now):
                    self._readable.reconnect(publisher)
                for publisher, seq in last_seqs:
                    sources.promised(publisher, seq)
            self._after_use()
