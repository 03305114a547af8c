"""Alarm rules: conditions, actions, and validation. Performs no input or output."""

from __future__ import annotations

import math
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from nep.errors import BadNameError, BadTopicError, NepError
from nep.i18n import _
from nep.messages.fields import parse_path
from nep.protocol.service_wire import check_service
from nep.protocol.topic_pattern import is_pattern
from nep.protocol.wire import check_node_name, check_topic

Scalar = float | int | str | bool | None
"""Type of the values with which a field can be compared."""

TOPIC_KINDS = ("silent", "rate_below", "rate_above", "loses", "appears")
VALUE_KINDS = ("below", "above", "equals", "is_not", "changes")
NODE_KINDS = ("leaves", "comes")
KINDS = (*TOPIC_KINDS, *VALUE_KINDS, *NODE_KINDS)
KINDS_WITH_LIMIT = frozenset({"rate_below", "rate_above", "loses", "below", "above", "equals", "is_not"})
NUMBER_KINDS = KINDS_WITH_LIMIT - {"equals", "is_not"}
EVENT_KINDS = frozenset({"changes", "appears", "comes"})
"""Kinds of conditions that describe a momentary event instead of a lasting state."""
ACTION_KINDS = ("banner", "sound", "keep", "run", "call", "send", "stop", "console")
NAMED_ACTIONS = frozenset({"run", "call", "send"})

MIN_FOR_S, MAX_FOR_S = 0.1, 86_400.0
MIN_CALM_S, MAX_CALM_S = 0.5, 3_600.0
MAX_WINDOW_S = 600.0
DEFAULT_CALM_S = 2.0
DEFAULT_RECORDING_S = 60.0
MAX_ACTIONS = 10
MAX_CHARACTERS = 300
_MAX_NUMBER = 1e300


@dataclass(frozen=True, slots=True)
class AlarmCondition:
    """Condition of an alarm.

    Attributes:
        kind: One of `KINDS`.
        name: Topic (with "appears" also a pattern) or node; "" if not chosen yet.
        path: Field path of the compared value, as in `nep topic echo`.
        limit: Value to compare with: a number for `NUMBER_KINDS` (Hz for rates, percent for "loses").
        for_s: Time in seconds that the condition must hold without interruption; for "silent" the duration
            of the silence, for "loses" the length of the window.
        margin: Hysteresis: distance from the limit, on the other side, that a number must reach before the
            alarm turns off.
    """

    kind: str
    name: str = ""
    path: str = ""
    limit: Scalar = None
    for_s: float = 0.0
    margin: float = 0.0

    @property
    def is_about_node(self) -> bool:
        """True if `name` is the name of a node."""
        return self.kind in NODE_KINDS

    @property
    def is_about_value(self) -> bool:
        """True if the condition compares the value of a field, for which messages must be decoded."""
        return self.kind in VALUE_KINDS

    @property
    def number(self) -> float:
        """Limit as a float; NaN if the kind has no numeric limit."""
        is_number = isinstance(self.limit, int | float) and not isinstance(self.limit, bool)
        return to_float(self.limit) if is_number else math.nan  # type: ignore[arg-type]

    @property
    def needs_topic(self) -> bool:
        """True if the condition needs a subscription to the topic."""
        return self.is_about_value or self.kind in {"silent", "rate_below", "rate_above"}


@dataclass(frozen=True, slots=True)
class AlarmAction:
    """Action that runs when an alarm turns on.

    Attributes:
        kind: One of `ACTION_KINDS`.
        name: Behaviour to run, service to call, or topic to publish on; "" for other kinds.
        payload: Request of the call, or payload of the message.
        msg_type: Message type of the topic.
        recording_s: Length of the saved recording in seconds, for the kind "keep".
    """

    kind: str
    name: str = ""
    payload: object = None
    msg_type: str = "json"
    recording_s: float = DEFAULT_RECORDING_S


@dataclass(frozen=True, slots=True)
class AlarmRule:
    """Alarm rule.

    Attributes:
        id: Unique id.
        condition: Condition that turns the alarm on.
        actions: Actions that run when the alarm turns on.
        is_enabled: False if the user disabled the rule.
        calm_s: Time in seconds that the condition must be false before the alarm turns off. A condition
            that becomes true again earlier is counted, but causes no event.
        snoozed_until_s: End of the snooze (s since 1970). Until then no actions run, but the history
            continues.
    """

    id: str
    condition: AlarmCondition
    actions: tuple[AlarmAction, ...] = ()
    is_enabled: bool = True
    calm_s: float = DEFAULT_CALM_S
    snoozed_until_s: float = 0.0

    def is_snoozed(self, now_s: float) -> bool:
        """Return True if the rule is snoozed at `now_s` (seconds since 1970)."""
        return now_s < self.snoozed_until_s


class RuleProblem(NamedTuple):
    """Problem of a rule.

    Attributes:
        key: Invalid key in the alarm file.
        message: Description without full stop.
    """

    key: str
    message: str


@dataclass(slots=True)
class _RuleChecker:
    problems: list[RuleProblem] = field(default_factory=list)

    def check_number(self, key: str, value: object, minimum: float, maximum: float) -> None:
        if isinstance(value, bool) or not isinstance(value, int | float) or not minimum <= value <= maximum:
            template = _("must be a number from {least:g} to {most:g}")
            self.problems.append(RuleProblem(key, template.format(least=minimum, most=maximum)))

    def check_name(self, key: str, check: object, name: str) -> None:
        try:
            check(name)  # type: ignore[operator]
        except (BadTopicError, BadNameError) as error:
            self.problems.append(RuleProblem(key, error.reason))
        except NepError as error:
            self.problems.append(RuleProblem(key, str(error)))


def to_float(number: float) -> float:
    """Convert a number to a float. An integer that is too large becomes infinite."""
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def new_id() -> str:
    """Return a new random rule id."""
    return secrets.token_hex(4)


def problem_of(rule: AlarmRule) -> RuleProblem | None:
    """Return the first problem of a rule, or None if it is valid."""
    checker = _RuleChecker()
    _check_condition(rule.condition, checker)
    checker.check_number("calm_s", rule.calm_s, MIN_CALM_S, MAX_CALM_S)
    if len(rule.actions) > MAX_ACTIONS:
        template = _("an alarm can have at most {most} actions; split it into two alarms")
        checker.problems.append(RuleProblem("do", template.format(most=MAX_ACTIONS)))
    for action in rule.actions:
        _check_action(action, checker)
    return checker.problems[0] if checker.problems else None


def _check_condition(condition: AlarmCondition, checker: _RuleChecker) -> None:
    if not condition.name:
        key, template = (
            ("node", _("the node name is missing"))
            if condition.is_about_node
            else ("topic", _("the topic name is missing"))
        )
        checker.problems.append(RuleProblem(key, template))
        return
    if condition.is_about_node:
        checker.check_name("node", check_node_name, condition.name)
    else:
        checker.check_name("topic", check_topic, condition.name)
        if is_pattern(condition.name) and condition.kind != "appears":
            template = _("wildcards are allowed only with 'appears'; use the name of a topic")
            checker.problems.append(RuleProblem("topic", template))
    if condition.is_about_value:
        checker.check_name("value", parse_path, condition.path)
    _check_limit(condition, checker)
    _check_time(condition, checker)


def _check_limit(condition: AlarmCondition, checker: _RuleChecker) -> None:
    limit = condition.limit
    if condition.kind in {"rate_below", "rate_above"}:
        checker.check_number("than", limit, 0.001, 1e6)
    elif condition.kind == "loses":
        checker.check_number("than", limit, 0, 100)
    elif condition.kind in NUMBER_KINDS:
        checker.check_number("than", limit, -_MAX_NUMBER, _MAX_NUMBER)
    elif condition.kind in KINDS_WITH_LIMIT and not _is_scalar(limit):
        checker.problems.append(RuleProblem("than", _("must be a number, a string, true, false or null")))
    checker.check_number("margin", condition.margin, 0, _MAX_NUMBER)


def _check_time(condition: AlarmCondition, checker: _RuleChecker) -> None:
    if condition.kind == "silent":
        checker.check_number("for_s", condition.for_s, MIN_FOR_S, MAX_FOR_S)
    elif condition.kind == "loses":
        checker.check_number("for_s", condition.for_s, 1, MAX_WINDOW_S)
    else:
        checker.check_number("for_s", condition.for_s, 0, MAX_FOR_S)


def _check_action(action: AlarmAction, checker: _RuleChecker) -> None:
    if action.kind in NAMED_ACTIONS and not action.name:
        checker.problems.append(RuleProblem(action.kind, _("the name is missing")))
    elif action.kind == "call":
        checker.check_name("call", check_service, action.name)
    elif action.kind == "send":
        checker.check_name("send", check_topic, action.name)
    elif action.kind == "keep":
        checker.check_number("keep_s", action.recording_s, 1, MAX_WINDOW_S)


def _is_scalar(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, str):
        return len(value) <= MAX_CHARACTERS
    return value is None or isinstance(value, int)


def topics_of(rules: Sequence[AlarmRule]) -> frozenset[str]:
    """Return the names of the topics to which the rules need a subscription."""
    return frozenset(
        rule.condition.name for rule in rules if rule.condition.needs_topic and rule.condition.name
    )
