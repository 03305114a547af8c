r"""Native wire format of messages. Pure functions; specification: `docs/wire.md`.

A message has three or four parts: topic and `\0`, a header of 32 bytes, the payload, and a msgpack map
if the header has the flag EXTENSION. Small messages combine the first three parts in one, for
subscribers whose hello announces this ability. Three notices are sent under a subscriber's hello topic
`\xffhello/<subscriber id>/<topic>`: *echo* (topic and header: the subscriber's messages are counted
from here), *bye* (echo with the flag BYE: the last message was sent) and messages for this subscriber
only (all parts).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from nep.errors import BadNameError, BadTopicError, WireError
from nep.i18n import _
from nep.messages.nesting import is_packed_too_deep, too_deep_reason
from nep.messages.packing import pack, unpack
from nep.text import first_control

VERSION = 1
HEADER_BYTES = 32
MAX_TOPIC_BYTES = 200
MAX_NODE_NAME_BYTES = 200
MAX_SUBSCRIPTION_BYTES = 4096
"""Maximum size of a subscription in bytes; a peer that sends more is disconnected.

libzmq needs 40 bytes of memory for each byte of a subscription.
"""

LATCHED = 1
"""Flag: the topic is latched, so the publisher sends its newest message to later subscribers."""
EXTENSION = 2
"""Flag: a fourth part follows, a msgpack map."""
BYE = 4
"""Flag of a notice: the publisher is closing and has sent everything."""
BATCH = 8
"""Flag: the part contains several messages. Sent only to subscribers with hello level 3."""
SHARED = 16
"""Flag: the payload is in shared memory; the message contains its number (u64) instead."""
OFFER = 32
"""Flag of a notice: an offer of shared memory. The size field of the header is the memory's generation."""

HELLO = b"\xffhello/"
"""Prefix of a hello filter. 0xff sorts after all UTF-8, so the hello filter is set after the topic filter."""
HELLO_ONE_PART = b"\xffhello1/"
"""Prefix of a hello filter, level 1: the subscriber also reads messages of one part."""
HELLO_ACKNOWLEDGES = b"\xffhello2/"
"""Prefix of a hello filter, level 2: the subscriber also acknowledges echoes with the last message read."""
HELLO_BATCHES = b"\xffhello3/"
"""Prefix of a hello filter, level 3: the subscriber also reads batches (`nep.protocol.batch`)."""
_HELLO_PREFIXES = (HELLO_BATCHES, HELLO_ACKNOWLEDGES, HELLO_ONE_PART, HELLO)
ACKNOWLEDGEMENT = b"\xffread/"
"""Prefix of the filter that acknowledges an echo.

The filter is removed immediately after it was set.
"""
ACCEPTANCE = b"\xffshares/"
"""Prefix of the filter that accepts an offer of shared memory.

The filter is removed immediately after it was set.
"""

_ID_PATTERN = re.compile(rb"[0-9a-fA-F]{16}")
"""Pattern of an id; stricter than `int`, which accepts signs and underscores."""
_HEADER = struct.Struct("<BBHIQQQ")  # version, codec, flags, size, seq, stamp_ns, publisher
_FAST_HEADER = struct.Struct("<IIQQQ")  # the first three fields in one
MAX_SIZE = 2**32 - 1


class Header(NamedTuple):
    """Message header, the second part of a message.

    Attributes:
        codec: Code of the codec on the wire.
        flags: Flags.
        seq: Sequence number, counted from 1.
        stamp_ns: Time of publication by the publisher's clock, in nanoseconds since 1970.
        publisher: Id of the publisher.
        size: Size of the payload in bytes; 0 if not stated.
    """

    codec: int
    flags: int
    seq: int
    stamp_ns: int
    publisher: int
    size: int = 0

    def pack(self) -> bytes:
        """Encode the header as 32 bytes, little-endian."""
        return _HEADER.pack(
            VERSION, self.codec, self.flags, self.size, self.seq, self.stamp_ns, self.publisher
        )


def encode_form(codec: int, flags: int) -> int:
    """Return the first four bytes of a header (version, codec, flags) as a number.

    The number is the same for most messages of a publisher, so back ends compute it in advance.
    """
    return VERSION | codec << 8 | flags << 16


pack_header: Callable[[int, int, int, int, int], bytes] = _FAST_HEADER.pack
"""Fast encoder for a header: (form, size, seq, stamp_ns, publisher). Sizes above `MAX_SIZE` are sent as 0."""
unpack_header: Callable[[bytes], tuple[int, int, int, int, int]] = _FAST_HEADER.unpack
"""Fast decoder for a header, without validation: (form, size, seq, stamp_ns, publisher).

Raises `struct.error`.
"""
unpack_header_at: Callable[[bytes, int], tuple[int, int, int, int, int]] = _FAST_HEADER.unpack_from
"""Fast decoder for a header at an offset, like `unpack_header`."""


def check_topic(topic: str) -> str:
    """Validate a topic name and return it: 1 to 200 bytes of UTF-8, no white space, control character or `{`.

    Raises `BadTopicError` with the reason.
    """
    if not isinstance(topic, str):
        raise BadTopicError(str(topic), _("a topic name must be a 'str'"))
    try:
        size = len(topic.encode("utf-8"))
    except UnicodeEncodeError:
        raise BadTopicError(ascii(topic)[1:-1], _("not valid Unicode text")) from None
    if not 1 <= size <= MAX_TOPIC_BYTES:
        raise BadTopicError(
            topic,
            _("the name is {size} bytes; 1 to {most} are allowed").format(size=size, most=MAX_TOPIC_BYTES),
        )
    for letter in topic:
        if letter.isspace() or letter == "{":
            raise BadTopicError(
                topic, _("the character '{ascii}' isn't allowed").format(ascii=ascii(letter)[1:-1])
            )
    if control := first_control(topic):
        raise BadTopicError(topic, _("the character '{control}' isn't allowed").format(control=control))
    return topic


def check_node_name(name: str) -> str:
    """Validate a node name and return it: 1 to 200 bytes of UTF-8 without control characters.

    Raises `BadNameError` with the reason.
    """
    if not isinstance(name, str):
        raise BadNameError(str(name), _("a node name must be a 'str'"))
    if control := first_control(name):
        raise BadNameError(name, _("the character '{control}' isn't allowed").format(control=control))
    size = len(name.encode("utf-8"))
    if not 1 <= size <= MAX_NODE_NAME_BYTES:
        raise BadNameError(
            name,
            _("the name is {size} bytes; 1 to {most} are allowed").format(
                size=size, most=MAX_NODE_NAME_BYTES
            ),
        )
    return name


def topic_part(topic: str) -> bytes:
    """Return the first part of a topic's messages and the filter of its subscribers: name and zero byte."""
    return topic.encode("utf-8") + b"\0"


class Hello(NamedTuple):
    """Parsed hello filter of a subscriber.

    Attributes:
        subscriber: Id of the subscriber.
        topic: Name of the topic.
        reads_one_part: True if the subscriber reads messages of one part.
        acknowledges_echoes: True if the subscriber acknowledges echoes.
        reads_batches: True if the subscriber reads batches.
    """

    subscriber: int
    topic: str
    reads_one_part: bool
    acknowledges_echoes: bool = False
    reads_batches: bool = False


class Acknowledgement(NamedTuple):
    """Parsed acknowledgement of a subscriber.

    Attributes:
        subscriber: Id of the subscriber.
        publisher: Id of the publisher.
        seq: Sequence number of the last message read.
        bound_bytes: Maximum size of unacknowledged messages that the subscriber accepts.
    """

    subscriber: int
    publisher: int
    seq: int
    bound_bytes: int


class OfferAcceptance(NamedTuple):
    """Parsed acceptance of a publisher's shared memory.

    Attributes:
        subscriber: Id of the subscriber.
        publisher: Id of the publisher.
        generation: Generation of the memory, as in the offer.
    """

    subscriber: int
    publisher: int
    generation: int


def hello_part(
    subscriber: int,
    topic: str,
    *,
    reads_one_part: bool = False,
    acknowledges_echoes: bool = False,
    reads_batches: bool = False,
) -> bytes:
    """Return the hello filter of a subscriber, which is also the first part of messages addressed to it.

    Each of the three abilities includes the ones before it.

    Args:
        subscriber: Id of the subscriber.
        topic: Name of the topic.
        reads_one_part: True if the subscriber reads messages of one part.
        acknowledges_echoes: True if the subscriber also acknowledges echoes.
        reads_batches: True if the subscriber also reads batches.
    """
    prefix = (
        HELLO_BATCHES
        if reads_batches
        else HELLO_ACKNOWLEDGES
        if acknowledges_echoes
        else HELLO_ONE_PART
        if reads_one_part
        else HELLO
    )
    return prefix + f"{subscriber:016x}/{topic}".encode()


def parse_hello(part: bytes) -> Hello | None:
    """Parse a hello filter; return None for anything else."""
    prefix = next((each for each in _HELLO_PREFIXES if part.startswith(each)), None)
    if prefix is None:
        return None
    digits, slash, topic = part[len(prefix) :].partition(b"/")
    try:
        if not _ID_PATTERN.fullmatch(digits) or not slash:
            return None
        rank = _HELLO_PREFIXES.index(prefix)
        return Hello(int(digits, 16), topic.decode("utf-8"), rank <= 2, rank <= 1, rank == 0)
    except ValueError:
        return None


def acknowledgement_part(acknowledgement: Acknowledgement) -> bytes:
    """Return the filter that acknowledges all messages up to `acknowledgement.seq`."""
    return ACKNOWLEDGEMENT + b"/".join(b"%016x" % number for number in acknowledgement)


def parse_acknowledgement(part: bytes) -> Acknowledgement | None:
    """Parse an acknowledgement; return None for anything else."""
    numbers = _numbers_after(ACKNOWLEDGEMENT, part, 4)
    return None if numbers is None else Acknowledgement(*numbers)


def acceptance_part(acceptance: OfferAcceptance) -> bytes:
    """Return the filter that accepts an offer of shared memory."""
    return ACCEPTANCE + b"/".join(b"%016x" % number for number in acceptance)


def parse_acceptance(part: bytes) -> OfferAcceptance | None:
    """Parse an acceptance of shared memory; return None for anything else."""
    numbers = _numbers_after(ACCEPTANCE, part, 3)
    return None if numbers is None else OfferAcceptance(*numbers)


def _numbers_after(prefix: bytes, part: bytes, count: int) -> list[int] | None:
    fields = part[len(prefix) :].split(b"/")
    if not part.startswith(prefix) or len(fields) != count or not all(map(_ID_PATTERN.fullmatch, fields)):
        return None
    return [int(each, 16) for each in fields]


def read_header(part: bytes) -> Header:
    """Parse a header. Raises `WireError`, also for an unknown version."""
    if len(part) != HEADER_BYTES:
        raise WireError(
            _("a header must have {size} bytes, but this one has {count}").format(
                size=HEADER_BYTES, count=len(part)
            ),
            len(part),
            code="header-size",
        )
    version, codec, flags, size, seq, stamp_ns, publisher = _HEADER.unpack(part)
    if version != VERSION:
        raise WireError(
            _("the message has wire version {version}, but this nep reads version {own}; update nep").format(
                version=version, own=VERSION
            ),
            len(part),
            code="version",
        )
    return Header(codec, flags, seq, stamp_ns, publisher, size)


def extension_part(extension: Mapping[str, object]) -> bytes:
    """Encode an extension part. Raises `WireError` if msgpack can't represent a value."""
    try:
        return pack(dict(extension))
    except ValueError as error:
        reason = _("can't encode the extension as msgpack: {error}").format(error=error)
        raise WireError(reason, code="extension") from error


def read_extension(part: bytes | memoryview) -> Mapping[str, object]:
    """Parse an extension part. Raises `WireError`."""
    try:
        value = unpack(part)
    except ValueError as error:
        reason = _("the extension isn't valid msgpack: {error}").format(error=error)
        raise WireError(reason, len(part), code="extension") from error
    if is_packed_too_deep(part, value):
        raise WireError(too_deep_reason(), len(part), code="extension")
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise WireError(_("the extension isn't a map with string keys"), len(part), code="extension")
    return value


def join(
    topic: str,
    header: Header,
    payload: bytes | memoryview,
    extension: Mapping[str, object] | None = None,
) -> tuple[bytes | memoryview, ...]:
    """Return all parts of a message. The flag EXTENSION is set if `extension` is not empty."""
    if not extension:
        return topic_part(topic), header.pack(), payload
    extended_header = header._replace(flags=header.flags | EXTENSION)
    return topic_part(topic), extended_header.pack(), payload, extension_part(extension)


def split_frame(frame: bytes) -> list[bytes]:
    """Split a frame without a topic into header, payload and, if the message has one, extension.

    Raises `WireError` if the header is malformed or declares more bytes than follow.
    """
    header = read_header(frame[:HEADER_BYTES])
    body = frame[HEADER_BYTES:]
    if not header.flags & EXTENSION:
        return [frame[:HEADER_BYTES], body]
    if header.size > len(body):
        raise WireError(
            _("the header declares {size} bytes, but only {count} follow").format(
                size=header.size, count=len(body)
            ),
            len(frame),
        )
    return [frame[:HEADER_BYTES], body[: header.size], body[header.size :]]


def split_single_part(part: bytes) -> tuple[bytes, bytes, bytes]:
    """Split a message of one part into topic, header and payload.

    Raises `WireError` if the part is too short.
    """
    header_start = part.find(b"\0") + 1
    if not header_start or len(part) < header_start + HEADER_BYTES:
        raise WireError(
            _("a message must have 3 or 4 parts, but this one has 1"), len(part), code="part-count"
        )
    return (
        part[:header_start],
        part[header_start : header_start + HEADER_BYTES],
        part[header_start + HEADER_BYTES :],
    )


class ParsedMessage(NamedTuple):
    """Parsed message: its topic, header, payload and extension."""

    topic: str
    header: Header
    payload: bytes | memoryview
    extension: Mapping[str, object]


def split(parts: Sequence[bytes | memoryview]) -> ParsedMessage:
    """Parse a message. The payload of a batch is its body, which `nep.protocol.batch.parse_parts` splits.

    Raises:
        WireError: The parts violate the specification. The rules are checked in the order of
            docs/wire.md.
    """
    if not parts:
        raise WireError(_("a message must have 3 or 4 parts, but this one has none"), code="part-count")
    first, *remaining_parts = split_single_part(bytes(parts[0])) if len(parts) == 1 else parts
    topic = _parse_topic(bytes(first))
    header, payload, extension = parse_remaining_parts(remaining_parts, is_one_part=len(parts) == 1)
    return ParsedMessage(topic, header, payload, extension)


def parse_remaining_parts(
    remaining_parts: Sequence[bytes | memoryview], *, is_one_part: bool = False
) -> tuple[Header, bytes | memoryview, Mapping[str, object]]:
    """Parse the parts after the first: header, payload and extension. Raises `WireError`.

    The extension is an empty map if the message has none.

    Args:
        remaining_parts: The parts.
        is_one_part: True if the parts were split from one part; only then a batch is allowed.
    """
    if not remaining_parts:
        raise WireError(_("a message must have 3 or 4 parts, but this one has 1"), code="part-count")
    header = read_header(bytes(remaining_parts[0]))
    expected_count, part_count = 4 if header.flags & EXTENSION else 3, len(remaining_parts) + 1
    if part_count not in {3, 4}:
        reason = _("a message must have 3 or 4 parts, but this one has {there}").format(there=part_count)
        raise WireError(reason, code="part-count")
    if part_count != expected_count:
        raise WireError(
            _("the flags require {wanted} parts, but there are {there}").format(
                wanted=expected_count, there=part_count
            ),
            code="part-count",
        )
    if header.flags & BATCH and not (is_one_part and header.flags == BATCH):
        raise WireError(_("a batch must be one part without other flags"), code="batch-form")
    size = len(remaining_parts[1])
    if header.size and header.size != size:
        raise WireError(
            _("the header declares {size} bytes, but the payload has {payload}").format(
                size=header.size, payload=size
            ),
            size,
            code="payload-size",
        )
    return header, remaining_parts[1], read_extension(remaining_parts[2]) if header.flags & EXTENSION else {}


def _parse_topic(part: bytes) -> str:
    try:
        if part[-1:] != b"\0":
            raise WireError(_("the topic doesn't end with a zero byte"), len(part), code="topic-end")
        return check_topic(part[:-1].decode("utf-8"))
    except (UnicodeDecodeError, BadTopicError) as error:
        raise WireError(
            _("invalid topic name: {error}").format(error=error), len(part), code="topic"
        ) from error
