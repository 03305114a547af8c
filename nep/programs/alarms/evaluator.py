"""Evaluation of alarm rules against messages, the graph and the clock.

Messages are processed in a thread of the node, the graph and the clock in another thread. A lock is held
while values are compared, but not while a message is decoded.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from nep.errors import DecodeError
from nep.messages.message import Message
from nep.programs.alarms.losses import TopicLosses
from nep.programs.alarms.rule import MAX_CHARACTERS, AlarmRule, Scalar, problem_of, topics_of
from nep.programs.alarms.track import AlarmStateMachine, Transition
from nep.protocol.graph_view import GraphView
from nep.protocol.topic_pattern import matches

LARGE_MESSAGE_BYTES = 256 * 1024
"""Size in bytes above which a message is decoded only if it is the newest of its batch."""
MAX_EVENTS = 1_000
MASTER_GRACE_S = 3.0
"""Time in seconds after a restart of the master in which no node counts as having left.

Nodes register again within this time.
"""
RATE_WINDOW_S, MAX_RATE_WINDOW_S = 2.0, 60.0
_SAMPLE_PERIOD_S = 0.25
_MAX_SAMPLES = 256

AlarmPhase = Literal["off", "faulty", "waits", "well", "pending", "on"]


@dataclass(frozen=True, slots=True)
class AlarmEvent:
    """Transition of an alarm.

    Attributes:
        kind: "on", "off", or "still" if the alarm is still on when its snooze ends.
        rule: Rule of the alarm.
        at_s: Time of the transition (s since 1970).
        value: Value that caused the transition.
        duration_s: Duration of the alarm in seconds; 0 if the alarm was turned on.
        count: Number of times the condition became true while the alarm was on.
        is_snoozed: True if no action runs because the rule is snoozed.
    """

    kind: Literal["on", "off", "still"]
    rule: AlarmRule
    at_s: float
    value: Scalar = None
    duration_s: float = 0.0
    count: int = 1
    is_snoozed: bool = False


@dataclass(frozen=True, slots=True)
class AlarmState:
    """Current state of an alarm.

    Attributes:
        phase: "off" (disabled), "faulty" (invalid rule), "waits" (the topic or node was never seen), "well"
            (condition false), "pending" (condition true, but not yet long enough) or "on".
        value: Newest value.
        on_duration_s: Time in seconds since the alarm turned on; 0 if it is off.
        count: Number of times the condition became true since the alarm turned on.
        problem: "missing" if the newest message lacks the field, "no_number" if the field isn't a number,
            "unreadable" if the message can't be decoded, else "".
    """

    phase: AlarmPhase
    value: Scalar = None
    on_duration_s: float = 0.0
    count: int = 0
    problem: str = ""


@dataclass(slots=True, eq=False)
class _SubscribedTopic:
    """Subscribed topic: message count, time of the last message, and the rules that read its values."""

    readers: list[AlarmStateMachine] = field(default_factory=list)
    present_since: float | None = None
    last_at: float | None = None
    count: int = 0
    is_undecodable: bool = False
    samples: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=_MAX_SAMPLES))

    def rate_hz(self, window_s: float, now: float) -> float | None:
        begin = None
        for sampled_at, count in self.samples:
            if now - sampled_at < window_s:
                break
            begin = (sampled_at, count)
        return None if begin is None else (self.count - begin[1]) / (now - begin[0])


class AlarmEvaluator:
    """Evaluator of alarm rules. `evaluate` is thread-safe; call the other methods from one thread."""

    def __init__(
        self,
        rules: Sequence[AlarmRule] = (),
        *,
        clock: Callable[[], float] = time.monotonic,
        clock_s: Callable[[], float] = time.time,
    ) -> None:
        self._clock, self._clock_s = clock, clock_s
        self._lock = threading.Lock()
        self._rules: tuple[AlarmRule, ...] = ()
        self._state_machines: dict[str, AlarmStateMachine] = {}
        self._subscribed: dict[str, _SubscribedTopic] = {}
        self._losses: dict[str, TopicLosses] = {}
        self._events: deque[AlarmEvent] = deque(maxlen=MAX_EVENTS)
        self._on_while_snoozed: set[str] = set()
        """Ids of alarms that turned on while snoozed."""
        self._view: GraphView | None = None
        self._nodes: frozenset[str] = frozenset()
        self._topics: frozenset[str] = frozenset()
        self._epoch: int | None = None
        self._epoch_at = 0.0
        self._sampled_at = 0.0
        self.skipped_count = 0
        """Number of large messages that were not decoded."""
        self.has_events = threading.Event()
        """Event that is set when a message turned an alarm on, to wake the thread that calls `tick`."""
        self.set_rules(rules)

    @property
    def rules(self) -> tuple[AlarmRule, ...]:
        """All rules."""
        return self._rules

    @property
    def topics(self) -> frozenset[str]:
        """Topics to which the rules need a subscription."""
        return topics_of([machine.rule for machine in self._state_machines.values()])

    def set_rules(self, rules: Sequence[AlarmRule]) -> None:
        """Replace the rules. The state of rules whose condition is unchanged is preserved."""
        now = self._clock()
        with self._lock:
            previous, self._state_machines = self._state_machines, {}
            for rule in rules:
                if not rule.is_enabled or problem_of(rule) is not None:
                    continue
                existing = previous.get(rule.id)
                if existing is not None and _is_same_condition(existing.rule, rule):
                    existing.rule = rule
                    self._state_machines[rule.id] = existing
                    del previous[rule.id]
                else:
                    self._state_machines[rule.id] = AlarmStateMachine(rule)
            for id, machine in previous.items():
                transition = machine.turn_off(now)
                if transition is not None:
                    self._emit(machine, transition)
                self._on_while_snoozed.discard(id)
            self._rules = tuple(rules)
            self._update_topics()

    def _update_topics(self) -> None:
        previous_topics, self._subscribed = self._subscribed, {}
        previous_losses, self._losses = self._losses, {}
        for machine in self._state_machines.values():
            condition = machine.rule.condition
            if condition.needs_topic:
                topic = self._subscribed.get(condition.name)
                if topic is None:
                    topic = self._subscribed[condition.name] = (
                        previous_topics.get(condition.name) or _SubscribedTopic()
                    )
                    topic.readers = []
                if condition.is_about_value:
                    topic.readers.append(machine)
            elif condition.kind == "loses":
                topic_losses = previous_losses.get(condition.name) or TopicLosses()
                self._losses[condition.name] = topic_losses

    # ---- inputs

    def evaluate(self, topic: str, messages: Sequence[Message]) -> None:
        """Evaluate the messages of a topic, oldest first. Topics without a rule are ignored."""
        subscription = self._subscribed.get(topic)
        if subscription is None or not messages:
            return
        payloads, is_undecodable, skipped_count = (
            _decode_payloads(messages) if subscription.readers else ([], False, 0)
        )
        now, has_transition = self._clock(), False
        with self._lock:
            subscription.last_at = now
            subscription.count += len(messages)
            subscription.is_undecodable = is_undecodable
            self.skipped_count += skipped_count
            if subscription.present_since is None:
                subscription.present_since = now
            for machine in subscription.readers:
                for payload in payloads:
                    transition = machine.read(payload, now)
                    if transition is not None:
                        self._emit(machine, transition)
                        has_transition = True
        if has_transition:
            self.has_events.set()

    def update_graph(self, view: GraphView | None) -> None:
        """Evaluate a new snapshot of the graph.

        Args:
            view: Graph; None while the master doesn't reply, so that no node counts as having left.
        """
        now = self._clock()
        with self._lock:
            previous, self._view = self._view, view
            if view is None:
                return
            if view.epoch != self._epoch:
                self._epoch, self._epoch_at = view.epoch, now
            nodes = frozenset(node.name for node in view.nodes.values())
            topics = frozenset(name for name, info in view.topics.items() if info.publishers)
            new_nodes, new_topics = nodes - self._nodes, topics - self._topics
            is_settled = previous is not None and now - self._epoch_at >= MASTER_GRACE_S
            self._nodes, self._topics = nodes, topics
            for name, subscription in self._subscribed.items():
                if subscription.present_since is None and name in topics:
                    subscription.present_since = now
            for name, losses in self._losses.items():
                losses.add(view.topics.get(name), now)
            for machine in self._state_machines.values():
                self._evaluate_graph(machine, new_nodes, new_topics, now, is_settled=is_settled)

    def _evaluate_graph(
        self,
        machine: AlarmStateMachine,
        nodes: frozenset[str],
        topics: frozenset[str],
        now: float,
        *,
        is_settled: bool,
    ) -> None:
        kind, name = machine.rule.condition.kind, machine.rule.condition.name
        transition: Transition | None = None
        if kind == "leaves":
            is_present = name in self._nodes
            if is_present or (machine.was_observed and now - self._epoch_at >= MASTER_GRACE_S):
                transition = machine.observe(not is_present, None, now)
        elif kind == "comes":
            machine.was_observed = machine.was_observed or name in self._nodes
            if is_settled and name in nodes:
                transition = machine.trigger(now)
        elif kind == "appears":
            matching = sorted(topic for topic in topics if matches(name, topic))
            machine.was_observed = True
            if is_settled and matching:
                machine.last_value = matching[0][:MAX_CHARACTERS]
                transition = machine.trigger(now)
        if transition is not None:
            self._emit(machine, transition)

    def tick(self) -> list[AlarmEvent]:
        """Evaluate time-based conditions and return the events since the last call.

        Call it at least 10 times a second.
        """
        now, now_s = self._clock(), self._clock_s()
        with self._lock:
            self.has_events.clear()
            if now - self._sampled_at >= _SAMPLE_PERIOD_S:
                self._sampled_at = now
                for subscription in self._subscribed.values():
                    if subscription.present_since is not None:
                        subscription.samples.append((now, subscription.count))
            for machine in self._state_machines.values():
                transition = self._evaluate_time(machine, now)
                if transition is not None:
                    self._emit(machine, transition)
            for id in [
                id for id in self._on_while_snoozed if not self._state_machines[id].rule.is_snoozed(now_s)
            ]:
                self._on_while_snoozed.discard(id)
                machine = self._state_machines[id]
                if machine.is_on:
                    event = AlarmEvent("still", machine.rule, now_s, machine.last_value, count=machine.count)
                    self._events.append(event)
            events = list(self._events)
            self._events.clear()
        return events

    def _evaluate_time(self, machine: AlarmStateMachine, now: float) -> Transition | None:
        condition = machine.rule.condition
        subscription = self._subscribed.get(condition.name) if condition.needs_topic else None
        if condition.kind == "silent" and subscription is not None and subscription.present_since is not None:
            silent_s = now - max(
                subscription.present_since, subscription.last_at or subscription.present_since
            )
            return machine.observe(silent_s >= condition.for_s, silent_s, now)
        if condition.kind in {"rate_below", "rate_above"} and subscription is not None:
            rate_hz = subscription.rate_hz(_window_s(condition.number), now)
            if rate_hz is not None:
                return machine.compare(rate_hz, now, is_below=condition.kind == "rate_below")
        elif condition.kind == "loses" and self._view is not None:
            percent = self._losses[condition.name].percent(condition.for_s, now)
            if percent is not None:
                return machine.compare(percent, now, is_below=False)
        elif condition.kind == "leaves" and self._view is None:
            return None  # without a master it is unknown which nodes exist
        return machine.advance(now)

    def _emit(self, machine: AlarmStateMachine, transition: Transition) -> None:
        rule, now_s = machine.rule, self._clock_s()
        is_snoozed = rule.is_snoozed(now_s)
        if transition.is_on and is_snoozed:
            self._on_while_snoozed.add(rule.id)
        elif not transition.is_on:
            self._on_while_snoozed.discard(rule.id)
        self._events.append(
            AlarmEvent(
                "on" if transition.is_on else "off",
                rule,
                now_s,
                transition.value,
                transition.duration_s,
                transition.occurrences,
                is_snoozed,
            )
        )

    # ---- state

    def state(self, rule: AlarmRule) -> AlarmState:
        """Return the current state of a rule's alarm; "off" or "faulty" if the rule isn't evaluated."""
        now = self._clock()
        with self._lock:
            machine = self._state_machines.get(rule.id)
            if machine is None:  # validate again only if the rule is not evaluated
                return AlarmState("off" if problem_of(rule) is None else "faulty")
            condition = machine.rule.condition
            subscription = self._subscribed.get(condition.name) if condition.needs_topic else None
            was_seen = machine.was_observed or (
                subscription is not None and subscription.present_since is not None
            )
            if condition.is_about_value:
                was_seen = subscription is not None and subscription.last_at is not None
            problem = machine.problem or (
                "unreadable" if subscription is not None and subscription.is_undecodable else ""
            )
            if machine.on_since is not None:
                return AlarmState("on", machine.last_value, now - machine.on_since, machine.count, problem)
            phase: AlarmPhase = "pending" if machine.is_pending else "well" if was_seen else "waits"
            return AlarmState(phase, machine.last_value, problem=problem)

    @property
    def states(self) -> Mapping[str, AlarmState]:
        """Current states of all alarms by rule id."""
        return {rule.id: self.state(rule) for rule in self._rules}


def _is_same_condition(rule: AlarmRule, other: AlarmRule) -> bool:
    return rule.condition == other.condition and rule.calm_s == other.calm_s


def _window_s(limit_hz: float) -> float:
    return min(MAX_RATE_WINDOW_S, max(RATE_WINDOW_S, 3.0 / limit_hz))


def _decode_payloads(messages: Sequence[Message]) -> tuple[list[object], bool, int]:
    payloads: list[object] = []
    is_undecodable, skipped_count, newest = False, 0, messages[-1]
    for message in messages:
        if message.size_bytes > LARGE_MESSAGE_BYTES and message is not newest:
            skipped_count += 1
            continue
        try:
            payloads.append(message.payload_or_extension)
            is_undecodable = False
        except DecodeError:
            is_undecodable = True
    return payloads, is_undecodable, skipped_count
