"""`FlightRecorder`: ring buffer on disk that contains the newest messages, limited in bytes and seconds.

Messages are written to files, called segments. The oldest segment is deleted if the ring exceeds its size, or
if the segment is older than the time limit. `FlightRecorder.save` copies the chunks of the last seconds
to a recording while the ring continues.
"""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import orjson
import psutil

from nep.errors import RecordingError
from nep.i18n import _
from nep.messages.message import Message
from nep.recordings.formats.channels import Role
from nep.recordings.formats.compression import decompress
from nep.recordings.formats.destination import DEFAULT_LIMITS, WriterLimits, disk_error
from nep.recordings.formats.mcap_file import ChannelTable, FileWriter
from nep.recordings.formats.message_counts import TopicStats, parse_stats
from nep.recordings.formats.records import (
    HEAD_BYTES,
    ChunkInfo,
    Opcode,
    RawMessage,
    read_chunk_head,
    records_in,
)
from nep.recordings.writer import LogClock, RecordingWriter

if TYPE_CHECKING:
    from typing_extensions import Self


_SEGMENT_COUNT = 8
"""Number of segments of a full ring."""
_PREFIX = "ring-"
_MAX_SECONDS = 1e9


@dataclass(frozen=True)
class RingStatus:
    """State of a ring.

    Attributes:
        seconds: Time span of the messages in the ring, in seconds.
        size_bytes: Size on disk.
        unkept: Number of received messages that were not recorded because writing was too slow.
        problem: Error that stopped the ring, or "".
    """

    seconds: float
    size_bytes: int
    unkept: int
    problem: str = ""


@dataclass(frozen=True)
class SavedRecording:
    """Recording that was saved by `FlightRecorder.save`.

    Attributes:
        path: File of the recording.
        message_count: Number of messages.
        duration_s: Duration in seconds.
    """

    path: Path
    message_count: int
    duration_s: float


@dataclass
class _Segment:
    """File of the ring.

    Attributes:
        writer: Writer of the file.
        user_count: Number of recordings for which the file is currently copied.
        is_removed: True if the file is deleted when it is no longer copied.
    """

    writer: FileWriter
    user_count: int = 0
    is_removed: bool = False

    @property
    def path(self) -> Path:
        return self.writer.path


class _Segments:
    """Destination of the ring's writer. `select`, `release` and `status` are thread-safe."""

    def __init__(self, folder: Path, seconds: float, size_bytes: int, min_free_bytes: int) -> None:
        self.table = ChannelTable()
        self._folder = folder
        self._span_ns, self._size_bytes = int(seconds * 1e9), size_bytes
        self._min_free_bytes = min_free_bytes
        self._lock = threading.Lock()
        self._number = 0
        folder.mkdir(parents=True, exist_ok=True)
        _remove_stale_segments(folder)
        self._segments: list[_Segment] = [self._new_segment()]

    def _new_segment(self) -> _Segment:
        self._number += 1
        path = self._folder / f"{_PREFIX}{os.getpid()}-{id(self):x}-{self._number}.mcap"
        return _Segment(FileWriter(path, self.table, is_new=False, keeps_chunks=True))

    @property
    def file(self) -> FileWriter:
        return self._segments[-1].writer

    def on_flushed(self) -> None:
        # Starts a new segment when this one has its share, and removes the oldest.
        writer = self._segments[-1].writer
        if writer.start_ns is None:
            return
        is_old = writer.end_ns - writer.start_ns >= self._span_ns // _SEGMENT_COUNT
        if is_old or writer.size_bytes >= self._size_bytes // _SEGMENT_COUNT:
            new_segment = self._new_segment()
            with self._lock:
                self._segments.append(new_segment)
            writer.close()
        with self._lock:
            self._trim_locked()

    def _trim_locked(self) -> None:
        newest = max(each.writer.end_ns for each in self._segments)
        while len(self._segments) > 1:
            oldest = self._segments[0]
            total = sum(each.writer.size_bytes for each in self._segments)
            if oldest.writer.end_ns >= newest - self._span_ns and total <= self._size_bytes:
                return
            self._remove_oldest_locked()

    def _remove_oldest_locked(self) -> None:
        oldest = self._segments.pop(0)
        oldest.is_removed = True
        if not oldest.user_count:
            _remove(oldest.path)

    def check_file(self) -> None:
        # Frees space before it raises.
        while shutil.disk_usage(self._folder).free < self._min_free_bytes:
            with self._lock:
                if len(self._segments) == 1:
                    raise RecordingError(str(self._folder), _("the disk is full"))
                if self._segments[0].user_count:  # removing it would free nothing until the copy is done
                    return
                self._remove_oldest_locked()

    is_full = False
    """Always False, because old segments are deleted without being finished."""

    def next_file(self) -> None: ...

    def finish(self) -> None:
        with self._lock:
            for segment in self._segments:
                with suppress(OSError):
                    segment.writer.close()
                segment.is_removed = True
                if not segment.user_count:
                    _remove(segment.path)
            self._segments = self._segments[-1:]

    abort = finish

    def status(self) -> tuple[float, int]:
        with self._lock:
            starts = [each.writer.start_ns for each in self._segments if each.writer.start_ns is not None]
            size = sum(each.writer.size_bytes for each in self._segments)
            return (self._newest_ns_locked() - min(starts)) / 1e9 if starts else 0.0, size

    def _newest_ns_locked(self) -> int:
        return max(each.writer.end_ns for each in self._segments)

    def select(self, seconds: float) -> list[tuple[_Segment, list[ChunkInfo]]]:
        # Call `release` afterwards.
        with self._lock:
            since_ns = self._newest_ns_locked() - int(seconds * 1e9)
            segments = []
            for segment in self._segments:
                chunks = [each for each in segment.writer.chunks or () if each.end_ns >= since_ns]
                if chunks:
                    segment.user_count += 1
                    segments.append((segment, chunks))
            return segments

    def release(self, segments: Sequence[tuple[_Segment, list[ChunkInfo]]]) -> None:
        with self._lock:
            for segment, _chunks in segments:
                segment.user_count -= 1
                if segment.is_removed and not segment.user_count:
                    _remove(segment.path)


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()


def _remove_stale_segments(folder: Path) -> None:
    # Of processes that have ended.
    for path in folder.glob(f"{_PREFIX}*-*.mcap"):
        pid = path.name.removeprefix(_PREFIX).split("-")[0]
        if pid.isascii() and pid.isdigit() and int(pid) < 2**31 and not psutil.pid_exists(int(pid)):
            _remove(path)


class FlightRecorder:
    """Flight recorder: buffers the messages of the last seconds on disk.

    Thread-safe; usable as a context manager.

        with FlightRecorder("ring", seconds=60.0) as ring, Recorder(node, ring):
            ...
            ring.save("incident.mcap", seconds=30.0)
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        seconds: float = 60.0,
        size_bytes: int = 2_000_000_000,
        clock: Callable[[], int] | None = None,
        limits: WriterLimits = DEFAULT_LIMITS,
        on_problem: Callable[[str], object] | None = None,
    ) -> None:
        """Start the ring.

        Args:
            folder: Folder for the ring's files only; created if needed.
            seconds: Length of the buffer in seconds.
            size_bytes: Maximum size on disk.
            clock: Clock for times of receipt in ns since 1970, which must not decrease; None for the
                default.
            limits: Limits of the writer.
            on_problem: Called once with the reason if the ring stops because of an error.

        Raises:
            RecordingError: The folder can't be written.
            ValueError: `seconds` or `size_bytes` is not positive.
        """
        if not 0.0 < seconds < _MAX_SECONDS or size_bytes < 1:
            raise ValueError(_("the duration and the size of the flight recorder must be greater than 0"))
        path = Path(folder)
        self._clock = LogClock() if clock is None else clock
        try:
            self._segments = _Segments(path, seconds, size_bytes, limits.min_free_bytes)
        except OSError as error:
            raise disk_error(path, error) from error
        self._writer = RecordingWriter(
            self._segments, clock=self._clock, limits=limits, on_problem=on_problem
        )

    def post(self, messages: Sequence[Message]) -> None:
        """Add messages that were just received.

        Never blocks or raises; usable as `sink` of `Node.new_sub`.
        """
        self._writer.post(messages)

    def write_entry(self, role: Role, value: object) -> None:
        """Record an entry of the recorder itself. See `RecordingWriter.write_entry`."""
        self._writer.write_entry(role, value)

    @property
    def status(self) -> RingStatus:
        """Current state of the ring."""
        seconds, size_bytes = self._segments.status()
        status = self._writer.status
        return RingStatus(seconds, size_bytes, status.unkept, status.problem)

    def save(self, path: str | os.PathLike[str], seconds: float, note: str = "") -> SavedRecording:
        """Save the last seconds, up to the newest message, as a recording.

        The recording may start up to half a second earlier. The call returns when all bytes are copied;
        the ring continues meanwhile.

        Args:
            path: File to write, which must not exist.
            seconds: Duration to save in seconds.
            note: Text for the metadata.

        Raises:
            RecordingError: No message was received yet, the ring has stopped because of an error, or
                the file exists or can't be written.
            ValueError: `seconds` is not positive.
        """
        if not 0.0 < seconds < _MAX_SECONDS:
            raise ValueError(_("the duration must be finite and greater than 0"))
        target = Path(path)
        if not self._writer.flush():
            raise RecordingError(str(target), self._writer.problem or _("the disk doesn't respond"))
        segments = self._segments.select(seconds)
        if not segments:
            raise RecordingError(str(target), _("no messages received yet"))
        try:
            return self._copy_segments(target, segments, note)
        except FileExistsError:
            raise RecordingError(str(target), _("the file already exists; choose another name")) from None
        except OSError as error:
            raise disk_error(target, error) from error
        finally:
            self._segments.release(segments)

    def _copy_segments(
        self, target: Path, segments: Sequence[tuple[_Segment, list[ChunkInfo]]], note: str
    ) -> SavedRecording:
        writer = FileWriter(target, self._segments.table)
        try:
            chunk_stats = _ChunkStats(self._segments.table)
            damaged_count = 0
            for segment, chunks in segments:
                with segment.path.open("rb") as file:
                    for chunk in chunks:
                        damaged_count += not _copy_chunk(file, chunk, writer, chunk_stats)
            if damaged_count and writer.start_ns is None:
                raise ValueError("nothing is left")
            metadata = {"note": note, "started_ns": str(writer.start_ns or 0), "ended_ns": str(writer.end_ns)}
            writer.add_metadata(
                "nep.recording", {**metadata, "end": "", "kept": "1", "damaged": str(damaged_count)}
            )
            totals = chunk_stats.stats(writer.counts)
            if totals:
                stats_by_topic = {
                    topic: orjson.dumps(each.to_plain()).decode() for topic, each in totals.items()
                }
                writer.add_metadata("nep.figures", stats_by_topic)
            writer.finish()
        except (OSError, ValueError) as error:
            writer.close()
            _remove(target)
            if isinstance(error, ValueError):
                raise RecordingError(
                    str(target), _("the messages buffered on the disk are damaged")
                ) from error
            raise
        count = sum(each.received - each.unkept for each in totals.values())
        return SavedRecording(target, count, (writer.end_ns - (writer.start_ns or writer.end_ns)) / 1e9)

    def close(self) -> None:
        """Stop the ring and delete its files. Idempotent."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def _copy_chunk(file: BinaryIO, chunk: ChunkInfo, writer: FileWriter, chunk_stats: _ChunkStats) -> bool:
    # False if it was damaged on disk. Raises `OSError`.
    file.seek(chunk.offset)
    record = memoryview(file.read(chunk.length))
    if len(record) != chunk.length or record[0] != Opcode.CHUNK:
        return False
    header = read_chunk_head(record, chunk.length - HEAD_BYTES)
    indexes = dict(_split_indexes(file.read(chunk.index_bytes)))
    if header is None or header.start_ns != chunk.start_ns or indexes.keys() != set(chunk.channels):
        return False
    if chunk_stats.has_stats(chunk):
        try:
            chunk_stats.read(decompress(record[header.data_offset :], header))
        except ValueError:
            return False
    writer.copy_chunk(record, chunk, indexes)
    return True


def _split_indexes(data: bytes) -> Iterator[tuple[int, bytes]]:
    # (channel, message index) of consecutive records.
    offset = 0
    while offset + HEAD_BYTES + 2 <= len(data):
        length = HEAD_BYTES + int.from_bytes(data[offset + 1 : offset + HEAD_BYTES], "little")
        index = data[offset : offset + length]
        yield int.from_bytes(index[HEAD_BYTES : HEAD_BYTES + 2], "little"), index
        offset += length


class _ChunkStats:
    """Message counts within the saved chunks.

    The counts are differences, because the ring counts messages since its start.
    """

    def __init__(self, table: ChannelTable) -> None:
        self._table = table
        self._first: dict[str, TopicStats] = {}
        self._last: dict[str, TopicStats] = {}

    def _role(self, channel: int) -> str:
        return dict(self._table.definitions[channel].metadata).get("nep.role", "")

    def has_stats(self, chunk: ChunkInfo) -> bool:
        return any(self._role(each) == "figures" for each in chunk.channels)

    def read(self, records: bytes | memoryview) -> None:
        for record in records_in(records):
            if not isinstance(record, RawMessage) or self._role(record.channel) != "figures":
                continue
            for topic, fields in orjson.loads(record.data)["topics"].items():
                stats = parse_stats(fields)
                if stats is not None:
                    self._first.setdefault(topic, stats)
                    self._last[topic] = stats

    def stats(self, counts: dict[int, int]) -> dict[str, TopicStats]:
        counts_by_topic: dict[str, int] = {}
        for channel, count in counts.items():
            if not self._role(channel):
                topic = self._table.definitions[channel].topic
                counts_by_topic[topic] = counts_by_topic.get(topic, 0) + count
        return {topic: self._difference(topic, count) for topic, count in counts_by_topic.items()}

    def _difference(self, topic: str, count: int) -> TopicStats:
        no_stats = TopicStats()
        difference = self._last.get(topic, no_stats).difference(self._first.get(topic, no_stats))
        return replace(difference, received=count + difference.unkept)
