"""MCAP's records as bytes: those of which there are many, and how to find them in a file.

The format is at https://mcap.dev/spec. Records of which there are few (schemas, channels, statistics) are
those of the package `mcap`; messages, chunks and their indexes come by the thousand each second, and are
packed and read here. Pure functions.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import mcap.data_stream as mcap_stream
    import mcap.exceptions as mcap_exceptions
    import mcap.records as mcap_records
else:  # who records nothing need not have them
    mcap_exceptions = lazy_module("mcap.exceptions")
    mcap_records = lazy_module("mcap.records")
    mcap_stream = lazy_module("mcap.data_stream")

__all__ = [
    "CHUNK_HEAD_BYTES",
    "HEAD_BYTES",
    "MAGIC",
    "MESSAGE_HEAD",
    "MESSAGE_REST_BYTES",
    "MESSAGE_START",
    "MOST_CHUNK_BYTES",
    "RECORD_HEAD",
    "ChunkHead",
    "ChunkInfo",
    "IndexEntry",
    "Opcode",
    "RawMessage",
    "chunk_head",
    "message_count",
    "message_head",
    "messages_in",
    "pack_chunk",
    "pack_chunk_info",
    "pack_message_index",
    "pack_offsets",
    "packed",
    "read_chunk_info",
    "read_message_index",
    "read_record",
]

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of what follows
HEAD_BYTES = RECORD_HEAD.size
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_MAX_OTHERS = 200_000
"""A chunk has schemas and channels beside its messages, each once."""
MESSAGE_REST_BYTES = MESSAGE_HEAD.size - HEAD_BYTES
MESSAGE_START = struct.Struct("<HIQ")  # channel, sequence, log time
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, CRC, letters of the compression
_SIZE = struct.Struct("<Q")
_ENTRIES = struct.Struct("<HI")  # channel, bytes of the entries
_ENTRY = struct.Struct("<QQ")
_OFFSET = struct.Struct("<HQ")
_INFO = struct.Struct("<QQQQI")  # start, end, offset, length, bytes of the index offsets
_INDEX_LENGTH = struct.Struct("<QI")
_SIZES = struct.Struct("<QQ")
MOST_CHUNK_BYTES = 2**31
"""A chunk that tells of more is none: whoever writes larger ones cannot be read in memory."""
CHUNK_HEAD_BYTES = HEAD_BYTES + _CHUNK.size + 16 + _SIZE.size
"""So many bytes hold the head of any chunk, whose compression has a name of a few letters."""


class Opcode(IntEnum):
    """The kinds of records, as the specification numbers them."""

    HEADER = 1
    FOOTER = 2
    SCHEMA = 3
    CHANNEL = 4
    MESSAGE = 5
    CHUNK = 6
    MESSAGE_INDEX = 7
    CHUNK_INDEX = 8
    ATTACHMENT = 9
    ATTACHMENT_INDEX = 10
    STATISTICS = 11
    METADATA = 12
    METADATA_INDEX = 13
    SUMMARY_OFFSET = 14
    DATA_END = 15


def read_record(kind: str, content: bytes | memoryview) -> Any:  # noqa: ANN401 - any record of mcap
    """One of mcap's records, by the name of its class, from its content. Raises `ValueError`."""
    stream_class, record_class = _classes(kind)
    try:
        return record_class.read(stream_class(io.BytesIO(content)))
    except (struct.error, OverflowError, EOFError, MemoryError, mcap_exceptions.McapError) as error:
        raise ValueError(str(error)) from error


@cache
def _classes(kind: str) -> tuple[Any, Any]:
    return mcap_stream.ReadDataStream, getattr(mcap_records, kind)


@cache
def _builder_class() -> Any:  # noqa: ANN401 - of mcap
    return mcap_stream.RecordBuilder


def packed(record: Any) -> bytes:  # noqa: ANN401 - any record of mcap
    """One of mcap's records as bytes."""
    builder = _builder_class()()
    record.write(builder)
    made: bytes = builder.end()
    return made


# ---- messages


class RawMessage(NamedTuple):
    """A message record in a chunk: `data` is what it carries, of the chunk's own memory."""

    offset: int
    channel: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: memoryview


def message_head(channel: int, sequence: int, log_ns: int, publish_ns: int, size_bytes: int) -> bytes:
    """What stands before a message's bytes in a chunk."""
    return MESSAGE_HEAD.pack(
        Opcode.MESSAGE, MESSAGE_REST_BYTES + size_bytes, channel, sequence, log_ns, publish_ns
    )


def messages_in(chunk: bytes | memoryview, offset: int = 0) -> Iterator[RawMessage | tuple[int, memoryview]]:
    """The records of a chunk from an offset on: messages, and others as (opcode, content).

    Ends without an error where the bytes do, or where they can be no record: the last record may be cut.
    """
    whole = memoryview(chunk)
    size, others = whole.nbytes, 0
    while offset + HEAD_BYTES <= size:
        opcode, length = RECORD_HEAD.unpack_from(whole, offset)
        end = offset + HEAD_BYTES + length
        if end > size:
            return
        if opcode == Opcode.MESSAGE:
            if length < MESSAGE_REST_BYTES:
                return
            _opcode, _length, channel, sequence, log_ns, publish_ns = MESSAGE_HEAD.unpack_from(whole, offset)
            yield RawMessage(
                offset, channel, sequence, log_ns, publish_ns, whole[offset + MESSAGE_HEAD.size : end]
            )
        else:
            others += 1
            if not opcode or others > _MAX_OTHERS:
                return
            yield opcode, whole[offset + HEAD_BYTES : end]
        offset = end


# ---- chunks


class ChunkHead(NamedTuple):
    """What a chunk's record says before its data. `data_at`: bytes from the record's begin to the data."""

    start_ns: int
    end_ns: int
    uncompressed_bytes: int
    crc: int
    compression: str
    data_at: int
    data_bytes: int


def chunk_head(record: bytes | memoryview, length: int) -> ChunkHead | None:
    """The head of a chunk's record of this `length`; None for bytes that can be none.

    What it says must fit: so that a place in a damaged file that merely looks like one is not taken.
    """
    if len(record) < HEAD_BYTES + _CHUNK.size:
        return None
    start_ns, end_ns, uncompressed, crc, letters = _CHUNK.unpack_from(record, HEAD_BYTES)
    at = HEAD_BYTES + _CHUNK.size + letters
    if letters > 16 or len(record) < at + _SIZE.size or max(uncompressed, length) > MOST_CHUNK_BYTES:
        return None
    compression = bytes(record[at - letters : at])
    (data_bytes,) = _SIZE.unpack_from(record, at)
    at += _SIZE.size
    if compression not in {b"", b"lz4", b"zstd"} or at + data_bytes != HEAD_BYTES + length:
        return None
    if start_ns > end_ns or (not compression and data_bytes != uncompressed):
        return None
    return ChunkHead(start_ns, end_ns, uncompressed, crc, compression.decode("ascii"), at, data_bytes)


def pack_chunk(
    data: bytes, compression: str, uncompressed_bytes: int, crc: int, times: tuple[int, int]
) -> bytes:
    """What stands before a chunk's data, which follows."""
    letters = compression.encode("ascii")
    rest = _CHUNK.pack(*times, uncompressed_bytes, crc, len(letters)) + letters + _SIZE.pack(len(data))
    return RECORD_HEAD.pack(Opcode.CHUNK, len(rest) + len(data)) + rest


# ---- indexes


class IndexEntry(NamedTuple):
    """Where a message is in its chunk."""

    log_ns: int
    offset: int


def pack_message_index(channel: int, entries: Sequence[int]) -> bytes:
    """A record of (time, offset, time, offset, ...) of a channel's messages in a chunk."""
    rest = struct.pack(f"<HI{len(entries)}Q", channel, 8 * len(entries), *entries)
    return RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, len(rest)) + rest


def message_count(index: bytes | memoryview) -> int:
    """How many messages a packed message index tells of."""
    return max(0, len(index) - _INDEX_HEAD) // _ENTRY.size


def read_message_index(content: bytes | memoryview) -> tuple[int, list[IndexEntry]]:
    """(channel, its entries). Raises `ValueError` for what is none."""
    try:
        channel, size = _ENTRIES.unpack_from(content)
        whole = memoryview(content)[_ENTRIES.size : _ENTRIES.size + size]
        if len(whole) != size:
            raise ValueError("size")
        return channel, [IndexEntry(*each) for each in _ENTRY.iter_unpack(whole)]
    except struct.error as error:
        raise ValueError(str(error)) from error


@dataclass(slots=True)
class ChunkInfo:
    """What is known of a chunk without reading it.

    `offset`, `length`: of its record in the file. `packed_offsets`: where each channel's message index is, as
    it stands in the file: of ten thousand chunks only a few are asked. `index_bytes`: of all these indexes.
    `is_run`: messages that stand outside of chunks, one behind the other. `packed_counts`: how many each
    channel has, where they were counted because no index tells.
    """

    start_ns: int
    end_ns: int
    offset: int
    length: int
    packed_offsets: bytes
    index_bytes: int
    compression: str
    compressed_bytes: int
    uncompressed_bytes: int
    is_run: bool = False
    packed_counts: bytes = b""

    @property
    def channels(self) -> list[int]:
        """The channels that have messages in it."""
        return [channel for channel, _offset in _OFFSET.iter_unpack(self.packed_offsets)]

    @property
    def index_offsets(self) -> dict[int, int]:
        """Where the message index of each channel begins in the file."""
        return dict(_OFFSET.iter_unpack(self.packed_offsets))

    def has_index_at(self, offset: int) -> bool:
        """Whether a message index can be there: they stand one behind the other, after the chunk."""
        after = self.offset + self.length
        return after <= offset < after + self.index_bytes

    @property
    def counts(self) -> dict[int, int]:
        """How many messages each channel has: its index has 16 bytes for each, and the next one follows.

        Channels without an index are missing: to count theirs the chunk must be read.
        """
        if self.packed_counts:
            return dict(_OFFSET.iter_unpack(self.packed_counts))
        after = self.offset + self.length
        end = after + self.index_bytes
        counts = {}
        pairs = sorted(_OFFSET.iter_unpack(self.packed_offsets), key=_second, reverse=True)
        for channel, offset in pairs:
            if after <= offset < end:
                counts[channel] = max(0, end - offset - _INDEX_HEAD) // _ENTRY.size
                end = offset
        return counts

    @property
    def channel_count(self) -> int:
        """How many channels have messages in it."""
        return len(self.packed_offsets) // _OFFSET.size


_INDEX_HEAD = HEAD_BYTES + _ENTRIES.size
_second = itemgetter(1)


def pack_offsets(offsets: Mapping[int, int]) -> bytes:
    """`ChunkInfo.packed_offsets` of these."""
    return b"".join([_OFFSET.pack(*each) for each in offsets.items()])


def read_chunk_info(content: bytes | memoryview) -> ChunkInfo:
    """A chunk index. Raises `ValueError` for what is none."""
    try:
        start_ns, end_ns, offset, length, size = _INFO.unpack_from(content)
        at = _INFO.size + size
        if size % _OFFSET.size or at > len(content):
            raise ValueError("size")
        index_bytes, letters = _INDEX_LENGTH.unpack_from(content, at)
        packed_offsets = bytes(content[_INFO.size : at])
        at += _INDEX_LENGTH.size
        compression = str(content[at : at + letters], "ascii")
        sizes = _SIZES.unpack_from(content, at + letters)
    except struct.error as error:
        raise ValueError(str(error)) from error
    return ChunkInfo(start_ns, end_ns, offset, length, packed_offsets, index_bytes, compression, *sizes)


def pack_chunk_info(info: ChunkInfo) -> bytes:
    """A chunk index as bytes."""
    letters = info.compression.encode("ascii")
    rest = (
        _INFO.pack(info.start_ns, info.end_ns, info.offset, info.length, len(info.packed_offsets))
        + info.packed_offsets
        + _INDEX_LENGTH.pack(info.index_bytes, len(letters))
        + letters
        + _SIZES.pack(info.compressed_bytes, info.uncompressed_bytes)
    )
    return RECORD_HEAD.pack(Opcode.CHUNK_INDEX, len(rest)) + rest
