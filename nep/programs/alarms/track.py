"""State machine of one alarm with the states off, pending and on; the caller passes the time.

An alarm stays on until its condition was false for `calm_s`. A condition that becomes true again earlier is
counted, but causes no transition.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from nep.messages.fields import MISSING, Path, parse_path, value_at
from nep.programs.alarms.rule import EVENT_KINDS, MAX_CHARACTERS, AlarmRule, Scalar, to_float

MIN_EVENT_DURATION_S = 5.0
"""Minimum time in seconds that an alarm stays on after a momentary event."""

ValueProblem = Literal["", "missing", "no_number"]


class Transition(NamedTuple):
    """Transition of an alarm.

    Attributes:
        is_on: True if the alarm turned on, False if it turned off.
        value: Value that caused the transition.
        duration_s: Time in seconds that the alarm was on; 0 if it turned on.
        occurrences: Number of times the condition became true while the alarm was on.
    """

    is_on: bool
    value: Scalar
    duration_s: float
    occurrences: int


@dataclass(slots=True)
class _FieldValue:
    """Field path of a rule, and the last value of that field."""

    path: Path = ()
    last: object = MISSING


class AlarmStateMachine:
    """State machine of one alarm.

    Call `observe` with new input and `advance` as time passes. Methods return the `Transition` that
    occurred, or None.
    """

    def __init__(self, rule: AlarmRule) -> None:
        self.rule = rule
        condition = rule.condition
        self._for_s = 0.0 if condition.kind in {"silent", "loses"} else condition.for_s
        self._calm_s = (
            max(rule.calm_s, MIN_EVENT_DURATION_S) if condition.kind in EVENT_KINDS else rule.calm_s
        )
        self._value = _FieldValue(parse_path(condition.path) if condition.is_about_value else ())
        self._is_below = condition.kind == "below"
        self._limit = condition.number if condition.kind in {"below", "above"} else None
        self._true_since: float | None = None
        self._false_since: float | None = None
        self.on_since: float | None = None
        self.count = 0
        self.last_value: Scalar = None
        self.was_observed = False
        """True if the alarm's topic or node has ever existed."""
        self.problem: ValueProblem = ""
        """Reason why the last value can't be compared; "" if it can."""

    @property
    def is_on(self) -> bool:
        """True if the alarm is on."""
        return self.on_since is not None

    @property
    def is_pending(self) -> bool:
        """True if the condition holds, but not long enough yet."""
        return self._true_since is not None and not self.is_on

    def read(self, payload: object, now: float) -> Transition | None:
        """Process a payload of the alarm's topic; return the transition, or None.

        A missing field, or a value that must be a number and isn't, is recorded in `problem`.

        Args:
            payload: Decoded payload.
            now: Monotonic time in seconds.
        """
        value = value_at(payload, self._value.path)
        if self._is_clearly_false(value):
            self.last_value, self.problem, self.was_observed = value, "", True  # type: ignore[assignment]  # a number
            return None
        self.was_observed = True
        if value is MISSING:
            self.problem = "missing"
            return None
        kind, previous = self.rule.condition.kind, self._value.last
        self._value.last = value
        if kind == "changes":
            self.last_value = to_scalar(value)
            self.problem = ""
            return self.trigger(now) if previous is not MISSING and not _are_equal(previous, value) else None
        if kind in {"equals", "is_not"}:
            self.problem = ""
            is_equal = _are_equal(value, self.rule.condition.limit)
            return self.observe(is_equal is (kind == "equals"), to_scalar(value), now)
        number = _number(value)
        self.problem = "no_number" if number is None else ""
        if number is None:
            return None
        observed = to_scalar(value) if math.isfinite(number) else number
        return self.compare(number, now, is_below=kind == "below", observed=observed)

    def _is_clearly_false(self, value: object) -> bool:
        if self._limit is None or self.on_since is not None or self._true_since is not None:
            return False
        if type(value) is not float and type(value) is not int:
            return False
        return value >= self._limit if self._is_below else value <= self._limit

    def compare(
        self, number: float, now: float, *, is_below: bool, observed: Scalar = None
    ) -> Transition | None:
        """Compare a number with the limit, with hysteresis; return the transition, or None.

        Args:
            number: Number to compare.
            now: Monotonic time in seconds.
            is_below: True if the alarm is on while the number is below the limit, False for above.
            observed: Original value, if `number` was converted from it.
        """
        limit, margin = self.rule.condition.number, self.rule.condition.margin
        if self.is_on:
            is_met = number < limit + margin if is_below else number > limit - margin
        else:
            is_met = number < limit if is_below else number > limit
        return self.observe(is_met, number if observed is None else observed, now)

    def trigger(self, now: float) -> Transition | None:
        """Process a momentary event, which turns the alarm on for at least `MIN_EVENT_DURATION_S`.

        Returns the transition, or None if the alarm's state is unchanged.
        """
        transition = self.observe(True, self.last_value, now)
        self.observe(False, self.last_value, now)
        return transition

    def observe(self, is_met: bool, observed: Scalar, now: float) -> Transition | None:
        """Process the current truth of the condition; return the transition, or None.

        Args:
            is_met: True if the condition is met.
            observed: Value that was compared.
            now: Monotonic time in seconds.
        """
        transition = self.advance(now)
        self.was_observed = True
        self.last_value = observed
        if is_met:
            if self.is_on and self._false_since is not None:
                self.count += 1  # false for less than calm_s
            self._false_since = None
            if self._true_since is None:
                self._true_since = now
        else:
            self._true_since = None
            if self.is_on and self._false_since is None:
                self._false_since = now
        return transition or self.advance(now)

    def advance(self, now: float) -> Transition | None:
        """Process the passing of time; return the transition, or None if the alarm's state is unchanged.

        Args:
            now: Monotonic time in seconds.
        """
        since, false_since = self._true_since, self._false_since
        if self.on_since is None:
            if since is None or now - since < self._for_s:
                return None
            self.on_since, self.count, self._false_since = now, 1, None
            return Transition(True, self.last_value, 0.0, 1)
        if false_since is None or now - false_since < self._calm_s:
            return None
        transition = Transition(False, self.last_value, max(0.0, false_since - self.on_since), self.count)
        self.on_since = self._false_since = None
        return transition

    def turn_off(self, now: float) -> Transition | None:
        """Turn the alarm off because its rule is no longer evaluated; return None if the alarm was off."""
        if self.on_since is None:
            return None
        ended_at = now if self._false_since is None else self._false_since
        transition = Transition(False, self.last_value, max(0.0, ended_at - self.on_since), self.count)
        self.on_since = self._true_since = self._false_since = None
        return transition


def to_scalar(value: object) -> Scalar:
    """Convert a value to a scalar for an event.

    A list or map is represented by its length in brackets, and long text is truncated. Integers beyond
    64 bits become floats, because few JSON readers accept them. Other values become None.
    """
    if isinstance(value, str):
        return value[:MAX_CHARACTERS]
    if isinstance(value, bool | int | float):
        return value if -(1 << 63) <= value < 1 << 64 else to_float(value)
    return (
        f"{{{len(value)}}}"
        if isinstance(value, Mapping)
        else f"[{len(value)}]"
        if isinstance(value, list)
        else None
    )


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float) or (value != value):  # noqa: PLR0124  NaN
        return None
    return to_float(value)


def _are_equal(value: object, other: object) -> bool:
    if isinstance(value, bool) is not isinstance(other, bool):
        return False
    return value == other or (value != value and other != other)  # noqa: PLR0124
