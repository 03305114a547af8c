"""Reader and writer of alarm files: JSON with alarm rules and their history. Errors name the line.

::

    {"format": 1, "alarms": [
      {"when": {"topic": "/robot/camera", "is": "silent", "for_s": 2}, "do": ["banner", {"keep_s": 60}]},
      {"when": {"topic": "/distance", "value": "range", "is": "below", "than": 0.4}, "do": ["stop"]},
      {"when": {"node": "lidar_driver", "is": "leaves"}, "do": [{"call": "restart_lidar", "with": {}}]}
    ]}
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from nep.errors import NepError, did_you_mean
from nep.i18n import _
from nep.messages.json_fault import find_json_fault
from nep.programs.alarms.history import AlarmHistory, record_from_plain, record_to_plain
from nep.programs.alarms.rule import (
    ACTION_KINDS,
    DEFAULT_CALM_S,
    KINDS,
    KINDS_WITH_LIMIT,
    NODE_KINDS,
    VALUE_KINDS,
    AlarmAction,
    AlarmCondition,
    AlarmRule,
    Scalar,
    new_id,
    problem_of,
)
from nep.text import escaped, quotable

FORMAT_VERSION = 1
MAX_ALARMS = 200
_MAX_BYTES = 4_000_000
_MAX_TIME_S = 3e10  # the year 2920: some systems have no later dates

EXAMPLE = """\
{
 "format": 1,
 "alarms": [
  {
   "when": {"topic": "/robot/camera", "is": "silent", "for_s": 2},
   "do": ["banner", "sound"]
  },
  {
   "when": {"topic": "/distance", "value": "range", "is": "below", "than": 0.4, "for_s": 1, "margin": 0.05},
   "do": ["banner", {"send": "/robot/speech", "message": {"say": "Too near"}}]
  },
  {
   "when": {"topic": "/cmd_vel", "is": "loses", "than": 1, "for_s": 30},
   "do": ["console"]
  },
  {
   "when": {"topic": "/odom", "is": "rate_below", "than": 10, "for_s": 3},
   "do": ["banner"]
  },
  {
   "when": {"node": "lidar_driver", "is": "leaves"},
   "do": ["banner", {"call": "restart_lidar", "with": {}}]
  }
 ]
}
"""
"""Example of an alarm file, printed by `nep watch --example`."""

_ROOT_KEYS = ("format", "alarms", "history")
_RULE_KEYS = ("id", "on", "when", "do", "calm_s", "snoozed_until_s")
_WHEN_KEYS = ("topic", "node", "value", "is", "than", "for_s", "margin")
_SIMPLE_ACTIONS = ("banner", "sound", "keep", "stop", "console")
_ACTION_KEYS: Mapping[str, tuple[str, ...]] = {
    "keep_s": (),
    "run": (),
    "call": ("with",),
    "send": ("message", "type"),
}
_DEFAULT_FOR_S: Mapping[str, float] = {"silent": 2.0, "loses": 30.0}


@dataclass(frozen=True, slots=True)
class AlarmFile:
    """Content of an alarm file.

    Attributes:
        rules: Valid rules.
        history: Records of earlier alarms.
        problems: One sentence for each invalid rule that was skipped.
    """

    rules: tuple[AlarmRule, ...] = ()
    history: AlarmHistory | None = None
    problems: tuple[str, ...] = ()


def read_alarms(path: Path) -> AlarmFile:
    """Read an alarm file. Raises `NepError` if the file can't be read or an alarm is invalid."""
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # NUL in a file name raises ValueError
        reason = getattr(error, "strerror", None) or str(error)
        template = _("'{path}' can't be read: {reason}; 'nep watch --example' prints an example")
        raise NepError(
            template.format(path=escaped(str(path)), reason=reason[:1].lower() + reason[1:])
        ) from error
    return parse_alarms(data, str(path))


def parse_alarms(data: bytes, path: str, *, lenient: bool = False) -> AlarmFile:
    """Parse the bytes of an alarm file.

    Args:
        data: Content of the file.
        path: Path of the file, for error messages.
        lenient: Skip invalid alarms and report them in `AlarmFile.problems`.

    Raises:
        NepError: The data is not an alarm file, or (unless `lenient`) an alarm is invalid.
    """
    path = escaped(path)
    if len(data) > _MAX_BYTES:
        template = _("'{path}' is too large for an alarm file (limit: {most} bytes); choose another file")
        raise NepError(template.format(path=path, most=_MAX_BYTES))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        template = _("line {line} of '{path}' isn't UTF-8; save the file as UTF-8")
        raise NepError(template.format(line=line, path=path)) from error
    fault = find_json_fault(text, allow_nan=True)
    if fault is not None:
        template = _(
            "'{path}' isn't valid JSON: line {line}, column {column}: {reason}; 'nep watch --example' "
            "prints an example"
        )
        raise NepError(template.format(path=path, line=fault.line, column=fault.column, reason=fault.reason))
    return _Reader(path, text, is_lenient=lenient).parse(json.loads(text))


def encode_alarms(rules: Sequence[AlarmRule], history: AlarmHistory | None = None) -> bytes:
    """Encode rules and history as the content of an alarm file."""
    records = [record_to_plain(record) for record in history.records] if history is not None else []
    value: dict[str, object] = {"format": FORMAT_VERSION, "alarms": [_rule_to_plain(rule) for rule in rules]}
    if records:
        value["history"] = records
    text = json.dumps(value, indent=1, ensure_ascii=False) + "\n"
    return text.encode("utf-8", "backslashreplace")


def _rule_to_plain(rule: AlarmRule) -> dict[str, object]:
    condition = rule.condition
    when: dict[str, object] = {"node" if condition.is_about_node else "topic": condition.name}
    if condition.is_about_value:
        when["value"] = condition.path
    when["is"] = condition.kind
    if condition.kind in KINDS_WITH_LIMIT:
        when["than"] = condition.limit
    if condition.for_s:
        when["for_s"] = condition.for_s
    if condition.margin:
        when["margin"] = condition.margin
    result: dict[str, object] = {"id": rule.id}
    if not rule.is_enabled:
        result["on"] = False
    result |= {
        "when": when,
        "do": [_action_to_plain(action) for action in rule.actions],
        "calm_s": rule.calm_s,
    }
    if rule.snoozed_until_s:
        result["snoozed_until_s"] = rule.snoozed_until_s
    return result


def _action_to_plain(action: AlarmAction) -> object:
    match action.kind:
        case "keep":
            return {"keep_s": action.recording_s}
        case "run":
            return {"run": action.name}
        case "call":
            return {"call": action.name, "with": action.payload}
        case "send":
            return {"send": action.name, "message": action.payload, "type": action.msg_type}
        case _:
            return action.kind


class NewerAlarmsError(NepError):
    """Error for an alarm file of a newer format, which a newer version of nep can read."""


class _InvalidAlarmError(Exception):
    """Error for an invalid alarm; its message names the file and the line."""


class _Reader:
    """Parser of alarm files that tracks the line of each alarm and key for error messages."""

    def __init__(self, path: str, text: str, *, is_lenient: bool) -> None:
        self._path, self._text, self._is_lenient = path, text, is_lenient
        self._spans: list[tuple[int, int]] | None = None

    def parse(self, value: object) -> AlarmFile:
        try:
            alarms = self._alarm_list(value)
        except _InvalidAlarmError as error:
            raise NepError(str(error)) from None
        rules: list[AlarmRule] = []
        problems: list[str] = []
        ids: set[str] = set()
        for index, entry in enumerate(alarms):
            try:
                rule = self._rule(entry, index)
                if rule.id in ids:
                    self._fail(
                        "id",
                        _("another alarm already has this id; use a different id for each alarm, or omit it"),
                        index,
                    )
            except _InvalidAlarmError as error:
                if not self._is_lenient:
                    raise NepError(str(error)) from None
                problems.append(str(error))
            else:
                ids.add(rule.id)
                rules.append(rule)
        return AlarmFile(tuple(rules), self._history(value), tuple(problems))

    def _alarm_list(self, value: object) -> list[object]:
        if not isinstance(value, dict):
            self._fail("", _('not an alarm file; it must begin with {"format": 1, "alarms": ['))
        version = value.get("format", FORMAT_VERSION)
        if not isinstance(version, int) or isinstance(version, bool) or version < 1:
            self._fail("format", _("must be {format}").format(format=FORMAT_VERSION))
        if version > FORMAT_VERSION:
            template = _(
                "'{path}' was written by a newer version of nep (format {found}; this version reads "
                "{format}); update nep"
            )
            raise NewerAlarmsError(template.format(path=self._path, found=version, format=FORMAT_VERSION))
        self._check_keys(value, _ROOT_KEYS, None)
        alarms = value.get("alarms")
        if not isinstance(alarms, list):
            self._fail("alarms", _('the list of alarms is missing; write "alarms": [...]'))
        if len(alarms) > MAX_ALARMS:
            self._fail("alarms", _("there are more than {most} alarms").format(most=MAX_ALARMS))
        return alarms

    def _history(self, value: object) -> AlarmHistory:
        records = value.get("history") if isinstance(value, dict) else None
        parsed = [record_from_plain(each) for each in records] if isinstance(records, list) else []
        return AlarmHistory([record for record in parsed if record is not None])

    def _rule(self, entry: object, index: int) -> AlarmRule:
        if not isinstance(entry, dict):
            self._fail("", _('not an alarm; write {"when": {...}, "do": [...]}'), index)
        self._check_keys(entry, _RULE_KEYS, index)
        when = entry.get("when")
        if not isinstance(when, dict):
            self._fail("when", _('the condition is missing; write "when": {"topic": ..., "is": ...}'), index)
        actions = entry.get("do", [])
        if not isinstance(actions, list):
            self._fail("do", _("must be a list of actions"), index)
        is_on = entry.get("on", True)
        if not isinstance(is_on, bool):
            self._fail("on", _("must be true or false"), index)
        rule_id = entry.get("id") or new_id()
        if not isinstance(rule_id, str) or len(rule_id) > 64:
            self._fail("id", _("must be a string of at most 64 characters"), index)
        rule = AlarmRule(
            rule_id,
            self._condition(when, index),
            tuple(self._action(each, index) for each in actions),
            is_on,
            self._number(entry, "calm_s", DEFAULT_CALM_S, index),
            min(self._number(entry, "snoozed_until_s", 0.0, index), _MAX_TIME_S),
        )
        problem = problem_of(rule)
        if problem is not None:
            self._fail(problem.key, problem.message, index)
        return rule

    def _condition(self, when: dict[str, object], index: int) -> AlarmCondition:
        self._check_keys(when, _WHEN_KEYS, index)
        kind = when.get("is")
        if not isinstance(kind, str) or kind not in KINDS:
            if kind is None:
                self._fail("when", _('the condition is missing; write "is": "silent"'), index)
            template = _("unknown condition '{kind}'; {did_you_mean}")
            shown_kind = quotable(str(kind))
            self._fail(
                "is", template.format(kind=shown_kind, did_you_mean=did_you_mean(shown_kind, KINDS)), index
            )
        subject = "node" if kind in NODE_KINDS else "topic"
        other_subject = "topic" if kind in NODE_KINDS else "node"
        if other_subject in when:
            template = _("'{kind}' needs a {subject}; write \"{subject}\": ...")
            self._fail(other_subject, template.format(kind=kind, subject=subject), index)
        name, path = when.get(subject, ""), when.get("value", "")
        if not isinstance(name, str) or not isinstance(path, str):
            self._fail(subject if not isinstance(name, str) else "value", _("must be a string"), index)
        if path and kind not in VALUE_KINDS:
            self._fail("value", _("'{kind}' doesn't take a value; remove it").format(kind=kind), index)
        if kind in KINDS_WITH_LIMIT and "than" not in when:
            self._fail("is", _('the limit is missing; write "than": ...'), index)
        return AlarmCondition(
            kind,
            name,
            path,
            self._scalar(when.get("than"), index),
            self._number(when, "for_s", _DEFAULT_FOR_S.get(kind, 0.0), index),
            self._number(when, "margin", 0.0, index),
        )

    def _action(self, entry: object, index: int) -> AlarmAction:
        if isinstance(entry, str):
            if entry not in _SIMPLE_ACTIONS:
                known_kinds = [
                    *_SIMPLE_ACTIONS,
                    *(kind for kind in ACTION_KINDS if kind not in _SIMPLE_ACTIONS),
                ]
                template = _("unknown action '{kind}'; {did_you_mean}")
                shown_kind = quotable(entry)
                self._fail(
                    "do",
                    template.format(kind=shown_kind, did_you_mean=did_you_mean(shown_kind, known_kinds)),
                    index,
                )
            return AlarmAction(entry)
        kind = next((key for key in _ACTION_KEYS if isinstance(entry, dict) and key in entry), None)
        if not isinstance(entry, dict) or kind is None:
            template = _(
                'an action must be {simple}, or an object with the key "call", "send", "run" or "keep_s", '
                'such as {{"call": "name", "with": {{}}}}'
            )
            self._fail(
                "do", template.format(simple=", ".join(f'"{each}"' for each in _SIMPLE_ACTIONS)), index
            )
        self._check_keys(entry, (kind, *_ACTION_KEYS[kind]), index)
        if kind == "keep_s":
            return AlarmAction("keep", recording_s=self._number(entry, "keep_s", 60.0, index))
        name, msg_type = entry[kind], entry.get("type", "json")
        if not isinstance(name, str) or not isinstance(msg_type, str) or not msg_type:
            self._fail(kind if not isinstance(name, str) else "type", _("must be a string"), index)
        payload = entry.get("message" if kind == "send" else "with", {} if kind == "call" else None)
        return AlarmAction(kind, name, payload, msg_type)

    def _scalar(self, value: object, index: int) -> Scalar:
        if value is not None and not isinstance(value, str | int | float):
            self._fail("than", _("must be a number, a string, true, false or null"), index)
        return value

    def _number(self, table: Mapping[str, object], key: str, default: float, index: int) -> float:
        value = table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not -1e300 < value < 1e300:
            self._fail(key, _("must be a number"), index)
        return float(value)

    def _check_keys(self, table: Mapping[str, object], known_keys: Sequence[str], index: int | None) -> None:
        for key in table:
            if key not in known_keys:
                template = _("unknown key '{key}'; {did_you_mean}")
                shown_key = quotable(key)
                self._fail(
                    key,
                    template.format(key=shown_key, did_you_mean=did_you_mean(shown_key, known_keys)),
                    index,
                )

    def _fail(self, key: str, message: str, index: int | None = None) -> NoReturn:
        line = self._line_number(key, index)
        if key:
            template = _("line {line} of '{path}', '{key}': {sentence}")
            raise _InvalidAlarmError(
                template.format(line=line, path=self._path, key=quotable(key), sentence=message)
            )
        raise _InvalidAlarmError(
            _("line {line} of '{path}': {sentence}").format(line=line, path=self._path, sentence=message)
        )

    def _line_number(self, key: str, index: int | None) -> int:
        if self._spans is None:
            self._spans = list(_alarm_spans(self._text))
        begin, end = 0, len(self._text)
        if index is not None and index < len(self._spans):
            begin, end = self._spans[index]
        match = re.compile(re.escape(json.dumps(key, ensure_ascii=False))).search(self._text, begin, end)
        position = match.start() if key and match is not None else begin
        return self._text.count("\n", 0, position) + 1


def _alarm_spans(text: str) -> list[tuple[int, int]]:
    spans: list[tuple[int, int]] = []
    decode: Callable[[str, int], tuple[object, int]] = json.JSONDecoder().raw_decode
    position = _skip_space(text, 1 if text[:1] == "{" else text.find("{") + 1)
    while position < len(text) and text[position] == '"':
        key, position = decode(text, position)
        position = _skip_space(text, _skip_space(text, position) + 1)
        if key != "alarms" or text[position : position + 1] != "[":
            _value, position = decode(text, position)
            position = _skip_space(text, _skip_space(text, position) + 1)
            continue
        position = _skip_space(text, position + 1)
        while position < len(text) and text[position] != "]":
            _value, end = decode(text, position)
            spans.append((position, end))
            end = _skip_space(text, end)
            position = _skip_space(text, end + 1) if text[end : end + 1] == "," else end
        return spans
    return spans


def _skip_space(text: str, position: int) -> int:
    while position < len(text) and text[position] in " \t\r\n":
        position += 1
    return position
