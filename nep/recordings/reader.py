"""Recording: reads a recording from any time on, without reading what is before; memory stays bounded."""

from __future__ import annotations

import os
import threading
from array import array
from bisect import bisect_left, bisect_right
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

import orjson

from nep.errors import ClosedError
from nep.messages.message import Message
from nep.recordings.channels import ChannelDecoder, Role
from nep.recordings.figures import TopicFigures, read_figures
from nep.recordings.index import FileIndex, read_chunk, read_entries, read_index
from nep.recordings.records import ChunkInfo, RawMessage, check_packages, messages_in
from nep.recordings.writer import disk_sentence

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["RecordedMessage", "RecordedTopic", "Recording"]

_CACHE_BYTES = 64_000_000
_MOST_EXACT = 200
"""Chunks whose message indexes are read to count exactly: what a screen shows of some minutes."""


class RecordedMessage(NamedTuple):
    """A message, and when it came (ns since 1970)."""

    log_ns: int
    message: Message


@dataclass(frozen=True)
class RecordedTopic:
    """A topic of a recording. `codec` and `msg_type` are those of its first channel.

    `publishers`: their numbers, None where one has none.
    """

    name: str
    msg_type: str
    codec: str
    message_count: int
    publishers: tuple[int | None, ...] = ()


class Recording:
    """A recording that is read. Use it from any thread; a context manager.

    `start_ns`, `end_ns`: when the first and the last message came; both 0 when there is none. `is_complete`:
    False when it was not ended: then it tells of all that is there, and `nep.recordings.repair` mends it.
    `topics`: by name. `damaged_chunks`: pieces of the file that were wanted and could not be read so far.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        cache_bytes: int = _CACHE_BYTES,
        progress: Callable[[int, int], object] | None = None,
    ) -> None:
        """Open it: by its summary at once, else by a look at the head of each record.

        `progress` is told then how many bytes of how many are done; what it raises ends it, and comes out.
        Raises `RecordingError` for what is no recording.
        """
        check_packages()
        self.path = Path(path)
        self._lock = threading.RLock()
        self.damaged_chunks = 0
        self._damaged: set[int] = set()
        self._cache: OrderedDict[int, bytes | memoryview] = OrderedDict()
        self._cache_bytes, self._cached_bytes = cache_bytes, 0
        try:
            self._file: BinaryIO = open(self.path, "rb", buffering=65_536)  # noqa: SIM115, PTH123
        except OSError as error:
            raise disk_sentence(self.path, error) from error
        try:
            self._index: FileIndex = read_index(self._file, self.path, progress)
        except OSError as error:
            self._file.close()
            raise disk_sentence(self.path, error) from error
        except BaseException:
            self._file.close()
            raise
        self.is_complete = self._index.is_complete
        self._decoders = {
            number: ChannelDecoder(each) for number, each in self._index.definitions.channels.items()
        }
        self._chunks = self._index.chunks
        self._starts = array("Q", [each.start_ns for each in self._chunks])
        self._latest_ends = array("Q")
        self._in_chunks: dict[int, array[int]] = {}
        """The chunks in which each channel has messages."""
        self._place_chunks()
        self.start_ns = self._starts[0] if self._chunks else 0
        self.end_ns = self._latest_ends[-1] if self._chunks else 0
        self.topics: Mapping[str, RecordedTopic] = self._topics()

    def _place_chunks(self) -> None:
        latest = 0
        for number, chunk in enumerate(self._chunks):
            latest = max(latest, chunk.end_ns)
            self._latest_ends.append(latest)
            for channel in chunk.channels:
                if channel not in self._in_chunks:
                    self._in_chunks[channel] = array("L")
                self._in_chunks[channel].append(number)

    def _topics(self) -> dict[str, RecordedTopic]:
        counts = self._index.counts
        if counts is None:
            counts = {}
            for at in range(len(self._chunks)):
                for channel, count in self._counts(at).items():
                    counts[channel] = counts.get(channel, 0) + count
        made: dict[str, RecordedTopic] = {}
        for number, decoder in self._decoders.items():
            if decoder.role is None and number in self._in_chunks:
                count = counts.get(number, 0)
                publishers: tuple[int | None, ...] = (decoder.publisher,)
                known = made.get(decoder.topic)
                if known is not None:
                    msg_type, codec, count = known.msg_type, known.codec, count + known.message_count
                    publishers = tuple(dict.fromkeys((*known.publishers, *publishers)))
                else:
                    msg_type, codec = decoder.msg_type, decoder.codec
                made[decoder.topic] = RecordedTopic(decoder.topic, msg_type, codec, count, publishers)
        return dict(sorted(made.items()))

    # ---- what it is

    @property
    def duration_s(self) -> float:
        """From the first message to the last one."""
        return (self.end_ns - self.start_ns) / 1e9

    @property
    def message_count(self) -> int:
        """Messages of all topics."""
        return sum(each.message_count for each in self.topics.values())

    @property
    def size_bytes(self) -> int:
        """Of the file, as far as it is whole."""
        return self._index.end

    @property
    def words(self) -> Mapping[str, str]:
        """What the recorder noted: "note", "end", "started_ns", "ended_ns"; what is not known is missing."""
        made: dict[str, str] = {}
        for name, values in self._index.metadata:
            if name == "nep.recording":
                made.update(values)
        return made

    def figures(self) -> dict[str, TopicFigures]:
        """What became of each topic's messages, as the recorder counted; empty for others' recordings.

        At once when it was ended, else by reading what it said once a second.
        """
        made: dict[str, TopicFigures] = {}
        for name, values in self._index.metadata:
            if name == "nep.figures":
                for topic, text in values.items():
                    known = read_figures(text)
                    if known is not None:
                        made[topic] = known
        if made:
            return made
        for _log_ns, each in self.figures_over_time():
            made.update(each)
        return made

    def figure_pieces(self) -> Sequence[int]:
        """The pieces of the file in which the recorder told figures, by time; nothing is read for that."""
        channels = [number for number, each in self._decoders.items() if each.role == "figures"]
        return sorted({number for channel in channels for number in self._in_chunks.get(channel, ())})

    def figures_over_time(
        self, pieces: Collection[int] | None = None
    ) -> Iterator[tuple[int, dict[str, TopicFigures]]]:
        """(time, figures of the topics that have new ones): where they grow, there something was lost.

        Of all of the file, or of some of `figure_pieces`.
        """
        for log_ns, value in self.said("figures", pieces):
            topics = value.get("topics") if isinstance(value, dict) else None
            if isinstance(topics, dict):
                made = {str(topic): read_figures(each) for topic, each in topics.items()}
                yield log_ns, {topic: each for topic, each in made.items() if each is not None}

    def said(self, role: Role, pieces: Collection[int] | None = None) -> Iterator[tuple[int, object]]:
        """(time, value) of what the recorder said: "alerts", "figures", "notes", "runs", "alarms".

        Of all of the file, or of these pieces.
        """
        channels = {number for number, each in self._decoders.items() if each.role == role}
        for _decoder, raw in self._raw(None, None, channels, pieces):
            try:
                yield raw.log_ns, orjson.loads(raw.data)
            except orjson.JSONDecodeError:
                continue

    # ---- reading

    def read(
        self,
        start_ns: int | None = None,
        end_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Iterator[RecordedMessage]:
        """Messages by the time when they came, from `start_ns` on and before `end_ns`; of all topics or some.

        A piece of the file that is damaged is passed over, and counted in `damaged_chunks`.
        """
        for decoder, raw in self._raw(start_ns, end_ns, self._channels(topics)):
            yield RecordedMessage(raw.log_ns, decoder.message(raw))

    def _channels(self, topics: Collection[str] | None) -> set[int]:
        return {
            number
            for number, each in self._decoders.items()
            if each.role is None and (topics is None or each.topic in topics)
        }

    def _raw(
        self,
        start_ns: int | None,
        end_ns: int | None,
        channels: Collection[int],
        pieces: Collection[int] | None = None,
    ) -> Iterator[tuple[ChannelDecoder, RawMessage]]:
        first = 0 if start_ns is None else bisect_left(self._latest_ends, max(0, start_ns))
        last = (
            len(self._chunks) if end_ns is None else bisect_left(self._starts, max(0, min(end_ns, 2**64 - 1)))
        )
        wanted = sorted(
            {
                number
                for channel in channels
                for number in self._chunks_of(channel, first, last)
                if (start_ns is None or self._chunks[number].end_ns >= start_ns)
                and (pieces is None or number in pieces)
            }
        )
        pending: list[RawMessage] = []
        for at, number in enumerate(wanted):
            came = [
                each
                for each in self._messages(number)
                if each.channel in channels
                and (start_ns is None or each.log_ns >= start_ns)
                and (end_ns is None or each.log_ns < end_ns)
            ]
            pending = sorted(pending + came, key=_log_ns)  # both are mostly sorted, which takes no time
            limit = self._starts[wanted[at + 1]] if at + 1 < len(wanted) else None
            until = len(pending) if limit is None else bisect_left(pending, limit, key=_log_ns)
            for raw in pending[:until]:
                yield self._decoders[raw.channel], raw
            pending = pending[until:]

    def _chunks_of(self, channel: int, first: int, last: int) -> Sequence[int]:
        numbers = self._in_chunks.get(channel, ())
        return numbers[bisect_left(numbers, first) : bisect_left(numbers, last)]

    def newest(self, at_ns: int, topics: Collection[str] | None = None) -> dict[str, RecordedMessage]:
        """The newest message of each topic that came at `at_ns` or before; topics without one are missing."""
        found: dict[str, tuple[int, int, int, int]] = {}
        for channel in self._channels(topics):
            place = self._last_before(channel, at_ns)
            topic = self._decoders[channel].topic
            if place is not None and (topic not in found or place > found[topic][:3]):
                found[topic] = (*place, channel)
        made = {}
        for topic, (log_ns, number, offset, channel) in found.items():
            message = self._message_at(number, offset, channel)
            if message is not None:
                made[topic] = RecordedMessage(log_ns, message)
        return made

    def newest_times(self, at_ns: int, topics: Collection[str] | None = None) -> dict[str, int]:
        """When the newest message of each topic came that came at `at_ns` or before; of the indexes alone."""
        made: dict[str, int] = {}
        for channel in self._channels(topics):
            place = self._last_before(channel, at_ns)
            if place is not None:
                topic = self._decoders[channel].topic
                made[topic] = max(place[0], made.get(topic, 0))
        return made

    def before(self, at_ns: int, topic: str) -> RecordedMessage | None:
        """The last message of a topic that came before `at_ns`."""
        return self.newest(at_ns - 1, (topic,)).get(topic) if at_ns > 0 else None

    def after(self, at_ns: int, topic: str) -> RecordedMessage | None:
        """The first message of a topic that came after `at_ns`."""
        return next(self.read(at_ns + 1, None, (topic,)), None)

    def _last_before(self, channel: int, at_ns: int) -> tuple[int, int, int] | None:
        """(time, chunk, offset in it) of a channel's last message up to a time."""
        numbers = self._in_chunks.get(channel, array("L"))
        place = (
            bisect_right(numbers, bisect_right(self._starts, max(-1, min(at_ns, 2**64 - 1))) - 1)
            if at_ns >= 0
            else 0
        )
        best: tuple[int, int, int] | None = None
        while place > 0:
            place -= 1
            number = numbers[place]
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
                told = read_entries(self._file, self._chunks[number], channel)
            except OSError:
                told = None
        if told is not None:
            return told
        return [(each.log_ns, each.offset) for each in self._messages(number) if each.channel == channel]

    def _message_at(self, number: int, offset: int, channel: int) -> Message | None:
        chunk = self._chunk(number)
        if chunk is None:
            return None
        record = next(messages_in(chunk, offset), None)
        if not isinstance(record, RawMessage) or record.channel != channel:
            return None
        return self._decoders[channel].message(record)

    # ---- how many there are

    def densities(
        self, start_ns: int, end_ns: int, buckets: int, topics: Collection[str] | None = None
    ) -> dict[str, list[int]]:
        """How many messages of each topic came in each of so many equal parts of [start, end).

        No payload is read: for a short time exactly, of the indexes; for a long one each chunk's messages are
        spread over its time, which is half a second at most in recordings of our own.
        """
        made: dict[str, list[int]] = {}
        if buckets < 1 or end_ns <= start_ns:
            return made
        first = bisect_left(self._latest_ends, max(0, start_ns))
        last = bisect_left(self._starts, max(0, min(end_ns, 2**64 - 1)))
        is_exact = last - first <= _MOST_EXACT
        span = end_ns - start_ns
        wanted = self._channels(topics)
        for number in range(first, last):
            chunk = self._chunks[number]
            for channel, count in self._counts(number).items():
                if channel not in wanted:
                    continue
                counts = made.setdefault(self._decoders[channel].topic, [0] * buckets)
                if not is_exact:
                    _spread(counts, (start_ns, end_ns), (chunk.start_ns, chunk.end_ns), count)
                    continue
                for log_ns, _offset in self._entries(number, channel):
                    if start_ns <= log_ns < end_ns:
                        counts[(log_ns - start_ns) * buckets // span] += 1
        return made

    def _counts(self, number: int) -> Mapping[int, int]:
        """The messages of each channel in a chunk; it is read where its indexes are not there."""
        chunk = self._chunks[number]
        counts = chunk.counts
        if len(counts) < chunk.channel_count:
            missing = set(chunk.channels) - counts.keys()
            for each in self._messages(number):
                if each.channel in missing:
                    counts[each.channel] = counts.get(each.channel, 0) + 1
        return counts

    # ---- chunks

    def _messages(self, number: int) -> Iterator[RawMessage]:
        chunk = self._chunk(number)
        if chunk is not None:
            for record in messages_in(chunk):
                if isinstance(record, RawMessage):
                    yield record

    def _chunk(self, number: int) -> bytes | memoryview | None:
        """A chunk's records; None when it is damaged."""
        with self._lock:
            self._check_open()
            known = self._cache.get(number)
            if known is not None:
                self._cache.move_to_end(number)
                return known
            try:
                made = read_chunk(self._file, self._chunks[number])
            except (ValueError, OSError):
                if number not in self._damaged:
                    self._damaged.add(number)
                    self.damaged_chunks += 1
                return None
            self._keep(number, made)
            return made

    def _keep(self, number: int, chunk: bytes | memoryview) -> None:
        self._cache[number] = chunk
        self._cached_bytes += len(chunk)
        while self._cached_bytes > self._cache_bytes and len(self._cache) > 1:
            self._cached_bytes -= len(self._cache.popitem(last=False)[1])

    def _check_open(self) -> None:
        if self._file.closed:
            raise ClosedError(f"recording '{self.path.name}'")

    def chunks(self) -> Sequence[ChunkInfo]:
        """The file's chunks by their times, for who copies them."""
        return tuple(self._chunks)

    def close(self) -> None:
        """Close the file. May be called twice; who reads then gets `ClosedError`."""
        with self._lock:
            self._file.close()
            self._cache.clear()
            self._cached_bytes = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def _spread(counts: list[int], whole: tuple[int, int], chunk: tuple[int, int], count: int) -> None:
    """Add the messages of a chunk to the equal parts of `whole`, as if they came evenly."""
    (start, end), (chunk_start, chunk_end), buckets = whole, chunk, len(counts)
    first = (chunk_start - start) * buckets // (end - start)
    last = (chunk_end - start) * buckets // (end - start)
    if first == last:
        if 0 <= first < buckets:
            counts[first] += count
        return

    def until(at: int) -> int:
        """How many come before the end of a part."""
        if at < first:
            return 0
        if at >= last:
            return count
        part_end = start + (at + 1) * (end - start) // buckets
        return count * (part_end - chunk_start) // (chunk_end - chunk_start)

    shown = range(max(0, first), min(last, buckets - 1) + 1)
    before = until(shown.start - 1)
    for at in shown:
        so_far = until(at)
        counts[at] += so_far - before
        before = so_far


def _log_ns(raw: RawMessage) -> int:
    return raw.log_ns
