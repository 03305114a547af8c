"""Iteration over the records of an MCAP file without reading their whole content."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from nep.recordings.formats.limits import RECORD_COST_BYTES, ReadBudget
from nep.recordings.formats.records import HEAD_BYTES, MAGIC, RECORD_HEAD, Opcode

_SMALL_WINDOW_BYTES, _LARGE_WINDOW_BYTES = 4_096, 1_048_576
_BUDGET_INTERVAL_RECORDS = 1_000


class RecordLocation(NamedTuple):
    """Location of a record in a file.

    Attributes:
        offset: Offset of the record.
        opcode: Opcode of the record.
        length: Length of the content.
        prefix: First bytes of the content, which were read together with the header.
    """

    offset: int
    opcode: int
    length: int
    prefix: bytes = b""

    @property
    def end(self) -> int:
        """Offset of the next record."""
        return self.offset + HEAD_BYTES + self.length


def walk_records(
    file: BinaryIO,
    size: int,
    budget: ReadBudget,
    offset: int = len(MAGIC),
    prefix_bytes: int = 64,
) -> Iterator[RecordLocation]:
    """Iterate over the records of a file up to `size`, or to the first invalid bytes.

    The file is read in windows that grow while records are short, so that millions of empty records
    take a second, and only the headers of large chunks are read.

    Args:
        file: Open file.
        size: Offset at which to stop, such as the size of the file.
        budget: Limit of the work.
        offset: Offset of the first record.
        prefix_bytes: Number of content bytes to return in `RecordLocation.prefix`.

    Raises:
        RecordingTooLargeError: The budget is exceeded.
        OSError: The file can't be read.
    """
    window, base, step, count = b"", offset, _SMALL_WINDOW_BYTES, 0
    while offset + HEAD_BYTES <= size:
        window_offset = offset - base
        if window_offset + HEAD_BYTES + prefix_bytes > len(window):
            step = min(2 * step, _LARGE_WINDOW_BYTES) if window_offset <= len(window) else _SMALL_WINDOW_BYTES
            file.seek(offset)
            window, base, window_offset = file.read(max(step, HEAD_BYTES + prefix_bytes)), offset, 0
            if len(window) < HEAD_BYTES:
                return
        opcode, length = RECORD_HEAD.unpack_from(window, window_offset)
        if (not 0 < opcode <= Opcode.DATA_END and opcode < 0x80) or offset + HEAD_BYTES + length > size:
            return
        window_offset += HEAD_BYTES
        count += 1
        if count % _BUDGET_INTERVAL_RECORDS == 0:
            budget.spend(_BUDGET_INTERVAL_RECORDS * RECORD_COST_BYTES)
        yield RecordLocation(
            offset, opcode, length, window[window_offset : window_offset + min(length, prefix_bytes)]
        )
        offset += HEAD_BYTES + length
