"""Index of a recording, read from its summary or, without one, built by scanning its records.

Files without summary, chunk index or chunks are supported. Messages outside of chunks (ROS 2's preset
"fastwrite") are grouped into runs of about 1 MB, which are read like uncompressed chunks. The package `mcap`
is not used, because its reader trusts the offsets, lengths and counts in the file
(docs/adr/0032-reading-foreign-recordings.md).
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from nep.errors import RecordingError, RecordingTooLargeError
from nep.i18n import _
from nep.recordings.formats.channels import ChannelDefinition
from nep.recordings.formats.compression import decompress
from nep.recordings.formats.limits import RECORD_COST_BYTES, ReadBudget, open_budget
from nep.recordings.formats.records import (
    HEAD_BYTES,
    MAGIC,
    MAX_CHUNK_BYTES,
    MESSAGE_FIELDS_BYTES,
    MESSAGE_START,
    RECORD_HEAD,
    ChunkHead,
    ChunkInfo,
    Opcode,
    RawMessage,
    pack_channel_map,
    read_chunk_head,
    read_chunk_info,
    read_message_index,
    read_record,
    records_in,
)
from nep.recordings.formats.walk import RecordLocation, walk_records

if TYPE_CHECKING:
    from mcap.records import Channel, Schema


_FOOTER_BYTES = HEAD_BYTES + 20 + len(MAGIC)
MAX_RECORD_BYTES = 64_000_000
"""Maximum size in bytes of records other than chunks.

Larger records are damaged, or are attachments, which are not read.
"""
_MAX_SCHEMA_BYTES = 8_000_000
_MAX_CHANNEL_BYTES = 256_000
_MAX_RECORD_SIZES: Mapping[int, int] = {Opcode.SCHEMA: _MAX_SCHEMA_BYTES, Opcode.CHANNEL: _MAX_CHANNEL_BYTES}
_MAX_DEFINITION_BYTES = 64_000_000
_MAX_OTHER_RECORDS = 200_000
_UNCOUNTED_OPCODES = frozenset({Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX})
_MAX_METADATA_BYTES = 4_000_000
"""Maximum total size of metadata in bytes, twice the size in a recording with 10,000 topics."""
_MAX_ATTACHMENTS = 1_000
_MAX_HEADER_BYTES = 64_000
_MAX_COUNTED_CHUNKS = 10_000
_MAX_RUN_BYTES = 1_000_000
_MAX_RUN_RECORD_BYTES = 65_536
"""Record size in bytes above which a run of messages ends, so that long records are not part of a run."""
_READ_BYTES = 1_048_576


@dataclass(frozen=True)
class CorruptRange:
    """Unreadable place of a file.

    Attributes:
        offset: Offset in the file.
        length: Length in bytes.
        start_ns: Time of the first missing message (ns since 1970); 0 if unknown.
        end_ns: Time of the last missing message (ns since 1970); 0 if unknown.
        message_count: Number of missing messages; None if unknown.
    """

    offset: int
    length: int
    start_ns: int = 0
    end_ns: int = 0
    message_count: int | None = None


@dataclass(frozen=True)
class AttachedFile:
    """Attachment of a recording, whose content is not read.

    Attributes:
        name: Name of the file.
        media_type: Media type of the file.
        size_bytes: Size of the file.
    """

    name: str
    media_type: str
    size_bytes: int


class RecordCounter:
    """Limit on the number of records other than messages, chunks and their indexes.

    Args:
        path: Path of the file, for error messages.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._count = path, 0

    def add(self, opcode: int) -> None:
        """Count a record. Raises `RecordingTooLargeError` if the limit is exceeded."""
        if opcode in _UNCOUNTED_OPCODES:
            return
        self._count += 1
        if self._count > _MAX_OTHER_RECORDS:
            template = _("the file contains more than {most} records other than messages")
            raise RecordingTooLargeError(str(self._path), template.format(most=_MAX_OTHER_RECORDS))


class Definitions:
    """Channels by id, collected from the schema and channel records of a file."""

    def __init__(self) -> None:
        self.channels: dict[int, ChannelDefinition] = {}
        self._schemas: dict[int, Schema] = {}
        self._without_schema: dict[int, dict[int, Channel]] = {}
        """Channels whose schema is missing, by the number of the schema and of the channel."""
        self._record_hashes: dict[tuple[int, int], int] = {}
        """Hashes of records by opcode and number, to skip repeated records."""
        self._size_bytes = 0

    @property
    def lacks_schemas(self) -> bool:
        """True if a channel refers to a schema that has not been read yet."""
        return bool(self._without_schema)

    def add(self, opcode: int, content: bytes | memoryview) -> list[int]:
        """Add a schema or channel record. Other, repeated, damaged and oversized records are ignored.

        Args:
            opcode: Opcode of the record.
            content: Content of the record.

        Returns:
            Ids of the channels that were added, or whose schema is now known.
        """
        max_size = _MAX_RECORD_SIZES.get(opcode, 0)
        if not 2 <= len(content) <= max_size:
            return []
        record_bytes = bytes(content)
        key = (opcode, int.from_bytes(record_bytes[:2], "little"))
        record_hash = hash(record_bytes)
        if self._record_hashes.get(key) == record_hash or self._size_bytes > _MAX_DEFINITION_BYTES:
            return []
        self._record_hashes[key] = record_hash
        self._size_bytes += len(record_bytes)
        try:
            record = read_record("Schema" if opcode == Opcode.SCHEMA else "Channel", record_bytes)
        except ValueError:
            return []
        channels = [record]
        if opcode == Opcode.SCHEMA:
            self._schemas[record.id] = record
            channels = list(self._without_schema.pop(record.id, {}).values())
        for channel in channels:
            self._add_channel(channel)
        return [channel.id for channel in channels]

    def _add_channel(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            self._without_schema.setdefault(channel.schema_id, {})[channel.id] = channel
        schema_fields = ("", "", b"") if schema is None else (schema.name, schema.encoding, schema.data)
        self.channels[channel.id] = ChannelDefinition(
            channel.topic, channel.message_encoding, *schema_fields, tuple(channel.metadata.items())
        )


@dataclass
class FileIndex:
    """Index of a recording file.

    Attributes:
        definitions: Channels and schemas.
        chunks: Chunks, sorted by start.
        metadata: Metadata records, as (name, values).
        attachments: Attached files.
        corruption: Unreadable places that were found while the index was read.
        is_complete: True if the file has a footer, so that it was closed properly.
        profile: MCAP profile.
        library: Program that wrote the file.
        metadata_bytes: Total size of the metadata records, including skipped ones.
    """

    definitions: Definitions = field(default_factory=Definitions)
    chunks: list[ChunkInfo] = field(default_factory=list)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    attachments: list[AttachedFile] = field(default_factory=list)
    corruption: list[CorruptRange] = field(default_factory=list)
    counts: dict[int, int] | None = None
    """Number of messages by channel; None if the file has no statistics."""
    is_complete: bool = True
    end: int = 0
    """Size of the intact part of the file in bytes."""
    profile: str = ""
    library: str = ""
    metadata_bytes: int = 0


def read_index(
    file: BinaryIO,
    path: Path,
    progress: Callable[[int, int], object] | None = None,
    budget: ReadBudget | None = None,
) -> FileIndex:
    """Read the index of a recording, or build it by scanning the file.

    Args:
        file: Open file.
        path: Path of the file, for error messages.
        progress: Called with bytes done and in total during a scan.
        budget: Limit of the work; None for the default.

    Raises:
        RecordingError: The file is not a recording.
        RecordingTooLargeError: The file exceeds a limit.
        OSError: The file can't be read.
    """
    size = file.seek(0, io.SEEK_END)
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        raise RecordingError(str(path), _("not an MCAP file"))
    work_budget = budget or open_budget(path, size)
    footer = _read_footer(file, size)
    index = None if footer is None else _SummaryReader(file, path, size, work_budget).read(footer)
    if index is None:
        data_end = size if footer is None else size - _FOOTER_BYTES
        index = _Scanner(file, path, size, work_budget, progress, data_end).run()
        index.is_complete = footer is not None
    _read_header(file, index)
    index.chunks.sort(key=lambda each: each.start_ns)
    return index


def _read_footer(file: BinaryIO, size: int) -> bytes | None:
    # With the magic after it; None if the file was not closed.
    if size < len(MAGIC) + _FOOTER_BYTES:
        return None
    file.seek(size - _FOOTER_BYTES)
    footer = file.read(_FOOTER_BYTES)
    if len(footer) < _FOOTER_BYTES or not footer.endswith(MAGIC):
        return None
    return footer if RECORD_HEAD.unpack_from(footer) == (Opcode.FOOTER, 20) else None


def _read_header(file: BinaryIO, index: FileIndex) -> None:
    file.seek(len(MAGIC))
    record_head = file.read(HEAD_BYTES)
    if len(record_head) < HEAD_BYTES:
        return
    opcode, length = RECORD_HEAD.unpack(record_head)
    if opcode == Opcode.HEADER and length <= _MAX_HEADER_BYTES:
        with suppress(ValueError):
            header = read_record("Header", file.read(length))
            index.profile, index.library = header.profile, header.library


def _read_content(file: BinaryIO, location: RecordLocation) -> bytes:
    if len(location.prefix) == location.length:
        return location.prefix
    file.seek(location.offset + HEAD_BYTES)
    return file.read(location.length)


def _read_metadata(file: BinaryIO, location: RecordLocation, index: FileIndex) -> None:
    index.metadata_bytes += location.length
    if not 0 < location.length <= MAX_RECORD_BYTES or index.metadata_bytes > _MAX_METADATA_BYTES:
        return
    with suppress(ValueError):
        record = read_record("Metadata", _read_content(file, location))
        index.metadata.append((record.name, record.metadata))


# ---- from the summary


class _SummaryReader:
    """Reader that validates the summary of a file."""

    def __init__(self, file: BinaryIO, path: Path, size: int, budget: ReadBudget) -> None:
        self._file, self._size, self._budget = file, size, budget
        self._record_counter = RecordCounter(path)
        self._index = FileIndex(end=size)
        self._message_count = 0
        self._seen_offsets: set[int] = set()
        self._opcodes: set[int] = set()
        self._required_index_opcodes: frozenset[int] = frozenset()

    def read(self, footer: bytes) -> FileIndex | None:
        # None if the summary is missing, damaged or incomplete.
        start = int.from_bytes(footer[9:17], "little")
        end = self._size - _FOOTER_BYTES
        if not len(MAGIC) <= start < end or not self._is_crc_valid(start, end, footer):
            return None
        try:
            for location in walk_records(self._file, end, self._budget, start):
                self._add(location)
        except ValueError:
            return None
        index = self._index
        return index if index.chunks and self._is_plausible(start) else None

    def _is_crc_valid(self, start: int, end: int, footer: bytes) -> bool:
        expected_crc = int.from_bytes(footer[25:29], "little")
        if not expected_crc:
            return True
        self._budget.spend(end - start)
        self._file.seek(start)
        crc, remaining = 0, end - start
        while remaining and (block := self._file.read(min(remaining, _READ_BYTES))):
            crc, remaining = zlib.crc32(block, crc), remaining - len(block)
        return zlib.crc32(footer[:25], crc) == expected_crc

    def _add(self, location: RecordLocation) -> None:
        # Raises `ValueError` for invalid entries.
        index, opcode = self._index, location.opcode
        self._record_counter.add(opcode)
        self._opcodes.add(opcode)
        if opcode == Opcode.CHUNK_INDEX:
            self._add_chunk(read_chunk_info(_read_content(self._file, location)))
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            if location.length <= _MAX_SCHEMA_BYTES:
                index.definitions.add(opcode, _read_content(self._file, location))
        elif opcode == Opcode.STATISTICS and location.length <= _MAX_METADATA_BYTES:
            statistics = read_record("Statistics", _read_content(self._file, location))
            index.counts, self._message_count = statistics.channel_message_counts, statistics.message_count
            index_counts = {
                Opcode.METADATA_INDEX: statistics.metadata_count,
                Opcode.ATTACHMENT_INDEX: statistics.attachment_count,
            }
            self._required_index_opcodes = frozenset(
                index_opcode for index_opcode, count in index_counts.items() if count
            )
        elif opcode == Opcode.METADATA_INDEX and location.length <= _MAX_HEADER_BYTES:
            entry = read_record("MetadataIndex", _read_content(self._file, location))
            if entry.offset + entry.length <= index.end and self._is_new(entry.offset):
                _read_metadata(
                    self._file,
                    RecordLocation(entry.offset, Opcode.METADATA, max(0, entry.length - HEAD_BYTES)),
                    index,
                )
        elif opcode == Opcode.ATTACHMENT_INDEX and location.length <= _MAX_HEADER_BYTES:
            record = read_record("AttachmentIndex", _read_content(self._file, location))
            if self._is_new(record.offset) and len(index.attachments) < _MAX_ATTACHMENTS:
                index.attachments.append(AttachedFile(record.name, record.media_type, record.data_size))

    def _is_new(self, offset: int) -> bool:
        # False for a second entry with the same offset.
        if offset in self._seen_offsets:
            return False
        self._seen_offsets.add(offset)
        return True

    def _add_chunk(self, info: ChunkInfo) -> None:
        end = info.offset + info.length + info.index_bytes
        if info.offset < len(MAGIC) or info.length < HEAD_BYTES or end > self._index.end:
            raise ValueError("a chunk beyond the file")
        if not self._is_new(info.offset):
            raise ValueError("two entries for one chunk")
        if not info.packed_offsets:
            damage = _index_records(self._file, info, self._index.definitions, self._budget)
            self._index.corruption.extend(damage)
        if info.packed_offsets:
            self._index.chunks.append(info)

    def _is_plausible(self, start: int) -> bool:
        # Chunks must not overlap, all channels must be known, and everything in the file must be listed.
        index, channels = self._index, self._index.definitions.channels
        if not self._required_index_opcodes <= self._opcodes:
            return False
        end = 0
        for info in sorted(index.chunks, key=lambda each: each.offset):
            if info.offset < end or info.offset + info.length > start:
                return False
            end = info.offset + info.length
        if any(channel not in channels for info in index.chunks for channel in info.channels):
            return False
        if len(index.chunks) > _MAX_COUNTED_CHUNKS or not all(info.index_bytes for info in index.chunks):
            return True
        return self._message_count <= sum(sum(info.counts.values()) for info in index.chunks)


# ---- from the records


class _Scanner:
    """Builder of an index for a file without summary, from its chunks and runs of messages."""

    def __init__(
        self,
        file: BinaryIO,
        path: Path,
        size: int,
        budget: ReadBudget,
        progress: Callable[[int, int], object] | None,
        data_end: int,
    ) -> None:
        self._file, self._size, self._budget, self._progress = file, size, budget, progress
        self._data_end = data_end
        self._index = FileIndex(end=len(MAGIC))
        self._chunk: ChunkInfo | None = None
        self._offsets: dict[int, int] = {}
        self._run: ChunkInfo | None = None
        self._counts: dict[int, int] = {}
        self._record_counter = RecordCounter(path)

    def run(self) -> FileIndex:
        # Raises `RecordingTooLargeError`, `OSError`, and what `progress` raises.
        index, reported_end = self._index, 0
        is_closed = self._data_end < self._size
        for location in walk_records(self._file, self._data_end, self._budget):
            self._add(location)
            index.end = location.end
            if self._progress is not None and index.end - reported_end >= _READ_BYTES:
                reported_end = index.end
                self._progress(index.end, self._size)
            if location.opcode == Opcode.DATA_END:
                index.end = self._data_end if is_closed else location.end
                break
        self._end_chunk()
        self._end_run()
        if is_closed and index.end < self._data_end:  # the file is not truncated, so the rest is damaged
            index.corruption.append(CorruptRange(index.end, self._data_end - index.end))
        for chunk in index.chunks:  # other programs write a schema into any chunk before its channel
            if index.definitions.lacks_schemas and not chunk.is_run:
                _index_records(self._file, chunk, index.definitions, self._budget)
        if is_closed and index.end == self._data_end:
            index.end = self._size
        return index

    def _add(self, location: RecordLocation) -> None:
        opcode = location.opcode
        if opcode == Opcode.MESSAGE:
            self._end_chunk()
            self._add_message(location)
            return
        if opcode == Opcode.MESSAGE_INDEX:
            if self._chunk is not None and location.length >= 2:
                self._offsets[int.from_bytes(location.prefix[:2], "little")] = location.offset
                self._chunk.index_bytes += HEAD_BYTES + location.length
            return
        self._end_chunk()
        self._record_counter.add(opcode)
        if opcode == Opcode.CHUNK or location.length > _MAX_RUN_RECORD_BYTES:
            self._end_run()
        if opcode == Opcode.CHUNK:
            self._start_chunk(location)
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            if location.length <= _MAX_SCHEMA_BYTES:
                self._index.definitions.add(opcode, _read_content(self._file, location))
        elif opcode == Opcode.METADATA:
            _read_metadata(self._file, location, self._index)
        elif opcode == Opcode.ATTACHMENT:
            self._add_attachment(location)

    # -- messages outside of chunks

    def _add_message(self, location: RecordLocation) -> None:
        if location.length < MESSAGE_FIELDS_BYTES:
            return
        channel, _sequence, log_ns = MESSAGE_START.unpack_from(location.prefix)
        run = self._run
        if run is None or location.end - run.offset > _MAX_RUN_BYTES:
            self._end_run()
            run = self._run = ChunkInfo(log_ns, log_ns, location.offset, 0, b"", 0, "", 0, 0, is_run=True)
        run.length = location.end - run.offset
        if log_ns < run.start_ns:
            run.start_ns = log_ns
        elif log_ns > run.end_ns:
            run.end_ns = log_ns
        self._counts[channel] = self._counts.get(channel, 0) + 1

    def _end_run(self) -> None:
        run, self._run = self._run, None
        if run is None:
            return
        run.compressed_bytes = run.uncompressed_bytes = run.length
        run.packed_counts = pack_channel_map(self._counts)
        run.packed_offsets = pack_channel_map(dict.fromkeys(self._counts, 0))
        self._counts = {}
        self._index.chunks.append(run)

    # -- chunks

    def _start_chunk(self, location: RecordLocation) -> None:
        header = read_chunk_head(
            RECORD_HEAD.pack(location.opcode, location.length) + location.prefix, location.length
        )
        if header is None:
            self._index.corruption.append(CorruptRange(location.offset, HEAD_BYTES + location.length))
        else:
            self._chunk = _chunk_info(location, header)

    def _end_chunk(self) -> None:
        # Called after the message indexes of the chunk.
        if self._chunk is None:
            return
        chunk, self._chunk = self._chunk, None
        chunk.packed_offsets, self._offsets = pack_channel_map(self._offsets), {}
        channels = self._index.definitions.channels
        if not chunk.packed_offsets or not all(each in channels for each in chunk.channels):
            damage = _index_records(self._file, chunk, self._index.definitions, self._budget)
            self._index.corruption.extend(damage)
        if chunk.packed_offsets:
            self._index.chunks.append(chunk)

    def _add_attachment(self, location: RecordLocation) -> None:
        if len(self._index.attachments) >= _MAX_ATTACHMENTS:
            return
        self._file.seek(location.offset + HEAD_BYTES + 16)  # after its two times
        head = self._file.read(min(location.length, _MAX_HEADER_BYTES))
        texts, offset = [], 0
        for _word in range(2):
            end = offset + 4 + int.from_bytes(head[offset : offset + 4], "little")
            if end + 4 > len(head):
                return
            texts.append(head[offset + 4 : end].decode("utf-8", "replace"))
            offset = end
        size = int.from_bytes(head[offset : offset + 8], "little")
        self._index.attachments.append(AttachedFile(texts[0], texts[1], min(size, location.length)))


def _chunk_info(location: RecordLocation, header: ChunkHead) -> ChunkInfo:
    return ChunkInfo(
        header.start_ns,
        header.end_ns,
        location.offset,
        HEAD_BYTES + location.length,
        b"",
        0,
        header.compression,
        header.data_bytes,
        header.uncompressed_bytes,
    )


def _index_records(
    file: BinaryIO, info: ChunkInfo, definitions: Definitions, budget: ReadBudget
) -> list[CorruptRange]:
    # For files without message indexes; an offset of 0 means no index.
    budget.spend(info.length)
    try:
        chunk = read_chunk(file, info)
    except ValueError:
        return (
            []
            if info.packed_offsets
            else [CorruptRange(info.offset, info.length, info.start_ns, info.end_ns)]
        )
    budget.spend(len(chunk))
    channels, counts = info.index_offsets, dict[int, int]()
    for number, record in enumerate(records_in(chunk), 1):
        if number % 1_000 == 0:
            budget.spend(1_000 * RECORD_COST_BYTES)
        if isinstance(record, RawMessage):
            counts[record.channel] = counts.get(record.channel, 0) + 1
        elif record[0] in {Opcode.SCHEMA, Opcode.CHANNEL}:
            definitions.add(*record)
    for channel in counts:
        channels.setdefault(channel, 0)
    info.packed_offsets, info.packed_counts = pack_channel_map(channels), pack_channel_map(counts)
    return []


def read_chunk(file: BinaryIO, info: ChunkInfo) -> bytes | memoryview:
    """Read a chunk and return its decompressed records.

    Raises:
        ValueError: The chunk is damaged or too large.
        OSError: The file can't be read.
    """
    if info.length > MAX_CHUNK_BYTES:
        raise ValueError("size")
    file.seek(info.offset)
    record = memoryview(file.read(info.length))
    if len(record) != info.length:
        raise ValueError("cut")
    if info.is_run:
        return record
    if len(record) < HEAD_BYTES or record[0] != Opcode.CHUNK:
        raise ValueError("cut")
    header = read_chunk_head(record, info.length - HEAD_BYTES)
    if header is None:
        raise ValueError("head")
    return decompress(record[header.data_offset :], header)


def read_entries(file: BinaryIO, info: ChunkInfo, channel: int) -> Sequence[tuple[int, int]] | None:
    """Read the message index of a channel in a chunk.

    Args:
        file: Open file.
        info: Metadata of the chunk.
        channel: Id of the channel.

    Returns:
        Tuples (log time, offset in the chunk) of the channel's messages; None if there is no message index.
    """
    offset = info.index_offsets.get(channel, 0)
    if not info.has_index_at(offset):
        return None
    file.seek(offset)
    record_head = file.read(HEAD_BYTES)
    if len(record_head) < HEAD_BYTES:
        return None
    opcode, length = RECORD_HEAD.unpack(record_head)
    if opcode != Opcode.MESSAGE_INDEX or length > info.index_bytes:
        return None
    try:
        number, entries = read_message_index(file.read(length))
    except ValueError:
        return None
    return list(entries) if number == channel else None
