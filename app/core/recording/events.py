"""Events that Studio adds to recordings: runs of behaviours, and alarms."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from itertools import count
from typing import Protocol

from app.core.parts.alarms import severity_of
from app.core.run.run_record import RunRecord
from app.core.run.view import RunState
from nep.i18n import _
from nep.programs.alarms import AlarmEvent
from nep.programs.alarms.sentences import event_text

MAX_ACTIVE_ALARMS = 200
"""Maximum number of active alarms that are sent repeatedly; further alarms are sent once."""
MAX_TEXT_LENGTH = 200


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
        self._run: RunRecord | None = None
        self._run_state: RunState | None = None
        self._run_entry: dict[str, object] = {}

    def resend(self, to: str) -> None:
        """Send the active runs and alarms again.

        Args:
            to: Destination: "recording" or "ring" (the flight recorder).
        """
        for role, content in self._active_events.values():
            self._send_event(role, content, to)

    # ---- behaviours

    def update_run(self, run: RunRecord) -> None:
        """Send an event if the run or its state has changed. Called at each tick."""
        if run is not self._run:
            if self._run is not None:
                self._send_result(self._run)
            self._run, self._run_state, self._run_entry = run, None, {}
        if run.state is self._run_state:
            return
        self._run_state = run.state
        if not run.is_active:
            self._send_result(run)
        elif not self._run_entry:
            self._run_entry = self._new_entry(f"run-{next(self._numbers)}", run.name)
            self._add("runs", self._run_entry)

    def _send_result(self, run: RunRecord) -> None:
        # Sent again with the robots' time once they have replied.
        if not self._run_entry:
            return
        if self._run_entry["until_ns"] is None:
            self._run_entry["until_ns"] = self._clock_ns()
            self._active_events.pop(str(self._run_entry["id"]), None)
        content = {**self._run_entry, **_result(run)}
        if content != self._run_entry:
            self._run_entry = content
            self._send_event("runs", dict(content))
        if run.state.state in {"proven", "ready"}:
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


def _result(run: RunRecord) -> dict[str, object]:
    if run.failure:
        return {"result": "failed", "words": run.failure[:MAX_TEXT_LENGTH]}
    if run.state.is_finished:
        return {"result": "ended", "words": ""}
    report = run.state.report
    if report is None or not report.is_confirmed or not report.robots:
        return {"result": "stopped", "words": ""}
    elapsed_ms = max(1, round(report.elapsed_ms))
    return {"result": "stopped", "words": _("Stop, {elapsed} ms").format(elapsed=elapsed_ms)}
