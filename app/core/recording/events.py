"""Events that Studio adds to recordings: runs of behaviours, and alarms."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from itertools import count
from typing import Protocol

from app.core.parts.alarms import severity_of
from app.core.run.view import RunState
from nep.i18n import _
from nep.programs.alarms import AlarmEvent
from nep.programs.alarms.sentences import event_text

MAX_ACTIVE_ALARMS = 200
"""Maximum number of active alarms that are sent repeatedly; further alarms are sent once."""
MAX_TEXT_LENGTH = 200
_ACTIVE_STATES = frozenset({"running", "paused"})


class SendEvent(Protocol):
    """Function that adds an event to the recorder's files."""

    def __call__(self, role: str, value: Mapping[str, object], to: str = "") -> object:
        """Add an event to the recording and to the flight recorder.

        Args:
            role: Channel of the event: "runs" or "alarms".
            value: JSON content of the event.
            to: "recording" or "ring" to add the event only there; "" for both.
        """


class RecordedEvents:
    """Publisher of run and alarm events for the recorder. Not thread-safe; use it from the main thread.

    Active runs and alarms are sent again by `resend`: once to a recording that starts later, and every
    second to the flight recorder, so that each saved part contains them. Otherwise only changes are
    sent.
    """

    def __init__(self, send_event: SendEvent, *, clock_ns: Callable[[], int] = time.time_ns) -> None:
        # `clock_ns` is ns since 1970, as in the recorder.
        self._send_event, self._clock_ns = send_event, clock_ns
        self._numbers = count(1)
        self._active_events: dict[str, tuple[str, Mapping[str, object]]] = {}
        self._run: RunState | None = None
        self._run_entry: dict[str, object] = {}

    def resend(self, to: str) -> None:
        """Send the active runs and alarms again.

        Args:
            to: Destination: "recording" or "ring" (the flight recorder).
        """
        for role, content in self._active_events.values():
            self._send_event(role, content, to)

    # ---- behaviours

    def update_run(self, run: RunState) -> None:
        """Send an event if the state of the run has changed. Called at each tick."""
        previous, self._run = self._run, run
        if run is previous:
            return
        was_active, is_active = (
            previous is not None and previous.state in _ACTIVE_STATES,
            run.state in _ACTIVE_STATES,
        )
        is_same_run = was_active and previous is not None and _is_unchanged(previous, run)
        if was_active and not (is_active and is_same_run):
            self._end_run(run if is_same_run else None)
        elif self._run_entry and not is_active:
            self._send_result(run)
        if is_active and not is_same_run:
            self._run_entry = self._new_entry(f"run-{next(self._numbers)}", run.tried_label or run.name)
            self._add("runs", self._run_entry)

    def _end_run(self, run: RunState | None) -> None:
        # `run` is None if the end was not observed.
        self._run_entry["until_ns"] = self._clock_ns()
        self._active_events.pop(str(self._run_entry.get("id")), None)
        if run is None:
            self._send_event("runs", dict(self._run_entry))
            self._run_entry = {}
        else:
            self._send_result(run)

    def _send_result(self, run: RunState) -> None:
        # Sent again with the robots' time once they have replied.
        content = {**self._run_entry, **_result(run)}
        if content != self._run_entry:
            self._run_entry = content
            self._send_event("runs", dict(content))
        if run.state in {"proven", "ready"}:
            self._run_entry = {}

    # ---- alarms

    def on_alarm(self, event: AlarmEvent) -> None:
        """Send an alarm event: raised, cleared, or still active."""
        key = f"alarm-{event.rule.id}"
        active = self._active_events.get(key)
        if event.kind == "off":
            if active is not None:
                del self._active_events[key]
                self._send_event("alarms", {**active[1], "until_ns": self._clock_ns()})
            return
        if active is not None:
            return
        condition = event.rule.condition
        entry = self._new_entry(f"{key}-{next(self._numbers)}", event_text(condition, event.value))
        entry["severity"] = severity_of(condition)
        entry["topic"] = "" if condition.is_about_node else condition.name
        self._add("alarms", entry, key)

    # ---- private

    def _new_entry(self, id: str, name: str) -> dict[str, object]:
        since_ns = self._clock_ns()
        return {
            "id": f"{id}-{since_ns}",
            "name": name[:MAX_TEXT_LENGTH],
            "since_ns": since_ns,
            "until_ns": None,
        }

    def _add(self, role: str, content: Mapping[str, object], key: str = "") -> None:
        self._send_event(role, dict(content))
        if len(self._active_events) < MAX_ACTIVE_ALARMS:
            self._active_events[key or str(content["id"])] = (role, content)


def _is_unchanged(previous: RunState, run: RunState) -> bool:
    # The clock of the same run is set once more when its scripts begin.
    return run.started_s == previous.started_s or (run.is_started and not previous.is_started)


def _result(run: RunState) -> dict[str, object]:
    if run.errors:
        return {"result": "failed", "words": next(iter(run.errors.values()))[:MAX_TEXT_LENGTH]}
    if run.is_finished:
        return {"result": "ended", "words": ""}
    report = run.report
    if report is None or not report.is_confirmed or not report.robots:
        return {"result": "stopped", "words": ""}
    elapsed_ms = max(1, round(report.elapsed_ms))
    return {"result": "stopped", "words": _("Stop, {elapsed} ms").format(elapsed=elapsed_ms)}
