"""Message counts, losses, runs and alarms of a recording for the timeline, read in a background thread."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from app.core.recording.replay.spans import RecordedSpans, spans_of
from app.core.storage.background_worker import BackgroundWorker
from app.core.timeline.lanes import Notch
from nep.errors import NepError, RecordingError
from nep.recordings.formats.message_counts import TopicStats
from nep.recordings.reader import Recording

MAX_NOTCHES = 2_000
"""Maximum number of notches for losses of one topic; later losses are added to the last one."""


@dataclass(frozen=True, slots=True)
class Density:
    """Message counts in equal intervals of the range [``start_ns``, ``end_ns``).

    Attributes:
        bucket_count: Number of intervals.
        counts: Number of messages in each interval, by topic.
    """

    start_ns: int
    end_ns: int
    bucket_count: int
    counts: Mapping[str, Sequence[int]]


@dataclass(frozen=True, slots=True)
class _Result:
    density: Density | None = None
    losses: Mapping[str, tuple[Notch, ...]] | None = None
    spans: RecordedSpans | None = None


class Densities:
    """Message counts, losses and spans of one recording for the timeline.

    Results are available some ticks after a request. Not thread-safe; use it from the main thread.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._worker: BackgroundWorker[_Result] = BackgroundWorker("studio-density")
        self.newest: Density | None = None
        self.problem = ""
        self.losses: Mapping[str, tuple[Notch, ...]] = {}
        self.spans = RecordedSpans()
        self._requested_range: tuple[int, int, int] | None = None
        self._worker.submit("losses", lambda: _Result(losses=losses_of(recording)))
        self._worker.submit("spans", lambda: _Result(spans=spans_of(recording)))

    def request(self, start_ns: int, end_ns: int, buckets: int) -> None:
        """Request the message counts of the visible range. A repeated request has no effect.

        Args:
            start_ns: Start of the range.
            end_ns: End of the range.
            buckets: Number of intervals.
        """
        requested = (start_ns, end_ns, buckets)
        if requested == self._requested_range or buckets < 1 or end_ns <= start_ns:
            return
        self._requested_range = requested
        self._worker.submit("density", lambda: _Result(density=density_of(self._recording, *requested)))

    def collect_results(self) -> bool:
        """Store finished results; return True if there were any.

        After a failure, `problem` contains the reason.
        """
        density, losses, spans = (self._pop_result(owner) for owner in ("density", "losses", "spans"))
        if density is not None:
            self.newest = density.density
        if losses is not None:
            self.losses = losses.losses or {}
        if spans is not None:
            self.spans = spans.spans or RecordedSpans()
        return density is not None or losses is not None or spans is not None

    def _pop_result(self, owner: str) -> _Result | None:
        try:
            return self._worker.pop_result(owner)
        except NepError as error:
            self.problem = error.reason if isinstance(error, RecordingError) else str(error)
            return None

    def close(self) -> None:
        """Stop the thread."""
        self._worker.close()


def density_of(recording: Recording, start_ns: int, end_ns: int, buckets: int) -> Density:
    """Count the messages in each interval, using only the index of the recording.

    Args:
        recording: Open recording.
        start_ns: Start of the range.
        end_ns: End of the range.
        buckets: Number of intervals.
    """
    counts_by_topic = recording.densities(start_ns, end_ns, buckets)
    return Density(
        start_ns, end_ns, buckets, {topic: array("L", counts) for topic, counts in counts_by_topic.items()}
    )


def losses_of(recording: Recording) -> dict[str, tuple[Notch, ...]]:
    """Return the times, by topic, at which the recorder's loss counter increased: once a second at most.

    A message that arrived late was first counted as lost. Such messages are subtracted from the newest
    earlier notches, so that the sum of all notches is the number of messages lost or not written.
    """
    notches_by_topic: dict[str, list[Notch]] = {}
    last_counts: dict[str, int] = {}
    for at_ns, stats_by_topic in _changing_stats(recording):
        for topic, stats in stats_by_topic.items():
            missing_count = _missing_count(stats)
            increase = missing_count - last_counts.get(topic, 0)
            last_counts[topic] = missing_count
            notches = notches_by_topic.setdefault(topic, [])
            if increase <= 0:
                _subtract_late(notches, -increase)
            elif len(notches) < MAX_NOTCHES:
                notches.append(Notch(at_ns, increase))
            else:
                notches[-1] = Notch(notches[-1].at_ns, notches[-1].count + increase)
    if recording.is_complete:  # not all counts were read
        last_counts = {topic: _missing_count(stats) for topic, stats in recording.stats().items()}
    for topic, notches in notches_by_topic.items():
        _subtract_late(notches, sum(notch.count for notch in notches) - last_counts.get(topic, 0))
    return {topic: tuple(notches) for topic, notches in notches_by_topic.items() if notches}


def _subtract_late(notches: list[Notch], count: int) -> None:
    # Late messages are subtracted from the newest notches.
    while notches and count > 0:
        newest = notches.pop()
        if newest.count > count:
            notches.append(Notch(newest.at_ns, newest.count - count))
        count -= newest.count


def _changing_stats(recording: Recording) -> Iterator[tuple[int, Mapping[str, TopicStats]]]:
    # Found by bisection. The counts only increase, except for late messages, and the final ones are in the
    # file: nothing is read between two times with equal counts. A long recording with few losses therefore
    # needs few reads. A recording that wasn't closed is read completely.
    if not recording.is_complete:
        yield from recording.stats_over_time()
        return
    chunks = recording.stats_chunks()
    stats_by_chunk: dict[int, list[tuple[int, dict[str, TopicStats]]]] = {}
    final_counts = {topic: _missing_count(each) for topic, each in recording.stats().items()}
    ranges: list[tuple[int, int, Mapping[str, int], Mapping[str, int]]] = [
        (-1, len(chunks), {}, final_counts)
    ]
    while ranges:
        first, last, lower_counts, upper_counts = ranges.pop()
        if last - first < 2 or all(
            lower_counts.get(topic, 0) >= count for topic, count in upper_counts.items()
        ):
            continue
        middle = (first + last) // 2
        stats_by_chunk[middle] = list(recording.stats_over_time((chunks[middle],)))
        counts = {
            topic: _missing_count(each)
            for _at_ns, stats in stats_by_chunk[middle]
            for topic, each in stats.items()
        }
        ranges.append((first, middle, lower_counts, {**upper_counts, **counts}))
        ranges.append((middle, last, {**lower_counts, **counts}, upper_counts))
    for number in sorted(stats_by_chunk):
        yield from stats_by_chunk[number]


def _missing_count(stats: TopicStats) -> int:
    return (stats.lost or 0) + stats.unkept
