"""Conversion of alarm rules to sentences with slots, and parsers for typed slot values.

This module does not depend on Qt.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from string import Formatter
from typing import Literal

from app.robots.description.typed_number import AMBIGUOUS_SEPARATORS_MESSAGE, TypedNumberError, parse_number
from nep.i18n import _, lazy, pgettext, plazy
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmRule
from nep.programs.alarms.rule import DEFAULT_RECORDING_S, KINDS_WITH_LIMIT, NUMBER_KINDS, VALUE_KINDS, Scalar
from nep.programs.alarms.sentences import action_text, duration_text, limit_text
from nep.text import quotable

PartKind = Literal["word", "slot", "dashed"]
MENU_ROLES = frozenset({"kind", "add"})
"""Roles of slots whose value is chosen from a menu; other slots have a text field."""

_TEMPLATES: Mapping[str, str] = {
    "silent": lazy("When {subject} is {kind} for {time}"),
    "rate_below": lazy("When {subject} has {kind} {limit} {time}"),
    "rate_above": lazy("When {subject} has {kind} {limit} {time}"),
    "loses": lazy("When {subject} {kind} {limit} in {time}"),
    "appears": lazy("When a topic {subject} {kind}"),
    "below": lazy("When {value} of {subject} is {kind} {limit} {time}"),
    "above": lazy("When {value} of {subject} is {kind} {limit} {time}"),
    "equals": lazy("When {value} of {subject} {kind} {limit} {time}"),
    "is_not": lazy("When {value} of {subject} {kind} {limit} {time}"),
    "changes": lazy("When {value} of {subject} {kind}"),
    "leaves": lazy("When {subject} {kind} {time}"),
    "comes": lazy("When {subject} {kind}"),
}
KIND_TEXTS: Mapping[str, str] = {
    "silent": plazy("alarm", "silent"),
    "rate_below": plazy("alarm rate", "fewer than"),
    "rate_above": plazy("alarm rate", "more than"),
    "loses": plazy("alarm", "loses more than"),
    "appears": plazy("alarm", "appears"),
    "below": plazy("alarm", "below"),
    "above": plazy("alarm", "above"),
    "equals": plazy("alarm", "is"),
    "is_not": plazy("alarm", "is not"),
    "changes": plazy("alarm", "changes"),
    "leaves": plazy("alarm", "leaves"),
    "comes": plazy("alarm", "joins"),
}
KIND_MENU: Sequence[Sequence[tuple[str, str]]] = (
    (
        ("silent", lazy("A topic is silent")),
        ("rate_below", lazy("A topic's message rate is too low")),
        ("rate_above", lazy("A topic's message rate is too high")),
        ("loses", lazy("A topic loses messages")),
        ("appears", lazy("A topic appears")),
    ),
    (
        ("below", lazy("A value is below a limit")),
        ("above", lazy("A value is above a limit")),
        ("equals", lazy("A value equals a given value")),
        ("is_not", lazy("A value differs from a given value")),
        ("changes", lazy("A value changes")),
    ),
    (("leaves", lazy("A node leaves")), ("comes", lazy("A node joins"))),
)
"""Alarm kinds and their labels, grouped as in the menu."""
SLOT_NAMES: Mapping[str, str] = {
    "subject": lazy("Subject"),
    "value": lazy("Value"),
    "kind": lazy("Condition"),
    "limit": lazy("Limit"),
    "time": lazy("Duration"),
    "add": lazy("Add an action"),
    "action": lazy("Action"),
    "name": lazy("Name"),
    "payload": lazy("Content"),
}
NEW_ACTIONS: Sequence[AlarmAction] = (
    AlarmAction("banner"),
    AlarmAction("sound"),
    AlarmAction("keep", recording_s=DEFAULT_RECORDING_S),
    AlarmAction("run"),
    AlarmAction("call", payload={}),
    AlarmAction("send"),
    AlarmAction("stop"),
    AlarmAction("console"),
)
ACTION_MENU: Mapping[str, str] = {
    "banner": lazy("Show a banner"),
    "sound": lazy("Play a sound"),
    "keep": lazy("Save the last 60 s"),
    "run": lazy("Run a behaviour"),
    "call": lazy("Call a service"),
    "send": lazy("Send a message"),
    "stop": lazy("Stop all robots"),
    "console": lazy("Write to the Console"),
}
ACTION_ICONS: Mapping[str, str] = {
    "banner": "bell",
    "sound": "volume-2",
    "keep": "history",
    "run": "play",
    "call": "spline",
    "send": "send",
    "stop": "square",
    "console": "terminal",
}
_VERBS: Mapping[str, str] = {
    "run": plazy("alarm", "run"),
    "call": plazy("alarm", "call"),
    "send": plazy("alarm", "send to"),
}
_DEFAULT_LIMITS: Mapping[str, tuple[Scalar, float]] = {
    "silent": (None, 2.0),
    "loses": (1.0, 30.0),
    "rate_below": (10.0, 2.0),
    "rate_above": (100.0, 2.0),
}


@dataclass(frozen=True, slots=True)
class PhrasePart:
    """Word or slot of an alarm's sentence.

    Attributes:
        key: Unique key within the sentence. The key of a slot is its role, followed by the index of the
            action for slots of actions, such as "subject" or "action:0".
        text: Displayed text.
        kind: "word", "slot", or "dashed" for a slot without a value.
        icon: Name of the icon before the text, or None.
        mono: True for text in the monospaced font.
    """

    key: str
    text: str
    kind: PartKind = "slot"
    icon: str | None = None
    mono: bool = False

    @property
    def role(self) -> str:
        """Role of the slot: `key` without the index of the action."""
        return self.key.partition(":")[0]

    @property
    def action_index(self) -> int:
        """Index of the action that the slot belongs to; 0 for slots of the condition."""
        return int(self.key.partition(":")[2] or 0)


def parts_of(rule: AlarmRule, icon: str = "braces") -> list[PhrasePart]:
    """Split the sentence of a rule into words and slots.

    Args:
        rule: Rule to describe.
        icon: Name of the icon for the message type of the rule's topic.
    """
    condition = rule.condition
    parts: list[PhrasePart] = []
    for text, slot_name, _spec, _conversion in Formatter().parse(_(_TEMPLATES[condition.kind])):
        if text.strip():
            parts.append(PhrasePart(f"word:{len(parts)}", text.strip(), "word"))
        if slot_name:
            parts.append(_slot(slot_name, condition, icon))
    for index, action in enumerate(rule.actions):
        separator = "," if index == 0 else _("and") if index == len(rule.actions) - 1 else ","
        parts.append(PhrasePart(f"word:{len(parts)}", separator, "word"))
        parts += _action_parts(index, action)
    parts.append(PhrasePart("add", "", "dashed", "plus"))
    return parts


def _slot(slot_name: str, condition: AlarmCondition, icon: str) -> PhrasePart:
    if slot_name == "subject":
        if not condition.name:
            placeholder = _("choose a node") if condition.is_about_node else _("choose a topic")
            return PhrasePart(slot_name, placeholder, "dashed")
        return PhrasePart(slot_name, quotable(condition.name), icon=_icon(condition, icon), mono=True)
    if slot_name == "value":
        placeholder = _("choose a value")
        text = condition.path if condition.path != "." else _("the message")
        return PhrasePart(
            slot_name, quotable(text) or placeholder, "slot" if text else "dashed", mono=bool(text)
        )
    if slot_name == "kind":
        return PhrasePart(slot_name, _(KIND_TEXTS[condition.kind]))
    if slot_name == "limit":
        return PhrasePart(slot_name, limit_text(condition, condition.limit))
    if not condition.for_s:
        return PhrasePart(slot_name, _("for…"), "dashed")
    if condition.kind in {"silent", "loses"}:
        return PhrasePart(slot_name, duration_text(condition.for_s))
    return PhrasePart(slot_name, _("for {time}").format(time=duration_text(condition.for_s)))


def _icon(condition: AlarmCondition, icon: str) -> str:
    return "network" if condition.is_about_node else "list" if condition.kind == "appears" else icon


def _action_parts(index: int, action: AlarmAction) -> list[PhrasePart]:
    verb = _VERBS.get(action.kind)
    if verb is None:
        icon = "square" if action.kind == "stop" else None
        return [PhrasePart(f"action:{index}", action_text(action), icon=icon)]
    name = quotable(action.name) or _("choose")
    parts = [
        PhrasePart(f"action:{index}", _(verb)),
        PhrasePart(f"name:{index}", name, "slot" if action.name else "dashed", mono=action.kind != "run"),
    ]
    if action.kind in {"call", "send"}:
        text = payload_text(action.payload)
        payload_label = text if len(text) <= 24 else f"{text[:23]}…"
        has_payload = action.payload not in ({}, None)
        parts.append(
            PhrasePart(
                f"payload:{index}",
                payload_label if has_payload else _("with…"),
                "slot" if has_payload else "dashed",
                mono=has_payload,
            )
        )
    return parts


def payload_text(payload: object) -> str:
    """Format a payload as one line of JSON."""
    return json.dumps(payload, ensure_ascii=False)


def initial_text(rule: AlarmRule, part: PhrasePart) -> str:
    """Return the current value of a slot in the form in which it is typed; "" if there is none."""
    condition = rule.condition
    match part.role:
        case "subject":
            return condition.name
        case "value":
            return condition.path
        case "limit":
            return condition.limit if isinstance(condition.limit, str) else payload_text(condition.limit)
        case "time":
            return duration_text(condition.for_s) if condition.for_s else ""
        case "name":
            return rule.actions[part.action_index].name
        case "payload":
            return payload_text(rule.actions[part.action_index].payload)
        case _:
            return ""


def with_slot_text(rule: AlarmRule, part: PhrasePart, text: str) -> AlarmRule | None:
    """Return a copy of the rule in which a slot has a new value, or None if the value is invalid.

    None is also returned for slots whose value is selected in a menu.

    Args:
        rule: Rule to copy.
        part: Slot to change.
        text: Typed value.
    """
    condition, text = rule.condition, text.strip()
    match part.role:
        case "subject":
            return replace(rule, condition=replace(condition, name=text))
        case "value":
            return replace(rule, condition=replace(condition, path=text))
        case "limit":
            limit = parse_limit(condition, text)
            return None if limit is _INVALID else replace(rule, condition=replace(condition, limit=limit))  # type: ignore[arg-type]
        case "time":
            for_s = parse_time(text)
            return None if for_s is None else replace(rule, condition=replace(condition, for_s=for_s))
        case "name":
            return with_action(rule, part.action_index, replace(rule.actions[part.action_index], name=text))
        case "payload":
            try:
                payload = json.loads(text) if text else None
            except (ValueError, RecursionError):
                return None
            return with_action(
                rule, part.action_index, replace(rule.actions[part.action_index], payload=payload)
            )
        case _:
            return None


_INVALID = object()


def parse_limit(condition: AlarmCondition, text: str) -> object:
    """Parse the limit of a condition.

    Conditions on numbers require a number; a "%" or a unit after the number is ignored. Other conditions
    accept scalars in JSON, and use any other text as a string.

    Returns:
        The limit, or `_INVALID` if a number is required and the text is not a number.
    """
    if condition.kind in NUMBER_KINDS:
        digits, *suffix = text.replace("%", " ").split() or [""]
        if any(each[0].isdigit() for each in suffix):
            return _INVALID  # "1 234"
        try:
            number = parse_number(digits)
        except TypedNumberError:
            return _INVALID
        return int(number) if number.is_integer() and abs(number) < 2**53 else number
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return text
    return value if value is None or isinstance(value, str | int | float) else text


def parse_time(text: str) -> float | None:
    """Parse a duration such as "2", "250 ms", "1.5 min" or "3 h".

    Returns:
        The duration in s; 0 for empty text, and None if the text is invalid or the duration exceeds a day.
    """
    typed = text.strip()
    if not typed:
        return 0.0
    for unit, factor in (("min", 60.0), ("ms", 0.001), ("h", 3600.0), ("s", 1.0), ("", 1.0)):
        if typed.endswith(unit):
            try:
                seconds = parse_number(typed[: len(typed) - len(unit)]) * factor
            except TypedNumberError:
                return None
            return round(seconds, 6) if 0 <= seconds <= 86_400 else None
    return None


def with_action(rule: AlarmRule, index: int, action: AlarmAction | None) -> AlarmRule:
    """Return a copy of the rule in which one action is replaced, added or removed.

    Args:
        rule: Rule to copy.
        index: Index of the action; the index after the last action adds an action.
        action: New action; None removes the action.
    """
    actions = [*rule.actions]
    actions[index : index + 1] = [] if action is None else [action]
    return replace(rule, actions=tuple(actions))


def with_kind(rule: AlarmRule, kind: str) -> AlarmRule:
    """Return a copy of the rule with another kind of condition; the rule itself if the kind is unchanged.

    The name and the field path are copied if they apply to the new kind too. The limit and the
    duration are copied only from one condition on a field's value to another; otherwise they get
    default values.
    """
    condition = rule.condition
    if kind == condition.kind:
        return rule
    limit, for_s = _DEFAULT_LIMITS.get(kind, (0 if kind in NUMBER_KINDS else None, 0.0))
    are_both_values = kind in VALUE_KINDS and condition.is_about_value
    if are_both_values and kind in KINDS_WITH_LIMIT:
        is_limit_valid = kind not in NUMBER_KINDS or not math.isnan(condition.number)
        limit = condition.limit if is_limit_valid and condition.kind in KINDS_WITH_LIMIT else limit
        for_s = condition.for_s
    new_condition = AlarmCondition(kind, limit=limit, for_s=for_s)
    if new_condition.is_about_node is condition.is_about_node:
        new_condition = replace(new_condition, name=condition.name)
    if new_condition.is_about_value:
        new_condition = replace(new_condition, path=condition.path)
    return replace(rule, condition=new_condition)


def rejection_text(part: PhrasePart, rule: AlarmRule) -> str:
    """Return the message for an invalid value of a slot, which explains the valid values.

    Return "" for slots that accept any text.
    """
    match part.role:
        case "limit" if rule.condition.kind in NUMBER_KINDS:
            return _(AMBIGUOUS_SEPARATORS_MESSAGE)
        case "time":
            return _("Enter a time such as 2 s, 1.5 min or 250 ms.")
        case "payload":
            return _("Enter the message as JSON, such as {example}.").format(example='{"x": 1}')
        case _:
            return ""


def placeholder_of(part: PhrasePart, rule: AlarmRule) -> str:
    """Return the placeholder text for the field of a slot, such as "pose.x"; "" for none."""
    match part.role:
        case "subject":
            return _("a node") if rule.condition.is_about_node else _("a topic")
        case "value":
            return pgettext("example of a field's path", "pose.x")
        case "time":
            return pgettext("example of a time", "2 s")
        case "payload":
            return "{}"
        case _:
            return ""
