"""How full a recording is, where something was lost, what went on: read in a thread, for a time line."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from app.core.documents.background_worker import BackgroundWorker
from app.core.recording.replay.spans import RecordedSpans, spans_of
from nep.errors import NepError, RecordingError
from nep.recordings.formats.figures import TopicFigures
from nep.recordings.reader import Recording

MOST_MARKS = 2_000
"""Of one topic; what was lost later is counted with the last one."""


@dataclass(frozen=True, slots=True)
class Density:
    """The messages of each topic in each of so many equal parts of [``start_ns``, ``end_ns``)."""

    start_ns: int
    end_ns: int
    buckets: int
    counts: Mapping[str, Sequence[int]]

    def peak(self, topic: str) -> int:
        """The most messages of a topic in one part."""
        counts = self.counts.get(topic)
        return max(counts, default=0) if counts is not None else 0


@dataclass(frozen=True, slots=True)
class LossMark:
    """So many messages were lost, or were not kept, in the second that ended then."""

    at_ns: int
    count: int


@dataclass(frozen=True, slots=True)
class _Made:
    density: Density | None = None
    losses: Mapping[str, tuple[LossMark, ...]] | None = None
    spans: RecordedSpans | None = None


class Densities:
    """Of one recording. One thread uses it (the window's); what it asks for is there some ticks later."""

    def __init__(self, recording: Recording) -> None:
        """Look for losses, runs and alarms at once."""
        self._recording = recording
        self._worker: BackgroundWorker[_Made] = BackgroundWorker("studio-density")
        self.newest: Density | None = None
        self.problem = ""
        self.losses: Mapping[str, tuple[LossMark, ...]] = {}
        self.spans = RecordedSpans()
        self._wanted: tuple[int, int, int] | None = None
        self._worker.ask("losses", lambda: _Made(losses=losses_of(recording)))
        self._worker.ask("spans", lambda: _Made(spans=spans_of(recording)))

    def want(self, start_ns: int, end_ns: int, buckets: int) -> None:
        """This part is shown; asked again and again it is read once."""
        wanted = (start_ns, end_ns, buckets)
        if wanted == self._wanted or buckets < 1 or end_ns <= start_ns:
            return
        self._wanted = wanted
        self._worker.ask("density", lambda: _Made(density=density_of(self._recording, *wanted)))

    def take(self) -> bool:
        """Take over what is ready; whether something is new. `problem` says why reading failed, if it did."""
        density, losses, spans = (self._take(owner) for owner in ("density", "losses", "spans"))
        if density is not None:
            self.newest = density.density
        if losses is not None:
            self.losses = losses.losses or {}
        if spans is not None:
            self.spans = spans.spans or RecordedSpans()
        return density is not None or losses is not None or spans is not None

    def _take(self, owner: str) -> _Made | None:
        try:
            return self._worker.take(owner)
        except NepError as error:
            self.problem = error.reason if isinstance(error, RecordingError) else str(error)
            return None

    def close(self) -> None:
        """End."""
        self._worker.close()


def density_of(recording: Recording, start_ns: int, end_ns: int, buckets: int) -> Density:
    """Count the messages of each part, of the index alone."""
    found = recording.densities(start_ns, end_ns, buckets)
    return Density(start_ns, end_ns, buckets, {topic: array("L", counts) for topic, counts in found.items()})


def losses_of(recording: Recording) -> dict[str, tuple[LossMark, ...]]:
    """Where the recorder's figures of each topic grew: there something was lost, or was not kept.

    What came late was missing until then: it is taken from the newest marks before, so that all marks of a
    topic are as many as are missing at the end.
    """
    found: dict[str, list[LossMark]] = {}
    before: dict[str, int] = {}
    for at_ns, figures in _figures_that_grow(recording):
        for topic, each in figures.items():
            missing = _missing(each)
            grown = missing - before.get(topic, 0)
            before[topic] = missing
            marks = found.setdefault(topic, [])
            if grown <= 0:
                _take_back(marks, -grown)
            elif len(marks) < MOST_MARKS:
                marks.append(LossMark(at_ns, grown))
            else:
                marks[-1] = LossMark(marks[-1].at_ns, marks[-1].count + grown)
    if recording.is_complete:  # not all figures were read
        before = {topic: _missing(each) for topic, each in recording.figures().items()}
    for topic, marks in found.items():
        _take_back(marks, sum(mark.count for mark in marks) - before.get(topic, 0))
    return {topic: tuple(marks) for topic, marks in found.items() if marks}


def _take_back(marks: list[LossMark], count: int) -> None:
    """So many came after all: take them from the newest marks."""
    while marks and count > 0:
        newest = marks.pop()
        if newest.count > count:
            marks.append(LossMark(newest.at_ns, newest.count - count))
        count -= newest.count


def _figures_that_grow(recording: Recording) -> Iterator[tuple[int, Mapping[str, TopicFigures]]]:
    """The figures at every time when more was missing than before, found by halving.

    What is missing grows, but for what comes late, and how much it is at the end stands in the file: between
    two times at which it is the same nothing is read. So of a long recording that lost little, little is
    read; of one that was not ended all of them.
    """
    if not recording.is_complete:
        yield from recording.figures_over_time()
        return
    pieces = recording.figure_pieces()
    told: dict[int, list[tuple[int, dict[str, TopicFigures]]]] = {}
    final = {topic: _missing(each) for topic, each in recording.figures().items()}
    spans: list[tuple[int, int, Mapping[str, int], Mapping[str, int]]] = [(-1, len(pieces), {}, final)]
    while spans:
        first, last, least, most = spans.pop()
        if last - first < 2 or all(least.get(topic, 0) >= count for topic, count in most.items()):
            continue
        middle = (first + last) // 2
        told[middle] = list(recording.figures_over_time((pieces[middle],)))
        there = {topic: _missing(each) for _at_ns, figures in told[middle] for topic, each in figures.items()}
        spans.append((first, middle, least, {**most, **there}))
        spans.append((middle, last, {**least, **there}, most))
    for number in sorted(told):
        yield from told[number]


def _missing(figures: TopicFigures) -> int:
    return (figures.lost or 0) + figures.unkept
