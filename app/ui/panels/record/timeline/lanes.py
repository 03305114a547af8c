"""Lanes of a recording: bookmarks, runs of behaviours, alarms, and a lane for each topic.

The lanes of topics show message counts and losses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from app.core.recording.replay.density import Densities
from app.core.recording.replay.replay import Replay
from app.core.recording.replay.spans import RecordedSpan, RecordedSpans
from app.core.timeline.lanes import (
    BarLayer,
    CountLayer,
    FlagLayer,
    LaneFigure,
    LaneLayer,
    Mark,
    NotchLayer,
    OutlineLayer,
    SpanLayer,
    Status,
    TimelineContent,
    TimelineLane,
)
from app.core.timeline.times import duration_text
from app.ui.text.numbers import group_digits
from nep.i18n import _, lazy, ngettext
from nep.recordings.bookmarks import Bookmark

BOOKMARKS, RUNS, ALARMS = "bookmarks", "runs", "alarms"
"""Ids of the pinned lanes."""
RESULT_STYLES: Mapping[str, tuple[str, Status, str]] = {
    "ended": ("circle-check", "ok", lazy("ended")),
    "stopped": ("square", "", lazy("stopped")),
    "failed": ("circle-x", "error", lazy("failed")),
}
"""Icon, status and text for each result of a run, by id."""
_ALARM_STATUS: Mapping[bool, Status] = {True: "error", False: "warn"}
TOPIC_ICONS = {"image": "image", "json": "braces", "string": "type", "msgpack": "braces"}


class ReplayLanes:
    """Lanes of an open recording. Parts that don't change are made once.

    Args:
        replay: Open recording.
    """

    def __init__(self, replay: Replay) -> None:
        self._replay = replay
        self._figures = {
            topic: _figures(replay, topic, recorded.message_count)
            for topic, recorded in replay.recorded_topics.items()
        }
        self._spans: RecordedSpans | None = None
        self._span_lanes: tuple[TimelineLane, ...] = ()
        self._alarms_by_topic: dict[str, list[Mark]] = {}

    def content(self) -> TimelineContent:
        """Return the lanes. Lanes of runs and alarms exist if the recording contains any."""
        replay, densities = self._replay, self._replay.densities
        if densities is not None and densities.spans is not self._spans:
            self._set_spans(densities.spans)
        lanes = [
            TimelineLane(
                topic,
                topic,
                TOPIC_ICONS.get(recorded.codec, "binary"),
                _topic_layers(topic, densities, self._alarms_by_topic.get(topic, ())) if densities else (),
                self._figures[topic],
                is_code=True,
            )
            for topic, recorded in replay.recorded_topics.items()
        ]
        pinned = (_bookmark_lane(replay.bookmarks), *self._span_lanes)
        return TimelineContent(pinned, lanes, (_("Messages"), _("Lost")))

    def _set_spans(self, spans: RecordedSpans) -> None:
        self._spans, start_ns = spans, self._replay.start_ns
        runs = [_run_mark(span, start_ns) for span in spans.runs]
        alarms = [_alarm_mark(span, start_ns) for span in spans.alarms]
        lanes = (
            TimelineLane(RUNS, _("Behaviours"), "blocks", (BarLayer(runs),)),
            TimelineLane(ALARMS, _("Alarms"), "bell", (SpanLayer(alarms),)),
        )
        self._span_lanes = tuple(lane for lane, marks in zip(lanes, (runs, alarms), strict=True) if marks)
        self._alarms_by_topic = {}
        for span, mark in zip(spans.alarms, alarms, strict=True):
            self._alarms_by_topic.setdefault(span.topic, []).append(mark)


def _bookmark_lane(bookmarks: Sequence[Bookmark]) -> TimelineLane:
    flags = [
        Mark(each.at_ns, each.at_ns, each.name, each.name or _("Bookmark"), key=each) for each in bookmarks
    ]
    layer = FlagLayer(flags, _("Press B to add a bookmark"))
    return TimelineLane(BOOKMARKS, _("Bookmarks"), "bookmark", (layer,))


def _topic_layers(topic: str, densities: Densities, alarms: Sequence[Mark]) -> tuple[LaneLayer, ...]:
    layers, density = list[LaneLayer](), densities.newest
    if density is not None and topic in density.counts:
        layers.append(CountLayer(density.start_ns, density.end_ns, density.counts[topic]))
    if losses := densities.losses.get(topic):
        layers.append(NotchLayer(losses, partial(_loss_text, topic)))
    if alarms:
        layers.append(OutlineLayer(alarms))
    return tuple(layers)


def _loss_text(topic: str, count: int) -> str:
    template = ngettext(
        "{count} message of {topic} was lost here", "{count} messages of {topic} were lost here", count
    )
    return template.format(count=group_digits(count), topic=topic)


def _figures(replay: Replay, topic: str, message_count: int) -> tuple[LaneFigure, LaneFigure]:
    stats = replay.stats.get(topic)
    lost = None if stats is None or stats.lost is None else stats.lost + stats.unkept
    if lost is None:
        lost_figure = LaneFigure("")
    elif lost:
        lost_figure = LaneFigure(group_digits(lost), "triangle-alert", "warn")
    else:
        lost_figure = LaneFigure(group_digits(0), is_muted=True)
    return LaneFigure(group_digits(message_count)), lost_figure


def _run_mark(span: RecordedSpan, start_ns: int) -> Mark:
    icon, status, result = RESULT_STYLES.get(span.result, ("", "", ""))
    return Mark(
        span.start_ns,
        span.end_ns,
        span.name,
        run_text(span, start_ns),
        icon="blocks",
        status=status,
        result=span.details or (_(result) if result else ""),
        result_icon=icon,
    )


def _alarm_mark(span: RecordedSpan, start_ns: int) -> Mark:
    text, status = alarm_text(span), _ALARM_STATUS[span.is_error]
    icon = "circle-x" if span.is_error else "triangle-alert"
    return Mark(span.start_ns, span.end_ns, text, _with_times(text, span, start_ns), icon=icon, status=status)


def alarm_text(span: RecordedSpan) -> str:
    """Format an alarm and, if known, its duration: "/distance: range is 0.36, below 0.4, 1.2 s"."""
    name = span.name.rstrip(".")
    name = f"{name[:1].upper()}{name[1:]}"
    if not span.has_ended:
        return name
    seconds = (span.end_ns - span.start_ns) / 1e9
    return _("{alarm}, {seconds} s").format(alarm=name, seconds=f"{seconds:.1f}")


def run_text(span: RecordedSpan, start_ns: int) -> str:
    """Format a run: name of the behaviour, result and times.

    Args:
        span: Run.
        start_ns: Start of the recording, in ns since 1970.
    """
    style = RESULT_STYLES.get(span.result)
    result = span.details or (_(style[2]) if style is not None else "")
    return _with_times(f"{span.name}: {result}" if result else span.name, span, start_ns)


def _with_times(text: str, span: RecordedSpan, start_ns: int) -> str:
    begin, end = (duration_text(each - start_ns, digits=1) for each in (span.start_ns, span.end_ns))
    if not span.has_ended:
        return _("{what}\nsince {begin}").format(what=text, begin=begin)
    return _("{what}\n{begin} to {end}").format(what=text, begin=begin, end=end)
