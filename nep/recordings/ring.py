"""FlightRecorder: the last minute, always. A ring of files on the disk, bounded in bytes and seconds.

What comes is written into segments; the oldest is removed when there are too many bytes, or when all of it
is older than asked. `keep` makes a recording of the last seconds by copying chunks as they are; meanwhile the
ring goes on.
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
from nep.recordings.formats.compression import decompressed
from nep.recordings.formats.destination import USUAL_LIMITS, WriterLimits, disk_sentence
from nep.recordings.formats.figures import TopicFigures, read_figures
from nep.recordings.formats.mcap_file import ChannelTable, FileWriter
from nep.recordings.formats.records import (
    HEAD_BYTES,
    ChunkInfo,
    Opcode,
    RawMessage,
    chunk_head,
    messages_in,
)
from nep.recordings.writer import LogClock, RecordingWriter

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["FlightRecorder", "KeptRecording", "RingStatus"]

_SEGMENTS = 8
"""So many make the whole time, or all the bytes."""
_PREFIX = "ring-"
_MOST_SECONDS = 1e9


@dataclass(frozen=True)
class RingStatus:
    """What is there to be kept: seconds, bytes on the disk. `unkept`: messages; `problem`: why it ended."""

    seconds: float
    size_bytes: int
    unkept: int
    problem: str = ""


@dataclass(frozen=True)
class KeptRecording:
    """What `keep` has made."""

    path: Path
    message_count: int
    duration_s: float


@dataclass
class _Segment:
    """A file of the ring. `users`: recordings that are being made of it just now."""

    writer: FileWriter
    users: int = 0
    is_unwanted: bool = False

    @property
    def path(self) -> Path:
        """Where it is."""
        return self.writer.path


class _Segments:
    """The destination of a ring's writer; `copied` and `status` may be asked by other threads."""

    def __init__(self, folder: Path, seconds: float, size_bytes: int, least_free_bytes: int) -> None:
        """Raises `OSError`."""
        self.table = ChannelTable()
        self._folder = folder
        self._span_ns, self._size_bytes = int(seconds * 1e9), size_bytes
        self._least_free_bytes = least_free_bytes
        self._lock = threading.Lock()
        self._number = 0
        folder.mkdir(parents=True, exist_ok=True)
        _remove_left_behind(folder)
        self._all: list[_Segment] = [self._new()]

    def _new(self) -> _Segment:
        self._number += 1
        path = self._folder / f"{_PREFIX}{os.getpid()}-{id(self):x}-{self._number}.mcap"
        return _Segment(FileWriter(path, self.table, is_new=False, keeps_chunks=True))

    @property
    def file(self) -> FileWriter:
        """See `Destination`."""
        return self._all[-1].writer

    def flushed(self) -> None:
        """A new segment when this one has its share, and the oldest are removed."""
        writer = self._all[-1].writer
        if writer.start_ns is None:
            return
        is_old = writer.end_ns - writer.start_ns >= self._span_ns // _SEGMENTS
        if is_old or writer.size_bytes >= self._size_bytes // _SEGMENTS:
            new = self._new()
            with self._lock:
                self._all.append(new)
            writer.close()
        with self._lock:
            self._trim()

    def _trim(self) -> None:
        newest = max(each.writer.end_ns for each in self._all)
        while len(self._all) > 1:
            oldest = self._all[0]
            total = sum(each.writer.size_bytes for each in self._all)
            if oldest.writer.end_ns >= newest - self._span_ns and total <= self._size_bytes:
                return
            self._remove_oldest()

    def _remove_oldest(self) -> None:
        oldest = self._all.pop(0)
        oldest.is_unwanted = True
        if not oldest.users:
            _remove(oldest.path)

    def look(self) -> None:
        """See `Destination`: it makes room before it ends."""
        while shutil.disk_usage(self._folder).free < self._least_free_bytes:
            with self._lock:
                if len(self._all) == 1:
                    raise RecordingError(str(self._folder), _("the disk is full"))
                if self._all[0].users:  # it frees nothing yet, and whoever copies it is soon done
                    return
                self._remove_oldest()

    is_full = False
    """Never: segments are removed as a whole, and hold no counts of their own."""

    def next_file(self) -> None:
        """See `Destination`."""

    def finish(self) -> None:
        """Nothing of it is needed any more."""
        with self._lock:
            for each in self._all:
                with suppress(OSError):
                    each.writer.close()
                each.is_unwanted = True
                if not each.users:
                    _remove(each.path)
            self._all = self._all[-1:]

    fail = finish

    def status(self) -> tuple[float, int]:
        """(seconds, bytes) that are there."""
        with self._lock:
            starts = [each.writer.start_ns for each in self._all if each.writer.start_ns is not None]
            size = sum(each.writer.size_bytes for each in self._all)
            return (self._newest() - min(starts)) / 1e9 if starts else 0.0, size

    def _newest(self) -> int:
        return max(each.writer.end_ns for each in self._all)

    def take(self, seconds: float) -> list[tuple[_Segment, list[ChunkInfo]]]:
        """The chunks of the last seconds; `give_back` their segments."""
        with self._lock:
            since = self._newest() - int(seconds * 1e9)
            taken = []
            for segment in self._all:
                chunks = [each for each in segment.writer.chunks or () if each.end_ns >= since]
                if chunks:
                    segment.users += 1
                    taken.append((segment, chunks))
            return taken

    def give_back(self, taken: Sequence[tuple[_Segment, list[ChunkInfo]]]) -> None:
        """They are copied."""
        with self._lock:
            for segment, _chunks in taken:
                segment.users -= 1
                if segment.is_unwanted and not segment.users:
                    _remove(segment.path)


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()


def _remove_left_behind(folder: Path) -> None:
    """Segments of processes that are gone."""
    for each in folder.glob(f"{_PREFIX}*-*.mcap"):
        pid = each.name.removeprefix(_PREFIX).split("-")[0]
        if pid.isascii() and pid.isdigit() and int(pid) < 2**31 and not psutil.pid_exists(int(pid)):
            _remove(each)


class FlightRecorder:
    """Keeps the last seconds of what is posted. Use it from any thread; a context manager."""

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        seconds: float = 60.0,
        size_bytes: int = 2_000_000_000,
        clock: Callable[[], int] | None = None,
        limits: WriterLimits = USUAL_LIMITS,
        on_problem: Callable[[str], object] | None = None,
    ) -> None:
        """Begin. `folder` is for its files alone; it is made. Raises `RecordingError`, and `ValueError`."""
        if not 0.0 < seconds < _MOST_SECONDS or size_bytes < 1:
            raise ValueError(_("a ring has more than 0 seconds and bytes"))
        path = Path(folder)
        self._clock = LogClock() if clock is None else clock
        try:
            self._segments = _Segments(path, seconds, size_bytes, limits.least_free_bytes)
        except OSError as error:
            raise disk_sentence(path, error) from error
        self._writer = RecordingWriter(
            self._segments, clock=self._clock, limits=limits, on_problem=on_problem
        )

    def post(self, messages: Sequence[Message]) -> None:
        """Messages that came now. Never waits, never raises; a sink of `Node.new_sub`."""
        self._writer.post(messages)

    def say(self, role: Role, value: object) -> None:
        """See `RecordingWriter.say`."""
        self._writer.say(role, value)

    @property
    def status(self) -> RingStatus:
        """What is there now."""
        seconds, size_bytes = self._segments.status()
        status = self._writer.status
        return RingStatus(seconds, size_bytes, status.unkept, status.problem)

    def keep(self, path: str | os.PathLike[str], seconds: float, note: str = "") -> KeptRecording:
        """Make a recording of the last seconds that are there, and half a second before at most.

        They end with the newest message. Takes as long as copying so many bytes, and what comes meanwhile is
        kept on. Raises `RecordingError`, also when nothing has come yet, and `ValueError` for no time.
        """
        if not 0.0 < seconds < _MOST_SECONDS:
            raise ValueError(_("a ring has more than 0 seconds and bytes"))
        target = Path(path)
        if not self._writer.flush():
            raise RecordingError(str(target), self._writer.problem or _("the disk does not answer"))
        taken = self._segments.take(seconds)
        if not taken:
            raise RecordingError(str(target), _("no message has come yet"))
        try:
            return self._copied(target, taken, note)
        except FileExistsError:
            raise RecordingError(
                str(target), _("there is such a file already; choose another name")
            ) from None
        except OSError as error:
            raise disk_sentence(target, error) from error
        finally:
            self._segments.give_back(taken)

    def _copied(
        self, target: Path, taken: Sequence[tuple[_Segment, list[ChunkInfo]]], note: str
    ) -> KeptRecording:
        writer = FileWriter(target, self._segments.table)
        try:
            figures = _FiguresSince(self._segments.table)
            damaged = 0
            for segment, chunks in taken:
                with segment.path.open("rb") as file:
                    for chunk in chunks:
                        damaged += not _copy(file, chunk, writer, figures)
            if damaged and writer.start_ns is None:
                raise ValueError("nothing is left")
            words = {"note": note, "started_ns": str(writer.start_ns or 0), "ended_ns": str(writer.end_ns)}
            writer.add_metadata("nep.recording", {**words, "end": "", "kept": "1", "damaged": str(damaged)})
            told = figures.figures(writer.counts)
            if told:
                plain = {topic: orjson.dumps(each.to_plain()).decode() for topic, each in told.items()}
                writer.add_metadata("nep.figures", plain)
            writer.finish()
        except (OSError, ValueError) as error:
            writer.close()
            _remove(target)
            if isinstance(error, ValueError):
                raise RecordingError(str(target), _("what was to be kept is damaged on the disk")) from error
            raise
        count = sum(each.received - each.unkept for each in told.values())
        return KeptRecording(target, count, (writer.end_ns - (writer.start_ns or writer.end_ns)) / 1e9)

    def close(self) -> None:
        """End, and remove its files. May be called twice."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def _copy(file: BinaryIO, chunk: ChunkInfo, writer: FileWriter, figures: _FiguresSince) -> bool:
    """Copy a chunk; False when something has damaged it on the disk. Raises `OSError`."""
    file.seek(chunk.offset)
    record = memoryview(file.read(chunk.length))
    if len(record) != chunk.length or record[0] != Opcode.CHUNK:
        return False
    head = chunk_head(record, chunk.length - HEAD_BYTES)
    indexes = dict(_indexes(file.read(chunk.index_bytes)))
    if head is None or head.start_ns != chunk.start_ns or indexes.keys() != set(chunk.channels):
        return False
    if figures.wants(chunk):
        try:
            figures.read(decompressed(record[head.data_at :], head))
        except ValueError:
            return False
    writer.copy_chunk(record, chunk, indexes)
    return True


def _indexes(data: bytes) -> Iterator[tuple[int, bytes]]:
    """(channel, message index) of those that stand one behind the other."""
    at = 0
    while at + HEAD_BYTES + 2 <= len(data):
        length = HEAD_BYTES + int.from_bytes(data[at + 1 : at + HEAD_BYTES], "little")
        index = data[at : at + length]
        yield int.from_bytes(index[HEAD_BYTES : HEAD_BYTES + 2], "little"), index
        at += length


class _FiguresSince:
    """What was lost within some chunks: the ring's own counts begin when it began."""

    def __init__(self, table: ChannelTable) -> None:
        self._table = table
        self._first: dict[str, TopicFigures] = {}
        self._last: dict[str, TopicFigures] = {}

    def _role(self, channel: int) -> str:
        return dict(self._table.definitions[channel].metadata).get("nep.role", "")

    def wants(self, chunk: ChunkInfo) -> bool:
        """Whether there are counts in it."""
        return any(self._role(each) == "figures" for each in chunk.channels)

    def read(self, records: bytes | memoryview) -> None:
        """The records of the next chunk that has some."""
        for record in messages_in(records):
            if not isinstance(record, RawMessage) or self._role(record.channel) != "figures":
                continue
            for topic, plain in orjson.loads(record.data)["topics"].items():
                figures = read_figures(plain)
                if figures is not None:
                    self._first.setdefault(topic, figures)
                    self._last[topic] = figures

    def figures(self, counts: dict[int, int]) -> dict[str, TopicFigures]:
        """Of each topic that has messages, by the messages of each channel that were copied."""
        kept: dict[str, int] = {}
        for channel, count in counts.items():
            if not self._role(channel):
                topic = self._table.definitions[channel].topic
                kept[topic] = kept.get(topic, 0) + count
        return {topic: self._difference(topic, count) for topic, count in kept.items()}

    def _difference(self, topic: str, count: int) -> TopicFigures:
        nothing = TopicFigures()
        made = self._last.get(topic, nothing).since(self._first.get(topic, nothing))
        return replace(made, received=count + made.unkept)
