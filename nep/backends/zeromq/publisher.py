"""Publisher on the native wire: an XPUB socket and its subscribers.

Messages are sent in the publishing thread. Subscriptions are read by the thread that uses the socket
next, which is the publishing thread or the I/O thread. A subscriber counts as connected when its hello
has been read. See docs/wire.md.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import cast

import zmq

from nep.backends.base import PublisherSpec
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.zeromq.bindings import Bindings
from nep.backends.zeromq.byte_window import ACK_INTERVAL_BYTES, TRACKING_INTERVAL_BYTES, Backlog
from nep.backends.zeromq.io_thread import Pollable, PollState
from nep.backends.zeromq.pending_batch import (
    BATCH_WINDOW_NS,
    FULL_BATCH_BYTES,
    MAX_BATCHED_BYTES,
    MAX_DELAY_NS,
    MAX_PENDING_MESSAGES,
    PendingBatch,
)
from nep.backends.zeromq.shared.memory import MIN_SHARED_BYTES, can_share, start_sharing
from nep.backends.zeromq.shared.payloads import SharedPayloads
from nep.backends.zeromq.sockets import Part, RemoteConnection, Socket, set_send_high_water_mark, to_sendable
from nep.backends.zeromq.subscriptions import Subscriptions
from nep.errors import ClosedError
from nep.messages.encoded import Encoded
from nep.messages.history import History
from nep.protocol.batch import encode_batch
from nep.protocol.requests import ExpectedSubscriber, PublisherCount
from nep.protocol.wire import (
    BYE,
    LATCHED,
    MAX_SIZE,
    OFFER,
    SHARED,
    encode_form,
    extension_part,
    pack_header,
    parse_hello,
    topic_part,
)
from nep.protocol.wire import EXTENSION as EXTENSION_FLAG
from nep.system.waits import wait_until

_logger = logging.getLogger("nep")
_SNDMORE = int(zmq.SNDMORE)  # plain ints: looking up pyzmq's enum members costs as much as the call
_EVENTS = int(zmq.EVENTS)
_POLLIN = int(zmq.POLLIN)
_time_ns = time.time_ns
_MIN_ZERO_COPY_BYTES = 65_536
_MAX_ONE_PART_BYTES = MAX_BATCHED_BYTES
"""Maximum size in bytes of messages sent in one part if all subscribers accept this form.

See docs/adr/0009-one-part.md.
"""
_READ_INTERVAL_NS = 500_000
"""Interval in nanoseconds at which a busy publishing thread reads subscriptions.

The I/O thread checks for subscriptions afterwards, because sending may have consumed the edge of
ZMQ_FD.
"""
_IO_CHECK_INTERVAL_S = 0.02
_BYE_RETRY_S = 0.05


class HandshakePublisher:
    """Base class of publishers that wait for the hellos of registered subscribers.

    The condition `changed` guards the publisher's state.
    """

    is_closed = False

    def __init__(self, changed: threading.Condition, counts_at_hello: dict[int, int]) -> None:
        """Initialize the publisher.

        Args:
            changed: Condition that guards the publisher's state.
            counts_at_hello: Number of messages published before the hello of each connected subscriber, by
                its id.
        """
        self._changed, self._counts_at_hello = changed, counts_at_hello
        self._node_names: dict[int, str] = {}
        self._expected_ids: set[int] = set()

    @property
    def subscriber_ids(self) -> frozenset[int]:
        """Ids of the connected subscribers."""
        with self._changed:
            return frozenset(self._counts_at_hello)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of nodes whose subscribers are registered but not connected."""
        with self._changed:
            missing_ids = self._expected_ids - set(self._counts_at_hello)
            return tuple(sorted({self._node_names[each] for each in missing_ids}))

    def expect(self, expected: Iterable[ExpectedSubscriber]) -> None:
        """Add registered subscribers whose hellos are expected."""
        with self._changed:
            for subscriber in expected:
                self._expected_ids.add(subscriber.id)
                self._node_names[subscriber.id] = subscriber.node_name

    def wait_for(self, expected: Iterable[ExpectedSubscriber], timeout_s: float) -> tuple[int, ...]:
        """Wait up to `timeout_s` seconds for the hellos of these subscribers; return the missing ids.

        The wait ends when the publisher is closed, as if no subscriber were missing.
        """
        missing_ids = {each.id for each in expected}

        def has_ended() -> bool:
            missing_ids.difference_update(self._counts_at_hello)
            return self.is_closed or not missing_ids

        with self._changed:
            wait_until(self._changed, has_ended, timeout_s)
            return () if self.is_closed else tuple(missing_ids)


class NativePublisher(HandshakePublisher):
    """Publisher on the native wire. Owns its socket, an XPUB that `move` or `legacy.attach` binds later."""

    has_subscribers = False
    """True if any subscriber is connected, with or without a hello."""

    def __init__(
        self,
        socket: Socket,
        spec: PublisherSpec,
        on_close: Callable[[NativePublisher, float], None],
        serve_soon: Callable[[Pollable], None],
    ) -> None:
        self.spec = spec
        self._count = 0
        """Number of messages sent or skipped."""
        self.subscribers = 0
        """Number of subscribers that have sent a hello and are still connected."""
        self._on_close = on_close
        self._serve_soon = serve_soon
        self._socket = socket
        set_send_high_water_mark(socket)
        self._bindings = Bindings(
            socket,
            may_bind_unix_sockets=spec.codec.is_small,
            has_silence_check=RemoteConnection.can_detect_silence,
        )
        # bypasses pyzmq's handling of routing ids and groups, which takes half of the time
        self._send: Callable[..., object] = super(zmq.Socket, socket).send
        self._bytes = self._windowed_bytes = 0
        """Value of `_bytes` up to which the send windows have been updated."""
        self._full_path_at = 0
        """Value of `_bytes` from which messages need flow control and so take the full path."""
        self._backlog = Backlog()
        self._last_stamp_ns: int | None = None
        self.problem = ""
        """Reason why the newest payload was rejected; "" if it was encoded."""
        self._subscriptions = Subscriptions(spec.topic, spec.id)
        if can_share() and not spec.history:
            self._subscriptions.shared = SharedPayloads(spec.id, self._send_offer_locked)
        self._legacy_filters = self._subscriptions.legacy_filters
        self._history: History[tuple[Part, ...]] = History(spec.history)
        self._polled_ns = self._count_at_check = 0
        self._is_io_scheduled = False
        self._batch = PendingBatch(is_enabled=spec.may_batch and not spec.is_latched)
        self._id = spec.id
        self._topic = topic_part(spec.topic)
        self._codec_number = spec.codec.number
        self._flags = LATCHED if spec.is_latched else 0
        self._form = encode_form(self._codec_number, self._flags)
        # entering the lock is three times faster than entering the condition
        self._lock = threading.Lock()
        super().__init__(threading.Condition(self._lock), self._subscriptions.counts_at_hello)
        self.fd = int(socket.getsockopt(zmq.FD))

    @property
    def count(self) -> int:
        """Number of messages published."""
        return self._count + len(self._batch.pending)

    # ---- subscribers

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for the hello of any subscriber."""
        with self._changed:
            wait_until(self._changed, lambda: bool(self._counts_at_hello), timeout_s)

    def counts(self) -> PublisherCount:
        """Return the statistics that a renewal reports.

        Because it is called once per second, this method also closes connections that don't respond.
        """
        with self._changed:
            self._subscriptions.close_silent()
            return PublisherCount(
                self.spec.id, self.count, self._bytes, self.count, self._last_stamp_ns, self.problem
            )

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:
        """Bind these addresses of this computer and unbind all others; return the endpoints.

        See `Bindings.move`.
        """
        with self._lock:
            endpoints = () if self._socket.closed else self._bindings.move(hosts)
            self._read_subscriptions_locked()  # binding may have consumed the edge of ZMQ_FD
            return endpoints

    def unbind_local(self) -> None:
        """Stop accepting connections other than TCP."""
        with self._lock:
            if not self._socket.closed and self._bindings.is_local:
                self._bindings.unbind_local()
                self._read_subscriptions_locked()

    @property
    def rejections(self) -> RejectionCounter:
        """Counter of rejected subscriptions."""
        return self._subscriptions.rejections

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All endpoints bound by `move`."""
        return self._bindings.endpoints

    @property
    def is_local(self) -> bool:
        """True if programs of this computer can connect without TCP. See `bindings`."""
        return self._bindings.is_local

    # ---- sending

    def report(self, problem: str) -> None:
        """Set the reason why payloads can't be encoded; the next renewal reports it."""
        self.problem = problem

    def skip(self) -> None:
        """Count a message that is not sent because the topic has no subscribers."""
        with self._lock:
            self.flush_locked()
            self._count += 1
            self._last_stamp_ns = time.time_ns()

    def send(self, encoded: Encoded) -> None:
        """Publish a message. Immutable data of 64 kB and more is sent without a copy.

        Raises `WireError` for an extension that can't be encoded, and `ClosedError` if the publisher is
        closed.
        """
        data, extension_fields = encoded
        if extension_fields is None and type(data) is bytes:
            self.send_bytes(data)
        else:
            self._send_now(data, extension_fields)

    def send_bytes(self, data: bytes) -> None:
        """Publish a message without extension: alone, or in a batch if the previous one was just published.

        Raises `ClosedError` if the publisher is closed.
        """
        batch, size, stamp_ns = self._batch, len(data), _time_ns()
        if stamp_ns >= batch.until_ns or size >= MAX_BATCHED_BYTES or self.is_closed or self.problem:
            self._send_now(data, None)
            return
        pending = batch.pending
        pending.append((data, stamp_ns))
        count = len(pending)
        if count >= MAX_PENDING_MESSAGES or count * size >= FULL_BATCH_BYTES:
            with self._lock:
                self.flush_locked()
            batch.has_sent_full_batch = True
            return
        if count == 1:
            batch.flush_deadline_ns = stamp_ns + MAX_DELAY_NS
        if not batch.is_flush_scheduled:
            with self._lock:
                self.flush_soon_locked()
        until_ns, deadline_ns = stamp_ns + BATCH_WINDOW_NS, batch.flush_deadline_ns
        batch.until_ns = until_ns if until_ns < deadline_ns else deadline_ns  # noqa: FURB136 - takes half the time of min

    def _send_now(self, payload: bytes | memoryview, extension_fields: Mapping[str, object] | None) -> None:
        data: Part = payload
        extension = None
        if (payload.nbytes if type(payload) is memoryview else len(payload)) >= MIN_SHARED_BYTES:
            self._send_large(payload, extension_part(extension_fields) if extension_fields else None)
            return
        if extension_fields or type(payload) is not bytes:
            data = to_sendable(payload) if len(payload) >= _MAX_ONE_PART_BYTES else bytes(payload)
            extension = extension_part(extension_fields) if extension_fields else None
        size = len(data)
        with self._lock:
            if self.is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            self.flush_locked()
            if self._flags:
                self._read_subscriptions_if_needed_locked(size)
            self._count = seq = self._count + 1
            self._bytes = total = self._bytes + size
            self._last_stamp_ns = stamp_ns = _time_ns()
            if total >= self._full_path_at or extension or self._flags:
                self._send_all_locked(data, extension, size)
            elif size < _MAX_ONE_PART_BYTES and not self._legacy_filters and type(data) is bytes:
                header = pack_header(self._form, size, seq, stamp_ns, self._id)
                self._send(b"".join((self._topic, header, data)))
                self._batch.open_window(stamp_ns)
            else:
                self._send_in_parts_locked(data, size, seq, stamp_ns)
            self._poll_subscriptions_locked(stamp_ns)

    def _read_subscriptions_if_needed_locked(self, size: int) -> None:
        # Reads subscriptions before a message of the history is counted, so that a new subscriber receives it
        # once, in order. With a history of one message only if `_send_all_locked` would read them.
        if self.spec.history > 1 or self._bytes + size >= self._full_path_at:
            self._read_subscriptions_locked()

    def _send_large(self, payload: bytes | memoryview, extension: bytes | None) -> None:
        # The payload is copied at most once.
        shared = self._subscriptions.shared
        # must stay referenced until `shared.write`; created before taking the lock, because loading the
        # library is slow
        iceoryx_node = (
            start_sharing() if shared is not None and self._counts_at_hello and not shared.readers else None
        )
        if shared is not None and iceoryx_node is None and not shared.readers:
            shared = None
        data = to_sendable(payload) if shared is None or not shared.readers else None
        size = payload.nbytes if isinstance(payload, memoryview) else len(payload)
        with self._lock:
            if self.is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            self.flush_locked()
            if self._flags:
                self._read_subscriptions_if_needed_locked(size)
            reference = (
                shared.write(payload, self._counts_at_hello, time.monotonic())
                if shared and not self._legacy_filters
                else None
            )
            is_for_all = (
                reference is not None
                and shared is not None
                and shared.readers >= self._counts_at_hello.keys()
            )
            if data is None and not is_for_all:
                data = to_sendable(payload)
            self._count = seq = self._count + 1
            self._bytes = total = self._bytes + size
            self._last_stamp_ns = stamp_ns = _time_ns()
            if (
                reference is not None
                and is_for_all
                and total < self._full_path_at
                and not (extension or self._flags)
            ):
                header = pack_header(self._form | SHARED << 16, len(reference), seq, stamp_ns, self._id)
                # subscribers with shared memory accept one part
                self._send(b"".join((self._topic, header, reference)))
            else:
                self._send_all_locked(b"" if data is None else data, extension, size, reference)
            self._poll_subscriptions_locked(stamp_ns)

    def borrow_memory(self, size_bytes: int) -> memoryview | None:
        """Return writable shared memory for a payload.

        Returns None if no subscriber shares memory, the payload is smaller than `MIN_SHARED_BYTES`, or
        no slot is free.
        """
        shared = self._subscriptions.shared
        with self._lock:
            return None if shared is None or self.is_closed else shared.borrow_memory(size_bytes)

    def _send_offer_locked(self, subscriber: int, generation: int) -> None:
        notice = pack_header(
            encode_form(self._codec_number, OFFER), generation, self._count, time.time_ns(), self._id
        )
        self._send_parts_locked(self._subscriptions.hellos[subscriber], (notice,))

    def _poll_subscriptions_locked(self, stamp_ns: int) -> None:
        # Reads subscriptions at most every `_READ_INTERVAL_NS`; the I/O thread checks afterwards.
        if not 0 <= stamp_ns - self._polled_ns < _READ_INTERVAL_NS:
            self._polled_ns = stamp_ns
            self._read_subscriptions_locked()
        elif not self._is_io_scheduled:
            self._is_io_scheduled = True
            self._serve_soon(self)

    def _send_in_parts_locked(self, data: Part, size: int, seq: int, stamp_ns: int) -> None:
        # Sends three parts.
        send = self._send
        send(self._topic, _SNDMORE)
        send(pack_header(self._form, size if size <= MAX_SIZE else 0, seq, stamp_ns, self._id), _SNDMORE)
        send(data, 0, size < _MIN_ZERO_COPY_BYTES)

    def flush_soon_locked(self) -> None:
        """Let the I/O thread send pending messages soon. Call with the lock held."""
        if not self._batch.is_flush_scheduled:
            self._batch.is_flush_scheduled = self._is_io_scheduled = True
            self._serve_soon(self)

    def flush_locked(self) -> None:
        """Send pending messages and count them. Call with the lock held."""
        batch = self._batch
        if batch.is_flushing or not batch.pending:
            return
        batch.is_flushing = True  # a nested flush must not overtake the messages being sent
        try:
            self._send_batches_locked(batch)
        finally:
            batch.is_flushing = False

    def _send_batches_locked(self, batch: PendingBatch) -> None:
        while batch.pending:
            messages = batch.pop_batch()
            self._last_stamp_ns = stamp_ns = messages[-1][1]
            count, payloads, stamps_ns = len(messages), *zip(*messages, strict=True)
            size = sum(map(len, payloads))
            if count > 1 and batch.is_allowed and self._bytes + size < self._full_path_at:
                part = encode_batch(self._topic, self._form, self._count + 1, self._id, stamps_ns, payloads)
                self._count += count
                self._bytes += size
                self._send(part)
            else:
                self._send_separately_locked(messages)
            self._poll_subscriptions_locked(stamp_ns)

    def _send_separately_locked(self, messages: Iterable[tuple[bytes, int]]) -> None:
        for data, stamp_ns in messages:
            self._last_stamp_ns = stamp_ns
            self._count += 1
            self._bytes += len(data)
            self._send_all_locked(data, None, len(data))

    def _send_all_locked(
        self, data: Part, extension: bytes | None, size: int, reference: bytes | None = None
    ) -> None:
        # Full path for messages with flags, and for flow control. Call with the lock held. `reference`
        # replaces `data` for subscribers that read shared memory.
        self.flush_locked()
        tail = self._message_parts(data, extension, size, 0)
        shared_parts = (
            None if reference is None else self._message_parts(reference, extension, len(reference), SHARED)
        )
        self._history.add(tail, size)
        if self._bytes < self._full_path_at:
            self._send_to_all_locked(tail, shared_parts)
        else:
            if not self._flags:
                self._read_subscriptions_locked()
            self._send_with_flow_control_locked(tail, shared_parts, size)

    def _message_parts(self, data: Part, extension: bytes | None, size: int, flags: int) -> tuple[Part, ...]:
        form = self._form | flags << 16 | (0 if extension is None else EXTENSION_FLAG << 16)
        size_field = size if size <= MAX_SIZE else 0
        header = pack_header(form, size_field, self._count, self._last_stamp_ns or 0, self._id)
        return (header, data) if extension is None else (header, data, extension)

    def _send_to_all_locked(self, tail: tuple[Part, ...], shared_parts: tuple[Part, ...] | None) -> None:
        # `shared_parts` goes to subscribers with shared memory, `tail` to the others.
        if shared_parts is None:
            self._send_parts_locked(self._topic, tail)
            return
        readers = self._shared_readers()
        if readers >= self._counts_at_hello.keys():
            if len(shared_parts) == 2:  # subscribers with shared memory accept one part
                self._send(b"".join((self._topic, *cast("tuple[bytes, bytes]", shared_parts))))
            else:
                self._send_parts_locked(self._topic, shared_parts)
            return
        for subscriber, hello_bytes in self._subscriptions.hellos.items():
            self._send_parts_locked(hello_bytes, shared_parts if subscriber in readers else tail)

    def _shared_readers(self) -> set[int]:
        shared = self._subscriptions.shared
        return set() if shared is None else shared.readers

    def _send_with_flow_control_locked(
        self, tail: tuple[Part, ...], shared_parts: tuple[Part, ...] | None, size: int
    ) -> None:
        # While a subscriber has no room, the message is sent to each of the others
        # alone.
        windows = self._subscriptions.windows
        unwindowed_bytes = self._bytes - size - self._windowed_bytes  # sent to all
        if unwindowed_bytes:
            for window in windows.values():
                window.add_sent(self._count - 1, unwindowed_bytes)
        self._windowed_bytes = self._bytes
        has_acks = self._subscriptions.all_acknowledge
        has_room = {subscriber: window.has_room(size) for subscriber, window in windows.items()}
        if all(has_room.values()) and (has_acks or self._backlog.has_room(size)):
            if has_acks:
                self._send_to_all_locked(tail, shared_parts)
            else:
                self._send_tracked_locked(tail, size + unwindowed_bytes)
            self._full_path_at = self._bytes + (ACK_INTERVAL_BYTES if has_acks else TRACKING_INTERVAL_BYTES)
            receivers = windows
        else:
            self._full_path_at = 0  # check each message until all have room again
            receivers = {subscriber: window for subscriber, window in windows.items() if has_room[subscriber]}
            for subscriber, window in windows.items():
                if subscriber in receivers:
                    is_shared = shared_parts is not None and subscriber in self._shared_readers()
                    parts = shared_parts if is_shared and shared_parts is not None else tail
                    self._send_parts_locked(self._subscriptions.hellos[subscriber], parts)
                else:
                    window.record_drop()
        for window in receivers.values():
            window.add_sent(self._count, size)
        now = time.monotonic()
        for subscriber, window in windows.items():
            if window.should_request_ack(now, has_room=has_room[subscriber]):
                self._send_parts_locked(self._subscriptions.hellos[subscriber], (self._encode_notice(0),))

    def _send_tracked_locked(self, tail: tuple[Part, ...], size: int) -> None:
        # `size` is the number of bytes since the last tracked message, including this one.
        data = tail[1].buffer if isinstance(tail[1], zmq.Frame) else tail[1]
        frame = zmq.Frame(data, track=True, copy=False, copy_threshold=0)
        self._send_parts_locked(self._topic, (tail[0], frame, *tail[2:]))
        self._backlog.add_sent(frame.tracker, size)

    def _send_parts_locked(self, first_part: bytes, tail: tuple[Part, ...]) -> None:
        # XPUB never blocks: it drops messages for subscribers whose queue is full.
        self.flush_locked()
        send = self._send
        send(first_part, _SNDMORE)
        for part in tail[:-1]:
            send(part, _SNDMORE, len(part) < _MIN_ZERO_COPY_BYTES)
        send(tail[-1], 0, len(tail[-1]) < _MIN_ZERO_COPY_BYTES)

    # ---- subscriptions

    def serve(self, now: float) -> PollState:
        """Send pending messages when due, and read subscriptions."""
        with self._lock:
            if not self.is_closed or self._counts_at_hello:
                self._read_subscriptions_locked()
            wait_s = self._batch.next_check_s(_time_ns())
            if not wait_s:
                self.flush_locked()
                wait_s = self._batch.burst_check_s
            if wait_s:
                return PollState(due=now + wait_s)
            count, self._count_at_check = self._count_at_check, self._count
            # While another thread publishes without reading subscriptions, this thread keeps checking.
            self._is_io_scheduled = self._is_io_scheduled and count != self._count and not self.is_closed
            return PollState(due=now + _IO_CHECK_INTERVAL_S) if self._is_io_scheduled else PollState()

    def _read_subscriptions_locked(self) -> None:
        # Reads until the socket is empty.
        while not self._socket.closed and int(self._socket.getsockopt(_EVENTS)) & _POLLIN:
            frame = self._socket.recv(zmq.DONTWAIT, copy=False)
            hello_bytes = self._subscriptions.handle_event(
                frame.bytes, self._count, partial(RemoteConnection.from_frame, frame)
            )
            # Before the echo: a subscriber that received it must already be counted.
            self.subscribers = len(self._counts_at_hello)
            # a connected subscriber may leave without being reported as missing
            self._expected_ids.difference_update(self._counts_at_hello)
            self.has_subscribers = self._subscriptions.has_subscribers
            self._batch.set_allowed(is_supported=self._subscriptions.all_accept_batches)
            if hello_bytes is not None:
                self._complete_handshake_locked(hello_bytes)
            self._changed.notify_all()
            if self._full_path_at == 0:
                self._notify_drops_locked()

    def _notify_drops_locked(self) -> None:
        for subscriber, window in self._subscriptions.windows.items():
            if window.should_notify():
                self._send_parts_locked(self._subscriptions.hellos[subscriber], (self._encode_notice(0),))

    def _complete_handshake_locked(self, hello_bytes: bytes) -> None:
        # The history, then the echo: from here on the subscriber counts losses.
        for message in self._history:
            self._send_parts_locked(hello_bytes, message)
        if self._history:
            hello = parse_hello(hello_bytes)
            window = self._subscriptions.windows.get(hello.subscriber) if hello is not None else None
            if window is not None:
                window.add_sent(self._count, self._history.size_bytes)
        self._send_parts_locked(hello_bytes, (self._encode_notice(0),))

    def _encode_notice(self, flags: int) -> bytes:
        return pack_header(encode_form(self._codec_number, flags), 0, self._count, time.time_ns(), self._id)

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Unregister, flush for up to `timeout_s` seconds and close the socket. Must be called only once."""
        self._on_close(self, timeout_s)

    def send_bye(self) -> None:
        """Send the bye, after which subscribers read the remaining messages and disconnect."""
        with self._changed:
            self.is_closed = True
            self.flush_locked()
            self._send_bye_locked()

    def finish(self, deadline: float) -> None:
        """Wait until all subscribers have disconnected; log undelivered messages at `deadline`.

        `deadline` is a time of `time.monotonic`.
        """
        with self._changed:
            while self._counts_at_hello and (remaining_s := deadline - time.monotonic()) > 0.0:
                if not wait_until(
                    self._changed, lambda: not self._counts_at_hello, min(remaining_s, _BYE_RETRY_S)
                ):
                    self._send_bye_locked()  # a full queue drops the bye like any other message
            if self._counts_at_hello:
                undelivered_counts = [
                    max(self._count - seen_count, len(self._history))
                    for seen_count in self._counts_at_hello.values()
                ]
                if any(undelivered_counts):  # otherwise only the bye is missing
                    _logger.warning(
                        "'%s' was closed before %d subscriber(s) received everything: "
                        "up to %d messages not delivered",
                        self.spec.topic,
                        sum(map(bool, undelivered_counts)),
                        max(undelivered_counts),
                    )
                self._subscriptions.clear()
                self.subscribers = 0

    def release(self) -> None:
        """Close the socket. The I/O thread must have stopped serving it."""
        with self._changed:
            self.is_closed = True
            if self._subscriptions.shared is not None:
                self._subscriptions.shared.close()
            self._socket.close(0)

    def _send_bye_locked(self) -> None:
        if not self._socket.closed:
            for hello_bytes in self._subscriptions.hellos.values():
                self._send_parts_locked(hello_bytes, (self._encode_notice(BYE),))
            self._read_subscriptions_locked()
