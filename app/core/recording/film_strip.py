"""A recording at a glance: some pictures along its time, and how much came when. Read in a thread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from app.core.messages.picture import Picture, Size, decode
from app.core.recording.folder import CACHE_BYTES
from nep.errors import NepError
from nep.recordings.export import Part
from nep.recordings.reader import RecordedTopic, Recording
from nep.recordings.recorder import TopicSelection


@dataclass(frozen=True)
class FilmStripLook:
    """What is in a recording from ``start_ns`` to ``end_ns``.

    ``pictures`` are those in the middles of equal parts of its time, of the topic that has most, None where
    one can't be read; none without such a topic. ``counts``: messages of all topics in each equal part.
    """

    path: Path
    start_ns: int
    end_ns: int
    pictures: Sequence[Picture | None] = ()
    counts: Sequence[int] = ()
    topics: Sequence[RecordedTopic] = ()


def film_strip(path: Path, pictures: int, bars: int, fit: Size) -> FilmStripLook | None:
    """Look at a recording: so many pictures, each for a view of that size; None when it can't be read."""
    try:
        with Recording(path, cache_bytes=CACHE_BYTES) as recording:
            if not recording.message_count:
                return None
            start_ns, end_ns = recording.start_ns, recording.end_ns
            counted = recording.densities(start_ns, end_ns + 1, bars)
            counts = tuple(map(sum, zip(*counted.values(), strict=True))) if counted else ()
            topics = tuple(recording.topics.values())
            return FilmStripLook(path, start_ns, end_ns, _pictures(recording, pictures, fit), counts, topics)
    except (NepError, OSError):
        return None


def _pictures(recording: Recording, count: int, fit: Size) -> tuple[Picture | None, ...]:
    topics = [each for each in recording.topics.values() if each.codec == "image"]
    if not topics:
        return ()
    topic = max(topics, key=lambda each: each.message_count).name
    made = []
    for place in range(count):
        span = recording.end_ns - recording.start_ns
        at_ns = recording.start_ns + (2 * place + 1) * span // (2 * count)
        found = recording.newest(at_ns, (topic,)).get(topic) or recording.after(at_ns, topic)
        made.append(decode(found.message, 0.0, fit)[0] if found is not None else None)
    return tuple(made)


def part_of(
    look: FilmStripLook, begin_ns: int, end_ns: int, wanted: Sequence[str], unwanted: Sequence[str]
) -> Part:
    """The part between two times (both are in it) with the topics that patterns mean; all without any.

    Its topics are empty when none fits. Raises `BadTopicError` for what can be no topic.
    """
    topics = None
    if wanted or unwanted:
        selection = TopicSelection(tuple(wanted), tuple(unwanted))
        topics = [each.name for each in look.topics if selection.has(each.name)]
    return Part(
        None if begin_ns <= look.start_ns else begin_ns, None if end_ns >= look.end_ns else end_ns + 1, topics
    )
