"""Parser of messages and notices of the native wire, which counts losses. Performs no I/O."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from nep.backends.base import SubscriberSpec
from nep.backends.bases.loss import PublisherTracker
from nep.errors import WireError
from nep.i18n import _
from nep.messages.codecs import codec_by_number
from nep.messages.message import (
    NO_EXTENSION,
    Message,
    message_kind,
    received_message,
)
from nep.protocol.batch import (
    check_batch,
    parse_entries,
    unknown_codec_error,
)
from nep.protocol.wire import (
    BYE,
    EXTENSION,
    LATCHED,
    OFFER,
    SHARED,
    Header,
    encode_form,
    parse_remaining_parts,
    read_header,
    split_single_part,
    topic_part,
)

MessageBuffer = list[Message] | deque[Message]
"""Container to which received messages are appended."""
MIN_VIEW_BYTES = 8_192
"""Minimum size in bytes of payloads passed on as views, because their memory is separate."""
SHARED_FORM = SHARED << 16
_Part = bytes | memoryview


class SharedPayloadReader(Protocol):
    """Interface of the shared memory of publishers to the parser."""

    def open(self, publisher: int, generation: int) -> None:
        """Open the memory that a publisher offers."""

    def read(self, publisher: int, part: _Part, *, may_copy: bool = False) -> _Part | None:
        """Return the payload that a message's part refers to, or None if it is no longer available."""


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
        shared: SharedPayloadReader | None = None,
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
        is_large = len(payload) >= MIN_VIEW_BYTES
        data = memoryview(payload).toreadonly() if is_large else bytes(payload)
        return received_message(source.kind, data, header.stamp_ns, header.seq, header.publisher, extension)


def _topic_error() -> WireError:
    return WireError(_("a message doesn't begin with its topic"), code="first-part")
