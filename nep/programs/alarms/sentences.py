"""Formatting of alarm rules, events and values as translated text."""

from __future__ import annotations

import math
from collections.abc import Mapping

from nep.i18n import _, format_list, lazy, number
from nep.programs.alarms.rule import (
    DEFAULT_RECORDING_S,
    AlarmAction,
    AlarmCondition,
    AlarmRule,
    Scalar,
    to_float,
)
from nep.text import quotable, shortened

_MAX_DISPLAYED_CHARACTERS = 40
_NO_ACTION_TEXT = lazy("add the alarm to the history")

_CONDITION_TEXTS: Mapping[str, str] = {
    "silent": lazy("{subject} is silent for {time}"),
    "rate_below": lazy("{subject} has fewer than {limit}"),
    "rate_above": lazy("{subject} has more than {limit}"),
    "loses": lazy("{subject} loses more than {limit} of its messages in {time}"),
    "appears": lazy("{subject} appears"),
    "below": lazy("{subject} is below {limit}"),
    "above": lazy("{subject} is above {limit}"),
    "equals": lazy("{subject} is {limit}"),
    "is_not": lazy("{subject} is not {limit}"),
    "changes": lazy("{subject} changes"),
    "leaves": lazy("{subject} leaves"),
    "comes": lazy("{subject} joins"),
}
_LASTING_CONDITION_TEXTS: Mapping[str, str] = {
    "rate_below": lazy("{subject} has fewer than {limit} for {time}"),
    "rate_above": lazy("{subject} has more than {limit} for {time}"),
    "below": lazy("{subject} is below {limit} for {time}"),
    "above": lazy("{subject} is above {limit} for {time}"),
    "equals": lazy("{subject} is {limit} for {time}"),
    "is_not": lazy("{subject} is not {limit} for {time}"),
    "leaves": lazy("{subject} is absent for {time}"),
}
_EVENT_TEXTS: Mapping[str, str] = {
    "silent": lazy("{subject} is silent"),
    "rate_below": lazy("{subject} has {seen}, fewer than {limit}"),
    "rate_above": lazy("{subject} has {seen}, more than {limit}"),
    "loses": lazy("{subject} loses {seen} of its messages"),
    "appears": lazy("the topic {seen} has appeared"),
    "below": lazy("{subject} is {seen}, below {limit}"),
    "above": lazy("{subject} is {seen}, above {limit}"),
    "equals": lazy("{subject} is {seen}"),
    "is_not": lazy("{subject} is {seen}, not {limit}"),
    "changes": lazy("{subject} changed to {seen}"),
    "leaves": lazy("{subject} left"),
    "comes": lazy("{subject} joined"),
}
_ACTION_TEXTS: Mapping[str, str] = {
    "banner": lazy("show a banner"),
    "sound": lazy("play a sound"),
    "keep": lazy("save the last {time}"),
    "run": lazy("run “{name}”"),
    "call": lazy("call {name}"),
    "send": lazy("send to {name}"),
    "stop": lazy("stop all robots"),
    "console": lazy("write to the Console"),
}


def duration_text(seconds: float) -> str:
    """Format a duration in seconds, minutes or hours, such as "60 s" or "10 min"."""
    for unit, size in ((_("{count} h"), 3600.0), (_("{count} min"), 60.0)):
        if seconds > size and math.isclose(seconds % size, 0.0, abs_tol=1e-9):
            return unit.format(count=number(seconds / size))
    return _("{count} s").format(count=number(round(seconds, 3)))


def value_text(value: object) -> str:
    """Format the value of a field.

    Long text is shortened. A list or map is represented by "a list" or "an object".
    """
    if isinstance(value, bool) or value is None:
        return {True: _("true"), False: _("false"), None: _("null")}[value]
    if isinstance(value, int):
        return number(value, "d") if abs(value) < 10**15 else number(to_float(value), ".6g")
    if isinstance(value, float):
        return number(value, ".6g")
    if isinstance(value, str):
        return f"“{quotable(shortened(value, _MAX_DISPLAYED_CHARACTERS))}”"
    return _("a list") if isinstance(value, list | tuple) else _("an object")


def limit_text(condition: AlarmCondition, value: Scalar) -> str:
    """Format a limit or a measured value with the unit of the condition, such as "10 messages per second"."""
    if condition.kind in {"rate_below", "rate_above"} and isinstance(value, int | float):
        return _("{count} messages per second").format(count=number(value, ".4g"))
    if condition.kind == "loses" and isinstance(value, int | float):
        return _("{count} %").format(count=number(value, ".3g"))
    return value_text(value)


def subject_text(condition: AlarmCondition) -> str:
    """Format the subject of a condition, such as "/distance", "lidar_driver" or "range of /distance".

    Without a name, the subject is "a node" or "a topic".
    """
    if not condition.name:
        return _("a node") if condition.is_about_node else _("a topic")
    name = quotable(condition.name)
    if condition.is_about_value and condition.path not in {"", "."}:
        return _("{value} of {topic}").format(value=quotable(condition.path), topic=name)
    return name


def condition_text(condition: AlarmCondition) -> str:
    """Format a condition, such as "/robot/camera is silent for 2 s"."""
    template = _CONDITION_TEXTS[condition.kind]
    if condition.for_s > 0:
        template = _LASTING_CONDITION_TEXTS.get(condition.kind, template)
    return _(template).format(
        subject=subject_text(condition),
        limit=limit_text(condition, condition.limit),
        time=duration_text(condition.for_s),
    )


def action_text(action: AlarmAction) -> str:
    """Format an action, such as "show a banner" or "call restart_lidar"."""
    return _(_ACTION_TEXTS[action.kind]).format(
        name=quotable(action.name), time=duration_text(action.recording_s or DEFAULT_RECORDING_S)
    )


def rule_text(rule: AlarmRule) -> str:
    """Format a rule as one sentence without full stop."""
    actions = [action_text(action) for action in rule.actions]
    return _("When {condition}: {actions}").format(
        condition=condition_text(rule.condition),
        actions=format_list(actions) if actions else _(_NO_ACTION_TEXT),
    )


def event_text(condition: AlarmCondition, value: Scalar) -> str:
    """Format an event for the history, such as "range of /distance is 0.36, below 0.4", without full stop."""
    return _(_EVENT_TEXTS[condition.kind]).format(
        subject=subject_text(condition),
        limit=limit_text(condition, condition.limit),
        seen=quotable(value)
        if condition.kind == "appears" and isinstance(value, str)
        else limit_text(condition, value),
    )


def current_value_text(condition: AlarmCondition, value: Scalar) -> str:
    """Format the current value, such as "0.82 now" or "silent for 4 s".

    Returns "" if there is no value, or if the condition has none to show, as when a topic appears.
    """
    if condition.kind == "silent":
        if not isinstance(value, int | float) or value < 1:
            return ""
        return _("silent for {time}").format(time=duration_text(round(value)))
    if value is None and condition.kind not in {"equals", "is_not"}:
        return ""
    if condition.kind in {"leaves", "comes", "appears"}:
        return ""
    return _("{value} now").format(value=limit_text(condition, value))
