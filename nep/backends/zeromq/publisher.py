"""NativePublisher: a publisher's XPUB socket, and who reads there.

Sends happen in the publisher's thread; subscriptions are read by whoever uses the socket next, the publisher
or the node's thread. A subscriber counts as connected when its hello has been read: see `docs/wire.md`.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import NoReturn, cast

import zmq

from nep.backends.base import PublisherSpec, QuickPublish
from nep.backends.zeromq.bindings import SMALL, Bindings
from nep.backends.zeromq.byte_window import BACKLOG_STEP_BYTES, STEP_BYTES, Backlog
from nep.backends.zeromq.io_thread import Rest, Served
from nep.backends.zeromq.pending_batch import SMALL_BYTES, PendingBatch
from nep.backends.zeromq.shared.memory import SHARED_BYTES, begin_sharing, can_share
from nep.backends.zeromq.shared.payloads import SharedPayloads
from nep.backends.zeromq.sockets import FarConnection, Part, Refusals, Socket, send_mark, sendable, wait_until
from nep.backends.zeromq.subscriptions import Subscriptions
from nep.errors import ClosedError
from nep.messages.encoded import Encoded
from nep.messages.history import History
from nep.protocol.batch import batch_part
from nep.protocol.requests import Expected, PublisherCount
from nep.protocol.wire import (
    BYE,
    LATCHED,
    OFFER,
    SHARED,
    SIZE_MAX,
    extension_part,
    form_of,
    pack_quickly,
    parse_hello,
    topic_part,
)
from nep.protocol.wire import EXTENSION as EXTENSION_FLAG

__all__ = ["NativePublisher"]

_logger = logging.getLogger("nep")
_SNDMORE = int(zmq.SNDMORE)  # plain numbers: pyzmq's enumerations cost as much as what they ask for
_EVENTS = int(zmq.EVENTS)
_POLLIN = int(zmq.POLLIN)
_time_ns = time.time_ns
_NO_COPY_BYTES = 65_536
_ONE_PART_BYTES = SMALL_BYTES
"""Smaller messages go out in one part where all who subscribe read that: see docs/adr/0009-one-part.md."""
_LOOK_NS = 500_000
"""Whoever publishes more often than this looks for subscriptions only this often; the node's thread looks
after it, because sending may have swallowed the descriptor's signal."""
_SERVE_S = 0.02
_BYE_AGAIN_S = 0.05


def _only_bytes(payload: object) -> NoReturn:
    raise TypeError(payload)


class GreetedPublisher:
    """A publisher to which those subscribers say hello that the master lists; `changed` guards all of it."""

    def __init__(self, changed: threading.Condition, seen: dict[int, int]) -> None:
        """`seen`: who has said hello, and how many messages there had been then."""
        self._changed, self._seen = changed, seen
        self._names: dict[int, str] = {}
        self._waited: set[int] = set()

    @property
    def subscriber_ids(self) -> frozenset[int]:
        """Ids of the subscribers that have said hello and have not gone."""
        with self._changed:
            return frozenset(self._seen)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of nodes that were expected and have not said hello."""
        with self._changed:
            return tuple(sorted({self._names[each] for each in self._waited - set(self._seen)}))

    def expect(self, expected: Iterable[Expected]) -> None:
        """These subscribers are registered and will connect."""
        with self._changed:
            for each in expected:
                self._waited.add(each.id)
                self._names[each.id] = each.node_name

    def wait_for(self, expected: Iterable[Expected], timeout_s: float) -> tuple[int, ...]:
        """Wait until these have said hello; the ids of those that did not in time."""
        wanted = {each.id for each in expected}
        with self._changed:
            wait_until(self._changed, lambda: wanted <= self._seen.keys(), timeout_s)
            return tuple(wanted - self._seen.keys())


class NativePublisher(GreetedPublisher):
    """Owns `socket`, an XPUB that is bound or connected already."""

    is_closed = False
    is_heard = False
    """Whether anybody reads, with or without a hello."""

    def __init__(
        self,
        socket: Socket,
        spec: PublisherSpec,
        on_close: Callable[[NativePublisher, float], None],
        serve_soon: Callable[[Served], None],
    ) -> None:
        self.spec = spec
        self._count = 0
        """Messages that were sent or skipped."""
        self.subscribers = 0
        """How many said hello and have not gone."""
        self._on_close = on_close
        self._serve_soon = serve_soon
        self._socket = socket
        send_mark(socket)
        self._bindings = Bindings(
            socket, may_be_local=spec.codec.name in SMALL, is_watched=FarConnection.can_tell
        )
        # Without pyzmq's layer for routing ids and groups, which takes half of the time.
        self._send: Callable[..., object] = super(zmq.Socket, socket).send
        self._bytes = self._settled_bytes = 0
        """So many of them are counted in the windows of those who read."""
        self._settle_at = 0
        """From so many on a message is not simply sent to all."""
        self._backlog = Backlog()
        self._last_stamp_ns: int | None = None
        self.problem = ""
        """What is wrong with the newest payload; empty when nothing is."""
        self._subscriptions = Subscriptions(spec.topic, spec.id)
        if can_share() and not spec.history:
            self._subscriptions.shared = SharedPayloads(spec.id, self._offer)
        self._apart = self._subscriptions.apart
        self._history: History[tuple[Part, ...]] = History(spec.history)
        self._looked_ns = self._served = 0
        self._io_comes = False
        self._batch = PendingBatch(may_wait=spec.may_batch and not spec.is_latched)
        self._id = spec.id
        self._topic = topic_part(spec.topic)
        self._codec = spec.codec.number
        self._flags = LATCHED if spec.is_latched else 0
        self._form = form_of(self._codec, self._flags)
        # `with` is three times faster on the lock itself than on the condition over it.
        self._lock = threading.Lock()
        super().__init__(threading.Condition(self._lock), self._subscriptions.seen)
        self.fd = int(socket.getsockopt(zmq.FD))
        bytes_only = QuickPublish(self, bytes, _only_bytes, None, self.send_now)
        self._send_bytes = self._batch.publishing(bytes_only, self, self._lock)

    @property
    def count(self) -> int:
        """Messages published so far."""
        return self._count + len(self._batch.waiting)

    # ---- who listens

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait until somebody has said hello."""
        with self._changed:
            wait_until(self._changed, lambda: bool(self._seen), timeout_s)

    def counts(self) -> PublisherCount:
        """The statistics for a renewal: once a second, so silent connections are looked for, too."""
        with self._changed:
            self._subscriptions.end_silent()
            return PublisherCount(
                self.spec.id, self.count, self._bytes, self.count, self._last_stamp_ns, self.problem
            )

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:
        """Be reached at these addresses of this computer from now on; the endpoints. See `Bindings.move`."""
        with self._lock:
            endpoints = () if self._socket.closed else self._bindings.move(hosts)
            self._read_subscriptions()  # binding may have swallowed the descriptor's signal
            return endpoints

    def leave_local(self) -> None:
        """Be reached by TCP only from now on."""
        with self._lock:
            if not self._socket.closed and self._bindings.is_local:
                self._bindings.leave_local()
                self._read_subscriptions()

    @property
    def refusals(self) -> Refusals:
        """What was sent to it and is no subscription."""
        return self._subscriptions.refusals

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All that its socket is bound to by `move`."""
        return self._bindings.endpoints

    @property
    def is_local(self) -> bool:
        """Whether programs of this computer reach it without TCP: see `bindings`."""
        return self._bindings.is_local

    # ---- sending

    def report(self, problem: str) -> None:
        """The publisher's trouble with a payload, for the next renewal."""
        self.problem = problem

    def skip(self) -> None:
        """Count a message that nobody wants."""
        with self._lock:
            self.flush()
            self._count += 1
            self._last_stamp_ns = time.time_ns()

    def send(self, encoded: Encoded) -> None:
        """Publish. `data` of 64 kB and more is sent without copying it, unless it can still be changed.

        Raises `WireError` for an extension that has no form on the wire.
        """
        data, beside = encoded
        if beside is None and type(data) is bytes:
            self._send_bytes(data)
        else:
            self._send_now(data, beside)

    def quick_publish(self, asked: QuickPublish) -> Callable[..., None]:
        """See `nep.backends.base.PublishesQuickly`."""
        return self._batch.publishing(asked, self, self._lock)

    def send_now(self, data: bytes) -> None:
        """Send it, and what waits before it."""
        self._send_now(data, None)

    def _send_now(self, given: bytes | memoryview, beside: Mapping[str, object] | None) -> None:
        """Send it, and what waits before it."""
        data: Part = given
        extension = None
        if (given.nbytes if type(given) is memoryview else len(given)) >= SHARED_BYTES:
            self._send_large(given, extension_part(beside) if beside else None)
            return
        if beside or type(given) is not bytes:
            data = sendable(given) if len(given) >= _ONE_PART_BYTES else bytes(given)
            extension = extension_part(beside) if beside else None
        size = len(data)
        with self._lock:
            if self.is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            self.flush()
            if self._flags:
                self._greet_before(size)
            self._count = seq = self._count + 1
            self._bytes = total = self._bytes + size
            self._last_stamp_ns = stamp_ns = _time_ns()
            if total >= self._settle_at or extension or self._flags:
                self._send_all(data, extension, size)
            elif size < _ONE_PART_BYTES and not self._apart and type(data) is bytes:
                head = pack_quickly(self._form, size, seq, stamp_ns, self._id)
                self._send(b"".join((self._topic, head, data)))
                self._batch.begin_after(stamp_ns)
            else:
                self._send_apart(data, size, seq, stamp_ns)
            self._look(stamp_ns)

    def _greet_before(self, size: int) -> None:
        """Before a message is counted that is kept: who is greeted now gets it like all others, and once.

        With a history the sooner the better; else only if `_send_all` would look for subscriptions.
        """
        if self.spec.history > 1 or self._bytes + size >= self._settle_at:
            self._read_subscriptions()

    def _send_large(self, given: bytes | memoryview, extension: bytes | None) -> None:
        """Through shared memory to those who read that; the payload is copied at most once."""
        shared = self._subscriptions.shared
        # Before the lock: it takes a moment for the first time.
        opened = begin_sharing() if shared is not None and self._seen and not shared.readers else None
        if shared is not None and opened is None and not shared.readers:
            shared = None
        data = sendable(given) if shared is None or not shared.readers else None
        size = given.nbytes if isinstance(given, memoryview) else len(given)
        with self._lock:
            if self.is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            self.flush()
            if self._flags:
                self._greet_before(size)
            number = shared.place(given, self._seen, time.monotonic()) if shared and not self._apart else None
            is_for_all = number is not None and shared is not None and shared.readers >= self._seen.keys()
            if data is None and not is_for_all:
                data = sendable(given)
            self._count = seq = self._count + 1
            self._bytes = total = self._bytes + size
            self._last_stamp_ns = stamp_ns = _time_ns()
            if (
                number is not None
                and is_for_all
                and total < self._settle_at
                and not (extension or self._flags)
            ):
                head = pack_quickly(self._form | SHARED << 16, len(number), seq, stamp_ns, self._id)
                self._send(b"".join((self._topic, head, number)))  # whoever shares reads one part
            else:
                self._send_all(b"" if data is None else data, extension, size, number)
            self._look(stamp_ns)

    def lend(self, size_bytes: int) -> memoryview | None:
        """See `PublisherTransport.lend`."""
        shared = self._subscriptions.shared
        with self._lock:
            return None if shared is None or self.is_closed else shared.lend(size_bytes)

    def _offer(self, subscriber: int, generation: int) -> None:
        """Let a subscriber open the shared memory of this generation. With the lock held."""
        notice = pack_quickly(form_of(self._codec, OFFER), generation, self._count, time.time_ns(), self._id)
        self._send_parts(self._subscriptions.hellos[subscriber], (notice,))

    def _look(self, stamp_ns: int) -> None:
        """Read subscriptions, now and then; the node's thread looks after that."""
        if not 0 <= stamp_ns - self._looked_ns < _LOOK_NS:
            self._looked_ns = stamp_ns
            self._read_subscriptions()
        elif not self._io_comes:
            self._io_comes = True
            self._serve_soon(self)

    def _send_apart(self, data: Part, size: int, seq: int, stamp_ns: int) -> None:
        """In three parts, with the lock held."""
        send = self._send
        send(self._topic, _SNDMORE)
        send(pack_quickly(self._form, size if size <= SIZE_MAX else 0, seq, stamp_ns, self._id), _SNDMORE)
        send(data, 0, size < _NO_COPY_BYTES)

    def flush_soon(self) -> None:
        """Let the node's thread send what waits then. With the lock held."""
        if not self._batch.is_looked_after:
            self._batch.is_looked_after = self._io_comes = True
            self._serve_soon(self)

    def flush(self) -> None:
        """Send the messages that wait, with the lock held. They count from now on."""
        batch = self._batch
        if batch.is_leaving or not batch.waiting:
            return
        batch.is_leaving = True  # what comes meanwhile does not overtake what is being sent
        try:
            self._send_batches(batch)
        finally:
            batch.is_leaving = False

    def _send_batches(self, batch: PendingBatch) -> None:
        while batch.waiting:
            taken = batch.take()
            self._last_stamp_ns = stamp_ns = taken[-1][1]
            count, payloads, stamps_ns = len(taken), *zip(*taken, strict=True)
            size = sum(map(len, payloads))
            if count > 1 and batch.is_allowed and self._bytes + size < self._settle_at:
                part = batch_part(self._topic, self._form, self._count + 1, self._id, stamps_ns, payloads)
                self._count += count
                self._bytes += size
                self._send(part)
            else:
                self._send_each(taken)
            self._look(stamp_ns)

    def _send_each(self, taken: Iterable[tuple[bytes, int]]) -> None:
        """Those that waited, one by one. With the lock held."""
        for data, stamp_ns in taken:
            self._last_stamp_ns = stamp_ns
            self._count += 1
            self._bytes += len(data)
            self._send_all(data, None, len(data))

    def _send_all(self, data: Part, extension: bytes | None, size: int, number: bytes | None = None) -> None:
        """Send what has flags, or when it is time to see what was read, with the lock held.

        `number` is what those get instead of `data` who read it in shared memory.
        """
        self.flush()
        tail = self._tail(data, extension, size, 0)
        shared = None if number is None else self._tail(number, extension, len(number), SHARED)
        self._history.add(tail, size)
        if self._bytes < self._settle_at:
            self._send_to_all(tail, shared)
        else:
            if not self._flags:
                self._read_subscriptions()
            self._send_to_those_with_room(tail, shared, size)

    def _tail(self, data: Part, extension: bytes | None, size: int, flags: int) -> tuple[Part, ...]:
        """What follows a message's first part."""
        form = self._form | flags << 16 | (0 if extension is None else EXTENSION_FLAG << 16)
        told = size if size <= SIZE_MAX else 0
        header = pack_quickly(form, told, self._count, self._last_stamp_ns or 0, self._id)
        return (header, data) if extension is None else (header, data, extension)

    def _send_to_all(self, tail: tuple[Part, ...], shared: tuple[Part, ...] | None) -> None:
        """With the lock held: `shared` to those who share memory, `tail` to everybody else."""
        if shared is None:
            self._send_parts(self._topic, tail)
            return
        readers = self._shared_readers()
        if readers >= self._seen.keys():
            if len(shared) == 2:  # whoever shares reads messages of one part
                self._send(b"".join((self._topic, *cast("tuple[bytes, bytes]", shared))))
            else:
                self._send_parts(self._topic, shared)
            return
        for each, own in self._subscriptions.hellos.items():
            self._send_parts(own, shared if each in readers else tail)

    def _shared_readers(self) -> set[int]:
        shared = self._subscriptions.shared
        return set() if shared is None else shared.readers

    def _send_to_those_with_room(
        self, tail: tuple[Part, ...], shared: tuple[Part, ...] | None, size: int
    ) -> None:
        """To all at once; while somebody has no room, to everybody else alone. With the lock held."""
        windows = self._subscriptions.windows
        since = self._bytes - size - self._settled_bytes  # sent to all
        if since:
            for window in windows.values():
                window.sent(self._count - 1, since)
        self._settled_bytes = self._bytes
        is_told = self._subscriptions.tells_all
        has_room = {each: window.has_room(size) for each, window in windows.items()}
        if all(has_room.values()) and (is_told or self._backlog.has_room(size)):
            if is_told:
                self._send_to_all(tail, shared)
            else:
                self._send_tracked(tail, size + since)
            self._settle_at = self._bytes + (STEP_BYTES if is_told else BACKLOG_STEP_BYTES)
            taking = windows
        else:
            self._settle_at = 0  # each message is looked at until all have room again
            taking = {each: window for each, window in windows.items() if has_room[each]}
            for each, window in windows.items():
                if each in taking:
                    is_shared = shared is not None and each in self._shared_readers()
                    chosen = shared if is_shared and shared is not None else tail
                    self._send_parts(self._subscriptions.hellos[each], chosen)
                else:
                    window.missed()
        for window in taking.values():
            window.sent(self._count, size)
        now = time.monotonic()
        for each, window in windows.items():
            if window.is_to_ask(now, has_room=has_room[each]):
                self._send_parts(self._subscriptions.hellos[each], (self._notice(0),))

    def _send_tracked(self, tail: tuple[Part, ...], size: int) -> None:
        """Send to all, and note until when libzmq holds it, with all of `size` bytes since the last one."""
        data = tail[1].buffer if isinstance(tail[1], zmq.Frame) else tail[1]
        frame = zmq.Frame(data, track=True, copy=False, copy_threshold=0)
        self._send_parts(self._topic, (tail[0], frame, *tail[2:]))
        self._backlog.sent(frame.tracker, size)

    def _send_parts(self, first: bytes, tail: tuple[Part, ...]) -> None:
        """Send with the lock held. XPUB never blocks: it drops for subscribers whose queue is full."""
        self.flush()
        send = self._send
        send(first, _SNDMORE)
        for part in tail[:-1]:
            send(part, _SNDMORE, len(part) < _NO_COPY_BYTES)
        send(tail[-1], 0, len(tail[-1]) < _NO_COPY_BYTES)

    # ---- subscriptions

    def serve(self, now: float) -> Rest:
        """Send what waits long enough, and read subscriptions."""
        with self._lock:
            if not self.is_closed or self._seen:
                self._read_subscriptions()
            again_s = self._batch.look_again_s(_time_ns())
            if not again_s:
                self.flush()
                again_s = self._batch.goes_on_s
            if again_s:
                return Rest(due=now + again_s)
            count, self._served = self._served, self._count
            # As long as somebody publishes without looking, this thread looks again and again.
            self._io_comes = self._io_comes and count != self._count and not self.is_closed
            return Rest(due=now + _SERVE_S) if self._io_comes else Rest()

    def _read_subscriptions(self) -> None:
        """With the lock held: until the socket has nothing more."""
        while not self._socket.closed and int(self._socket.getsockopt(_EVENTS)) & _POLLIN:
            event = self._socket.recv(zmq.DONTWAIT, copy=False)
            own = self._subscriptions.note(event.bytes, self._count, partial(FarConnection.of, event))
            # First: whoever gets the echo may rely on being counted.
            self.subscribers = len(self._seen)
            self._waited.difference_update(self._seen)  # whoever has connected may leave again
            self.is_heard = self._subscriptions.is_there
            self._batch.allow(reads_batches=self._subscriptions.reads_batches)
            if own is not None:
                self._greet(own)
            self._changed.notify_all()
            if self._settle_at == 0:
                self._tell_what_was_missed()

    def _tell_what_was_missed(self) -> None:
        for each, window in self._subscriptions.windows.items():
            if window.is_to_tell():
                self._send_parts(self._subscriptions.hellos[each], (self._notice(0),))

    def _greet(self, own: bytes) -> None:
        """What was latched, then the echo: from here on the subscriber counts."""
        for kept in self._history:
            self._send_parts(own, kept)
        if self._history:
            hello = parse_hello(own)
            window = self._subscriptions.windows.get(hello.subscriber) if hello is not None else None
            if window is not None:
                window.sent(self._count, self._history.size_bytes)
        self._send_parts(own, (self._notice(0),))

    def _notice(self, flags: int) -> bytes:
        return pack_quickly(form_of(self._codec, flags), 0, self._count, time.time_ns(), self._id)

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Unregister, deliver what is on its way, and close the socket. Once; called by its publisher."""
        self._on_close(self, timeout_s)

    def say_bye(self) -> None:
        """Nothing is published any more; every subscriber disconnects when it has read everything."""
        with self._changed:
            self.is_closed = True
            self.flush()
            self._bye()

    def finish(self, deadline: float) -> None:
        """Wait until all have disconnected; log what was not delivered at `deadline`, and to how many."""
        with self._changed:
            while self._seen and (left := deadline - time.monotonic()) > 0.0:
                if not wait_until(self._changed, lambda: not self._seen, min(left, _BYE_AGAIN_S)):
                    self._bye()  # a full queue drops it like anything else
            if self._seen:
                owed = [max(self._count - seen, len(self._history)) for seen in self._seen.values()]
                if any(owed):  # else only the bye was not taken
                    _logger.warning(
                        "'%s' is closed before %d subscriber(s) took everything: "
                        "up to %d messages not delivered",
                        self.spec.topic,
                        sum(map(bool, owed)),
                        max(owed),
                    )
                self._subscriptions.forget()
                self.subscribers = 0

    def release(self) -> None:
        """Close the socket; the node's thread has let go of it."""
        with self._changed:
            self.is_closed = True
            if self._subscriptions.shared is not None:
                self._subscriptions.shared.close()
            self._socket.close(0)

    def _bye(self) -> None:
        if not self._socket.closed:
            for own in self._subscriptions.hellos.values():
                self._send_parts(own, (self._notice(BYE),))
            self._read_subscriptions()
