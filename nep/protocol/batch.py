"""Batches: several small messages of one publisher in one part. Pure functions; see `docs/wire.md`.

The topic and the header are followed by the number of messages (u32), their sizes (u32 each), their
time stamps (u64 each) and their payloads. The header has the flag `BATCH`, the sequence number of the
first message (the others follow consecutively), and the size of everything after the header.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from nep.errors import WireError
from nep.i18n import _
from nep.messages.codecs import codec_by_number
from nep.protocol.wire import BATCH, Header, ParsedMessage, pack_header, split

__all__ = [
    "BATCH",
    "BATCH_FORM_FLAG",
    "MAX_BATCH_MESSAGES",
    "BatchEntry",
    "check_batch",
    "encode_batch",
    "parse_entries",
    "parse_parts",
    "table_struct",
    "unknown_codec_error",
]

BATCH_FORM_FLAG = BATCH << 16
"""Flag `BATCH`, shifted to its position in the result of `encode_form`."""
MAX_BATCH_MESSAGES = 256
"""Maximum number of messages in a batch; larger batches are rejected."""
_COUNT = struct.Struct("<I")


class BatchEntry(NamedTuple):
    """Position of a message in a batch.

    Attributes:
        number: Index of the message.
        stamp_ns: Time stamp of the message.
        begin: Offset of the payload in the body.
        end: Offset of the end of the payload.
    """

    number: int
    stamp_ns: int
    begin: int
    end: int


@cache
def table_struct(count: int) -> struct.Struct:
    """Return the binary layout of a batch's table: number of messages, their sizes, their time stamps."""
    return struct.Struct(f"<I{count}I{count}Q")


def encode_batch(
    topic: bytes,
    form: int,
    seq: int,
    publisher: int,
    stamps_ns: Sequence[int],
    payloads: Sequence[bytes],
) -> bytes:
    """Encode a batch as one part.

    Args:
        topic: Topic part.
        form: Result of `encode_form`, the same for all messages.
        seq: Sequence number of the first message.
        publisher: Id of the publisher.
        stamps_ns: Time stamps of the messages.
        payloads: Payloads of the messages.
    """
    sizes = [*map(len, payloads)]
    count = len(sizes)
    table = table_struct(count).pack(count, *sizes, *stamps_ns)
    header = pack_header(form | BATCH_FORM_FLAG, len(table) + sum(sizes), seq, stamps_ns[0], publisher)
    return b"".join((topic, header, table, *payloads))


def parse_entries(body: bytes) -> list[BatchEntry]:
    """Parse the table of a batch's body. Raises `WireError` if it is invalid or doesn't match the body."""
    count = _COUNT.unpack_from(body)[0] if len(body) >= _COUNT.size else 0
    if not 1 <= count <= MAX_BATCH_MESSAGES:
        raise WireError(
            _("a batch must have 1 to {most} messages, but this one has {count}").format(
                most=MAX_BATCH_MESSAGES, count=count
            ),
            len(body),
            code="batch-count",
        )
    table = table_struct(count)
    if len(body) < table.size:
        raise WireError(_("the table of a batch is incomplete"), len(body), code="batch-table")
    numbers = table.unpack_from(body)
    sizes, stamps = numbers[1 : count + 1], numbers[count + 1 :]
    if table.size + sum(sizes) != len(body):
        reason = _("the sizes in a batch don't match its messages")
        raise WireError(reason, len(body), code="batch-sizes")
    entries, offset = [], table.size
    for number, (size, stamp_ns) in enumerate(zip(sizes, stamps, strict=True)):
        entries.append(BatchEntry(number, stamp_ns, offset, offset + size))
        offset += size
    return entries


def check_batch(header: Header, body: bytes) -> None:
    """Raise `WireError` unless the flags and size in a batch's header match its body."""
    if header.flags != BATCH:
        raise WireError(_("a batch must be one part without other flags"), len(body), code="batch-form")
    if header.size != len(body):
        raise WireError(
            _("the header declares {size} bytes, but the payload has {payload}").format(
                size=header.size, payload=len(body)
            ),
            len(body),
            code="payload-size",
        )


def parse_parts(parts: Sequence[bytes | memoryview]) -> list[ParsedMessage]:
    """Parse a message or batch; return its messages.

    Raises:
        WireError: The parts violate the specification. The rules are checked in the order of docs/wire.md.
    """
    message = split(parts)
    messages = [message] if not message.header.flags & BATCH else _split_batch(message)
    if codec_by_number(message.header.codec) is None:
        raise unknown_codec_error(message.header.codec)
    return messages


def _split_batch(message: ParsedMessage) -> list[ParsedMessage]:
    body = bytes(message.payload)
    check_batch(message.header, body)
    return [
        message._replace(
            header=message.header._replace(
                flags=0,
                seq=message.header.seq + each.number,
                stamp_ns=each.stamp_ns,
                size=each.end - each.begin,
            ),
            payload=body[each.begin : each.end],
        )
        for each in parse_entries(body)
    ]


def unknown_codec_error(number: int) -> WireError:
    """Return the error for a message with an unknown codec number."""
    return WireError(
        _("unknown codec {codec}; update nep, or register the codec in this program").format(codec=number),
        code="codec",
    )
