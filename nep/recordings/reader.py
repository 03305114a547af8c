"""Recording: reads a recording from any time on, without reading what is before; memory stays bounded."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import orjson

from nep.messages.message import Message
from nep.recordings.file_reader import CACHE_BYTES, FileFacts, FileReader, RawFile
from nep.recordings.formats.channels import ChannelDecoder, ChannelDefinition, Role
from nep.recordings.formats.figures import TopicFigures, read_figures
from nep.recordings.formats.index import Damage
from nep.recordings.formats.records import RawMessage

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["RecordedMessage", "RecordedTopic", "Recording"]


class RecordedMessage(NamedTuple):
    """A message, and when it came (ns since 1970)."""

    log_ns: int
    message: Message


@dataclass(frozen=True)
class RecordedTopic:
    """A topic of a recording. `codec` and `msg_type` are those of its first channel.

    `publishers`: their numbers, None where one has none. `encoding`, `schema_encoding`: as the file names
    them, "" for none.
    """

    name: str
    msg_type: str
    codec: str
    message_count: int
    publishers: tuple[int | None, ...] = ()
    encoding: str = ""
    schema_encoding: str = ""


class Recording:
    """A recording that is read. Thread-safe; usable as a context manager.

    `start_ns`, `end_ns`: when the first and the last message came; both 0 when there is none. `is_complete`:
    False for a file that was not closed, because its program was killed or its end was cut off: all that is
    whole is read, and `nep.recordings.repair` closes it. `topics`: by name, also those without messages.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        cache_bytes: int = CACHE_BYTES,
        progress: Callable[[int, int], object] | None = None,
        file: RawFile | None = None,
    ) -> None:
        """Open it, in this process unless a `file` is given that is open elsewhere.

        Args:
            path: The file.
            cache_bytes: How much of decompressed chunks is kept.
            progress: Given how many bytes of how many are done, where the whole file must be walked over;
                what it raises ends that, and comes out.
            file: Reads the file instead, for example in another process; it is closed with the recording.

        Raises:
            RecordingError: The file can't be opened or is no recording.
        """
        self.path = Path(path)
        self.file: RawFile = (
            FileReader(path, cache_bytes=cache_bytes, progress=progress) if file is None else file
        )
        self.facts: FileFacts = self.file.facts
        self.is_complete = self.facts.is_complete
        self._decoders = _Decoders(self.facts.channels)
        self.start_ns, self.end_ns = self.facts.start_ns, self.facts.end_ns
        self._roles = {
            number: role
            for number, each in self.facts.channels.items()
            if (role := dict(each.metadata).get("nep.role")) is not None
        }
        self.topics: Mapping[str, RecordedTopic] = self._topics()
        self._channels_of: dict[str, list[int]] = {}
        for number, each in self.facts.channels.items():
            if number not in self._roles:
                self._channels_of.setdefault(each.topic, []).append(number)

    def _topics(self) -> dict[str, RecordedTopic]:
        made: dict[str, RecordedTopic] = {}
        for number, definition in self.facts.channels.items():
            if number in self._roles:
                continue
            count, decoder = self.facts.counts.get(number, 0), self._decoders[number]
            known = made.get(definition.topic)
            if known is not None and (known.message_count or not count):
                publishers = tuple(dict.fromkeys((*known.publishers, decoder.publisher)))
                made[known.name] = RecordedTopic(
                    known.name,
                    known.msg_type,
                    known.codec,
                    known.message_count + count,
                    publishers,
                    known.encoding,
                    known.schema_encoding,
                )
                continue
            made[definition.topic] = RecordedTopic(
                definition.topic,
                decoder.msg_type,
                decoder.codec,
                count,
                (decoder.publisher,),
                definition.message_encoding,
                definition.schema_encoding,
            )
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
        """Size of the file, as far as it is whole."""
        return self.facts.size_bytes

    @property
    def damage(self) -> Sequence[Damage]:
        """Pieces of the file that can't be read, as far as they were met."""
        return self.file.damage

    @property
    def damaged_chunks(self) -> int:
        """How many pieces of the file were wanted and could not be read so far."""
        return len(self.file.damage)

    @property
    def words(self) -> Mapping[str, str]:
        """What the recorder noted: "note", "end", "started_ns", "ended_ns"; what is not known is missing."""
        made: dict[str, str] = {}
        for name, values in self.facts.metadata:
            if name == "nep.recording":
                made.update(values)
        return made

    def figures(self) -> dict[str, TopicFigures]:
        """What became of each topic's messages, as the recorder counted; empty for others' recordings.

        At once when it was ended, else by reading what it said once a second.
        """
        made: dict[str, TopicFigures] = {}
        for name, values in self.facts.metadata:
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
        return self.file.pieces_of(self._channels_with("figures"))

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
        for raw in self.file.raw(None, None, self._channels_with(role), pieces):
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
        """Messages by the time when they came, from `start_ns` on and before `end_ns`; of all topics or some.

        A piece of the file that is damaged is skipped, and listed in `damage`.
        """
        for raw in self.read_raw(start_ns, end_ns, topics):
            yield RecordedMessage(raw.log_ns, self._decoders[raw.channel].message(raw))

    def read_raw(
        self,
        start_ns: int | None = None,
        end_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Iterator[RawMessage]:
        """The same as they lie in the file, with the numbers of their channels (`facts.channels`)."""
        return self.file.raw(start_ns, end_ns, self._channels(topics))

    def _channels(self, topics: Collection[str] | None) -> set[int]:
        if topics is None:
            return {number for numbers in self._channels_of.values() for number in numbers}
        return {number for topic in topics for number in self._channels_of.get(topic, ())}

    def newest(self, at_ns: int, topics: Collection[str] | None = None) -> dict[str, RecordedMessage]:
        """The newest message of each topic that came at `at_ns` or before; topics without one are missing."""
        wanted = [topic for topic in self._named(topics) if self.topics[topic].message_count]
        found = self.file.newest(at_ns, [self._channels_of[topic] for topic in wanted])
        return {
            topic: RecordedMessage(raw.log_ns, self._decoders[raw.channel].message(raw))
            for topic, raw in zip(wanted, found, strict=True)
            if raw is not None
        }

    def _named(self, topics: Collection[str] | None) -> list[str]:
        return (
            list(self._channels_of)
            if topics is None
            else [each for each in topics if each in self._channels_of]
        )

    def newest_times(self, at_ns: int, topics: Collection[str] | None = None) -> dict[str, int]:
        """When the newest message of each topic came that came at `at_ns` or before; of the indexes alone."""
        made: dict[str, int] = {}
        for channel, log_ns in self.file.newest_times(at_ns, self._channels(topics)).items():
            topic = self.facts.channels[channel].topic
            made[topic] = max(log_ns, made.get(topic, 0))
        return made

    def before(self, at_ns: int, topic: str) -> RecordedMessage | None:
        """The last message of a topic that came before `at_ns`."""
        return self.newest(at_ns - 1, (topic,)).get(topic) if at_ns > 0 else None

    def after(self, at_ns: int, topic: str) -> RecordedMessage | None:
        """The first message of a topic that came after `at_ns`."""
        return next(self.read(at_ns + 1, None, (topic,)), None)

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
        for channel, counts in self.file.densities(start_ns, end_ns, buckets, self._channels(topics)).items():
            topic = self.facts.channels[channel].topic
            known = made.get(topic)
            made[topic] = list(counts) if known is None else list(map(sum, zip(known, counts, strict=True)))
        return made

    def close(self) -> None:
        """Close the file. May be called twice; who reads then gets `ClosedError`."""
        self.file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


class _Decoders(dict[int, ChannelDecoder]):
    """Decoders of channels, made when they are first used."""

    def __init__(self, definitions: Mapping[int, ChannelDefinition]) -> None:
        super().__init__()
        self._definitions = definitions

    def __missing__(self, number: int) -> ChannelDecoder:
        made = self[number] = ChannelDecoder(self._definitions[number])
        return made
