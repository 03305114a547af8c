"""MCAP writer: chunks with indexes, and the summary.

This module replaces the writer of the package `mcap` for three reasons: the flight recorder copies chunks
from other files unchanged; after a failed write, the file must end with a whole record; and channels are
written before and outside of the chunk that first uses them, so that a damaged chunk doesn't affect them.
"""

from __future__ import annotations

import os
import zlib
from array import array
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from nep.recordings.formats.channels import ChannelDefinition
from nep.recordings.formats.compression import check_packages, compress
from nep.recordings.formats.records import (
    MAGIC,
    ChunkInfo,
    Opcode,
    message_count,
    pack_channel_map,
    pack_chunk,
    pack_chunk_info,
    pack_message_head,
    pack_message_index,
    pack_record,
)
from nep.system.lazy_import import lazy_module
from nep.version import __version__

if TYPE_CHECKING:
    import mcap.records as mcap_records
else:  # optional for programs that don't record
    mcap_records = lazy_module("mcap.records")


CHUNK_BYTES = 1_000_000
MAX_CHANNELS = 65_535
"""Maximum number of channels, because channel numbers have 16 bits."""


class ChannelTable:
    """Assignment of ids to channels and schemas.

    Files that share a table can copy each other's chunks.

    Args:
        definitions: Channels that already have an id, by id.
    """

    def __init__(self, definitions: Mapping[int, ChannelDefinition] | None = None) -> None:
        """Create a table."""
        self.definitions: dict[int, ChannelDefinition] = {}
        self._ids: dict[ChannelDefinition, int] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._next = 1
        for number, definition in (definitions or {}).items():
            self._add(number, definition)

    def channel_id(self, definition: ChannelDefinition) -> int | None:
        """Return the id of a channel, assigning one if needed; None if there are too many channels."""
        number = self._ids.get(definition)
        if number is None:
            if self._next > MAX_CHANNELS:
                return None
            number = self._next
            self._add(number, definition)
        return number

    def add_with_id(self, number: int, definition: ChannelDefinition) -> None:
        """Add a channel with a given id, unless the id is already assigned."""
        if number not in self.definitions:
            self._add(number, definition)

    def has(self, definition: ChannelDefinition) -> bool:
        """Return True if a channel already has an id."""
        return definition in self._ids

    def _add(self, number: int, definition: ChannelDefinition) -> None:
        # The schema gets its number here, because other threads may call `records` concurrently.
        key = (definition.schema_name, definition.schema_encoding, definition.schema_data)
        if key[1]:
            self._schemas.setdefault(key, len(self._schemas) + 1)
        self.definitions[number] = definition
        self._ids[definition] = number
        self._next = max(self._next, number + 1)

    def records(self, number: int) -> tuple[mcap_records.Schema | None, mcap_records.Channel]:
        """Return the schema record (None without a schema) and the channel record of a channel id."""
        definition = self.definitions[number]
        key = (definition.schema_name, definition.schema_encoding, definition.schema_data)
        schema_number = self._schemas.get(key, 0)
        channel = mcap_records.Channel(
            id=number,
            topic=definition.topic,
            message_encoding=definition.message_encoding,
            schema_id=schema_number,
            metadata=dict(definition.metadata),
        )
        if not schema_number:
            return None, channel
        return mcap_records.Schema(
            id=schema_number,
            data=definition.schema_data,
            encoding=definition.schema_encoding,
            name=definition.schema_name,
        ), channel


def _open_private_file(path: str, flags: int) -> int:
    # Readable by the owner only: recordings may contain camera images and sound.
    return os.open(path, flags, 0o600)


class _Chunk:
    """Chunk to which messages are being added."""

    def __init__(self) -> None:
        self.parts: list[bytes | memoryview] = []
        self.size = 0
        self.start_ns = 0
        self.end_ns = 0
        self.indexes: dict[int, array[int]] = {}


class FileWriter:
    """Writer of one file. Not thread-safe. Every method raises `OSError` if the file can't be written.

    After an error, the file ends with the last whole record, and `finish` may still be called.
    """

    def __init__(
        self,
        path: Path,
        table: ChannelTable | None = None,
        *,
        compression: str = "zstd",
        is_new: bool = True,
        keeps_chunks: bool = False,
        profile: str = "",
    ) -> None:
        """Create the file.

        Args:
            path: File to write.
            table: Table of channel ids; None for a new one.
            compression: "zstd", "lz4", or "" for none.
            is_new: Raise `FileExistsError` if the file exists; False to overwrite it.
            keeps_chunks: Keep the list `chunks` in memory, for copying chunks.
            profile: MCAP profile of the messages, such as "ros2".

        Raises:
            OSError: The file can't be written.
            RecordingsUnavailableError: Packages for recordings are not installed.
        """
        check_packages()
        self.path = path
        self.table = ChannelTable() if table is None else table
        self.chunks: list[ChunkInfo] | None = [] if keeps_chunks else None
        """Written chunks, if they may be copied later.

        None otherwise, because of the memory for hours of recording.
        """
        self.start_ns: int | None = None
        self.end_ns = 0
        self._packed_chunks = bytearray()
        self._chunk_count = 0
        self.counts: dict[int, int] = {}
        """Number of messages by channel in the written chunks."""
        self._compression = compression
        self._file: BinaryIO = open(  # noqa: SIM115
            path, "xb" if is_new else "wb", buffering=0, opener=_open_private_file
        )
        self._position = 0
        self._chunk = _Chunk()
        self._written_channels: set[int] = set()
        self._written_schemas: set[int] = set()
        self._metadata: list[mcap_records.MetadataIndex] = []
        try:
            self._write(
                MAGIC + pack_record(mcap_records.Header(profile=profile, library=f"nep {__version__}"))
            )
        except OSError:
            self._file.close()
            with suppress(OSError):  # the file is empty
                path.unlink()
            raise

    # ---- writing

    @property
    def size_bytes(self) -> int:
        """Size of the file on disk in bytes."""
        return self._position

    @property
    def pending_bytes(self) -> int:
        """Size in bytes of the current chunk, which is not written yet."""
        return self._chunk.size

    @property
    def pending_counts(self) -> dict[int, int]:
        """Number of messages by channel in the current chunk, which is not written yet."""
        return {number: len(entries) // 2 for number, entries in self._chunk.indexes.items()}

    @property
    def message_count(self) -> int:
        """Number of messages in the file."""
        return sum(self.counts.values())

    def add(
        self, channel: int, times: tuple[int, int], sequence: int, prefix: bytes, data: bytes | memoryview
    ) -> None:
        """Add a message to the current chunk in memory.

        Args:
            channel: Id of the channel.
            times: Log time and publish time in ns since 1970.
            sequence: Sequence number in the record.
            prefix: Bytes that precede the data.
            data: Data of the message.
        """
        chunk = self._chunk
        log_ns = times[0]
        size = len(prefix) + (len(data) if isinstance(data, bytes) else data.nbytes)
        index = chunk.indexes.get(channel)
        if index is None:
            index = chunk.indexes[channel] = array("Q")
        if not chunk.parts:
            chunk.start_ns = chunk.end_ns = log_ns
        elif log_ns > chunk.end_ns:
            chunk.end_ns = log_ns
        elif log_ns < chunk.start_ns:
            chunk.start_ns = log_ns
        index.append(log_ns)
        index.append(chunk.size)
        header = pack_message_head(channel, sequence, log_ns, times[1], size)
        chunk.parts.append(header + prefix if prefix else header)
        chunk.parts.append(data)
        chunk.size += len(header) + size

    def flush(self) -> int:
        """Write the current chunk; return the number of messages written."""
        chunk = self._chunk
        if not chunk.parts:
            return 0
        data = b"".join(chunk.parts)
        crc, size = zlib.crc32(data), len(data)
        payload, compression = compress(data, self._compression), self._compression
        if len(payload) >= size:
            payload, compression = data, ""
        header = pack_chunk(payload, compression, size, crc, (chunk.start_ns, chunk.end_ns))
        indexes = {number: pack_message_index(number, entries) for number, entries in chunk.indexes.items()}
        counts = self.pending_counts
        self.write_channels(counts)
        info = ChunkInfo(
            chunk.start_ns,
            chunk.end_ns,
            self._position,
            len(header) + len(payload),
            b"",
            0,
            compression,
            len(payload),
            size,
        )
        self._write_chunk(info, [header, payload], indexes, counts)
        self._chunk = _Chunk()
        return sum(counts.values())

    def copy_chunk(self, record: bytes | memoryview, info: ChunkInfo, indexes: Mapping[int, bytes]) -> None:
        """Copy a chunk of another file that uses the same channel table.

        Args:
            record: Chunk record.
            info: Metadata of the chunk.
            indexes: Message index records by channel.
        """
        self.flush()
        counts = {number: message_count(index) for number, index in indexes.items()}
        self.write_channels(counts)
        new_info = replace(info, offset=self._position, packed_offsets=b"", index_bytes=0)
        self._write_chunk(new_info, [record], indexes, counts)

    def _write_chunk(
        self,
        info: ChunkInfo,
        record: list[bytes | memoryview],
        indexes: Mapping[int, bytes],
        counts: Mapping[int, int],
    ) -> None:
        offset = self._position + info.length
        offsets = {}
        for number, index in indexes.items():
            offsets[number] = offset
            offset += len(index)
        info.packed_offsets, info.index_bytes = pack_channel_map(offsets), offset - info.offset - info.length
        self._write(*record, b"".join(indexes.values()))
        if self.chunks is not None:
            self.chunks.append(info)
        self._packed_chunks += pack_chunk_info(info)
        self._chunk_count += 1
        self.start_ns = info.start_ns if self.start_ns is None else min(self.start_ns, info.start_ns)
        self.end_ns = max(self.end_ns, info.end_ns)
        for number, count in counts.items():
            self.counts[number] = self.counts.get(number, 0) + count

    def write_channels(self, channels: Mapping[int, object]) -> None:
        """Write the channels, and their schemas, that are not in the file yet.

        Args:
            channels: Mapping whose keys are channel ids; the values are ignored.
        """
        new_channels = [number for number in channels if number not in self._written_channels]
        if not new_channels:
            return
        parts: list[bytes | memoryview] = []
        schemas: set[int] = set()
        for number in new_channels:
            schema, channel = self.table.records(number)
            if schema is not None and schema.id not in self._written_schemas and schema.id not in schemas:
                schemas.add(schema.id)
                parts.append(pack_record(schema))
            parts.append(pack_record(channel))
        self._write(b"".join(parts))
        self._written_channels.update(new_channels)
        self._written_schemas |= schemas

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write the current chunk, followed by a metadata record."""
        self.flush()
        record = pack_record(mcap_records.Metadata(name=name, metadata=dict(values)))
        index = mcap_records.MetadataIndex(offset=self._position, length=len(record), name=name)
        self._write(record)
        self._metadata.append(index)

    def _write(self, *parts: bytes | memoryview) -> None:
        # All or nothing: a partial write is truncated. Raises `OSError`.
        size = 0
        try:
            for part in parts:
                view = memoryview(part)
                offset = 0
                while offset < view.nbytes:
                    offset += self._file.write(view[offset:]) or 0
                size += view.nbytes
        except OSError:
            self.truncate()
            raise
        self._position += size

    def truncate(self) -> None:
        """Truncate the file after its last whole record; errors are ignored."""
        try:
            self._file.truncate(self._position)
            self._file.seek(self._position)
        except OSError:
            return

    # ---- closing

    def finish(self) -> None:
        """Write the current chunk and the summary, sync and close the file."""
        try:
            self.flush()
            self._write(self._summary())
            os.fsync(self._file.fileno())
        finally:
            self._file.close()

    def close(self) -> None:
        """Close the file without a summary, so that readers must scan its records."""
        self._file.close()

    def _summary(self) -> bytes:
        data_end = pack_record(mcap_records.DataEnd(data_section_crc=0))
        start = self._position + len(data_end)
        groups = self._groups()
        summary, offsets = b"", b""
        for opcode, group in groups:
            if group:
                offsets += pack_record(
                    mcap_records.SummaryOffset(
                        group_opcode=opcode, group_start=start + len(summary), group_length=len(group)
                    )
                )
                summary += group
        footer = mcap_records.Footer(
            summary_start=start, summary_offset_start=start + len(summary), summary_crc=0
        )
        footer_prefix = pack_record(footer)[:-4]
        crc = zlib.crc32(summary + offsets + footer_prefix)
        return data_end + summary + offsets + footer_prefix + crc.to_bytes(4, "little") + MAGIC

    def _summary_order(self, number: int) -> tuple[bool, int]:
        # Wrapped channels last: viewers read all messages of a topic as those of its first channel.
        return ("nep.form", "wrapped") in self.table.definitions[number].metadata, number

    def _groups(self) -> list[tuple[Opcode, bytes]]:
        schemas: dict[int, bytes] = {}
        channels = []
        for number in sorted(self._written_channels, key=self._summary_order):
            schema, channel = self.table.records(number)
            channels.append(pack_record(channel))
            if schema is not None:
                schemas.setdefault(schema.id, pack_record(schema))
        statistics = mcap_records.Statistics(
            attachment_count=0,
            channel_count=len(channels),
            channel_message_counts=self.counts,
            chunk_count=self._chunk_count,
            message_count=self.message_count,
            message_end_time=self.end_ns,
            message_start_time=self.start_ns or 0,
            metadata_count=len(self._metadata),
            schema_count=len(schemas),
        )
        return [
            (Opcode.SCHEMA, b"".join(schemas.values())),
            (Opcode.CHANNEL, b"".join(channels)),
            (Opcode.STATISTICS, pack_record(statistics)),
            (Opcode.CHUNK_INDEX, bytes(self._packed_chunks)),
            (Opcode.METADATA_INDEX, b"".join(map(pack_record, self._metadata))),
        ]
