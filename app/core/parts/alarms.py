"""Alarms of a session: loaded from a file, evaluated on messages and graphs, and shown as alerts."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Protocol

from app.core.alerts.alerts import Alerts
from app.core.network.watches import Watch
from app.core.robots.fleet import Fleet
from app.core.robots.motion.permission import PermissionQuestion
from app.core.robots.stop.moved_robots import OnMoved, ignore_moved
from app.core.robots.voices import Notes, RobotVoices
from app.core.run.control import Runs
from app.core.storage.atomic_file import write_atomically
from app.core.storage.background_worker import BackgroundWorker
from app.core.storage.settings import Settings
from app.core.storage.user_file import read_stored
from app.core.world.console import Console
from app.core.world.live import LiveWorld
from app.core.world.part import SessionPart
from app.intents import ShowAlarms
from nep.i18n import _, format_list, lazy
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmEvent, AlarmFile, AlarmRule, Alarms
from nep.programs.alarms.alarms import ActionStarter, DoneCallback
from nep.programs.alarms.commands import AlarmCommands
from nep.programs.alarms.history import AlarmHistory
from nep.programs.alarms.rule import EVENT_KINDS, Scalar, new_id, problem_of
from nep.programs.alarms.rule_file import MAX_ALARMS, NewerAlarmsError, encode_alarms, parse_alarms
from nep.programs.alarms.sentences import duration_text, event_text, subject_text
from nep.protocol.graph_view import GraphView

FILE_NAME = "alarms.json"
MAX_MESSAGE_AGE_S = 10.0
"""Maximum age in seconds of an unsent message. Older messages may be outdated and are discarded."""
SOUND: Notes = ((880.0, 0.16), (0.0, 0.06), (880.0, 0.16), (0.0, 0.06), (660.0, 0.3))
VOLUME = 0.6
ACTION_FAILED_MESSAGE = lazy("an alarm can't carry out its action: {error}")
_MAX_FILE_BYTES = 4_000_000
WARNING_KINDS = frozenset({*EVENT_KINDS, "loses", "rate_below", "rate_above"})
"""Kinds of conditions with severity "warn"; all other kinds are errors."""


def severity_of(condition: AlarmCondition) -> str:
    """Return the severity of an alarm with this condition: "error" or "warn"."""
    return "warn" if condition.kind in WARNING_KINDS else "error"


class AlarmSession(Protocol):
    """Parts of the session that `SessionAlarms` uses."""

    settings: Settings
    alerts: Alerts
    console: Console
    live: LiveWorld
    fleet: Fleet
    voices: RobotVoices
    runs: Runs


@dataclass(frozen=True, slots=True)
class _PendingSend:
    """Message to be sent by an alarm once the user confirms that the robot may move."""

    question: PermissionQuestion
    on_done: DoneCallback


class SessionAlarms(SessionPart):
    """Alarms of a session. Not thread-safe, except `evaluate`; use it from the main thread.

    Attributes:
        save_flight_recorder: Callback that saves the flight recorder. While None, the action fails.
        run_behaviour: Callback that runs a behaviour by name and returns an error message or "". While
            None, the action fails.
        on_event: Callback for each alarm that was raised or cleared, or that is still active.
    """

    task = lazy("monitor the alarms")

    def __init__(
        self,
        session: AlarmSession,
        *,
        clock: Callable[[], float] = time.monotonic,
        clock_s: Callable[[], float] = time.time,
    ) -> None:
        self._session = session
        self.path: Path | None = session.settings.path.with_name(FILE_NAME)
        self._clock, self._clock_s = clock, clock_s
        self._commands = AlarmCommands(session.fleet.gate.current_rejection_reason)
        self._pending_send: _PendingSend | None = None
        self.on_moved: OnMoved = ignore_moved
        """Called before a message that moves robots is sent, with the robots and "alarm"."""
        self.save_flight_recorder: ActionStarter | None = None
        self.run_behaviour: Callable[[str], str] | None = None
        self.on_event: Callable[[AlarmEvent], object] = _ignore_event
        self._worker: BackgroundWorker[bool] = BackgroundWorker("studio-alarms")
        self._watches: dict[str, Watch] = {}
        self._last_removed: tuple[AlarmRule, int] | None = None
        self._is_file_newer = False
        alarm_file = self._read(self.path)
        action_starters: dict[str, ActionStarter] = {
            "banner": _complete_with_alert,
            "console": self._log_to_console,
            "sound": self._play_sound,
            "keep": self._save_recording,
            "run": self._run,
            "call": self._submit_command,
            "send": self._send,
            "stop": self._stop,
        }
        self.alarms = Alarms(
            alarm_file.rules, alarm_file.history, action_starters, clock=clock, clock_s=clock_s
        )
        self._saved_state: object = self._state()
        self._view: GraphView | None = None
        self._active_ids: set[str] = set()

    # ---- interface of the panel and menus

    @property
    def rules(self) -> tuple[AlarmRule, ...]:
        """All alarms, newest first."""
        return self.alarms.rules

    @property
    def history(self) -> AlarmHistory:
        """Bounded list of past alarm events."""
        return self.alarms.history

    @property
    def revision(self) -> int:
        """Counter that increases when the rules or the history change, but not with the measured values."""
        return self.alarms.revision + self.history.revision

    @property
    def active(self) -> Sequence[AlarmRule]:
        """Active alarms: the condition is true and the alarm is not snoozed."""
        return [
            rule
            for rule in self.rules
            if rule.id in self._active_ids and not rule.is_snoozed(self._clock_s())
        ]

    def create(self, condition: AlarmCondition) -> AlarmRule:
        """Return a new alarm that shows a banner while a condition is true, and add it to the list.

        Evaluation starts as soon as all fields of the condition are filled in. If the list is full, the
        alarm is not added and an alert is raised; see `set_rule`.
        """
        rule = AlarmRule(new_id(), condition, (AlarmAction("banner"),))
        self.set_rule(rule)
        return rule

    def set_rule(self, rule: AlarmRule) -> None:
        """Add an alarm, or replace the alarm with the same id.

        If the list is full, an alert is raised instead.
        """
        if self.alarms.rule(rule.id) is not None or self._check_capacity():
            self.alarms.set_rule(rule)
            self._update_watches()

    def _check_capacity(self) -> bool:
        if len(self.rules) < MAX_ALARMS:
            return True
        text = _("You have {count} alarms, the maximum.").format(count=MAX_ALARMS)
        hint = _("Delete one you don't need.")
        self._session.alerts.raise_alert(
            "alarms:most", "warn", text, hint, button=_("Show the alarms"), intent=ShowAlarms(), count=0
        )
        return False

    def remove(self, rule_id: str) -> AlarmRule | None:
        """Remove an alarm and return it; None if the id is unknown. Undo with `restore`."""
        rule = self.alarms.rule(rule_id)
        if rule is not None:
            self._last_removed = (rule, self.rules.index(rule))
            self.alarms.remove(rule_id)
            self._session.alerts.resolve("alarms:most")
            self._update_watches()
        return rule

    def restore(self) -> None:
        """Restore the last removed alarm at its position; if the list is full, an alert is raised instead."""
        if self._last_removed is not None and self._check_capacity():
            (rule, index), self._last_removed = self._last_removed, None
            rules = [*self.rules]
            rules.insert(index, rule)
            self.alarms.set_rules(rules)
            self._update_watches()

    def snooze(self, rule_id: str, until_s: float) -> None:
        """Suppress the actions of an alarm until ``until_s`` (seconds since 1970); 0 ends the snooze."""
        self.alarms.snooze(rule_id, until_s)
        if until_s > self._clock_s():
            self._session.alerts.dismiss(_alert_id(rule_id))

    # ---- interface of the session

    def evaluate(self, topic: str, messages: Sequence[Message]) -> None:
        """Evaluate the alarms on new messages of a topic. Called in the receiving thread."""
        self.alarms.evaluator.evaluate(topic, messages)

    def update_graph(self, view: GraphView | None) -> None:
        """Evaluate the alarms on a new graph.

        Args:
            view: New graph; None if the connection to the master was lost.
        """
        self._view = view
        self.alarms.evaluator.update_graph(view)

    def start(self) -> None:
        """Subscribe to the topics that the alarms use."""
        self._update_watches()

    def tick(self) -> None:
        """Apply a new graph, process pending alarm events and run the actions that are due."""
        if self._session.live.new_graph is not None:
            self.update_graph(self._session.live.new_graph)
        for event in self.alarms.tick():
            self._show_event(event)
        self.alarms.take_action_results()
        pending = self._pending_send
        if pending is not None and self._session.fleet.permission.question is not pending.question:
            self._pending_send = None
            pending.on_done(
                False,
                _("not sent: no permission to move {robots}").format(
                    robots=format_list(pending.question.names)
                ),
            )

    def check(self) -> None:
        """Update the alerts and save changed alarms. Called once a second."""
        for rule in self.rules:
            if rule.id in self._active_ids:
                self._update_alert(rule, self.alarms.evaluator.state(rule).value, count=0)
        self._write()
        try:
            if self._worker.pop_result(FILE_NAME):
                self._session.alerts.resolve("alarms:kept")
        except OSError as error:
            self._saved_state = None  # retried at the next check
            self._session.alerts.raise_alert(
                "alarms:kept",
                "warn",
                _("Alarms can't be saved."),
                _("Reason: {reason}. The alarms stay active until Studio closes.").format(
                    reason=error.strerror or error
                ),
                count=0,
            )

    def close(self) -> None:
        """Close all watches and save pending changes."""
        for watch in self._watches.values():
            watch.close()
        self._watches.clear()
        self._write()
        self._worker.finish(FILE_NAME)
        self._worker.close()
        self._commands.close()

    def _update_watches(self) -> None:
        required_topics = self.alarms.evaluator.topics
        for topic in self._watches.keys() - required_topics:
            self._watches.pop(topic).close()
        for topic in required_topics - self._watches.keys():
            self._watches[topic] = self._session.live.watch(topic)
        if self._view is not None:
            self.alarms.evaluator.update_graph(self._view)

    # ---- alerts

    def _show_event(self, event: AlarmEvent) -> None:
        rule, alerts = event.rule, self._session.alerts
        self.on_event(event)
        if event.kind == "off":
            self._active_ids.discard(rule.id)
            alerts.resolve(_alert_id(rule.id))
            return
        if event.kind == "still":
            alerts.resolve(_alert_id(rule.id))  # the snooze dismissed its banner
        self._active_ids.add(rule.id)
        self._update_alert(rule, event.value, count=1)
        if event.is_snoozed or not any(action.kind == "banner" for action in rule.actions):
            alerts.dismiss(_alert_id(rule.id))

    def _update_alert(self, rule: AlarmRule, value: Scalar, count: int) -> None:
        condition, record = rule.condition, self.history.last(rule.id)
        # use the value that triggered the alarm, if it was recorded, instead of the current one
        alert_text = record.cause if record is not None else event_text(condition, value)
        if condition.kind == "silent" and isinstance(value, int | float) and value >= 1:
            template = _("{topic} has been silent for {time}")
            alert_text = template.format(topic=subject_text(condition), time=duration_text(round(value)))
        details = [result.text for result in record.action_results] if record is not None else []
        total_count = self.alarms.evaluator.state(rule).count
        previous_count = next(
            (each.count for each in self._session.alerts.active if each.id == _alert_id(rule.id)), 0
        )
        self._session.alerts.raise_alert(
            _alert_id(rule.id),
            severity_of(condition),
            f"{alert_text[:1].upper()}{alert_text[1:]}.",
            ". ".join([*(each[:1].upper() + each[1:] for each in details), ""]).strip(),
            button=_("Show the alarm"),
            intent=ShowAlarms(),
            count=max(count, total_count - previous_count) if previous_count else max(1, count),
        )

    # ---- actions

    def _log_to_console(self, event: AlarmEvent, _action: AlarmAction, on_done: DoneCallback) -> None:
        text = event_text(event.rule.condition, event.value)
        self._session.console.add(severity_of(event.rule.condition), "alarms", text)
        on_done(True, "")

    def _play_sound(self, _event: AlarmEvent, _action: AlarmAction, on_done: DoneCallback) -> None:
        speaker = self._session.voices.speaker
        if speaker is None:
            on_done(False, _("sound isn't available"))
            return
        speaker.play(SOUND, VOLUME)
        on_done(True, _("sound played"))

    def _save_recording(self, event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        if self.save_flight_recorder is None:
            on_done(False, _("nothing saved: recording is off"))
        else:
            self.save_flight_recorder(event, action, on_done)

    def _run(self, _event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        error_text = _("no window is open") if self.run_behaviour is None else self.run_behaviour(action.name)
        if error_text:
            on_done(False, _("“{name}” wasn't started: {reason}").format(name=action.name, reason=error_text))
        else:
            on_done(True, _("started “{name}”").format(name=action.name))

    def _stop(self, _event: AlarmEvent, _action: AlarmAction, on_done: DoneCallback) -> None:
        self._session.runs.stop()
        on_done(True, _("Stop was sent to all robots"))

    def _send(self, event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        fleet, (topic, msg_type) = self._session.fleet, (action.name, action.msg_type)
        if not fleet.gate.is_permitted(topic, msg_type) and fleet.permission.question is not None:
            on_done(False, _("not sent: waiting for permission to move a robot"))
            return
        reason = _("An alarm wants to send a message on {topic} ({what}).").format(
            topic=topic, what=event_text(event.rule.condition, event.value)
        )
        resume = partial(self._resume_send, event, action, on_done)
        if not fleet.gate.request_permission(topic, resume, msg_type, reason=reason):
            question = fleet.permission.question
            self._pending_send = None if question is None else _PendingSend(question, on_done)
            return
        moved_robots = fleet.gate.robots_moved_by(topic, msg_type)
        if moved_robots:
            self.on_moved(moved_robots, "alarm")
        self._submit_command(event, action, on_done)

    def _resume_send(self, event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        self._pending_send = None
        self._send(event, action, on_done)

    def _submit_command(self, _event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        requested_s = self._clock()

        def job(node: Node) -> None:
            if self._clock() - requested_s > MAX_MESSAGE_AGE_S:
                on_done(False, _("no master was running"))
            else:
                self._commands.start_action(node, action, on_done)

        self._session.live.source.submit(ACTION_FAILED_MESSAGE, job)

    # ---- file

    def _state(self) -> tuple[tuple[AlarmRule, ...], int]:
        return self.rules, self.history.revision

    def _write(self) -> None:
        path, state = self.path, self._state()
        if path is None or self._is_file_newer or state == self._saved_state:
            return
        self._saved_state = state
        # an incomplete rule could not be read back
        rules = [rule for rule in self.rules if problem_of(rule) is None]
        history = AlarmHistory([replace(record) for record in self.history.records])

        def write() -> bool:
            write_atomically(path, encode_alarms(rules, history), durable=False, private=True)
            return True

        self._worker.submit(FILE_NAME, write)

    def _read(self, path: Path) -> AlarmFile:
        def parse(data: bytes) -> tuple[AlarmFile, str]:
            alarm_file = parse_alarms(data, path.name, lenient=True)
            return alarm_file, next(iter(alarm_file.problems), "")

        stored = read_stored(path, parse, NewerAlarmsError, _MAX_FILE_BYTES)
        self._is_file_newer = stored.is_newer
        if stored.problem:
            is_partial = stored.value is not None
            title = _("Some alarms couldn't be read.") if is_partial else _("The alarms couldn't be read.")
            self._session.alerts.raise_alert(
                "alarms:file", "warn", title, stored.problem, button=_("Show the alarms"), intent=ShowAlarms()
            )
        return stored.value if stored.value is not None else AlarmFile()


def _ignore_event(_event: AlarmEvent) -> None: ...


def _alert_id(rule_id: str) -> str:
    return f"alarm:{rule_id}"


def _complete_with_alert(_event: AlarmEvent, _action: AlarmAction, on_done: DoneCallback) -> None:
    on_done(True, "")
