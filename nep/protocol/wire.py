r"""The native wire: parts ↔ messages. Pure functions; the specification is `docs/wire.md`.

A message is three parts, or four: topic and `\0`, a header of 32 bytes, the payload, and a msgpack map when
the header's flag says so. Small ones travel with the first three in one part, to subscribers whose hello says
that they read it. Beside messages three notices travel, all under a subscriber's own hello topic
`\xffhello/<subscriber id>/<topic>`: *echo* (topic and header: "I have seen you; my messages are counted from
here"), *bye* (the same with the flag BYE: "nothing comes after this") and messages for it alone (all parts).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from nep.errors import BadNameError, BadTopicError, WireError
from nep.i18n import _
from nep.messages.nesting import packed_is_too_deep, too_deep
from nep.messages.packing import pack, unpack
from nep.text import control_in

__all__ = [
    "BATCH",
    "BYE",
    "EXTENSION",
    "HEADER_BYTES",
    "LATCHED",
    "OFFER",
    "SHARED",
    "SIZE_MAX",
    "SUBSCRIPTION_MAX_BYTES",
    "VERSION",
    "Header",
    "Hello",
    "Read",
    "Shares",
    "apart",
    "check_node_name",
    "check_topic",
    "extension_part",
    "form_of",
    "hello_part",
    "join",
    "pack_quickly",
    "parse_hello",
    "parse_read",
    "parse_shares",
    "read_extension",
    "read_header",
    "read_part",
    "shares_part",
    "split",
    "split_rest",
    "topic_part",
    "unpack_at",
    "unpack_quickly",
]

VERSION = 1
HEADER_BYTES = 32
TOPIC_MAX_BYTES = 200
NODE_NAME_MAX_BYTES = 200
SUBSCRIPTION_MAX_BYTES = 4096
"""Whoever subscribes more is disconnected: libzmq keeps some forty bytes for each of them."""

LATCHED = 1
"""Flag: the publisher keeps this message and sends it to whoever comes late."""
EXTENSION = 2
"""Flag: a fourth part follows, a msgpack map."""
BYE = 4
"""Flag of a notice: the publisher is closing and has sent everything."""
BATCH = 8
"""Flag: one part has several messages. Sent only to subscribers whose hello has level 3."""
SHARED = 16
"""Flag: the payload lies in memory that publisher and subscriber share; its part is the number, u64."""
OFFER = 32
"""Flag of a notice: payloads may lie in shared memory, of which the header's size says the generation."""

HELLO = b"\xffhello/"
"""How a hello filter starts. 0xff sorts behind all of UTF-8, so it is installed after the topic filter."""
HELLO_ONE = b"\xffhello1/"
"""The same of a subscriber that also reads messages of one part."""
HELLO_TELLS = b"\xffhello2/"
"""The same of one that besides answers every later echo with what it has read."""
HELLO_BATCHES = b"\xffhello3/"
"""The same of one that besides reads batches: see `nep.protocol.batch`."""
_HELLOS = (HELLO_BATCHES, HELLO_TELLS, HELLO_ONE, HELLO)
READ = b"\xffread/"
"""How a filter starts that answers an echo. It is taken back at once."""
SHARES = b"\xffshares/"
"""How a filter starts that answers an offer. It is taken back at once."""

_HEX = re.compile(rb"[0-9a-fA-F]{16}")
"""`int` would take a sign and underscores, too."""
_HEADER = struct.Struct("<BBHIQQQ")  # version, codec, flags, size, seq, stamp_ns, publisher
_QUICKLY = struct.Struct("<IIQQQ")  # the first three in one
SIZE_MAX = 2**32 - 1


class Header(NamedTuple):
    """The second part. `stamp_ns` is the publisher's clock, `publisher` its id; `seq` counts from 1.

    `size` is that of the payload in bytes, 0 when it is not told.
    """

    codec: int
    flags: int
    seq: int
    stamp_ns: int
    publisher: int
    size: int = 0

    def pack(self) -> bytes:
        """The 32 bytes, little-endian."""
        return _HEADER.pack(
            VERSION, self.codec, self.flags, self.size, self.seq, self.stamp_ns, self.publisher
        )


def form_of(codec: int, flags: int) -> int:
    """The first four bytes of a header of this version, as a number: what many messages have in common."""
    return VERSION | codec << 8 | flags << 16


pack_quickly: Callable[[int, int, int, int, int], bytes] = _QUICKLY.pack
"""The 32 bytes of (form, size, seq, stamp_ns, publisher). A size beyond `SIZE_MAX` is told as 0."""
unpack_quickly: Callable[[bytes], tuple[int, int, int, int, int]] = _QUICKLY.unpack
"""(form, size, seq, stamp_ns, publisher) of a header, unchecked. Raises `struct.error`."""
unpack_at: Callable[[bytes, int], tuple[int, int, int, int, int]] = _QUICKLY.unpack_from
"""The same of a header that begins at an offset."""


def check_topic(topic: str) -> str:
    """`topic` itself when the grammar allows it: 1 to 200 bytes of UTF-8, no white space, control or `{`.

    Raises `BadTopicError` with the reason.
    """
    if not isinstance(topic, str):
        raise BadTopicError(str(topic), _("a topic is a 'str'"))
    try:
        size = len(topic.encode("utf-8"))
    except UnicodeEncodeError:
        raise BadTopicError(ascii(topic), _("it is no Unicode text")) from None
    if not 1 <= size <= TOPIC_MAX_BYTES:
        raise BadTopicError(
            topic, _("it has {size} bytes, 1 to {most} are allowed").format(size=size, most=TOPIC_MAX_BYTES)
        )
    for letter in topic:
        if letter.isspace() or letter == "{":
            raise BadTopicError(
                topic, _("the character '{ascii}' is not allowed in it").format(ascii=ascii(letter)[1:-1])
            )
    if control := control_in(topic):
        raise BadTopicError(
            topic, _("the character '{control}' is not allowed in it").format(control=control)
        )
    return topic


def check_node_name(name: str) -> str:
    """`name` itself when a node may have it: 1 to 200 bytes of UTF-8 and nothing that controls.

    Raises `BadNameError` with the reason.
    """
    if not isinstance(name, str):
        raise BadNameError(str(name), _("a name is a 'str'"))
    if control := control_in(name):
        raise BadNameError(name, _("the character '{control}' is not allowed in it").format(control=control))
    size = len(name.encode("utf-8"))
    if not 1 <= size <= NODE_NAME_MAX_BYTES:
        raise BadNameError(
            name,
            _("it has {size} bytes, 1 to {most} are allowed").format(size=size, most=NODE_NAME_MAX_BYTES),
        )
    return name


def topic_part(topic: str) -> bytes:
    """The first part of a topic's messages, and the filter of its subscribers: the name and a zero byte."""
    return topic.encode("utf-8") + b"\0"


class Hello(NamedTuple):
    """What a hello filter says: who subscribes to what.

    `one_part`: messages may come to it in one part. `tells`: it tells what it has read. `batches`: several
    may come to it in one part.
    """

    subscriber: int
    topic: str
    one_part: bool
    tells: bool = False
    batches: bool = False


class Read(NamedTuple):
    """What a subscriber has read of a publisher: everything up to `seq`. It wants `bound_bytes` under way."""

    subscriber: int
    publisher: int
    seq: int
    bound_bytes: int


class Shares(NamedTuple):
    """A subscriber reads a publisher's memory of this generation from now on."""

    subscriber: int
    publisher: int
    generation: int


def hello_part(
    subscriber: int, topic: str, *, one_part: bool = False, tells: bool = False, batches: bool = False
) -> bytes:
    """The hello filter of a subscriber, and the first part of what is sent to it alone.

    Who reads batches also tells, and who tells also reads messages of one part.
    """
    begin = HELLO_BATCHES if batches else HELLO_TELLS if tells else HELLO_ONE if one_part else HELLO
    return begin + f"{subscriber:016x}/{topic}".encode()


def parse_hello(part: bytes) -> Hello | None:
    """What a hello filter says; None for anything else."""
    begin = next((each for each in _HELLOS if part.startswith(each)), None)
    if begin is None:
        return None
    digits, slash, topic = part[len(begin) :].partition(b"/")
    try:
        if not _HEX.fullmatch(digits) or not slash:
            return None
        rank = _HELLOS.index(begin)
        return Hello(int(digits, 16), topic.decode("utf-8"), rank <= 2, rank <= 1, rank == 0)
    except ValueError:
        return None


def read_part(read: Read) -> bytes:
    """The filter that answers an echo."""
    return READ + b"/".join(b"%016x" % number for number in read)


def parse_read(part: bytes) -> Read | None:
    """What such a filter says; None for anything else."""
    numbers = _numbers_behind(READ, part, 4)
    return None if numbers is None else Read(*numbers)


def shares_part(shares: Shares) -> bytes:
    """The filter that answers an offer."""
    return SHARES + b"/".join(b"%016x" % number for number in shares)


def parse_shares(part: bytes) -> Shares | None:
    """What such a filter says; None for anything else."""
    numbers = _numbers_behind(SHARES, part, 3)
    return None if numbers is None else Shares(*numbers)


def _numbers_behind(begin: bytes, part: bytes, count: int) -> list[int] | None:
    words = part[len(begin) :].split(b"/")
    if not part.startswith(begin) or len(words) != count or not all(map(_HEX.fullmatch, words)):
        return None
    return [int(each, 16) for each in words]


def read_header(part: bytes) -> Header:
    """The header in a second part. Raises `WireError`; an unknown version is named in it."""
    if len(part) != HEADER_BYTES:
        raise WireError(
            _("a header has {size} bytes, this one has {count}").format(size=HEADER_BYTES, count=len(part)),
            len(part),
            code="header-size",
        )
    version, codec, flags, size, seq, stamp_ns, publisher = _HEADER.unpack(part)
    if version != VERSION:
        raise WireError(
            _("its version is {version}, this nep reads version {own}; update nep").format(
                version=version, own=VERSION
            ),
            len(part),
            code="version",
        )
    return Header(codec, flags, seq, stamp_ns, publisher, size)


def extension_part(extension: Mapping[str, object]) -> bytes:
    """The fourth part. Raises `WireError` when a value has no form in msgpack."""
    try:
        return pack(dict(extension))
    except ValueError as error:
        reason = _("can't encode the extension as msgpack: {error}").format(error=error)
        raise WireError(reason, code="extension") from error


def read_extension(part: bytes | memoryview) -> Mapping[str, object]:
    """The map in a fourth part. Raises `WireError`."""
    try:
        value = unpack(part)
    except ValueError as error:
        reason = _("the extension is not valid msgpack: {error}").format(error=error)
        raise WireError(reason, len(part), code="extension") from error
    if packed_is_too_deep(part, value):
        raise WireError(too_deep(), len(part), code="extension")
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise WireError(_("the extension is not a map with string keys"), len(part), code="extension")
    return value


def join(
    topic: str,
    header: Header,
    payload: bytes | memoryview,
    extension: Mapping[str, object] | None = None,
) -> tuple[bytes | memoryview, ...]:
    """All parts of a message; the EXTENSION flag is set here when there is one."""
    if not extension:
        return topic_part(topic), header.pack(), payload
    flagged = header._replace(flags=header.flags | EXTENSION)
    return topic_part(topic), flagged.pack(), payload, extension_part(extension)


def apart(part: bytes) -> tuple[bytes, bytes, bytes]:
    """Topic, header and payload of a message in one part. Raises `WireError` when it is too short."""
    cut = part.find(b"\0") + 1
    if not cut or len(part) < cut + HEADER_BYTES:
        raise WireError(_("a message has 3 or 4 parts, this one has 1"), len(part), code="part-count")
    return part[:cut], part[cut : cut + HEADER_BYTES], part[cut + HEADER_BYTES :]


class Parts(NamedTuple):
    """A message as read from its parts."""

    topic: str
    header: Header
    payload: bytes | memoryview
    extension: Mapping[str, object]


def split(parts: Sequence[bytes | memoryview]) -> Parts:
    """Return the message in `parts`. The body of a batch is its payload: see `nep.protocol.batch.read_parts`.

    Raises:
        WireError: The parts violate the specification; checked in the order of docs/wire.md.
    """
    if not parts:
        raise WireError(_("a message has 3 or 4 parts, this one has none"), code="part-count")
    first, *rest = apart(bytes(parts[0])) if len(parts) == 1 else parts
    topic = _topic_in(bytes(first))
    header, payload, extension = split_rest(rest, is_one_part=len(parts) == 1)
    return Parts(topic, header, payload, extension)


def split_rest(
    rest: Sequence[bytes | memoryview], *, is_one_part: bool = False
) -> tuple[Header, bytes | memoryview, Mapping[str, object]]:
    """Return header, payload and extension from the parts after the first. Raises `WireError`.

    ``is_one_part`` is True if they were split from one part; only then a batch is allowed.
    """
    if not rest:
        raise WireError(_("a message has 3 or 4 parts, this one has 1"), code="part-count")
    header = read_header(bytes(rest[0]))
    wanted, there = 4 if header.flags & EXTENSION else 3, len(rest) + 1
    if there not in {3, 4}:
        reason = _("a message has 3 or 4 parts, this one has {there}").format(there=there)
        raise WireError(reason, code="part-count")
    if there != wanted:
        raise WireError(
            _("the flags require {wanted} parts, but there are {there}").format(wanted=wanted, there=there),
            code="part-count",
        )
    if header.flags & BATCH and not (is_one_part and header.flags == BATCH):
        raise WireError(_("a batch must be one part without other flags"), code="batch-form")
    size = len(rest[1])
    if header.size and header.size != size:
        raise WireError(
            _("the header declares {size} bytes, but the payload has {payload}").format(
                size=header.size, payload=size
            ),
            size,
            code="payload-size",
        )
    return header, rest[1], read_extension(rest[2]) if header.flags & EXTENSION else {}


def _topic_in(part: bytes) -> str:
    """The topic in a first part."""
    try:
        if part[-1:] != b"\0":
            raise WireError(_("its topic does not end with a zero byte"), len(part), code="topic-end")
        return check_topic(part[:-1].decode("utf-8"))
    except (UnicodeDecodeError, BadTopicError) as error:
        raise WireError(_("invalid topic: {error}").format(error=error), len(part), code="topic") from error
