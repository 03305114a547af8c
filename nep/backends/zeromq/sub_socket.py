"""SUB socket and its publishers, which parses messages and notices, and counts losses.

Guarded by its subscriber's lock. Nearly every message directly follows the previous message of its
publisher and takes a fast path; `MessageParser` handles all others.
"""

from __future__ import annotations

import errno
import logging
import time
from collections.abc import Callable
from typing import Any

import zmq

from nep.backends.base import SubscriberSpec
from nep.backends.bases.loss import PublisherTracker, TrackedPublisher
from nep.backends.bases.message_parser import MIN_VIEW_BYTES, SHARED_FORM, MessageBuffer, MessageParser
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.zeromq.byte_window import WINDOW_BYTES
from nep.backends.zeromq.shared.payloads import REFERENCE_BYTES, SharedSources
from nep.backends.zeromq.sockets import (
    Socket,
    enable_keep_alive,
    is_remote,
    receive_high_water_mark,
    set_receive_timeout,
)
from nep.errors import WireError
from nep.i18n import _, lazy
from nep.messages.codecs import codec_for
from nep.messages.message import (
    NO_EXTENSION,
    UNDECODED,
    Message,
    new_message,
    received_message,
)
from nep.protocol.batch import (
    BATCH_FORM_FLAG,
    MAX_BATCH_MESSAGES,
    table_struct,
)
from nep.protocol.requests import RemotePublisher
from nep.protocol.wire import (
    HEADER_BYTES,
    Acknowledgement,
    OfferAcceptance,
    acceptance_part,
    acknowledgement_part,
    hello_part,
    topic_part,
    unpack_header,
    unpack_header_at,
)
from nep.system.addresses import is_endpoint

_Part = bytes | memoryview

_logger = logging.getLogger("nep")
_DONTWAIT = int(zmq.DONTWAIT)  # plain ints: looking up pyzmq's enum members costs as much as the call
_EVENTS = int(zmq.EVENTS)
_RCVMORE = int(zmq.RCVMORE)
_POLLIN = int(zmq.POLLIN)
_INCOMPLETE_MESSAGE_TEXT = lazy("a message must have 3 or 4 parts, but this one is incomplete")


class SubSocket:
    """SUB socket on the native wire.

    The constructor sets the filters before the socket connects or binds, because the filter for the topic
    must precede the hello.
    """

    def __init__(self, socket: Socket, spec: SubscriberSpec) -> None:
        self.sources = PublisherTracker()
        self.rejections = RejectionCounter()
        self.fd = int(socket.getsockopt(zmq.FD))
        self._socket = socket
        self._recv: Callable[..., Any] = socket.recv
        self._topic_name = spec.topic
        self._topic = topic_part(spec.topic)
        self._hello = hello_part(spec.id, spec.topic, reads_batches=True)
        self._id = spec.id
        self._shared = SharedSources(spec.id, self._confirm_offer)
        self._parser = MessageParser(
            spec, self._hello, self.sources, self.disconnect, self._acknowledge, self._shared
        )
        self._topic_length = len(self._topic)
        self._payload_offset = self._topic_length + HEADER_BYTES
        """Offset of the payload in a message of one part."""
        # sizes at which a payload can't be told apart from the first part of the next message
        self._ambiguous_sizes = frozenset({0, len(self._topic), len(self._hello)})
        set_receive_timeout(socket)
        socket.setsockopt(zmq.RCVHWM, receive_high_water_mark(codec_for(spec.msg_type)))
        socket.setsockopt(zmq.SNDHWM, 0)  # libzmq otherwise drops filters beyond 1000 silently
        socket.setsockopt(zmq.SUBSCRIBE, self._topic)
        socket.setsockopt(zmq.SUBSCRIBE, self._hello)

    @property
    def received(self) -> int:
        """Number of messages received."""
        return self.sources.received

    @property
    def lost(self) -> int:
        """Number of messages lost."""
        return self.sources.lost

    @property
    def has_input(self) -> bool:
        """True if a message can be read. Reading this property also processes connects and disconnects."""
        return bool(int(self._socket.getsockopt(_EVENTS)) & _POLLIN)

    def connect(self, remote: RemotePublisher) -> None:
        """Connect to a publisher. Silent publishers that `remote` replaces are removed later. Idempotent."""
        endpoint = remote.publisher.endpoints[0] if remote.publisher.endpoints else ""
        self._disconnect_replaced(remote, endpoint)
        source = self.sources.add_listed(remote)
        source.form = 0  # its message type may have changed
        source.is_silent = False
        source.bye_deadline = None
        if endpoint and endpoint not in (source.endpoint, source.failed_endpoint):
            source.failed_endpoint = source.problem = ""
            if is_endpoint(endpoint):
                self._connect(source, endpoint)
            else:
                is_nanomsg = endpoint.startswith("nanomsg://")
                self._report_problem(
                    source,
                    endpoint,
                    _("the endpoint belongs to 'nanomsg'") if is_nanomsg else _("not a valid endpoint"),
                )

    def _disconnect_replaced(self, remote: RemotePublisher, endpoint: str) -> None:
        # Removes silent publishers once their last messages are read; at once if their endpoint is reused.
        for replaced in self.sources.replaced_publishers(remote):
            self.sources.mark_closing(replaced, 0, time.monotonic())
        existing = self.sources.find(remote.publisher.id)
        if not endpoint or (existing is not None and existing.endpoint == endpoint):
            return
        for replaced, source in self.sources.items():
            if source.endpoint == endpoint:
                self.sources.count_missing(replaced)
                self.disconnect(replaced)

    def _connect(self, source: TrackedPublisher, endpoint: str) -> None:
        if source.endpoint:  # its computer has a new address, or its master has restarted
            self._disconnect(source.endpoint)
        source.reset_connection(endpoint)
        try:
            enable_keep_alive(self._socket, endpoint)
            self._socket.connect(endpoint)
        except zmq.ZMQError as error:
            self._report_problem(source, endpoint, str(error))
        else:
            source.endpoint = endpoint

    def reconnect_remote(self) -> None:
        """Reconnect to publishers on other computers, which discards their unread messages."""
        for source in self.sources.by_id.values():
            if is_remote(source.endpoint):
                self._connect(source, source.endpoint)

    def reconnect(self, publisher: int) -> None:
        """Disconnect from the endpoint of a known publisher and connect to it again."""
        source = self.sources.get(publisher)
        self._connect(source, source.endpoint)

    def _report_problem(self, source: TrackedPublisher, endpoint: str, reason: str) -> None:
        # An invalid endpoint is reported, not raised: it must not affect other publishers.
        name = source.remote.node_name if source.remote is not None else ""
        shown_endpoint = ascii(endpoint[:100])[1:-1]
        source.failed_endpoint = endpoint
        source.problem = _("can't connect to the endpoint '{shown}' of '{name}': {why}").format(
            shown=shown_endpoint, name=name, why=reason
        )
        if self.rejections.add(source.problem):
            _logger.warning("subscription to '%s': %s", self._topic_name, source.problem)

    @property
    def problem(self) -> str:
        """Reason why messages of a listed publisher can't be received; "" if there is none."""
        problem_sources = (
            each for each in self.sources.by_id.values() if each.problem and not each.is_silent
        )
        return next((each.problem for each in problem_sources), "")

    def disconnect(self, publisher: int) -> None:
        """Disconnect from a publisher and remove it."""
        source = self.sources.pop(publisher)
        self._shared.close_publisher(publisher)
        if source is not None and source.endpoint:
            self._disconnect(source.endpoint)

    def _acknowledge(self, publisher: int, seq: int) -> None:
        # Acknowledges `seq` to a publisher, and assigns it a share of the receive window.
        window_bytes = WINDOW_BYTES // max(1, self.sources.echo_count)
        self._send_filter(acknowledgement_part(Acknowledgement(self._id, publisher, seq, window_bytes)))

    def _confirm_offer(self, acceptance: OfferAcceptance) -> None:
        self._send_filter(acceptance_part(acceptance))

    def _send_filter(self, filter_part: bytes) -> None:
        # Reaches all publishers, as a filter that is set and removed at once.
        self._socket.setsockopt(zmq.SUBSCRIBE, filter_part)
        self._socket.setsockopt(zmq.UNSUBSCRIBE, filter_part)

    def _has_more(self) -> bool:
        return bool(self._socket.getsockopt(_RCVMORE))

    def _disconnect(self, endpoint: str) -> None:
        try:
            self._socket.disconnect(endpoint)
        except zmq.ZMQError as error:
            if error.errno != errno.ENOENT:  # not connected any more
                raise

    def read_into(  # noqa: PLR0915 - inlined, because it runs for every message
        self,
        buffer: MessageBuffer,
        max_messages: int,
        max_bytes: int,
        *,
        may_wait: bool = False,
    ) -> int:
        """Read messages until the socket is empty or a limit is reached; return their number.

        Batches are always read completely. Notices are processed but not counted. The fast path for
        messages of one part is inlined here.

        Args:
            buffer: Container to which messages are appended.
            max_messages: Maximum number of messages.
            max_bytes: Maximum number of bytes.
            may_wait: True to wait up to `SHORT_WAIT_S` for the first message.
        """
        if not may_wait and not self.has_input:
            return 0  # the common case: raising `zmq.Again` is ten times slower
        first: bytes | None = None
        recv, topic, find, append = self._recv, self._topic, self.sources.by_id.get, buffer.append
        header_offset, payload_offset = self._topic_length, self._payload_offset
        count, counted_earlier, flags = 0, 0, 0 if may_wait else _DONTWAIT
        try:
            while count < max_messages and max_bytes > 0:
                if first is None:
                    if count == 1 and not self.has_input:
                        break  # see above; a longer burst seldom ends
                    first = recv(flags)
                    flags = _DONTWAIT  # all parts of a message are available with its first one
                if len(first) >= payload_offset and first.startswith(topic):
                    form, size, seq, stamp_ns, publisher = unpack_header_at(first, header_offset)
                    source = find(publisher)
                    if (
                        source
                        and source.form == form
                        and source.last == seq - 1
                        and len(first) == payload_offset + size
                    ):
                        message = new_message(Message)
                        message.kind, message.raw = source.kind, first[payload_offset:]
                        message.stamp_ns = stamp_ns
                        message.seq = source.last = seq
                        message.publisher, message.extension = publisher, NO_EXTENSION
                        message.decoded = UNDECODED
                        append(message)
                        count += 1
                        max_bytes -= size
                        first = None
                        continue
                    if form & BATCH_FORM_FLAG:
                        read_count, uncounted = self._read_batch(first, buffer)
                        # a rejected batch returns 0, so the caller waits as for an empty socket
                        count, counted_earlier, max_bytes, first = (
                            count + read_count,
                            counted_earlier + read_count - uncounted,
                            max_bytes - (len(first) if read_count else 0),
                            None,
                        )
                        continue
                    parsed = self._read_shared(first) if form & SHARED_FORM else None
                else:
                    parsed = None
                first, parsed = (None, parsed) if parsed is not None else self._read_parts(first)
                if parsed is not None:
                    append(parsed)
                    count += 1
                    counted_earlier += 1
                    max_bytes -= parsed.size_bytes
        except zmq.Again:
            pass  # the socket is empty
        self.sources.received += count - counted_earlier
        return count

    def _read_batch(self, first: bytes, buffer: MessageBuffer) -> tuple[int, int]:
        # Returns the number of messages, and how many of them aren't counted yet.
        payload_offset = self._payload_offset
        form, size, seq, _stamp_ns, publisher = unpack_header_at(first, self._topic_length)
        source = self.sources.by_id.get(publisher)
        count = int.from_bytes(first[payload_offset : payload_offset + 4], "little")
        is_next = source and source.last == seq - 1 and source.form | BATCH_FORM_FLAG == form
        if not (
            source and is_next and 0 < count <= MAX_BATCH_MESSAGES and len(first) == payload_offset + size
        ):
            return self._read_any_batch(first, buffer)
        table = table_struct(count)
        offset = payload_offset + table.size
        if offset > len(first):
            return self._read_any_batch(first, buffer)
        numbers = table.unpack_from(first, payload_offset)
        sizes = numbers[1 : count + 1]
        if offset + sum(sizes) != len(first):
            return self._read_any_batch(first, buffer)
        kind, append = source.kind, buffer.append
        for size, stamp_ns in zip(sizes, numbers[count + 1 :], strict=True):
            message = new_message(Message)
            message.kind, message.raw = kind, first[offset : (offset := offset + size)]
            message.stamp_ns = stamp_ns
            message.seq = seq
            message.publisher, message.extension = publisher, NO_EXTENSION
            message.decoded = UNDECODED
            append(message)
            seq += 1
        source.last = seq - 1
        return count, count

    def _read_shared(self, first: bytes) -> Message | None:
        # Fast path for shared memory. Returns None to continue on the careful path.
        form, size, seq, stamp_ns, publisher = unpack_header_at(first, self._topic_length)
        source = self.sources.by_id.get(publisher)
        if (
            not source
            or source.last != seq - 1
            or source.shared_form != form
            or len(first) != self._payload_offset + size
            or size != REFERENCE_BYTES
        ):
            return None
        data = self._shared.read(
            publisher, first[self._payload_offset :], may_copy=source.kind.codec == "bytes"
        )
        if data is None:
            return None
        self.sources.received += 1
        source.last = seq
        return received_message(source.kind, data, stamp_ns, seq, publisher)

    def _read_any_batch(self, first: bytes, buffer: MessageBuffer) -> tuple[int, int]:
        if self._has_more():
            self._parse_parts(first)
            return 0, 0
        try:
            messages = self._parser.parse_batch(first)
        except WireError as error:
            self.rejections.add(error.reason)
            return 0, 0
        buffer.extend(messages)
        return len(messages), 0

    def _read_parts(self, first: bytes) -> tuple[bytes | None, Message | None]:
        # Asking pyzmq whether a part is the last takes longer than receiving it, so this assumes three parts,
        # see `_parse_parts`.
        if first != self._topic:
            return self._parse_parts(first)
        recv, data = self._recv, None
        try:
            header = recv(_DONTWAIT)
            if len(header) == HEADER_BYTES:
                form, size, seq, stamp_ns, publisher = unpack_header(header)
                source = self.sources.by_id.get(publisher)
                if (
                    source
                    and source.form == form
                    and source.last == seq - 1
                    and size not in self._ambiguous_sizes
                ):
                    data = recv(_DONTWAIT, size < MIN_VIEW_BYTES)
                    if len(data) == size:
                        self.sources.received += 1
                        source.last = seq
                        raw = data if size < MIN_VIEW_BYTES else memoryview(data).toreadonly()
                        return None, received_message(source.kind, raw, stamp_ns, seq, publisher)
        except zmq.Again:
            self.rejections.add(_(_INCOMPLETE_MESSAGE_TEXT))
            return None, None
        return self._parse_parts(first, header, data)

    def _parse_parts(
        self, first: bytes, *received: bytes | zmq.Frame | None
    ) -> tuple[bytes | None, Message | None]:
        # If a message has fewer than three parts, the last part in `received` is already the first of the
        # next message. It then begins with the topic or the hello, unlike a header, and is returned.
        received_parts = [each for each in received if each is not None]
        tail: list[_Part] = [each.buffer if isinstance(each, zmq.Frame) else each for each in received_parts]
        if tail and bytes(tail[-1][: len(self._hello)]).startswith((self._topic, self._hello)):
            next_first_part = bytes(tail.pop())
            self.rejections.add(
                _("a message must have 3 or 4 parts, but this one has {count}").format(count=len(tail) + 1)
            )
            return next_first_part, None
        has_more = self._has_more()
        while has_more:
            frame = self._recv(_DONTWAIT, False)
            tail.append(frame.buffer)
            has_more = frame.more
        try:
            return None, self._parser.parse(first, tail)
        except WireError as error:
            self.rejections.add(error.reason)
            return None, None

    def count_dropped(self, count: int) -> None:
        """Add received messages that were dropped from a full queue to the losses."""
        self.sources.count_dropped(count)

    def close(self) -> None:
        """Close the socket."""
        self._shared.close()
        self._socket.close(0)
