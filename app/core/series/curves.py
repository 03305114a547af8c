"""Curves of one plot. Curves share sources and calculations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from app.core.series.calculated import CalculatedSamples, ExpressionCurve, WindowCurve
from app.core.series.feed import SeriesFeed
from app.core.series.field_path import (
    MISSING,
    FieldPath,
    PlottableField,
    fields_of,
    kind_of_value,
    nearest_field,
)
from app.core.series.field_series import FieldSeries, TopicSeries
from app.core.series.formula import (
    ExpressionSource,
    FieldSource,
    Source,
    WindowSource,
    parse,
)
from app.core.series.samples import MAX_SAMPLES, Samples
from app.core.series.states import States
from app.errors import CurveError
from nep.i18n import _

MAX_CURVES = 64
MAX_TOTAL_SAMPLES = 8 * MAX_SAMPLES
"""Maximum total number of samples of all curves of a plot (about 150 MB)."""
MIN_SAMPLES = 8192


@dataclass(eq=False, slots=True)
class Curve:
    """Curve of a plot.

    Attributes:
        text: Expression of the source, which is unique within the plot.
        source: Source of the samples.
        samples: Numbers over time.
        series: Series of the field; None for a calculated curve.
    """

    text: str
    source: Source
    samples: Samples
    series: FieldSeries | None = None

    @property
    def states(self) -> States | None:
        """States of a field with text or boolean values, else None."""
        return self.series.states if self.series is not None and len(self.series.states) else None

    @property
    def is_state(self) -> bool:
        """True if the curve is shown as a lane of states."""
        return self.series is not None and (
            self.series.is_state or (not len(self.samples) and len(self.series.states) > 0)
        )

    @property
    def last(self) -> object:
        """Newest value as received; `MISSING` before the first value."""
        if self.series is not None:
            return self.series.last
        return float(self.samples.values[-1]) if len(self.samples) else MISSING


def topics_of(source: Source) -> set[str]:
    """Return the topics that a source needs."""
    if isinstance(source, FieldSource):
        return {source.topic}
    if isinstance(source, WindowSource):
        return topics_of(source.source)
    return {topic for each in source.inputs for topic in topics_of(each)}


@dataclass(slots=True, eq=False)
class _SharedSamples:
    """Samples that one or several curves use, with the number of these curves."""

    samples: Samples
    user_count: int = 0
    dependencies: list[str] = field(default_factory=list)
    series: FieldSeries | None = None
    calculated: CalculatedSamples | None = None


class Curves:
    """All curves of one plot. Not thread-safe; use it from the main thread."""

    def __init__(self, feed: SeriesFeed, topics: Callable[[], Iterable[str]]) -> None:
        # `topics` returns the names of existing topics.
        self._feed, self._existing_topics = feed, topics
        self._topics: dict[str, TopicSeries] = {}
        self._shared: dict[str, _SharedSamples] = {}  # in order of dependency
        self.all: list[Curve] = []

    # -- commands of the user ----------------------------------------------------------------------

    def add(self, text: str, extra_topics: Iterable[str] = ()) -> list[Curve]:
        """Add and return the curves for a typed expression, except for curves that are already plotted.

        A path with ``[*]`` adds a curve for each array element. A field that does not exist is no
        error, because fields are known only after the first message of a topic.

        Args:
            text: Expression that the user typed.
            extra_topics: Names of topics that are valid although they don't exist at the moment.

        Raises:
            CurveError: The expression is invalid, its array is empty, or there are too many curves.
                Nothing is added; the message says how to fix it.
        """
        source = parse(text, [*self._known_topics(), *extra_topics])
        sources: Sequence[Source] = [source]
        if isinstance(source, FieldSource) and source.path.has_wildcard:
            payload = self.payload_of(source.topic)
            sources = [FieldSource(source.topic, path) for path in source.path.expand(payload)]
        return self.add_sources(sources, text)

    def add_field(self, topic: str, path: FieldPath) -> list[Curve]:
        """Add and return the curves of a field, even if its topic doesn't exist.

        Curves that are already plotted are left out.

        Raises:
            CurveError: The array of a path with ``[*]`` is empty, or there are too many curves.
        """
        paths = path.expand(self.payload_of(topic)) if path.has_wildcard else [path]
        return self.add_sources([FieldSource(topic, each) for each in paths], str(FieldSource(topic, path)))

    def add_sources(self, sources: Sequence[Source], text: str) -> list[Curve]:
        """Add and return curves for sources, except for sources that are already plotted.

        Args:
            sources: Sources of the curves.
            text: Expression that the user typed, for error messages.

        Raises:
            CurveError: There are no sources, or too many curves.
        """
        plotted_texts = {each.text for each in self.all}
        new_sources = [each for each in sources if str(each) not in plotted_texts]
        if not sources:
            raise CurveError(_("{text} has no elements now").format(text=text))
        if len(self.all) + len(new_sources) > MAX_CURVES:
            raise CurveError(_("a plot can have at most {count} curves").format(count=MAX_CURVES))
        curves = []
        for source in new_sources:
            shared = self._acquire(source)
            curves.append(Curve(str(source), source, shared.samples, shared.series))
        self.all += curves
        self._distribute_capacity()
        return curves

    def remove(self, curve: Curve) -> None:
        """Remove a curve. Its topic is no longer watched if no other curve needs it."""
        if curve in self.all:
            self.all.remove(curve)
            self._release(curve.text)
            self._distribute_capacity()

    def close(self) -> None:
        """Remove all curves."""
        for curve in list(self.all):
            self.remove(curve)

    def advance(self) -> None:
        """Calculate new samples. Called once per tick, after new messages were added."""
        for shared in self._shared.values():
            if shared.calculated is not None:
                shared.calculated.advance()

    # -- queries -----------------------------------------------------------------------------------

    def payload_of(self, topic: str) -> object:
        """Return the payload of the newest message of a plotted topic; `MISSING` if there is none."""
        topic_series = self._topics.get(topic)
        return topic_series.payload if topic_series is not None else MISSING

    def fields(self, topic: str) -> list[PlottableField]:
        """Return the plottable fields in the newest message of a plotted topic."""
        payload = self.payload_of(topic)
        return [] if payload is MISSING else list(fields_of(payload))

    @property
    def lost(self) -> int:
        """Number of lost messages of the plotted topics."""
        return sum(each.lost for each in self._topics.values())

    @property
    def skipped_count(self) -> int:
        """Number of messages that were skipped: undecodable, too large, or with an invalid time stamp."""
        return sum(each.unreadable_count + each.invalid_stamp_count for each in self._topics.values())

    @property
    def discarded_count(self) -> int:
        """Number of samples and states that were removed because a clock was set back."""
        fields = [field for topic in self._topics.values() for field in topic.fields]
        return sum(field.numbers.removed_count + field.states.removed_count for field in fields)

    @property
    def evicted_count(self) -> int:
        """Number of old samples and states that were evicted."""
        states = [each.states for each in self.all if each.states is not None]
        return sum(each.samples.evicted_count for each in self.all) + sum(
            each.evicted_count for each in states
        )

    @property
    def newest_s(self) -> float | None:
        """Time in seconds of the newest sample or state of all curves; None if there is none."""
        last_times = [
            last
            for curve in self.all
            for last in (curve.samples.last_s, curve.states.last_s if curve.states is not None else None)
            if last is not None
        ]
        return max(last_times, default=None)

    def no_values_reason(self, curve: Curve) -> str:
        """Return a sentence about why a curve has no values; "" if it has values or may get some."""
        if curve.series is None or len(curve.samples) or len(curve.series.states):
            return ""
        payload = self.payload_of(curve.series.topic)
        if payload is MISSING:
            return ""
        value = curve.series.path.value_in(payload)
        if kind_of_value(value) in {"number", "state"}:
            return ""
        if value is MISSING:
            nearest = nearest_field(curve.series.path, payload)
            if nearest is None:
                return _("{field} doesn't exist.").format(field=curve.text)
            suggestion = FieldSource(curve.series.topic, FieldPath.parse(nearest))
            return _("{field} doesn't exist. Did you mean {near}?").format(field=curve.text, near=suggestion)
        return _("{field} isn't a number, text or boolean. Choose one of its fields.").format(
            field=curve.text
        )

    # -- private -----------------------------------------------------------------------------------

    def _known_topics(self) -> list[str]:
        return list(dict.fromkeys([*self._topics, *self._existing_topics()]))

    def _acquire(self, source: Source) -> _SharedSamples:
        # Creates the samples at the first use, and counts their users.
        name = str(source)
        shared = self._shared.get(name)
        if shared is None:
            shared = self._create_samples(source)
            self._shared[name] = shared
        shared.user_count += 1
        return shared

    def _create_samples(self, source: Source) -> _SharedSamples:
        if isinstance(source, FieldSource):
            return self._create_field_samples(source)
        if isinstance(source, WindowSource):
            shared = self._acquire(source.source)
            calculated: CalculatedSamples = WindowCurve(source.kind, shared.samples, source.window_s)
            return _SharedSamples(
                calculated.samples, dependencies=[str(source.source)], calculated=calculated
            )
        assert isinstance(source, ExpressionSource)  # noqa: S101  the only other type
        inputs = [self._acquire(each).samples for each in source.inputs]
        calculated = ExpressionCurve(source.calculate, inputs)
        return _SharedSamples(
            calculated.samples, dependencies=[str(each) for each in source.inputs], calculated=calculated
        )

    def _create_field_samples(self, source: FieldSource) -> _SharedSamples:
        topic = self._topics.get(source.topic)
        if topic is None:
            topic = self._topics[source.topic] = TopicSeries(source.topic, self._feed.origin_ns)
            self._feed.register(source.topic, topic)
        series = FieldSeries(source.topic, source.path)
        topic.add_field(series)
        return _SharedSamples(series.numbers, series=series)

    def _release(self, name: str) -> None:
        shared = self._shared[name]
        shared.user_count -= 1
        if shared.user_count > 0:
            return
        del self._shared[name]
        for dependency in shared.dependencies:
            self._release(dependency)
        if shared.series is not None:
            topic = self._topics[shared.series.topic]
            topic.fields.remove(shared.series)
            if not topic.fields:
                del self._topics[topic.topic]
                self._feed.unregister(topic.topic, topic)

    def _distribute_capacity(self) -> None:
        capacity = max(MIN_SAMPLES, min(MAX_SAMPLES, MAX_TOTAL_SAMPLES // max(1, len(self._shared))))
        for shared in self._shared.values():
            shared.samples.limit = capacity
