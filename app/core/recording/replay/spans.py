"""Spans of time in a recording: runs of behaviours, and alarms.

Spans are read from the recorder's channels, to which Studio writes them (`app.core.recording.events`;
in the flight recorder repeatedly), and from the graph's alerts. Files of other programs and damaged
files may contain any data there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from nep.recordings.reader import Recording

MAX_SPANS = 2_000
"""Maximum number of spans in each lane; further spans are only counted."""
_MAX_NAME_LENGTH = 200
RESULTS = ("ended", "stopped", "failed")


@dataclass(frozen=True, slots=True)
class RecordedSpan:
    """Run or alarm from ``start_ns`` to ``end_ns``, clipped to the recording.

    Attributes:
        name: Name of the behaviour, or the sentence of the alarm.
        has_ended: True if the run or alarm ended within the recording.
        result: Result of a run, one of `RESULTS`; "" while unknown.
        details: Details of the result.
        is_error: True for an alarm with the severity "error".
        topic: Topic of the alarm, or "".
    """

    start_ns: int
    end_ns: int
    name: str
    has_ended: bool = False
    result: str = ""
    details: str = ""
    is_error: bool = False
    topic: str = ""


@dataclass(frozen=True, slots=True)
class RecordedSpans:
    """Spans of a recording, in order of time.

    Attributes:
        omitted_count: Number of spans beyond the limit, which are not included.
    """

    runs: Sequence[RecordedSpan] = ()
    alarms: Sequence[RecordedSpan] = ()
    omitted_count: int = 0

    def starts(self) -> list[int]:
        """Return the start times of all spans."""
        return sorted(each.start_ns for each in (*self.runs, *self.alarms))


class _Lane:
    """Spans of one kind, by id. Records with the same id describe the same span."""

    def __init__(self, first_ns: int, last_ns: int) -> None:
        self._first_ns, self._last_ns = first_ns, last_ns
        self._spans_by_id: dict[str, RecordedSpan] = {}
        self._omitted_ids: set[str] = set()

    @property
    def omitted_count(self) -> int:
        return len(self._omitted_ids)

    def sorted_spans(self) -> tuple[RecordedSpan, ...]:
        return tuple(sorted(self._spans_by_id.values(), key=lambda span: (span.start_ns, span.end_ns)))

    def add(self, id: str, span: RecordedSpan) -> None:
        # The start is the earliest of all records.
        existing = self._spans_by_id.get(id)
        if existing is None and len(self._spans_by_id) >= MAX_SPANS:
            if len(self._omitted_ids) < MAX_SPANS:
                self._omitted_ids.add(id)
            return
        start_ns = self._clamp(span.start_ns if existing is None else min(existing.start_ns, span.start_ns))
        end_ns = max(start_ns, self._clamp(span.end_ns))
        self._spans_by_id[id] = replace(span, start_ns=start_ns, end_ns=end_ns)

    def end_span(self, id: str, at_ns: int) -> None:
        existing = self._spans_by_id.get(id)
        if existing is not None:
            self._spans_by_id[id] = replace(
                existing, end_ns=max(existing.start_ns, self._clamp(at_ns)), has_ended=True
            )

    def _clamp(self, at_ns: int) -> int:
        return max(self._first_ns, min(at_ns, self._last_ns))


def spans_of(recording: Recording) -> RecordedSpans:
    """Return the runs and alarms of a recording; malformed records are skipped."""
    first_ns, last_ns = recording.start_ns, recording.end_ns
    runs, alarms = _Lane(first_ns, last_ns), _Lane(first_ns, last_ns)
    for lane, role in ((runs, "runs"), (alarms, "alarms")):
        for at_ns, entry in recording.entries(role):
            if isinstance(entry, Mapping) and isinstance(entry.get("id"), str):
                lane.add(entry["id"], _parse_span(entry, at_ns, last_ns))
    _read_alerts(recording, alarms)
    return RecordedSpans(
        runs.sorted_spans(), alarms.sorted_spans(), runs.omitted_count + alarms.omitted_count
    )


def _parse_span(entry: Mapping[str, object], at_ns: int, last_ns: int) -> RecordedSpan:
    since_ns, until_ns = entry.get("since_ns"), entry.get("until_ns")
    has_ended = type(until_ns) is int
    result = _text(entry, "result")
    return RecordedSpan(
        since_ns if type(since_ns) is int and since_ns <= at_ns else at_ns,
        until_ns if type(until_ns) is int else last_ns,
        _text(entry, "name"),
        has_ended,
        result if result in RESULTS else "",
        _text(entry, "words"),
        entry.get("severity") == "error",
        _text(entry, "topic"),
    )


def _read_alerts(recording: Recording, lane: _Lane) -> None:
    # Each change of the graph's alerts lists all of them.
    span_ids: dict[str, str] = {}
    for at_ns, entry in recording.entries("alerts"):
        alert_list = entry.get("alerts") if isinstance(entry, Mapping) else None
        alerts_by_id = {
            _text(alert, "id"): alert
            for alert in (alert_list if isinstance(alert_list, list) else ())[:MAX_SPANS]
            if isinstance(alert, Mapping) and _text(alert, "id")
        }
        for ended_id in [id for id in span_ids if id not in alerts_by_id]:
            lane.end_span(span_ids.pop(ended_id), at_ns)
        for id, alert in alerts_by_id.items():
            if id not in span_ids:
                span_ids[id] = f"alert-{id}-{at_ns}"
                _kind, _colon, topic = id.partition(":")
                lane.add(
                    span_ids[id],
                    RecordedSpan(at_ns, recording.end_ns, _text(alert, "sentence") or id, topic=topic),
                )


def _text(entry: Mapping[str, object], key: str) -> str:
    value = entry.get(key)
    return value[:_MAX_NAME_LENGTH] if isinstance(value, str) else ""
