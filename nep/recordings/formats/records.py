"""Encoding and decoding of MCAP records. Performs no input or output.

The specification is at https://mcap.dev/spec. Messages, chunks and their indexes, of which there are
thousands per second, are encoded and decoded by this module. Rare records (schemas, channels, statistics) use
the classes of the package `mcap`.
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
else:  # optional for programs that don't record
    mcap_exceptions = lazy_module("mcap.exceptions")
    mcap_records = lazy_module("mcap.records")
    mcap_stream = lazy_module("mcap.data_stream")


MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of the content
HEAD_BYTES = RECORD_HEAD.size
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_MAX_OTHER_RECORDS = 200_000
"""Maximum number of schema and channel records in a chunk."""
MESSAGE_FIELDS_BYTES = MESSAGE_HEAD.size - HEAD_BYTES
MESSAGE_START = struct.Struct("<HIQ")  # channel, sequence, log time
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, CRC, length of the compression's name
_SIZE = struct.Struct("<Q")
_INDEX_FIELDS = struct.Struct("<HI")  # channel, bytes of the entries
_ENTRY = struct.Struct("<QQ")
_OFFSET = struct.Struct("<HQ")
_CHUNK_INDEX_FIELDS = struct.Struct("<QQQQI")  # start, end, offset, length, bytes of the index offsets
_INDEX_LENGTH = struct.Struct("<QI")
_SIZES = struct.Struct("<QQ")
MAX_CHUNK_BYTES = 2**31
"""Maximum size of a chunk in bytes. Larger chunks can't be read into memory."""
CHUNK_HEAD_BYTES = HEAD_BYTES + _CHUNK.size + 16 + _SIZE.size
"""Maximum size of the header of a chunk, in bytes."""


class Opcode(IntEnum):
    """Opcodes of the records in an MCAP file."""

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
    """Parse a record as an object of `mcap`. Raises `ValueError`.

    Args:
        kind: Name of the class in `mcap.records`.
        content: Content of the record.
    """
    stream_class, record_class = _record_classes(kind)
    try:
        return record_class.read(stream_class(io.BytesIO(content)))
    except (struct.error, OverflowError, EOFError, MemoryError, mcap_exceptions.McapError) as error:
        raise ValueError(str(error)) from error


@cache
def _record_classes(kind: str) -> tuple[Any, Any]:
    return mcap_stream.ReadDataStream, getattr(mcap_records, kind)


@cache
def _builder_class() -> Any:  # noqa: ANN401 - of mcap
    return mcap_stream.RecordBuilder


def pack_record(record: Any) -> bytes:  # noqa: ANN401 - any record of mcap
    """Encode a record object of the package `mcap`."""
    builder = _builder_class()()
    record.write(builder)
    encoded: bytes = builder.end()
    return encoded


# ---- messages


class RawMessage(NamedTuple):
    """Message record of a chunk.

    Attributes:
        offset: Offset of the record in the chunk.
        channel: Id of the channel.
        sequence: Sequence number.
        log_ns: Time of receipt in ns since 1970.
        publish_ns: Time stamp in ns since 1970.
        data: Data of the message, as a slice of the chunk.
    """

    offset: int
    channel: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: memoryview


def pack_message_head(channel: int, sequence: int, log_ns: int, publish_ns: int, size_bytes: int) -> bytes:
    """Encode the part of a message record that precedes the data.

    Args:
        channel: Id of the channel.
        sequence: Sequence number.
        log_ns: Time of receipt in ns since 1970.
        publish_ns: Time stamp in ns since 1970.
        size_bytes: Size of the data.
    """
    return MESSAGE_HEAD.pack(
        Opcode.MESSAGE, MESSAGE_FIELDS_BYTES + size_bytes, channel, sequence, log_ns, publish_ns
    )


def records_in(chunk: bytes | memoryview, offset: int = 0) -> Iterator[RawMessage | tuple[int, memoryview]]:
    """Iterate over the records of a chunk: messages, and other records as (opcode, content).

    Stops without an error at the end or at invalid bytes, because the last record may be truncated.

    Args:
        chunk: Decompressed records.
        offset: Offset of the first record to return.
    """
    view = memoryview(chunk)
    size, other_count = view.nbytes, 0
    while offset + HEAD_BYTES <= size:
        opcode, length = RECORD_HEAD.unpack_from(view, offset)
        end = offset + HEAD_BYTES + length
        if end > size:
            return
        if opcode == Opcode.MESSAGE:
            if length < MESSAGE_FIELDS_BYTES:
                return
            _opcode, _length, channel, sequence, log_ns, publish_ns = MESSAGE_HEAD.unpack_from(view, offset)
            yield RawMessage(
                offset, channel, sequence, log_ns, publish_ns, view[offset + MESSAGE_HEAD.size : end]
            )
        else:
            other_count += 1
            if not opcode or other_count > _MAX_OTHER_RECORDS:
                return
            yield opcode, view[offset + HEAD_BYTES : end]
        offset = end


# ---- chunks


class ChunkHead(NamedTuple):
    """Parsed header of a chunk record.

    Attributes:
        start_ns: Time of the first message (ns since 1970).
        end_ns: Time of the last message (ns since 1970).
        uncompressed_bytes: Size of the decompressed data.
        crc: CRC-32 of the decompressed data; 0 if unknown.
        compression: "zstd", "lz4", or "" for none.
        data_offset: Offset of the data in the record.
        data_bytes: Size of the data in the record.
    """

    start_ns: int
    end_ns: int
    uncompressed_bytes: int
    crc: int
    compression: str
    data_offset: int
    data_bytes: int


def read_chunk_head(record: bytes | memoryview, length: int) -> ChunkHead | None:
    """Parse the header of a chunk record; return None if the bytes are invalid.

    Validation is strict, so that arbitrary bytes of a damaged file are not mistaken for a chunk.

    Args:
        record: First bytes of the record.
        length: Length of the record's content.
    """
    if len(record) < HEAD_BYTES + _CHUNK.size:
        return None
    start_ns, end_ns, uncompressed, crc, name_bytes = _CHUNK.unpack_from(record, HEAD_BYTES)
    offset = HEAD_BYTES + _CHUNK.size + name_bytes
    if name_bytes > 16 or len(record) < offset + _SIZE.size or max(uncompressed, length) > MAX_CHUNK_BYTES:
        return None
    compression = bytes(record[offset - name_bytes : offset])
    (data_bytes,) = _SIZE.unpack_from(record, offset)
    offset += _SIZE.size
    if compression not in {b"", b"lz4", b"zstd"} or offset + data_bytes != HEAD_BYTES + length:
        return None
    if start_ns > end_ns or (not compression and data_bytes != uncompressed):
        return None
    return ChunkHead(start_ns, end_ns, uncompressed, crc, compression.decode("ascii"), offset, data_bytes)


def pack_chunk(
    data: bytes, compression: str, uncompressed_bytes: int, crc: int, times: tuple[int, int]
) -> bytes:
    """Encode the part of a chunk record that precedes its data.

    Args:
        data: Compressed data.
        compression: "zstd", "lz4", or "" for none.
        uncompressed_bytes: Size of the decompressed data.
        crc: CRC-32 of the decompressed data.
        times: Log times of the first and last message in ns since 1970.
    """
    name = compression.encode("ascii")
    content = _CHUNK.pack(*times, uncompressed_bytes, crc, len(name)) + name + _SIZE.pack(len(data))
    return RECORD_HEAD.pack(Opcode.CHUNK, len(content) + len(data)) + content


# ---- indexes


class IndexEntry(NamedTuple):
    """Log time of a message, and its offset in the chunk."""

    log_ns: int
    offset: int


def pack_message_index(channel: int, entries: Sequence[int]) -> bytes:
    """Encode the message index record of a channel.

    Args:
        channel: Id of the channel.
        entries: Alternating log times and offsets.
    """
    content = struct.pack(f"<HI{len(entries)}Q", channel, 8 * len(entries), *entries)
    return RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, len(content)) + content


def message_count(index: bytes | memoryview) -> int:
    """Return the number of messages in an encoded message index."""
    return max(0, len(index) - _INDEX_HEAD_BYTES) // _ENTRY.size


def read_message_index(content: bytes | memoryview) -> tuple[int, list[IndexEntry]]:
    """Parse a message index record; return the channel id and the entries. Raises `ValueError`."""
    try:
        channel, size = _INDEX_FIELDS.unpack_from(content)
        entries_view = memoryview(content)[_INDEX_FIELDS.size : _INDEX_FIELDS.size + size]
        if len(entries_view) != size:
            raise ValueError("size")
        return channel, [IndexEntry(*each) for each in _ENTRY.iter_unpack(entries_view)]
    except struct.error as error:
        raise ValueError(str(error)) from error


@dataclass(slots=True)
class ChunkInfo:
    """Metadata of a chunk.

    Attributes:
        start_ns: Time of the first message (ns since 1970).
        end_ns: Time of the last message (ns since 1970).
        offset: Offset of the chunk record in the file.
        length: Length of the chunk record.
        packed_offsets: Offsets of the message indexes by channel, encoded as in the file, because most of
            them are never used.
        index_bytes: Total size of the message indexes.
        compression: Name of the compression.
        compressed_bytes: Size of the data in the file.
        uncompressed_bytes: Size of the decompressed data.
        is_run: True for consecutive messages outside of chunks.
        packed_counts: Number of messages by channel, encoded; set if they were counted because there are no
            indexes.
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
        """Ids of the channels with messages in the chunk."""
        return [channel for channel, _offset in _OFFSET.iter_unpack(self.packed_offsets)]

    @property
    def index_offsets(self) -> dict[int, int]:
        """Offsets of the message indexes in the file, by channel."""
        return dict(_OFFSET.iter_unpack(self.packed_offsets))

    def has_index_at(self, offset: int) -> bool:
        """Return True if a message index may start at an offset, which must follow the chunk."""
        chunk_end = self.offset + self.length
        return chunk_end <= offset < chunk_end + self.index_bytes

    @property
    def counts(self) -> dict[int, int]:
        """Number of messages by channel, computed from the sizes of the indexes (16 bytes per message).

        Channels without an index are omitted, because counting them requires reading the chunk.
        """
        if self.packed_counts:
            return dict(_OFFSET.iter_unpack(self.packed_counts))
        chunk_end = self.offset + self.length
        end = chunk_end + self.index_bytes
        counts = {}
        pairs = sorted(_OFFSET.iter_unpack(self.packed_offsets), key=_second, reverse=True)
        for channel, offset in pairs:
            if chunk_end <= offset < end:
                counts[channel] = max(0, end - offset - _INDEX_HEAD_BYTES) // _ENTRY.size
                end = offset
        return counts

    @property
    def channel_count(self) -> int:
        """Number of channels with messages in the chunk."""
        return len(self.packed_offsets) // _OFFSET.size


_INDEX_HEAD_BYTES = HEAD_BYTES + _INDEX_FIELDS.size
_second = itemgetter(1)


def pack_channel_map(offsets: Mapping[int, int]) -> bytes:
    """Encode one number per channel: index offsets (`packed_offsets`) or counts (`packed_counts`)."""
    return b"".join([_OFFSET.pack(*each) for each in offsets.items()])


def read_chunk_info(content: bytes | memoryview) -> ChunkInfo:
    """Parse a chunk index record. Raises `ValueError`."""
    try:
        start_ns, end_ns, offset, length, size = _CHUNK_INDEX_FIELDS.unpack_from(content)
        position = _CHUNK_INDEX_FIELDS.size + size
        if size % _OFFSET.size or position > len(content):
            raise ValueError("size")
        index_bytes, name_bytes = _INDEX_LENGTH.unpack_from(content, position)
        packed_offsets = bytes(content[_CHUNK_INDEX_FIELDS.size : position])
        position += _INDEX_LENGTH.size
        compression = str(content[position : position + name_bytes], "ascii")
        sizes = _SIZES.unpack_from(content, position + name_bytes)
    except struct.error as error:
        raise ValueError(str(error)) from error
    return ChunkInfo(start_ns, end_ns, offset, length, packed_offsets, index_bytes, compression, *sizes)


def pack_chunk_info(info: ChunkInfo) -> bytes:
    """Encode a chunk index record."""
    name = info.compression.encode("ascii")
    content = (
        _CHUNK_INDEX_FIELDS.pack(
            info.start_ns, info.end_ns, info.offset, info.length, len(info.packed_offsets)
        )
        + info.packed_offsets
        + _INDEX_LENGTH.pack(info.index_bytes, len(name))
        + name
        + _SIZES.pack(info.compressed_bytes, info.uncompressed_bytes)
    )
    return RECORD_HEAD.pack(Opcode.CHUNK_INDEX, len(content)) + content
