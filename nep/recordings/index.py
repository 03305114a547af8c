"""What is where in a recording: of its summary, or, where it has none, of a look at each record's head."""

from __future__ import annotations

import io
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

from nep.errors import RecordingError
from nep.i18n import _
from nep.recordings.channels import ChannelDefinition
from nep.recordings.records import (
    CHUNK_HEAD_BYTES,
    HEAD_BYTES,
    MAGIC,
    MOST_CHUNK_BYTES,
    RECORD_HEAD,
    ChunkHead,
    ChunkInfo,
    Opcode,
    RawMessage,
    chunk_head,
    decompressed,
    messages_in,
    pack_offsets,
    read_chunk_info,
    read_message_index,
    read_record,
)

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

__all__ = [
    "MOST_SMALL_BYTES",
    "Definitions",
    "FileIndex",
    "Place",
    "read_chunk",
    "read_entries",
    "read_index",
    "records_of",
]

_FOOTER_BYTES = HEAD_BYTES + 20 + len(MAGIC)
MOST_SMALL_BYTES = 64_000_000
"""A record that is no chunk and is larger is damaged, or an attachment that nobody needs here."""
_MOST_SUMMARY_BYTES = 1_000_000_000
"""A summary with more is damaged: a week of recording has less."""


class Definitions:
    """Channels by their numbers, as records of schemas and channels tell of them."""

    def __init__(self) -> None:
        self.channels: dict[int, ChannelDefinition] = {}
        self._schemas: dict[int, Schema] = {}
        self._waiting: dict[int, dict[int, Channel]] = {}
        """By the schema that they need, and their own number."""

    @property
    def lacks_schemas(self) -> bool:
        """Whether there are channels whose schemas have not been told yet."""
        return bool(self._waiting)

    def add(self, opcode: int, content: bytes | memoryview) -> None:
        """A record of a schema or channel; others, and damaged ones, are passed over."""
        with suppress(ValueError):
            if opcode == Opcode.SCHEMA:
                schema = read_record("Schema", content)
                self._schemas[schema.id] = schema
                for channel in self._waiting.pop(schema.id, {}).values():
                    self._add_channel(channel)
            elif opcode == Opcode.CHANNEL:
                self._add_channel(read_record("Channel", content))

    def _add_channel(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            self._waiting.setdefault(channel.schema_id, {})[channel.id] = channel
        told = ("", "", b"") if schema is None else (schema.name, schema.encoding, schema.data)
        self.channels[channel.id] = ChannelDefinition(
            channel.topic, channel.message_encoding, *told, tuple(channel.metadata.items())
        )


@dataclass
class FileIndex:
    """`chunks` by the time when they begin. `is_complete`: the file has its summary, so it was ended."""

    definitions: Definitions = field(default_factory=Definitions)
    chunks: list[ChunkInfo] = field(default_factory=list)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    counts: dict[int, int] | None = None
    """Messages of each channel; None where the file does not tell."""
    is_complete: bool = True
    end: int = 0
    """How far the file is whole, in bytes."""


class Place(NamedTuple):
    """A record in a file."""

    offset: int
    opcode: int
    length: int


def records_of(file: BinaryIO, size: int, offset: int = len(MAGIC)) -> Iterator[Place]:
    """The records from an offset on, up to the end, or to where there can be none. Content is not read."""
    while offset + HEAD_BYTES <= size:
        file.seek(offset)
        head = file.read(HEAD_BYTES)
        if len(head) < HEAD_BYTES:
            return
        opcode, length = RECORD_HEAD.unpack(head)
        if not 0 < opcode <= Opcode.DATA_END and opcode < 0x80:
            return
        if offset + HEAD_BYTES + length > size:
            return
        yield Place(offset, opcode, length)
        offset += HEAD_BYTES + length


def read_index(file: BinaryIO, path: Path, progress: Callable[[int, int], object] | None = None) -> FileIndex:
    """The index of a recording. Raises `RecordingError` for what is none, `OSError`.

    `progress` is told how many bytes of how many are done, where they all have to be looked through.
    """
    size = file.seek(0, io.SEEK_END)
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        raise RecordingError(str(path), _("it is no MCAP file"))
    return _of_summary(file, size) or _of_records(file, size, progress)


# ---- by the summary


def _of_summary(file: BinaryIO, size: int) -> FileIndex | None:
    """None for a file that was not ended, or whose summary is damaged."""
    if size < 2 * len(MAGIC) + _FOOTER_BYTES:
        return None
    file.seek(size - _FOOTER_BYTES)
    footer = file.read(_FOOTER_BYTES)
    opcode, length = RECORD_HEAD.unpack_from(footer)
    if opcode != Opcode.FOOTER or length != 20 or not footer.endswith(MAGIC):
        return None
    start = int.from_bytes(footer[9:17], "little")
    crc = int.from_bytes(footer[25:29], "little")
    if not len(MAGIC) <= start < size - _FOOTER_BYTES or size - start > _MOST_SUMMARY_BYTES:
        return None
    file.seek(start)
    summary = file.read(size - _FOOTER_BYTES - start)
    if crc and zlib.crc32(footer[:25], zlib.crc32(summary)) != crc:
        return None
    index = FileIndex(end=size)
    try:
        _read_summary(file, summary, index)
    except ValueError:
        return None
    if not index.chunks and _has_messages(file, size, start):
        return None
    index.chunks.sort(key=lambda each: each.start_ns)
    return index


def _read_summary(file: BinaryIO, summary: bytes, index: FileIndex) -> None:
    whole, at = memoryview(summary), 0
    while at + HEAD_BYTES <= len(whole):
        opcode, length = RECORD_HEAD.unpack_from(whole, at)
        content = whole[at + HEAD_BYTES : at + HEAD_BYTES + length]
        at += HEAD_BYTES + length
        if opcode == Opcode.CHUNK_INDEX:
            info = read_chunk_info(content)
            if not _is_inside(info, index.end):
                raise ValueError("a chunk beyond the file")
            if not info.packed_offsets:
                info = _indexed_by_reading(file, info, Definitions())
            index.chunks.append(info)
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            index.definitions.add(opcode, content)
        elif opcode == Opcode.STATISTICS:
            index.counts = read_record("Statistics", content).channel_message_counts
        elif opcode == Opcode.METADATA_INDEX:
            place = read_record("MetadataIndex", content)
            if place.offset + place.length <= index.end:
                _read_metadata(file, Place(place.offset, Opcode.METADATA, place.length - HEAD_BYTES), index)


def _is_inside(info: ChunkInfo, size: int) -> bool:
    """Whether a chunk and its indexes can be where a summary says that they are."""
    end = info.offset + info.length + info.index_bytes
    return info.offset >= len(MAGIC) and info.length >= HEAD_BYTES and end <= size


def _has_messages(file: BinaryIO, size: int, data_end: int) -> bool:
    """Whether there are messages that no summary tells of."""
    wanted = {Opcode.CHUNK, Opcode.MESSAGE}
    return any(each.opcode in wanted for each in records_of(file, min(size, data_end)))


def _read_metadata(file: BinaryIO, place: Place, index: FileIndex) -> None:
    if not 0 < place.length <= MOST_SMALL_BYTES:
        return
    file.seek(place.offset + HEAD_BYTES)
    try:
        made = read_record("Metadata", file.read(place.length))
    except ValueError:
        return
    index.metadata.append((made.name, made.metadata))


# ---- by the records


def _of_records(file: BinaryIO, size: int, progress: Callable[[int, int], object] | None) -> FileIndex:
    index = FileIndex(is_complete=False, end=len(MAGIC))
    scanned = _Scan(file, index)
    for place in records_of(file, size):
        scanned.add(place)
        index.end = place.offset + HEAD_BYTES + place.length
        if progress is not None:
            progress(index.end, size)
        if place.opcode == Opcode.DATA_END:
            break
    scanned.end_chunk()
    for chunk in index.chunks:  # other programs put a schema into any chunk before that of its channel
        if index.definitions.lacks_schemas:
            _indexed_by_reading(file, chunk, index.definitions)
    index.chunks.sort(key=lambda each: each.start_ns)
    return index


class _Scan:
    """Puts together the chunks of a file without a summary."""

    def __init__(self, file: BinaryIO, index: FileIndex) -> None:
        self._file = file
        self._index = index
        self._chunk: ChunkInfo | None = None
        self._offsets: dict[int, int] = {}

    def add(self, place: Place) -> None:
        """The next record."""
        if place.opcode == Opcode.MESSAGE_INDEX:
            self._file.seek(place.offset + HEAD_BYTES)
            if self._chunk is not None:
                self._offsets[int.from_bytes(self._file.read(2), "little")] = place.offset
                self._chunk.index_bytes += HEAD_BYTES + place.length
            return
        self.end_chunk()
        if place.opcode == Opcode.CHUNK:
            self._file.seek(place.offset)
            head = chunk_head(self._file.read(CHUNK_HEAD_BYTES), place.length)
            if head is not None:
                self._chunk = _info(place, head)
        elif place.opcode in {Opcode.SCHEMA, Opcode.CHANNEL} and place.length <= MOST_SMALL_BYTES:
            self._file.seek(place.offset + HEAD_BYTES)
            self._index.definitions.add(place.opcode, self._file.read(place.length))
        elif place.opcode == Opcode.METADATA:
            _read_metadata(self._file, place, self._index)

    def end_chunk(self) -> None:
        """No more indexes of the last chunk come."""
        if self._chunk is None:
            return
        chunk, self._chunk = self._chunk, None
        chunk.packed_offsets, self._offsets = pack_offsets(self._offsets), {}
        known = self._index.definitions.channels
        if not chunk.packed_offsets or not all(each in known for each in chunk.channels):
            chunk = _indexed_by_reading(self._file, chunk, self._index.definitions)
        self._index.chunks.append(chunk)


def _info(place: Place, head: ChunkHead) -> ChunkInfo:
    return ChunkInfo(
        head.start_ns,
        head.end_ns,
        place.offset,
        HEAD_BYTES + place.length,
        b"",
        0,
        head.compression,
        head.data_bytes,
        head.uncompressed_bytes,
    )


def _indexed_by_reading(file: BinaryIO, info: ChunkInfo, definitions: Definitions) -> ChunkInfo:
    """Which channels a chunk has, where the file does not tell; an offset of 0 is no index."""
    try:
        chunk = read_chunk(file, info)
    except ValueError:
        return info
    channels = info.index_offsets
    for record in messages_in(chunk):
        if isinstance(record, RawMessage):
            channels.setdefault(record.channel, 0)
        else:
            definitions.add(*record)
    info.packed_offsets = pack_offsets(channels)
    return info


def read_chunk(file: BinaryIO, info: ChunkInfo) -> bytes | memoryview:
    """A chunk's records. Raises `ValueError` when it is damaged, `OSError`."""
    if info.length > MOST_CHUNK_BYTES:
        raise ValueError("size")
    file.seek(info.offset)
    record = memoryview(file.read(info.length))
    if len(record) != info.length or len(record) < HEAD_BYTES or record[0] != Opcode.CHUNK:
        raise ValueError("cut")
    head = chunk_head(record, info.length - HEAD_BYTES)
    if head is None:
        raise ValueError("head")
    return decompressed(record[head.data_at :], head)


def read_entries(file: BinaryIO, info: ChunkInfo, channel: int) -> Sequence[tuple[int, int]] | None:
    """(time, offset in the chunk) of a channel's messages; None where the file does not tell."""
    offset = info.index_offsets.get(channel, 0)
    if not info.has_index_at(offset):
        return None
    file.seek(offset)
    head = file.read(HEAD_BYTES)
    if len(head) < HEAD_BYTES:
        return None
    opcode, length = RECORD_HEAD.unpack(head)
    if opcode != Opcode.MESSAGE_INDEX or length > info.index_bytes:
        return None
    try:
        told, entries = read_message_index(file.read(length))
    except ValueError:
        return None
    return list(entries) if told == channel else None
