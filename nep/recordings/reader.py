"""`Recording`: random access to recorded messages by time, with bounded memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import orjson

from nep.messages.message import Message
from nep.recordings.file_reader import CACHE_BYTES, FileInfo, FileReader, RawFile
from nep.recordings.formats.channels import ChannelDecoder, ChannelDefinition, Role
from nep.recordings.formats.index import CorruptRange
from nep.recordings.formats.message_counts import TopicStats, parse_stats
from nep.recordings.formats.records import RawMessage

if TYPE_CHECKING:
    from typing_extensions import Self


class RecordedMessage(NamedTuple):
    """Message and its time of receipt.

    Attributes:
        log_ns: Time of receipt in ns since 1970.
        message: The message.
    """

    log_ns: int
    message: Message


@dataclass(frozen=True)
class RecordedTopic:
    """Topic of a recording.

    Attributes:
        name: Name of the topic.
        msg_type: Message type, according to the first channel.
        codec: Codec, according to the first channel.
        message_count: Number of messages.
        publishers: Ids of the publishers; None where unknown.
        encoding: Name of the message encoding in the file.
        schema_encoding: Name of the schema encoding in the file, or "".
    """

    name: str
    msg_type: str
    codec: str
    message_count: int
    publishers: tuple[int | None, ...] = ()
    encoding: str = ""
    schema_encoding: str = ""


class Recording:
    """Recording that is open for reading. Thread-safe; usable as a context manager.

        with Recording("tour.mcap") as recording:
            for log_ns, message in recording.read(topics=["/camera"]):
                show(message.payload)

    Attributes:
        start_ns: Time of the first message in ns since 1970; 0 if there are no messages.
        end_ns: Time of the last message in ns since 1970; 0 if there are no messages.
        is_complete: False if the file was not closed properly (killed program, truncated file). Its intact
            part can be read; `nep.recordings.repair` completes the file.
        topics: Topics by name, including topics without messages.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        cache_bytes: int = CACHE_BYTES,
        progress: Callable[[int, int], object] | None = None,
        file: RawFile | None = None,
    ) -> None:
        """Open a recording, in this process unless `file` is given.

        Args:
            path: File to open.
            cache_bytes: Maximum size of cached decompressed chunks.
            progress: Called with bytes done and in total if the whole file must be scanned; its exceptions
                propagate.
            file: File that is already open, such as one of another process; closed with the recording.

        Raises:
            RecordingError: The file can't be opened or is not a recording.
            RecordingsUnavailableError: Packages for recordings are not installed.
        """
        self.path = Path(path)
        self.file: RawFile = (
            FileReader(path, cache_bytes=cache_bytes, progress=progress) if file is None else file
        )
        self.info: FileInfo = self.file.info
        self.is_complete = self.info.is_complete
        self._decoders = _Decoders(self.info.channels)
        self.start_ns, self.end_ns = self.info.start_ns, self.info.end_ns
        self._roles = {
            number: role
            for number, channel in self.info.channels.items()
            if (role := dict(channel.metadata).get("nep.role")) is not None
        }
        self.topics: Mapping[str, RecordedTopic] = self._topics()
        self._channels_by_topic: dict[str, list[int]] = {}
        for number, channel in self.info.channels.items():
            if number not in self._roles:
                self._channels_by_topic.setdefault(channel.topic, []).append(number)

    def _topics(self) -> dict[str, RecordedTopic]:
        topics: dict[str, RecordedTopic] = {}
        for number, definition in self.info.channels.items():
            if number in self._roles:
                continue
            count, decoder = self.info.counts.get(number, 0), self._decoders[number]
            topic = topics.get(definition.topic)
            if topic is not None and (topic.message_count or not count):
                publishers = tuple(dict.fromkeys((*topic.publishers, decoder.publisher)))
                topics[topic.name] = RecordedTopic(
                    topic.name,
                    topic.msg_type,
                    topic.codec,
                    topic.message_count + count,
                    publishers,
                    topic.encoding,
                    topic.schema_encoding,
                )
                continue
            topics[definition.topic] = RecordedTopic(
                definition.topic,
                decoder.msg_type,
                decoder.codec,
                count,
                (decoder.publisher,),
                definition.message_encoding,
                definition.schema_encoding,
            )
        return dict(sorted(topics.items()))

    # ---- properties

    @property
    def duration_s(self) -> float:
        """Time from the first to the last message in seconds."""
        return (self.end_ns - self.start_ns) / 1e9

    @property
    def message_count(self) -> int:
        """Total number of messages of all topics."""
        return sum(each.message_count for each in self.topics.values())

    @property
    def size_bytes(self) -> int:
        """Size of the intact part of the file in bytes."""
        return self.info.size_bytes

    @property
    def corruption(self) -> Sequence[CorruptRange]:
        """Unreadable places of the file found so far."""
        return self.file.corruption

    @property
    def corrupt_range_count(self) -> int:
        """Number of unreadable places found so far."""
        return len(self.file.corruption)

    @property
    def recorder_metadata(self) -> Mapping[str, str]:
        """Metadata that the recorder wrote to the file.

        The keys are "note", "end", "started_ns" and "ended_ns", as far as known.
        """
        metadata: dict[str, str] = {}
        for name, values in self.info.metadata:
            if name == "nep.recording":
                metadata.update(values)
        return metadata

    def stats(self) -> dict[str, TopicStats]:
        """Return the message counts by topic; empty for recordings of other programs.

        A complete recording has the counts in its metadata. Otherwise they are read from the entries that
        the recorder writes once a second.
        """
        totals: dict[str, TopicStats] = {}
        for name, values in self.info.metadata:
            if name == "nep.figures":
                for topic, text in values.items():
                    topic_stats = parse_stats(text)
                    if topic_stats is not None:
                        totals[topic] = topic_stats
        if totals:
            return totals
        for _log_ns, stats_by_topic in self.stats_over_time():
            totals.update(stats_by_topic)
        return totals

    def stats_chunks(self) -> Sequence[int]:
        """Return the indexes of the chunks that contain message counts, sorted by time.

        The chunks are not read.
        """
        return self.file.chunks_with(self._channels_with("figures"))

    def stats_over_time(
        self, chunk_indexes: Collection[int] | None = None
    ) -> Iterator[tuple[int, dict[str, TopicStats]]]:
        """Iterate over the message counts in the recording, to locate losses in time.

        Args:
            chunk_indexes: Indexes of the chunks to read, from `stats_chunks`; None for the whole file.

        Yields:
            Time in ns since 1970, and the changed counts by topic.
        """
        for log_ns, value in self.entries("figures", chunk_indexes):
            topics = value.get("topics") if isinstance(value, dict) else None
            if isinstance(topics, dict):
                parsed = {str(topic): parse_stats(each) for topic, each in topics.items()}
                yield log_ns, {topic: each for topic, each in parsed.items() if each is not None}

    def entries(
        self, role: Role, chunk_indexes: Collection[int] | None = None
    ) -> Iterator[tuple[int, object]]:
        """Iterate over the entries of one role that the recorder itself wrote.

        Args:
            role: Role of the entries, such as "alerts" or "notes".
            chunk_indexes: Indexes of the chunks to read; None for the whole file.

        Yields:
            Time in ns since 1970, and the value of the entry.
        """
        for raw in self.file.read_raw(None, None, self._channels_with(role), chunk_indexes):
            try:
                yield raw.log_ns, orjson.loads(raw.data)
            except orjson.JSONDecodeError:
                continue

    def _channels_with(self, role: Role) -> set[int]:
        return {number for number, each in self._roles.items() if each == role}

    # ---- reading

    def read(
        self,
        start_ns: int | None = None,
        end_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Iterator[RecordedMessage]:
        """Iterate over messages, sorted by time of receipt.

        Damaged places of the file are skipped and listed in `corruption`.

        Args:
            start_ns: Start in ns since 1970 (inclusive); None for no limit.
            end_ns: End in ns since 1970 (exclusive); None for no limit.
            topics: Names of topics; None for all.
        """
        for raw in self.read_raw(start_ns, end_ns, topics):
            yield RecordedMessage(raw.log_ns, self._decoders[raw.channel].message(raw))

    def read_raw(
        self,
        start_ns: int | None = None,
        end_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Iterator[RawMessage]:
        """Iterate over raw messages, sorted by time of receipt.

        The arguments are those of `read`. The channel ids of messages refer to `info.channels`.
        """
        return self.file.read_raw(start_ns, end_ns, self._channels(topics))

    def _channels(self, topics: Collection[str] | None) -> set[int]:
        if topics is None:
            return {number for numbers in self._channels_by_topic.values() for number in numbers}
        return {number for topic in topics for number in self._channels_by_topic.get(topic, ())}

    def newest(self, at_ns: int, topics: Collection[str] | None = None) -> dict[str, RecordedMessage]:
        """Return the newest message at or before a time, by topic. Topics without such a message are omitted.

        Args:
            at_ns: Time in ns since 1970.
            topics: Names of topics; None for all.
        """
        selected = [topic for topic in self._known_topics(topics) if self.topics[topic].message_count]
        raw_messages = self.file.newest(at_ns, [self._channels_by_topic[topic] for topic in selected])
        return {
            topic: RecordedMessage(raw.log_ns, self._decoders[raw.channel].message(raw))
            for topic, raw in zip(selected, raw_messages, strict=True)
            if raw is not None
        }

    def _known_topics(self, topics: Collection[str] | None) -> list[str]:
        return (
            list(self._channels_by_topic)
            if topics is None
            else [each for each in topics if each in self._channels_by_topic]
        )

    def newest_times(self, at_ns: int, topics: Collection[str] | None = None) -> dict[str, int]:
        """Return the time in ns since 1970 of the newest message at or before a time, by topic.

        Topics without such a message are omitted. Messages are read only where indexes are missing.

        Args:
            at_ns: Time in ns since 1970.
            topics: Names of topics; None for all.
        """
        times: dict[str, int] = {}
        for channel, log_ns in self.file.newest_times(at_ns, self._channels(topics)).items():
            topic = self.info.channels[channel].topic
            times[topic] = max(log_ns, times.get(topic, 0))
        return times

    def before(self, at_ns: int, topic: str) -> RecordedMessage | None:
        """Return the last message of a topic before `at_ns`, or None."""
        return self.newest(at_ns - 1, (topic,)).get(topic) if at_ns > 0 else None

    def after(self, at_ns: int, topic: str) -> RecordedMessage | None:
        """Return the first message of a topic after `at_ns`, or None."""
        return next(self.read(at_ns + 1, None, (topic,)), None)

    def densities(
        self, start_ns: int, end_ns: int, buckets: int, topics: Collection[str] | None = None
    ) -> dict[str, list[int]]:
        """Return the number of messages in each of several equal time intervals, by topic.

        Payloads are not read. Short spans are counted exactly with the indexes. For long spans, the
        messages of a chunk are distributed evenly over its duration, which is at most half a second in
        recordings of nep. Topics without messages in the span may be missing.

        Args:
            start_ns: Start of the first interval in ns since 1970.
            end_ns: End of the last interval (exclusive).
            buckets: Number of intervals.
            topics: Names of topics; None for all.
        """
        result: dict[str, list[int]] = {}
        if buckets < 1 or end_ns <= start_ns:
            return result
        for channel, counts in self.file.densities(start_ns, end_ns, buckets, self._channels(topics)).items():
            topic = self.info.channels[channel].topic
            existing = result.get(topic)
            result[topic] = (
                list(counts) if existing is None else list(map(sum, zip(existing, counts, strict=True)))
            )
        return result

    def close(self) -> None:
        """Close the file. Concurrent reads raise `ClosedError`. Idempotent."""
        self.file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


class _Decoders(dict[int, ChannelDecoder]):
    """Decoders by channel id, created when they are first used."""

    def __init__(self, definitions: Mapping[int, ChannelDefinition]) -> None:
        super().__init__()
        self._definitions = definitions

    def __missing__(self, number: int) -> ChannelDecoder:
        decoder = self[number] = ChannelDecoder(self._definitions[number])
        return decoder
