"""A batch: several small messages of one publisher in one part. Pure functions; see `docs/wire.md`.

After topic and header come the number of messages (u32), the size of each (u32), the stamp of each (u64), and
then their payloads, one behind the other. The header has the flag `BATCH`, the seq of the first, which those
that follow count on from, and as size all that comes after it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from nep.errors import WireError
from nep.i18n import _
from nep.protocol.wire import pack_quickly

__all__ = ["BATCH", "BATCH_FORM", "BATCH_MAX", "BatchEntry", "batch_part", "entries", "table_of"]

BATCH = 8
"""Flag: the part holds several messages. Only those get it whose hello says that they read it."""
BATCH_FORM = BATCH << 16
"""The flag in `form_of`."""
BATCH_MAX = 256
"""Whoever sends more in one part is refused."""
_COUNT = struct.Struct("<I")


class BatchEntry(NamedTuple):
    """One message of a batch: its number in it, when it was published, and where its payload is."""

    number: int
    stamp_ns: int
    begin: int
    end: int


@cache
def table_of(count: int) -> struct.Struct:
    """The table of a batch of so many messages: their number, all sizes, all stamps."""
    return struct.Struct(f"<I{count}I{count}Q")


def batch_part(
    topic: bytes,
    form: int,
    seq: int,
    publisher: int,
    stamps_ns: Sequence[int],
    payloads: Sequence[bytes],
) -> bytes:
    """The part. `topic` is the topic part, `form` that of each message, `seq` the number of the first."""
    sizes = [*map(len, payloads)]
    count = len(sizes)
    table = table_of(count).pack(count, *sizes, *stamps_ns)
    header = pack_quickly(form | BATCH_FORM, len(table) + sum(sizes), seq, stamps_ns[0], publisher)
    return b"".join((topic, header, table, *payloads))


def entries(body: bytes) -> list[BatchEntry]:
    """The messages in what follows the header. Raises `WireError`."""
    count = _COUNT.unpack_from(body)[0] if len(body) >= _COUNT.size else 0
    if not 1 <= count <= BATCH_MAX:
        raise WireError(
            _("a batch has 1 to {most} messages, this one {count}").format(most=BATCH_MAX, count=count),
            len(body),
        )
    table = table_of(count)
    if len(body) < table.size:
        raise WireError(_("a batch ends within its table"), len(body))
    numbers = table.unpack_from(body)
    sizes, stamps = numbers[1 : count + 1], numbers[count + 1 :]
    if table.size + sum(sizes) != len(body):
        raise WireError(_("the messages of a batch have other sizes than it tells"), len(body))
    made, at = [], table.size
    for number, (size, stamp_ns) in enumerate(zip(sizes, stamps, strict=True)):
        made.append(BatchEntry(number, stamp_ns, at, at + size))
        at += size
    return made
