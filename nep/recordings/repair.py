"""Repair of truncated and damaged recordings by copying their intact messages to a new file.

Records are read up to the end or a damaged place. A chunk with a wrong CRC is skipped, and reading continues
with the next intact chunk. All whole messages of a truncated last chunk are recovered. The new file is
verified, and the old file is not modified.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import orjson

from nep.errors import RecordingError, RecordingTooLargeError
from nep.i18n import _
from nep.recordings.formats.channels import ChannelDecoder
from nep.recordings.formats.compression import check_packages, decompress, decompress_partial
from nep.recordings.formats.destination import disk_error
from nep.recordings.formats.index import MAX_RECORD_BYTES, Definitions, RecordCounter, read_chunk, read_index
from nep.recordings.formats.limits import open_budget
from nep.recordings.formats.mcap_file import ChannelTable, FileWriter
from nep.recordings.formats.records import (
    CHUNK_HEAD_BYTES,
    HEAD_BYTES,
    MAGIC,
    MAX_CHUNK_BYTES,
    RECORD_HEAD,
    ChunkHead,
    ChunkInfo,
    Opcode,
    RawMessage,
    pack_message_index,
    read_chunk_head,
    read_message_index,
    read_record,
    records_in,
)
from nep.recordings.formats.walk import RecordLocation
from nep.system.replace_file import replace_file

_WINDOW_BYTES = 4_000_000
_CHUNK_PATTERN = re.compile(rb"\x06.{4}[\x00-\x7f]\x00\x00\x00", re.DOTALL)
"""Pattern that finds chunk records: the opcode of a chunk, followed by a length below 2^39."""
_FLUSH_BYTES = 1_000_000
_PARSED_OPCODES = frozenset(
    {Opcode.MESSAGE, Opcode.MESSAGE_INDEX, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA}
)
"""Opcodes of records that a repair parses. If such a record is very long, its length is damaged."""


@dataclass(frozen=True)
class RepairReport:
    """Result of a repair.

    Attributes:
        path: New file.
        recovered: Number of messages in the new file.
        discarded: Number of lost messages; None if unknown.
        discarded_bytes: Number of unreadable bytes in the old file; 0 if nothing was lost.
        lost_s: Time in seconds between the last recovered message and the end of the recording, as far as
            known.
        duration_s: Duration of the new file in seconds.
        corrupt_range_count: Number of damaged places in the old file.
    """

    path: Path
    recovered: int
    discarded: int | None
    discarded_bytes: int
    lost_s: float
    duration_s: float
    corrupt_range_count: int

    @property
    def is_complete(self) -> bool:
        """True if nothing was lost, as when the old file merely wasn't closed properly."""
        return not self.discarded_bytes and not self.discarded


@dataclass
class _Counts:
    recovered: int = 0
    discarded: int = 0
    discarded_bytes: int = 0
    is_unknown: bool = False
    """True if the number of lost messages is unknown."""
    corrupt_range_count: int = 0
    last_ns: int = 0
    """Time of the end of the recording in ns since 1970, as far as known."""
    stats: dict[str, object] = field(default_factory=dict)
    recorder_metadata: dict[str, str] = field(default_factory=dict)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)


def repaired_path(path: Path) -> Path:
    """Return an unused file name next to a damaged recording."""
    candidate = path.with_name(f"{path.stem}.repaired.mcap")
    number = 2
    while candidate.exists():
        candidate = path.with_name(f"{path.stem}.repaired-{number}.mcap")
        number += 1
    return candidate


def repair(
    path: Path, target: Path | None = None, progress: Callable[[int, int], object] | None = None
) -> RepairReport:
    """Write the intact part of a recording to a new file, and verify the new file.

    Args:
        path: Damaged recording.
        target: File to write; None for `repaired_path`.
        progress: Called with bytes done and in total.

    Raises:
        RecordingError: The recording can't be read, no message can be decoded, or the target exists or
            can't be written.
        RecordingsUnavailableError: A package is not installed.
    """
    check_packages()
    target = repaired_path(path) if target is None else target
    if target.exists():
        raise RecordingError(str(target), _("the file already exists; choose another name"))
    part_path = target.with_name(f"{target.name}.part")
    try:
        file = path.open("rb")
    except OSError as error:
        raise disk_error(path, error) from error
    try:
        with file:
            repairer = _Repair(file, path, part_path, progress or _no_progress)
            try:
                counts = repairer.run()
                first_ns, last_ns = _verify(part_path, repairer.writer)
                if not counts.recovered:
                    raise RecordingError(str(path), _("no message can be decoded"))
                replace_file(part_path, target)
            finally:
                repairer.writer.close()
    except OSError as error:
        raise disk_error(target, error) from error
    finally:
        with suppress(OSError):
            part_path.unlink(missing_ok=True)
    return RepairReport(
        target,
        counts.recovered,
        None if counts.is_unknown else counts.discarded,
        counts.discarded_bytes,
        max(0, counts.last_ns - last_ns) / 1e9,
        (last_ns - first_ns) / 1e9,
        counts.corrupt_range_count,
    )


def _no_progress(_done: int, _total: int) -> None:
    pass


def _verify(path: Path, writer: FileWriter) -> tuple[int, int]:
    # Verifies the new file; returns the times of its first and last message. Raises `RecordingError`.
    counts: dict[int, int] = {}
    with path.open("rb") as file:
        index = read_index(file, path)
        if not index.is_complete:
            raise RecordingError(str(path), _("the recovered messages can't be read back"))
        for info in index.chunks:
            try:
                chunk = read_chunk(file, info)
            except ValueError as error:
                raise RecordingError(str(path), _("the recovered messages can't be read back")) from error
            for record in records_in(chunk):
                if isinstance(record, RawMessage):
                    counts[record.channel] = counts.get(record.channel, 0) + 1
    if counts != writer.counts:
        raise RecordingError(str(path), _("the recovered messages can't be read back"))
    return writer.start_ns or 0, writer.end_ns


class _Repair:
    """State of the repair of one file."""

    def __init__(
        self, file: BinaryIO, path: Path, target: Path, progress: Callable[[int, int], object]
    ) -> None:
        self._file = file
        self._progress = progress
        self._size = file.seek(0, io.SEEK_END)
        self._search_budget = open_budget(path, self._size)
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC and not self._has_chunk_after(0):
            raise RecordingError(str(path), _("not an MCAP file"))
        self._definitions = self._known_definitions(path)
        self._table = ChannelTable(self._definitions.channels)
        self._counts = _Counts()
        self._corrupt_chunk: ChunkHead | None = None
        self._record_counter = RecordCounter(path)
        self.writer = FileWriter(target, self._table, is_new=False)

    def _known_definitions(self, path: Path) -> Definitions:
        # From the summary, if it is intact, so that damage can't lose a channel.
        try:
            index = read_index(self._file, path)
        except RecordingError:
            return Definitions()
        return index.definitions

    def run(self) -> _Counts:
        # Raises `OSError`.
        offset = len(MAGIC)
        while offset + HEAD_BYTES <= self._size:
            self._progress(offset, self._size)
            location = self._record_location(offset)
            if location is not None:
                self._record_counter.add(location.opcode)
            if location is not None and location.opcode == Opcode.DATA_END:
                break
            if location is not None and self._copy(location):
                offset += HEAD_BYTES + location.length
                continue
            offset = self._skip_corruption(offset)
        else:
            self._count_discarded_bytes(max(0, self._size - offset))
        self._finish()
        self._progress(self._size, self._size)
        return self._counts

    def _record_location(self, offset: int) -> RecordLocation | None:
        # The record may be truncated.
        self._file.seek(offset)
        opcode, length = RECORD_HEAD.unpack(self._file.read(HEAD_BYTES))
        is_known = 0 < opcode <= Opcode.DATA_END or opcode >= 0x80
        return RecordLocation(offset, opcode, length) if is_known and length < 2**39 else None

    def _copy(self, location: RecordLocation) -> bool:
        # False if it is not a whole record.
        end = location.offset + HEAD_BYTES + location.length
        if end > self._size:
            return False
        if location.opcode == Opcode.CHUNK:
            return self._copy_chunk_at(location)
        limit = MAX_CHUNK_BYTES if location.opcode == Opcode.MESSAGE else MAX_RECORD_BYTES
        if location.opcode in _PARSED_OPCODES and location.length > limit:
            return False
        if location.opcode == Opcode.MESSAGE_INDEX:
            self._count_lost(location)
        elif location.opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            self._define(location.opcode, self._read_content(location))
        elif location.opcode == Opcode.METADATA:
            self._copy_metadata(self._read_content(location))
        elif location.opcode == Opcode.MESSAGE:
            self._file.seek(location.offset)
            for record in records_in(self._file.read(end - location.offset)):
                self._copy_record(record)
        return self._is_record_at(end)

    def _is_record_at(self, offset: int) -> bool:
        # A damaged length would lead to arbitrary bytes.
        if offset + HEAD_BYTES > self._size:
            return True
        return self._record_location(offset) is not None

    def _read_content(self, location: RecordLocation) -> bytes:
        self._file.seek(location.offset + HEAD_BYTES)
        return self._file.read(location.length)

    def _define(self, opcode: int, content: bytes | memoryview) -> None:
        for number in self._definitions.add(opcode, content):
            self._table.add_with_id(number, self._definitions.channels[number])

    def _copy_metadata(self, content: bytes) -> None:
        try:
            record = read_record("Metadata", content)
        except ValueError:
            return
        if record.name == "nep.recording":
            self._counts.recorder_metadata.update(record.metadata)
        elif record.name == "nep.figures":
            for topic, text in record.metadata.items():
                with suppress(orjson.JSONDecodeError):
                    self._counts.stats[topic] = orjson.loads(text)
        else:
            self._counts.metadata.append((record.name, record.metadata))

    # ---- chunks

    def _copy_chunk_at(self, location: RecordLocation) -> bool:
        self._file.seek(location.offset)
        header = read_chunk_head(self._file.read(CHUNK_HEAD_BYTES), location.length)
        self._corrupt_chunk = None
        if header is None:
            return False
        self._file.seek(location.offset)
        record = memoryview(self._file.read(HEAD_BYTES + location.length))
        try:
            chunk = decompress(record[header.data_offset :], header)
        except ValueError:
            if not self._is_record_at(location.offset + HEAD_BYTES + location.length):
                return False
            self._corrupt_chunk = header
            self._counts.corrupt_range_count += 1
            self._counts.is_unknown = True  # until its message indexes are read
            self._counts.last_ns = max(self._counts.last_ns, header.end_ns)
            self._count_discarded_bytes(HEAD_BYTES + location.length)
            return True
        self._counts.last_ns = max(self._counts.last_ns, header.end_ns)
        self._copy_chunk(record, header, chunk)
        return True

    def _copy_chunk(self, record: memoryview, header: ChunkHead, chunk: bytes | memoryview) -> None:
        # Copied unchanged if it contains only messages of known channels.
        indexes: dict[int, list[int]] = {}
        is_plain = True
        for item in records_in(chunk):
            if not isinstance(item, RawMessage) or item.channel not in self._definitions.channels:
                is_plain = False
                break
            indexes.setdefault(item.channel, []).extend((item.log_ns, item.offset))
            self._read_entry(item)
        if not is_plain or not indexes:
            for item in records_in(chunk):
                self._copy_record(item)
            return
        info = ChunkInfo(
            header.start_ns,
            header.end_ns,
            0,
            len(record),
            b"",
            0,
            header.compression,
            header.data_bytes,
            header.uncompressed_bytes,
        )
        encoded_indexes = {number: pack_message_index(number, entries) for number, entries in indexes.items()}
        self.writer.copy_chunk(record, info, encoded_indexes)
        self._counts.recovered += sum(
            len(entries) // 2 for number, entries in indexes.items() if not self._is_recorder_channel(number)
        )

    def _copy_record(self, record: RawMessage | tuple[int, memoryview]) -> None:
        # From outside of chunks, or from a chunk that can't be copied unchanged.
        if not isinstance(record, RawMessage):
            self._define(*record)
            return
        self._counts.last_ns = max(self._counts.last_ns, record.log_ns)
        if record.channel not in self._definitions.channels:
            self._counts.discarded += 1
            return
        self._read_entry(record)
        self.writer.add(
            record.channel, (record.log_ns, record.publish_ns), record.sequence, b"", bytes(record.data)
        )
        if not self._is_recorder_channel(record.channel):
            self._counts.recovered += 1
        if self.writer.pending_bytes >= _FLUSH_BYTES:
            self.writer.flush()

    def _role(self, channel: int) -> str:
        return dict(self._definitions.channels[channel].metadata).get("nep.role", "")

    def _is_recorder_channel(self, channel: int) -> bool:
        return bool(self._role(channel))

    def _read_entry(self, record: RawMessage) -> None:
        # The recorder's counts are written to the metadata of the new file, too.
        if self._role(record.channel) != "figures":
            return
        with suppress(orjson.JSONDecodeError, AttributeError):
            self._counts.stats.update(orjson.loads(record.data).get("topics", {}))

    def _count_lost(self, location: RecordLocation) -> None:
        # The index of a damaged chunk has the number of its lost messages.
        if self._corrupt_chunk is None:
            return
        with suppress(ValueError):
            channel, entries = read_message_index(self._read_content(location))
            definition = self._definitions.channels.get(channel)
            if definition is None or ChannelDecoder(definition).role is None:
                self._counts.discarded += len(entries)
            self._counts.is_unknown = False

    # ---- damage

    def _count_discarded_bytes(self, count: int) -> None:
        self._counts.discarded_bytes += count

    def _skip_corruption(self, offset: int) -> int:
        # Returns the offset to continue at. Keeps whole messages of a chunk truncated by the end of the file.
        chunk_offset = next(self._complete_chunks(offset + 1), None)
        self._counts.corrupt_range_count += 1
        self._counts.is_unknown = True
        if chunk_offset is None:
            copied_bytes = self._copy_truncated_chunk(offset)
            self._count_discarded_bytes(self._size - offset - copied_bytes)
            return self._size
        self._count_discarded_bytes(chunk_offset - offset)
        return chunk_offset

    def _has_chunk_after(self, offset: int) -> bool:
        return next(self._complete_chunks(offset), None) is not None

    def _complete_chunks(self, offset: int) -> Iterator[int]:
        # Offsets of chunks with a valid CRC.
        while offset + CHUNK_HEAD_BYTES <= self._size:
            self._file.seek(offset)
            window = self._file.read(_WINDOW_BYTES)
            for match in _CHUNK_PATTERN.finditer(window):
                window_offset = match.start()
                _opcode, length = RECORD_HEAD.unpack_from(window, window_offset)
                if offset + window_offset + HEAD_BYTES + length > self._size:
                    continue
                try:
                    is_whole = self._is_complete_chunk(offset + window_offset, length)
                except RecordingTooLargeError:  # too many places look like chunks
                    return
                if is_whole:
                    yield offset + window_offset
            offset += max(1, len(window) - CHUNK_HEAD_BYTES)
            self._progress(min(offset, self._size), self._size)

    def _is_complete_chunk(self, offset: int, length: int) -> bool:
        self._file.seek(offset)
        header = read_chunk_head(self._file.read(CHUNK_HEAD_BYTES), length)
        if header is None or not header.crc:
            return False
        self._search_budget.spend(header.data_bytes + min(header.uncompressed_bytes, _WINDOW_BYTES))
        self._file.seek(offset + header.data_offset)
        try:
            decompress(memoryview(self._file.read(header.data_bytes)), header)
        except ValueError:
            return False
        return True

    def _copy_truncated_chunk(self, offset: int) -> int:
        # Returns the number of its bytes in the file.
        self._file.seek(offset)
        head = self._file.read(CHUNK_HEAD_BYTES)
        if len(head) < HEAD_BYTES or head[0] != Opcode.CHUNK:
            return 0
        _opcode, length = RECORD_HEAD.unpack_from(head)
        header = read_chunk_head(head, length)
        if header is None or offset + HEAD_BYTES + length <= self._size:
            return 0
        self._file.seek(offset)
        record = memoryview(self._file.read(HEAD_BYTES + length))
        self._counts.last_ns = max(self._counts.last_ns, header.end_ns)
        recovered_before = self._counts.recovered
        for item in records_in(decompress_partial(record[header.data_offset :], header)):
            if isinstance(item, RawMessage):
                is_plausible = header.start_ns <= item.log_ns <= header.end_ns
                if not is_plausible or item.channel not in self._definitions.channels:
                    break
            self._copy_record(item)
        return len(record) if self._counts.recovered > recovered_before else 0

    # ---- finishing

    def _finish(self) -> None:
        counts, writer = self._counts, self.writer
        writer.flush()
        recorder_metadata = dict(counts.recorder_metadata)
        recorder_metadata["repaired"] = "1"
        recorder_metadata["recovered"] = str(counts.recovered)
        recorder_metadata["discarded"] = "" if counts.is_unknown else str(counts.discarded)
        recorder_metadata["discarded_bytes"] = str(counts.discarded_bytes)
        writer.add_metadata("nep.recording", recorder_metadata)
        if counts.stats:
            stats_by_topic = {topic: orjson.dumps(each).decode() for topic, each in counts.stats.items()}
            writer.add_metadata("nep.figures", stats_by_topic)
        for name, values in counts.metadata:
            writer.add_metadata(name, values)
        writer.finish()
