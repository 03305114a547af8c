"""Reading of raw messages at any time of a recording, with bounded memory.

This module provides channels and bytes, so that it can run in another process
(`nep.recordings.apart.remote`); `nep.recordings.reader` provides topics and messages.
"""

from __future__ import annotations

import os
import threading
from array import array
from bisect import bisect_left, bisect_right
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Protocol

from nep.errors import ClosedError
from nep.recordings.formats.channels import ChannelDefinition
from nep.recordings.formats.compression import check_packages
from nep.recordings.formats.destination import disk_error
from nep.recordings.formats.index import (
    AttachedFile,
    CorruptRange,
    FileIndex,
    read_chunk,
    read_entries,
    read_index,
)
from nep.recordings.formats.limits import ReadBudget
from nep.recordings.formats.records import ChunkInfo, RawMessage, records_in

if TYPE_CHECKING:
    from typing_extensions import Self


CACHE_BYTES = 64_000_000
_MAX_EXACT_CHUNKS = 200
"""Maximum number of chunks, some minutes long, that `densities` counts exactly with message indexes."""
_MAX_COUNTED_CHUNKS = 10_000
"""Maximum number of chunks that are counted. For more chunks, the statistics in the file are used."""
_MAX_OVERLAP_BYTES = 64_000_000
"""Maximum size in bytes of overlapping chunks in memory; if it is exceeded, messages are not fully sorted."""
_LARGE_CHUNK_BYTES = 8_000_000
"""Chunk size above which messages are copied, so that a single message doesn't retain the whole chunk."""


@dataclass(frozen=True)
class FileInfo:
    """Properties of an open recording file.

    Attributes:
        channels: Channels by id.
        counts: Number of messages by channel id; channels without messages may be missing.
        start_ns: Time of the first message in ns since 1970; 0 if there are no messages.
        end_ns: Time of the last message in ns since 1970; 0 if there are no messages.
        size_bytes: Size of the intact part of the file.
        is_complete: True if the file was closed properly.
        metadata: Metadata records, as (name, values).
        attachments: Attached files.
        compressions: Number of chunks by compression ("" for none, "-" for messages outside of chunks).
        profile: MCAP profile.
        library: Program that wrote the file.
    """

    channels: Mapping[int, ChannelDefinition]
    counts: Mapping[int, int]
    start_ns: int = 0
    end_ns: int = 0
    size_bytes: int = 0
    is_complete: bool = True
    metadata: Sequence[tuple[str, Mapping[str, str]]] = ()
    attachments: Sequence[AttachedFile] = ()
    compressions: Mapping[str, int] = field(default_factory=dict)
    profile: str = ""
    library: str = ""


class RawFile(Protocol):
    """Interface to a recording file that is open in this or another process. Thread-safe."""

    @property
    def info(self) -> FileInfo:
        """Properties of the file."""

    @property
    def corruption(self) -> Sequence[CorruptRange]:
        """Unreadable places of the file found so far."""

    def read_raw(
        self,
        start_ns: int | None,
        end_ns: int | None,
        channels: Collection[int],
        chunk_indexes: Collection[int] | None = None,
    ) -> Iterator[RawMessage]:
        """Iterate over the messages of some channels, sorted by log time.

        Args:
            start_ns: Start in ns since 1970 (inclusive); None for no limit.
            end_ns: End in ns since 1970 (exclusive); None for no limit.
            channels: Ids of the channels.
            chunk_indexes: Indexes of the chunks to read, as returned by `chunks_with`; None for all.
        """

    def newest(self, at_ns: int, groups: Sequence[Collection[int]]) -> list[RawMessage | None]:
        """Return the last message at or before a time for each group of channels; None if there is none.

        Args:
            at_ns: Time in ns since 1970.
            groups: Groups of channel ids.
        """

    def newest_times(self, at_ns: int, channels: Collection[int]) -> dict[int, int]:
        """Return the log time of the last message at or before `at_ns`, by channel id.

        Channels without such a message are omitted. Messages are read only where indexes are missing.
        """

    def densities(
        self, start_ns: int, end_ns: int, buckets: int, channels: Collection[int]
    ) -> dict[int, Sequence[int]]:
        """Return the number of messages in each of several equal time intervals, by channel id.

        Long spans may be estimated. Channels without messages in the span may be missing.

        Args:
            start_ns: Start of the first interval in ns since 1970.
            end_ns: End of the last interval (exclusive).
            buckets: Number of intervals.
            channels: Ids of the channels.
        """

    def chunks_with(self, channels: Collection[int]) -> Sequence[int]:
        """Return the indexes of the chunks that contain messages of these channels, in order."""

    def close(self) -> None:
        """Close the file. Later calls raise `ClosedError`. Idempotent."""


class _LoadedChunk:
    """Decompressed chunk in memory."""

    def __init__(self, data: bytes | memoryview) -> None:
        self.data = data
        self._offsets: dict[int, array[int]] | None = None

    def messages(self, info: ChunkInfo, channels: Collection[int]) -> Iterator[RawMessage]:
        # Indexed at the first search for few channels among many.
        if self._offsets is None and all(each in channels for each in info.channels):
            for record in records_in(self.data):
                if isinstance(record, RawMessage) and record.channel in channels:
                    yield record
            return
        offsets = self._offsets if self._offsets is not None else self._index()
        channel_offsets = [offsets[each] for each in channels if each in offsets]
        for offset in (
            channel_offsets[0]
            if len(channel_offsets) == 1
            else sorted(each for offset_group in channel_offsets for each in offset_group)
        ):
            indexed_record = next(records_in(self.data, offset), None)
            if isinstance(indexed_record, RawMessage):
                yield indexed_record

    def _index(self) -> dict[int, array[int]]:
        offsets: dict[int, array[int]] = {}
        for record in records_in(self.data):
            if isinstance(record, RawMessage):
                if record.channel not in offsets:
                    offsets[record.channel] = array("Q")
                offsets[record.channel].append(record.offset)
        self._offsets = offsets
        return offsets


class FileReader:
    """Recording file that is read in this process (a `RawFile`)."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        cache_bytes: int = CACHE_BYTES,
        progress: Callable[[int, int], object] | None = None,
        budget: ReadBudget | None = None,
    ) -> None:
        """Open a file using its summary or, if there is none, by scanning the records.

        Args:
            path: File to open.
            cache_bytes: Maximum size of cached decompressed chunks.
            progress: Called with bytes done and in total during a scan; its exceptions propagate.
            budget: Limit of the work until the file is closed; None limits only opening.

        Raises:
            RecordingError: The file can't be opened or is not a recording.
            RecordingTooLargeError: The file exceeds a limit.
            RecordingsUnavailableError: Packages for recordings are not installed.
        """
        check_packages()
        self.path = Path(path)
        self._lock = threading.RLock()
        self._budget = budget
        self._corrupt_ranges: dict[int, CorruptRange] = {}
        self._unreadable_chunks: set[int] = set()
        self._cache: OrderedDict[int, _LoadedChunk] = OrderedDict()
        self._cache_bytes, self._cached_bytes = cache_bytes, 0
        try:
            self._file: BinaryIO = open(self.path, "rb", buffering=65_536)  # noqa: SIM115, PTH123
        except OSError as error:
            raise disk_error(self.path, error) from error
        try:
            self._index: FileIndex = read_index(self._file, self.path, progress, budget)
            self._chunks = self._index.chunks
            self._starts = array("Q", [each.start_ns for each in self._chunks])
            self._latest_ends = array("Q")
            self._chunks_by_channel: dict[int, array[int]] = {}
            self._index_chunks()
            self._info = self._read_info()
        except OSError as error:
            self._file.close()
            raise disk_error(self.path, error) from error
        except BaseException:
            self._file.close()
            raise

    def _index_chunks(self) -> None:
        latest = 0
        for number, chunk in enumerate(self._chunks):
            latest = max(latest, chunk.end_ns)
            self._latest_ends.append(latest)
            for channel in chunk.channels:
                if channel not in self._chunks_by_channel:
                    self._chunks_by_channel[channel] = array("L")
                self._chunks_by_channel[channel].append(number)

    def _read_info(self) -> FileInfo:
        index, compressions = self._index, dict[str, int]()
        for chunk in self._chunks:
            name = "-" if chunk.is_run else chunk.compression
            compressions[name] = compressions.get(name, 0) + 1
        counts = index.counts
        if counts is None or len(self._chunks) <= _MAX_COUNTED_CHUNKS:
            counts = {}
            for chunk_index in range(len(self._chunks)):
                for channel, count in self._chunk_counts(chunk_index).items():
                    counts[channel] = counts.get(channel, 0) + count
        return FileInfo(
            index.definitions.channels,
            counts,
            self._starts[0] if self._chunks else 0,
            self._latest_ends[-1] if self._chunks else 0,
            index.end,
            index.is_complete,
            tuple(index.metadata),
            tuple(index.attachments),
            compressions,
            index.profile,
            index.library,
        )

    @property
    def info(self) -> FileInfo:
        """Properties of the file."""
        return self._info

    @property
    def corruption(self) -> Sequence[CorruptRange]:
        """Unreadable places of the file found so far."""
        with self._lock:
            return tuple(
                sorted(
                    (*self._index.corruption, *self._corrupt_ranges.values()),
                    key=lambda each: (each.start_ns, each.offset),
                )
            )

    def chunks(self) -> Sequence[ChunkInfo]:
        """Return the chunks of the file, sorted by time."""
        return tuple(self._chunks)

    # ---- reading

    def read_raw(
        self,
        start_ns: int | None,
        end_ns: int | None,
        channels: Collection[int],
        chunk_indexes: Collection[int] | None = None,
    ) -> Iterator[RawMessage]:
        """Iterate over the messages of some channels, sorted by log time. See `RawFile.read_raw`."""
        numbers = self._chunks_in(start_ns, end_ns, channels, chunk_indexes)
        first, last = start_ns or 0, 2**64 if end_ns is None else end_ns
        pending: list[tuple[int, int, RawMessage]] = []
        sequence = buffered_bytes = 0
        for position, number in enumerate(numbers):
            messages = [
                message for message in self._messages(number, channels) if first <= message.log_ns < last
            ]
            messages.sort(key=_log_ns)  # usually sorted, which costs no time
            next_number = numbers[position + 1] if position + 1 < len(numbers) else None
            limit_ns = 2**64 if next_number is None else self._starts[next_number]
            buffered_bytes += self._chunk_size(number)
            if next_number is None or buffered_bytes + self._chunk_size(next_number) > _MAX_OVERLAP_BYTES:
                limit_ns = 2**64
            split_index = 0 if pending else bisect_left(messages, limit_ns, key=_log_ns)
            yield from messages[:split_index]
            for message in messages[split_index:]:
                sequence += 1
                heappush(pending, (message.log_ns, sequence, message))
            del messages
            while pending and pending[0][0] < limit_ns:
                yield heappop(pending)[2]
            if not pending:
                buffered_bytes = 0

    def _chunk_size(self, number: int) -> int:
        return self._chunks[number].uncompressed_bytes

    def _chunks_in(
        self,
        start_ns: int | None,
        end_ns: int | None,
        channels: Collection[int],
        chunk_indexes: Collection[int] | None,
    ) -> list[int]:
        # Chunks that may contain such messages.
        first = 0 if start_ns is None else bisect_left(self._latest_ends, max(0, start_ns))
        last = (
            len(self._chunks) if end_ns is None else bisect_left(self._starts, max(0, min(end_ns, 2**64 - 1)))
        )
        chunk_numbers = {
            number
            for channel in channels
            for number in self._chunks_of(channel, first, last)
            if (start_ns is None or self._chunks[number].end_ns >= start_ns)
            and (chunk_indexes is None or number in chunk_indexes)
        }
        return sorted(chunk_numbers)

    def _chunks_of(self, channel: int, first: int, last: int) -> Sequence[int]:
        numbers = self._chunks_by_channel.get(channel, ())
        return numbers[bisect_left(numbers, first) : bisect_left(numbers, last)]

    def newest(self, at_ns: int, groups: Sequence[Collection[int]]) -> list[RawMessage | None]:
        """Return the last message at or before a time for each group of channels. See `RawFile.newest`."""
        messages: list[RawMessage | None] = []
        for group in groups:
            candidates = [
                (*location, channel)
                for channel in group
                if (location := self._last_before(channel, at_ns)) is not None
            ]
            messages.append(self._message_at(*max(candidates)[1:]) if candidates else None)
        return messages

    def newest_times(self, at_ns: int, channels: Collection[int]) -> dict[int, int]:
        """Return the log time of the last message by channel. See `RawFile.newest_times`."""
        locations = {channel: self._last_before(channel, at_ns) for channel in channels}
        return {channel: location[0] for channel, location in locations.items() if location is not None}

    def _last_before(self, channel: int, at_ns: int) -> tuple[int, int, int] | None:
        # (time, chunk, offset)
        numbers = self._chunks_by_channel.get(channel, array("L"))
        position = (
            bisect_right(numbers, bisect_right(self._starts, max(-1, min(at_ns, 2**64 - 1))) - 1)
            if at_ns >= 0
            else 0
        )
        best: tuple[int, int, int] | None = None
        while position > 0:
            position -= 1
            number = numbers[position]
            if best is not None and self._latest_ends[number] <= best[0]:
                break
            for log_ns, offset in self._entries(number, channel):
                if log_ns <= at_ns and (best is None or (log_ns, number, offset) > best):
                    best = (log_ns, number, offset)
        return best

    def _entries(self, number: int, channel: int) -> Sequence[tuple[int, int]]:
        with self._lock:
            self._check_open()
            try:
                entries = read_entries(self._file, self._chunks[number], channel)
            except OSError:
                entries = None
        if entries is not None:
            return entries
        return [(each.log_ns, each.offset) for each in self._messages(number, (channel,))]

    def _message_at(self, number: int, offset: int, channel: int) -> RawMessage | None:
        chunk = self._chunk(number)
        if chunk is None:
            return None
        record = next(records_in(chunk.data, offset), None)
        if not isinstance(record, RawMessage) or record.channel != channel:
            return None
        return self._detach(record, chunk)

    # ---- counts

    def densities(
        self, start_ns: int, end_ns: int, buckets: int, channels: Collection[int]
    ) -> dict[int, Sequence[int]]:
        """Return the number of messages in each of several equal time intervals. See `RawFile.densities`.

        Payloads are not read. Short spans are counted exactly with the indexes. For long spans, the
        messages of a chunk are distributed evenly over its duration, which is at most half a second in
        recordings of nep.
        """
        result: dict[int, list[int]] = {}
        first = bisect_left(self._latest_ends, max(0, start_ns))
        last = bisect_left(self._starts, max(0, min(end_ns, 2**64 - 1)))
        is_exact = last - first <= _MAX_EXACT_CHUNKS
        span = end_ns - start_ns
        for number in range(first, last):
            chunk = self._chunks[number]
            for channel, count in self._chunk_counts(number).items():
                if channel not in channels:
                    continue
                counts = result.setdefault(channel, [0] * buckets)
                if not is_exact:
                    _distribute(counts, (start_ns, end_ns), (chunk.start_ns, chunk.end_ns), count)
                    continue
                for log_ns, _offset in self._entries(number, channel):
                    if start_ns <= log_ns < end_ns:
                        counts[(log_ns - start_ns) * buckets // span] += 1
        return dict(result)

    def chunks_with(self, channels: Collection[int]) -> Sequence[int]:
        """Return the indexes of the chunks with messages of these channels. See `RawFile.chunks_with`."""
        return sorted({number for channel in channels for number in self._chunks_by_channel.get(channel, ())})

    def _chunk_counts(self, number: int) -> Mapping[int, int]:
        # Reads the chunk if it has no indexes.
        chunk = self._chunks[number]
        counts = chunk.counts
        if len(counts) < chunk.channel_count:
            missing = set(chunk.channels) - counts.keys()
            for message in self._messages(number, missing):
                counts[message.channel] = counts.get(message.channel, 0) + 1
        return counts

    # ---- chunks

    def check(
        self, progress: Callable[[int, int], object] | None = None, max_bytes: int | None = None
    ) -> bool:
        """Read every chunk once, so that `corruption` becomes complete.

        Args:
            progress: Called with bytes done and in total.
            max_bytes: Maximum decompressed size to read; None for no limit.

        Returns:
            False if the check stopped at `max_bytes`.
        """
        done, total = 0, sum(each.length for each in self._chunks)
        expanded_bytes = 0
        for number, chunk in enumerate(self._chunks):
            expanded_bytes += chunk.uncompressed_bytes
            if max_bytes is not None and expanded_bytes > max_bytes:
                return False
            self._chunk(number)
            done += chunk.length
            if progress is not None:
                progress(done, total)
        return True

    def _messages(self, number: int, channels: Collection[int]) -> Iterator[RawMessage]:
        chunk = self._chunk(number)
        if chunk is not None:
            for message in chunk.messages(self._chunks[number], channels):
                yield self._detach(message, chunk)

    def _detach(self, raw: RawMessage, chunk: _LoadedChunk) -> RawMessage:
        if len(chunk.data) <= _LARGE_CHUNK_BYTES:
            return raw
        return raw._replace(data=memoryview(bytes(raw.data)))

    def _chunk(self, number: int) -> _LoadedChunk | None:
        # None if it is damaged.
        with self._lock:
            self._check_open()
            cached = self._cache.get(number)
            if cached is not None:
                self._cache.move_to_end(number)
                return cached
            if number in self._unreadable_chunks:
                return None
            info = self._chunks[number]
            if self._budget is not None:
                self._budget.spend(max(info.length, info.uncompressed_bytes))
            self._evict_chunks(info.uncompressed_bytes)
            try:
                chunk = _LoadedChunk(read_chunk(self._file, info))
            except (ValueError, OSError) as error:
                self._corrupt_ranges[number] = self._corrupt_range(info)
                if isinstance(error, ValueError):  # an I/O error may be temporary
                    self._unreadable_chunks.add(number)
                return None
            self._corrupt_ranges.pop(number, None)
            self._cache[number] = chunk
            self._cached_bytes += len(chunk.data)
            return chunk

    def _corrupt_range(self, info: ChunkInfo) -> CorruptRange:
        counts = info.counts
        own_channels = {
            number
            for number, each in self._index.definitions.channels.items()
            if number in counts and "nep.role" in dict(each.metadata)
        }
        is_known = len(counts) == info.channel_count > 0
        count = (
            sum(message_count for channel, message_count in counts.items() if channel not in own_channels)
            if is_known
            else None
        )
        return CorruptRange(info.offset, info.length, info.start_ns, info.end_ns, count)

    def _evict_chunks(self, size: int) -> None:
        while self._cache and self._cached_bytes + size > self._cache_bytes:
            self._cached_bytes -= len(self._cache.popitem(last=False)[1].data)

    def _check_open(self) -> None:
        if self._file.closed:
            raise ClosedError(f"recording '{self.path.name}'")

    def close(self) -> None:
        """Close the file. Idempotent."""
        with self._lock:
            self._file.close()
            self._cache.clear()
            self._cached_bytes = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def _distribute(counts: list[int], span: tuple[int, int], chunk: tuple[int, int], count: int) -> None:
    # Distributes messages evenly over the chunk's time.
    (start, end), (chunk_start, chunk_end), buckets = span, chunk, len(counts)
    first = (chunk_start - start) * buckets // (end - start)
    last = (chunk_end - start) * buckets // (end - start)
    if first == last:
        if 0 <= first < buckets:
            counts[first] += count
        return

    def count_until(bucket: int) -> int:
        if bucket < first:
            return 0
        if bucket >= last:
            return count
        part_end = start + (bucket + 1) * (end - start) // buckets
        return count * (part_end - chunk_start) // (chunk_end - chunk_start)

    covered = range(max(0, first), min(last, buckets - 1) + 1)
    before = count_until(covered.start - 1)
    for bucket in covered:
        total = count_until(bucket)
        counts[bucket] += total - before
        before = total


def _log_ns(raw: RawMessage) -> int:
    return raw.log_ns
