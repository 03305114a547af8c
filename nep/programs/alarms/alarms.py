"""`Alarms`: alarm rules with their actions and history. Used by `nep watch` and Studio."""

from __future__ import annotations

import queue
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from nep.i18n import _
from nep.programs.alarms.evaluator import AlarmEvaluator, AlarmEvent
from nep.programs.alarms.history import ActionResult, AlarmHistory, AlarmRecord
from nep.programs.alarms.rule import AlarmAction, AlarmRule
from nep.programs.alarms.sentences import event_text

RETRY_DELAY_S = 30.0
MAX_TRIES = 20
_MAX_ACTION_RESULTS = 1_000

DoneCallback = Callable[[bool, str], None]
"""Completion callback of an action, called once, in any thread, with the success and the result as text."""
ActionStarter = Callable[[AlarmEvent, AlarmAction, DoneCallback], None]
"""Function that starts an action without blocking and calls `DoneCallback` when the action has completed."""


@dataclass(slots=True)
class _Retry:
    event: AlarmEvent
    action: AlarmAction
    tries: int
    due_at: float


class Alarms:
    """Alarm rules with their history and running actions.

    Not thread-safe, except for `evaluator.evaluate` and the completion callbacks of actions.
    """

    def __init__(
        self,
        rules: Sequence[AlarmRule] = (),
        history: AlarmHistory | None = None,
        action_starters: Mapping[str, ActionStarter] | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        clock_s: Callable[[], float] = time.time,
    ) -> None:
        """Initialize the alarms.

        Args:
            rules: Rules to evaluate.
            history: History to continue; None for an empty one.
            action_starters: Functions that start actions, by kind of action. Actions of other kinds are
                recorded as failed.
            clock: Monotonic clock in seconds.
            clock_s: Clock in seconds since 1970.
        """
        self.evaluator = AlarmEvaluator(rules, clock=clock, clock_s=clock_s)
        self.history = history if history is not None else AlarmHistory()
        self._action_starters = dict(action_starters or {})
        self._clock, self._clock_s = clock, clock_s
        self._results: queue.SimpleQueue[tuple[AlarmEvent, AlarmAction, int, bool, str]] = queue.SimpleQueue()
        self._retries: dict[tuple[str, str], _Retry] = {}
        self._action_results: deque[tuple[AlarmRule, str, float]] = deque(maxlen=_MAX_ACTION_RESULTS)
        self._running_count = 0
        self.revision = 0
        """Number of changes to the rules so far."""

    @property
    def rules(self) -> tuple[AlarmRule, ...]:
        """All rules, in display order."""
        return self.evaluator.rules

    def set_rules(self, rules: Sequence[AlarmRule]) -> None:
        """Replace all rules."""
        self.evaluator.set_rules(rules)
        self.revision += 1

    def rule(self, rule_id: str) -> AlarmRule | None:
        """Return the rule with this id, or None."""
        return next((rule for rule in self.rules if rule.id == rule_id), None)

    def set_rule(self, rule: AlarmRule) -> None:
        """Replace the rule with the same id, or insert a new one at the front."""
        if self.rule(rule.id) is None:
            self.set_rules([rule, *self.rules])
        else:
            self.set_rules([rule if each.id == rule.id else each for each in self.rules])

    def remove(self, rule_id: str) -> None:
        """Remove the rule with this id."""
        self.set_rules([each for each in self.rules if each.id != rule_id])

    def snooze(self, rule_id: str, until_s: float) -> None:
        """Snooze a rule: run none of its actions until a given time.

        Args:
            rule_id: Id of the rule.
            until_s: End of the snooze (s since 1970); 0 ends the snooze now.
        """
        rule = self.rule(rule_id)
        if rule is not None:
            self.set_rule(replace(rule, snoozed_until_s=until_s))

    def retry_in_s(self, rule_id: str) -> float | None:
        """Return the seconds until a failed action of a rule is retried, or None if no retry is pending."""
        due_times = [retry.due_at for (id, _kind), retry in self._retries.items() if id == rule_id]
        return max(0.0, min(due_times) - self._clock()) if due_times else None

    @property
    def is_busy(self) -> bool:
        """True while an action is running."""
        return self._running_count > 0

    def take_action_results(self) -> list[tuple[AlarmRule, str, float]]:
        """Return the actions completed since the last call, including failed ones.

        If there were more than 1000, only the newest 1000 are returned.

        Returns:
            Tuples of the rule, the result as text, and the time of completion (s since 1970).
        """
        results = list(self._action_results)
        self._action_results.clear()
        return results

    def tick(self) -> list[AlarmEvent]:
        """Evaluate time-based rules, start actions and due retries, and return the new events."""
        self._process_results()
        events = self.evaluator.tick()
        for event in events:
            self._handle_event(event)
        self._run_retries()
        return events

    def _handle_event(self, event: AlarmEvent) -> None:
        rule = event.rule
        if event.kind == "on":
            cause = event_text(rule.condition, event.value)
            record = AlarmRecord(rule.id, cause, event.at_s, is_on=True, was_snoozed=event.is_snoozed)
            self.history.add(record)
        if event.kind == "off":
            current = self.history.current(rule.id)
            if current is not None:
                current.is_on, current.duration_s, current.count = (
                    False,
                    event.duration_s,
                    event.count,
                )
                self.history.revision += 1
            self._retries = {key: each for key, each in self._retries.items() if key[0] != rule.id}
        elif not event.is_snoozed:
            for action in rule.actions:
                self._start_action(event, action, 1)

    def _start_action(self, event: AlarmEvent, action: AlarmAction, tries: int) -> None:
        start = self._action_starters.get(action.kind)
        self._running_count += 1
        if start is None:
            self._results.put((event, action, MAX_TRIES, False, _("this action isn't available here")))
            return
        on_done = partial(self._on_action_done, event, action, tries)
        try:
            start(event, action, on_done)
        except Exception as error:  # noqa: BLE001  a failing action must not block the next
            on_done(False, str(error) or type(error).__name__)

    def _on_action_done(
        self, event: AlarmEvent, action: AlarmAction, tries: int, is_ok: bool, text: str
    ) -> None:
        self._results.put((event, action, tries, is_ok, text))

    def _process_results(self) -> None:
        for _number in range(self._results.qsize()):
            event, action, tries, is_ok, text = self._results.get()
            self._running_count -= 1
            self._action_results.append((event.rule, text, self._clock_s()))
            record = self.history.last(event.rule.id)
            if record is None:
                continue
            if text:
                record.add(ActionResult(action.kind, text))
                self.history.revision += 1
            if not is_ok and action.kind == "call" and record.is_on and tries < MAX_TRIES:
                retry = _Retry(event, action, tries + 1, self._clock() + RETRY_DELAY_S)
                self._retries[event.rule.id, action.name] = retry

    def _run_retries(self) -> None:
        now, now_s = self._clock(), self._clock_s()
        for key, retry in list(self._retries.items()):
            rule = self.rule(retry.event.rule.id)
            if rule is None or retry.action not in rule.actions:
                del self._retries[key]
            elif now >= retry.due_at and not rule.is_snoozed(now_s):
                del self._retries[key]
                self._start_action(retry.event, retry.action, retry.tries)
