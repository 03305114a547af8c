"""SUB socket and its publishers, which parses messages and notices, and counts losses.

Guarded by its subscriber's lock. Nearly every message directly follows the previous message of its
publisher and takes a fast path; `MessageParser` handles all others.
"""

from __future__ import annotations

import errno
import logging
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import zmq

from nep.backends.base import SubscriberSpec
from nep.backends.zeromq.byte_window import WINDOW_BYTES
from nep.backends.zeromq.loss import PublisherTracker, TrackedPublisher
from nep.backends.zeromq.shared.payloads import SharedSources
from nep.backends.zeromq.sockets import (
    RejectionCounter,
    Socket,
    enable_keep_alive,
    is_remote,
    receive_high_water_mark,
    set_receive_timeout,
)
from nep.errors import DecodeError, WireError
from nep.i18n import _, lazy
from nep.messages.codecs import codec_by_number, codec_for
from nep.messages.message import (
    NO_EXTENSION,
    UNDECODED,
    Message,
    MessageKind,
    message_kind,
    new_message,
    received_message,
)
from nep.protocol.batch import (
    BATCH_FORM_FLAG,
    MAX_BATCH_MESSAGES,
    check_batch,
    parse_entries,
    table_struct,
    unknown_codec_error,
)
from nep.protocol.requests import RemotePublisher
from nep.protocol.wire import (
    BYE,
    EXTENSION,
    HEADER_BYTES,
    LATCHED,
    OFFER,
    SHARED,
    Acknowledgement,
    Header,
    OfferAcceptance,
    acceptance_part,
    acknowledgement_part,
    encode_form,
    hello_part,
    parse_remaining_parts,
    read_header,
    split_single_part,
    topic_part,
    unpack_header,
    unpack_header_at,
)
from nep.system.addresses import is_endpoint

MessageBuffer = list[Message] | deque[Message]
"""Container to which received messages are appended."""

_MIN_ZERO_COPY_BYTES = 8_192
"""Minimum size in bytes of messages that libzmq receives into separate memory, which views can reference."""
SHARED_FORM = SHARED << 16
_Part = bytes | memoryview
_DecodedRun = tuple[MessageKind, int, int, tuple[int, ...], Sequence[bytes]]
"""Messages with decoded payloads.

The items are the kind, the publisher's id, the first sequence number, the time stamps and the encoded
payloads.
"""

_logger = logging.getLogger("nep")
_DONTWAIT = int(zmq.DONTWAIT)  # plain ints: looking up pyzmq's enum members costs as much as the call
_EVENTS = int(zmq.EVENTS)
_RCVMORE = int(zmq.RCVMORE)
_POLLIN = int(zmq.POLLIN)
_INCOMPLETE_MESSAGE_TEXT = lazy("a message must have 3 or 4 parts, but this one is incomplete")


class MessageParser:
    """Parser for messages and notices outside the fast path. Performs no I/O.

    Args:
        spec: Settings of the subscriber.
        hello: Hello filter of the subscriber.
        sources: Publishers; updated by the parser.
        disconnect: Ends the connection to the publisher with this id.
        acknowledge: Sends an acknowledgement; called with the publisher id and the newest sequence number.
        shared: Readers of shared memory, or None.
    """

    def __init__(
        self,
        spec: SubscriberSpec,
        hello: bytes,
        sources: PublisherTracker,
        disconnect: Callable[[int], None],
        acknowledge: Callable[[int, int], None],
        shared: SharedSources | None = None,
    ) -> None:
        self._topic_name = spec.topic
        self._msg_type = spec.msg_type
        self._topic = topic_part(spec.topic)
        self._hello = hello
        self._sources = sources
        self._disconnect = disconnect
        self._acknowledge = acknowledge
        self._shared = shared

    def parse(self, first: bytes, tail: Sequence[_Part]) -> Message | None:
        """Return the message in these parts; None for notices and duplicates.

        Args:
            first: First part: a topic, a hello, or a whole message of one part.
            tail: Remaining parts.

        Raises:
            WireError: The message is malformed.
        """
        is_alone = first == self._hello
        is_one_part = not tail and first.startswith(self._topic)
        if is_one_part:
            first, *tail = split_single_part(first)
        if not is_alone and first != self._topic:
            raise _topic_error()
        if is_alone and len(tail) == 1:
            self._handle_notice(read_header(bytes(tail[0])))
            return None
        return self._parse_message(*parse_remaining_parts(tail, is_one_part=is_one_part), is_alone=is_alone)

    def parse_batch(self, first: bytes) -> list[Message]:
        """Return the messages of a batch, given as one part. Raises `WireError` if the batch is malformed.

        Messages that the subscriber must not deliver are left out, such as those before the handshake.
        """
        topic, header_part, body = split_single_part(first)
        if topic != self._topic:
            raise _topic_error()
        header, _payload, _extension = parse_remaining_parts((header_part, body), is_one_part=True)
        check_batch(header, body)
        single_header = header._replace(flags=0)
        messages = (
            self._parse_message(
                single_header._replace(seq=header.seq + each.number, stamp_ns=each.stamp_ns),
                body[each.begin : each.end],
                NO_EXTENSION,
                is_alone=False,
            )
            for each in parse_entries(body)
        )
        return [each for each in messages if each is not None]

    def _handle_notice(self, header: Header) -> None:
        source = self._sources.get(header.publisher)
        last = source.last
        is_gap_accepted = self._sources.advance_to(header.publisher, header.seq)
        if header.flags & BYE:
            self._disconnect(header.publisher)
        elif header.flags & OFFER:
            if self._shared is not None:
                self._shared.open(header.publisher, header.size)
        elif source.has_echoed:
            self._acknowledge(header.publisher, header.seq)
        else:
            source.has_echoed = True
        if not is_gap_accepted:
            raise WireError(
                _("the sequence number jumps from {last} to {seq}").format(last=last, seq=header.seq),
                code="seq-leap",
            )

    def _parse_message(
        self, header: Header, payload: _Part, extension: Mapping[str, object], *, is_alone: bool
    ) -> Message | None:
        codec = codec_by_number(header.codec)
        if codec is None:
            raise unknown_codec_error(header.codec)
        if not is_alone and self._sources.is_early(header.publisher):
            return None
        if not self._sources.count_message(header.publisher, header.seq, is_alone=is_alone):
            return None
        shared_payload: bytes | memoryview | None = None
        if header.flags & SHARED:
            if self._shared is None:
                raise WireError(
                    _("the payload is in shared memory that no publisher has offered"), code="shared-memory"
                )
            shared_payload = self._shared.read(header.publisher, payload, may_copy=codec.name == "bytes")
            if shared_payload is None:
                self._sources.count_dropped(1)
                return None
        source = self._sources.get(header.publisher)
        msg_type = self._msg_type if source.remote is None else source.remote.publisher.msg_type
        source.kind = message_kind(
            self._topic_name,
            codec.name,
            msg_type,
            is_latched=bool(header.flags & LATCHED),
            clock=source.clock,
        )
        # `kind` depends on both forms: a message with another codec takes the careful path again
        plain_form = 0 if header.flags & EXTENSION else encode_form(header.codec, header.flags & ~SHARED)
        if header.flags & SHARED:
            source.shared_form = plain_form and plain_form | SHARED_FORM
            source.form = source.form if source.form == plain_form else 0
        else:
            source.form = plain_form
            source.shared_form = source.shared_form if source.shared_form == plain_form | SHARED_FORM else 0
        if shared_payload is not None:
            return received_message(
                source.kind, shared_payload, header.stamp_ns, header.seq, header.publisher, extension
            )
        # a small view must not keep a large receive buffer alive
        is_large = len(payload) >= _MIN_ZERO_COPY_BYTES
        data = memoryview(payload).toreadonly() if is_large else bytes(payload)
        return received_message(source.kind, data, header.stamp_ns, header.seq, header.publisher, extension)


def _topic_error() -> WireError:
    return WireError(_("a message doesn't begin with its topic"), code="first-part")


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
        self.payloads: deque[Any] = deque()
        """Decoded payloads. See `nep.backends.base.SupportsPayloads`."""
        self.wants_payloads = False
        self._decoded_run: _DecodedRun | None = None
        self._payload_offset = self._topic_length + HEADER_BYTES
        """Offset of the payload in a message of one part."""
        # sizes at which a payload can't be told apart from the first part of the next message
        self._ambiguous_sizes = frozenset({0, len(self._topic), len(self._hello)})
        set_receive_timeout(socket)
        socket.setsockopt(zmq.RCVHWM, receive_high_water_mark(codec_for(spec.msg_type).name))
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

    def read_into(
        self,
        buffer: MessageBuffer,
        max_messages: int,
        max_bytes: int,
        *,
        may_wait: bool = False,
        first: bytes | None = None,
    ) -> int:
        """Read messages until the socket is empty or a limit is reached; return their number.

        Batches are always read completely. Notices are processed but not counted. The fast path for
        messages of one part is inlined here.

        Args:
            buffer: Container to which messages are appended.
            max_messages: Maximum number of messages.
            max_bytes: Maximum number of bytes.
            may_wait: True to wait up to `SHORT_WAIT_S` for the first message.
            first: First part of the next message, if it was already read.
        """
        recv, topic, find, append = self._recv, self._topic, self.sources.by_id.get, buffer.append
        header_offset, payload_offset = self._topic_length, self._payload_offset
        count, counted_earlier, flags = 0, 0, 0 if may_wait else _DONTWAIT
        try:
            while count < max_messages and max_bytes > 0:
                if first is None:
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
        if self.wants_payloads and not self.payloads and not buffer:
            raws = [first[offset : (offset := offset + size)] for size in sizes]
            if self._read_payloads(source, seq, publisher, numbers[count + 1 :], raws, buffer):
                return count, count
            offset = payload_offset + table.size
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

    def _read_payloads(
        self,
        source: TrackedPublisher,
        seq: int,
        publisher: int,
        stamps_ns: tuple[int, ...],
        raws: Sequence[bytes],
        buffer: MessageBuffer,
    ) -> bool:
        # Decodes all but the first message of a batch. Returns False if a payload can't be decoded.
        kind = source.kind
        decode = kind.decode
        try:
            self.payloads.extend([decode(raw, NO_EXTENSION) for raw in raws[1:]])
        except DecodeError:
            return False
        buffer.append(received_message(kind, raws[0], stamps_ns[0], seq, publisher))
        source.last = seq + len(raws) - 1
        self._decoded_run = kind, publisher, seq, stamps_ns, raws
        return True

    def restore(self, buffer: deque[Message]) -> None:
        """Convert the remaining payloads back to messages and insert them at the front of `buffer`."""
        if self._decoded_run is None:
            return
        kind, publisher, first_seq, stamps_ns, raws = self._decoded_run
        index = len(raws)
        while True:
            try:
                payload = self.payloads.pop()  # from the right: other threads take from the left
            except IndexError:
                return
            index -= 1
            message = received_message(kind, raws[index], stamps_ns[index], first_seq + index, publisher)
            message.decoded = payload
            buffer.appendleft(message)

    def _read_shared(self, first: bytes) -> Message | None:
        # Fast path for shared memory. Returns None to continue on the careful path.
        form, size, seq, stamp_ns, publisher = unpack_header_at(first, self._topic_length)
        source = self.sources.by_id.get(publisher)
        if (
            not source
            or source.last != seq - 1
            or source.shared_form != form
            or len(first) != self._payload_offset + size
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

    def read(self, overflow: MessageBuffer, *, may_wait: bool = False) -> Message | None:
        """Return the next message, or None if the socket is empty.

        The fast path of `read_into` is repeated here, because calling it would take a third longer in
        programs that read single messages.

        Args:
            overflow: Container to which further messages of the same batch are appended.
            may_wait: True to wait up to `SHORT_WAIT_S` for a message.
        """
        if not may_wait and not int(self._socket.getsockopt(_EVENTS)) & _POLLIN:
            return None  # the common case: raising `zmq.Again` is ten times slower
        try:
            first = self._recv(0 if may_wait else _DONTWAIT)
        except zmq.Again:
            return None
        if len(first) >= self._payload_offset and first.startswith(self._topic):
            form, size, seq, stamp_ns, publisher = unpack_header_at(first, self._topic_length)
            source = self.sources.by_id.get(publisher)
            raw = first[self._payload_offset :]
            if source and source.form == form and source.last == seq - 1 and len(raw) == size:
                self.sources.received += 1
                message = new_message(Message)
                message.kind, message.raw = source.kind, raw
                message.stamp_ns = stamp_ns
                message.seq = source.last = seq
                message.publisher, message.extension = publisher, NO_EXTENSION
                message.decoded = UNDECODED
                return message
        buffer: deque[Message] = deque()
        if not self.read_into(buffer, 1, 1, first=first):
            return None
        message = buffer.popleft()
        overflow.extend(buffer)
        return message

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
                    data = recv(_DONTWAIT, size < _MIN_ZERO_COPY_BYTES)
                    if len(data) == size:
                        self.sources.received += 1
                        source.last = seq
                        raw = data if size < _MIN_ZERO_COPY_BYTES else memoryview(data).toreadonly()
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
