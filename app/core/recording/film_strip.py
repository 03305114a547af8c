"""Preview of a recording: images over time and message counts, read in a background thread."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from app.core.messages.picture import Picture, Size, decode
from app.core.recording.folder import CACHE_BYTES
from app.core.recording.opener import RecordingOpener
from nep.errors import NepError
from nep.messages.codecs import content_of
from nep.recordings.export import Part
from nep.recordings.reader import RecordedTopic, Recording
from nep.recordings.recorder import TopicSelection

_READ_BUDGET = (1_000_000_000, 20.0)
"""Maximum number of bytes and seconds for reading one recording."""
_MAX_TOPICS = 10_000
SAMPLES_PER_TOPIC = 4
"""Number of messages of a topic that are read to estimate the size of all its messages."""
MAX_SAMPLED_TOPICS = 200
"""Maximum number of topics whose message size is estimated."""


@dataclass(frozen=True)
class FilmStripPreview:
    """Preview of a recording from ``start_ns`` to ``end_ns``.

    Attributes:
        pictures: Images at the centres of equal time intervals, of the topic with the most images. None
            for an image that can't be read; empty if the recording has no images.
        counts: Number of messages of all topics in each of several equal time intervals.
        counts_by_topic: Number of messages in these intervals, by topic.
        message_bytes: Average message size, by topic; topics with unknown size are missing.
    """

    path: Path
    start_ns: int
    end_ns: int
    pictures: Sequence[Picture | None] = ()
    counts: Sequence[int] = ()
    topics: Sequence[RecordedTopic] = ()
    counts_by_topic: Mapping[str, Sequence[int]] = field(default_factory=dict)
    message_bytes: Mapping[str, float] = field(default_factory=dict)

    def size_of(self, topic: RecordedTopic) -> float | None:
        """Return the estimated size of all messages of a topic in bytes; None if unknown."""
        mean_bytes = self.message_bytes.get(topic.name)
        return None if mean_bytes is None else mean_bytes * topic.message_count

    def estimate_messages(
        self, begin_ns: int, end_ns: int, topics: Collection[str]
    ) -> tuple[float, float | None]:
        """Estimate the number and the total size (bytes) of the messages in a time range.

        The estimate is as precise as the intervals of `counts`. The size is None if it is unknown for
        one of the topics.

        Args:
            begin_ns: Start of the range.
            end_ns: End of the range.
            topics: Names of the topics to count.
        """
        count = size_bytes = 0.0
        is_known = True
        for topic in self.topics:
            if topic.name in topics:
                share = self._share_in_range(self.counts_by_topic.get(topic.name, ()), begin_ns, end_ns)
                count += share * topic.message_count
                topic_bytes = self.size_of(topic)
                is_known = is_known and topic_bytes is not None
                size_bytes += share * (topic_bytes or 0.0)
        return count, size_bytes if is_known else None

    def _share_in_range(self, counts: Sequence[int], begin_ns: int, end_ns: int) -> float:
        # Share of the counted messages within the range, 0 to 1.
        if begin_ns <= self.start_ns and end_ns >= self.end_ns:
            return 1.0
        total = sum(counts)
        if not total:
            return 0.0
        bucket_ns = (self.end_ns + 1 - self.start_ns) / len(counts)
        first, last = (begin_ns - self.start_ns) / bucket_ns, (end_ns + 1 - self.start_ns) / bucket_ns
        overlaps = (max(0.0, min(last, index + 1) - max(first, index)) for index in range(len(counts)))
        return sum(overlap * count for overlap, count in zip(overlaps, counts, strict=True)) / total


def read_preview(
    path: Path, picture_count: int, interval_count: int, display_size: Size, opener: RecordingOpener
) -> FilmStripPreview | None:
    """Read the preview of a recording.

    Returns None if the recording can't be read within the budget, or has no messages or too many
    topics.

    Args:
        path: File of the recording.
        picture_count: Number of images.
        interval_count: Number of time intervals in which messages are counted.
        display_size: Size of the images in pixels.
        opener: Opens the recording.
    """
    try:
        with opener.open(path, cache_bytes=CACHE_BYTES, budget=_READ_BUDGET) as recording:
            if not recording.message_count or len(recording.topics) > _MAX_TOPICS:
                return None
            start_ns, end_ns = recording.start_ns, recording.end_ns
            counts_by_topic = recording.densities(start_ns, end_ns + 1, interval_count)
            counts = tuple(map(sum, zip(*counts_by_topic.values(), strict=True))) if counts_by_topic else ()
            topics = tuple(recording.topics.values())
            images = _pictures(recording, picture_count, display_size)
            sizes = _message_bytes(recording)
            return FilmStripPreview(path, start_ns, end_ns, images, counts, topics, counts_by_topic, sizes)
    except (NepError, OSError):
        return None


def _pictures(recording: Recording, count: int, display_size: Size) -> tuple[Picture | None, ...]:
    topics = [each for each in recording.topics.values() if content_of(each.codec) == "image"]
    if not topics:
        return ()
    topic = max(topics, key=lambda each: each.message_count).name
    images = []
    for index in range(count):
        span_ns = recording.end_ns - recording.start_ns
        at_ns = recording.start_ns + (2 * index + 1) * span_ns // (2 * count)
        entry = recording.newest(at_ns, (topic,)).get(topic) or recording.after(at_ns, topic)
        images.append(decode(entry.message, 0.0, display_size)[0] if entry is not None else None)
    return tuple(images)


def _message_bytes(recording: Recording) -> dict[str, float]:
    # From the recorder's counts, else from a few messages along the time.
    stats = recording.stats()
    mean_bytes = {
        topic: each.size_bytes / each.received
        for topic, each in stats.items()
        if each.received and topic in recording.topics
    }
    other_topics = [topic for topic in recording.topics if topic not in mean_bytes][:MAX_SAMPLED_TOPICS]
    samples: dict[str, dict[int, int]] = {topic: {} for topic in other_topics}
    span_ns = recording.end_ns - recording.start_ns
    for index in range(SAMPLES_PER_TOPIC if other_topics else 0):
        at_ns = recording.start_ns + (index + 1) * span_ns // SAMPLES_PER_TOPIC
        for topic, entry in recording.newest(at_ns, other_topics).items():
            samples[topic][entry.log_ns] = entry.message.size_bytes
    return mean_bytes | {topic: sum(sizes.values()) / len(sizes) for topic, sizes in samples.items() if sizes}


def select_part(
    preview: FilmStripPreview, begin_ns: int, end_ns: int, included: Sequence[str], excluded: Sequence[str]
) -> Part:
    """Return the part of a recording in an inclusive time range, limited to topics that match patterns.

    Raises `BadTopicError` for an invalid pattern.

    Args:
        preview: Preview of the recording.
        begin_ns: Start of the range.
        end_ns: End of the range.
        included: Patterns of topics to include; empty for all topics.
        excluded: Patterns of topics to exclude.

    Returns:
        Part of the recording. If no topic matches, its ``topics`` is empty.
    """
    topics = None
    if included or excluded:
        selection = TopicSelection(tuple(included), tuple(excluded))
        topics = [each.name for each in preview.topics if selection.has(each.name)]
    return Part(
        None if begin_ns <= preview.start_ns else begin_ns,
        None if end_ns >= preview.end_ns else end_ns + 1,
        topics,
    )
