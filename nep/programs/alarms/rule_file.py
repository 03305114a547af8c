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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from msgspec import UNSET, Meta, Struct, UnsetType, field

from nep.errors import NepError, did_you_mean
from nep.i18n import _, lazy
from nep.messages.fields import FieldPathError
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
    new_id,
    problem_of,
)
from nep.programs.config_file import ConfigFile, ConfigKind, checks, convert_table
from nep.text import quotable

FORMAT_VERSION = 1
MAX_ALARMS = 200
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

_KIND = ConfigKind(
    "JSON",
    "nep watch",
    4_000_000,
    lazy("'{path}' is too large for an alarm file (limit: {most} bytes); choose another file"),
)
_SIMPLE_ACTIONS = ("banner", "sound", "keep", "stop", "console")
_DEFAULT_FOR_S: Mapping[str, float] = {"silent": 2.0, "loses": 30.0}


_Number = Annotated[float, Meta(gt=-1e300, lt=1e300)]


class _FileTable(Struct):
    """Root of an alarm file."""

    format: Any = FORMAT_VERSION
    alarms: list[Any] = []
    history: Any = None


class _RuleTable(Struct):
    """One alarm of an alarm file."""

    when: dict[str, Any] | None = None
    do: list[Any] = []
    id: Annotated[str, Meta(max_length=64)] | None = None
    is_on: bool = field(name="on", default=True)
    calm_s: _Number = DEFAULT_CALM_S
    snoozed_until_s: _Number = 0.0


class _ConditionTable(Struct):
    """Condition of an alarm."""

    topic: str = ""
    node: str = ""
    value: str = ""
    kind: Any = field(name="is", default=None)
    than: Any = None
    for_s: _Number | UnsetType = UNSET
    margin: _Number = 0.0


class _KeepTable(Struct):
    """Action `{"keep_s": 60}`."""

    keep_s: _Number


class _RunTable(Struct):
    """Action `{"run": "name"}`."""

    run: str


class _CallTable(Struct):
    """Action `{"call": "name", "with": {}}`."""

    call: str
    payload: Any = field(name="with", default_factory=dict)


class _SendTable(Struct):
    """Action `{"send": "/topic", "message": {}, "type": "json"}`."""

    send: str
    message: Any = None
    msg_type: Annotated[str, Meta(min_length=1)] = field(name="type", default="json")


_ACTION_TABLES: Mapping[str, type[_KeepTable | _RunTable | _CallTable | _SendTable]] = {
    "keep_s": _KeepTable,
    "run": _RunTable,
    "call": _CallTable,
    "send": _SendTable,
}


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
    return _parse(ConfigFile.read(_KIND, path), is_lenient=False)


def parse_alarms(data: bytes, path: str, *, lenient: bool = False) -> AlarmFile:
    """Parse the bytes of an alarm file.

    Args:
        data: Content of the file.
        path: Path of the file, for error messages.
        lenient: Skip invalid alarms and report them in `AlarmFile.problems`.

    Raises:
        NepError: The data is not an alarm file, or (unless `lenient`) an alarm is invalid.
    """
    return _parse(ConfigFile.decode(_KIND, path, data), is_lenient=lenient)


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


def _parse(file: ConfigFile, *, is_lenient: bool) -> AlarmFile:
    try:
        root = _root_table(file.value, file.path)
    except FieldPathError as error:
        raise file.error(error) from None
    rules: list[AlarmRule] = []
    problems: list[str] = []
    ids: set[str] = set()
    for index, entry in enumerate(root.alarms):
        try:
            with checks("alarms", index):
                rule = _rule(entry)
                if rule.id in ids:
                    raise FieldPathError(
                        _("another alarm already has this id; use a different id for each alarm, or omit it"),
                        "id",
                    )
        except FieldPathError as error:
            if not is_lenient:
                raise file.error(error) from None
            problems.append(str(file.error(error)))
        else:
            ids.add(rule.id)
            rules.append(rule)
    records = [record_from_plain(each) for each in root.history] if isinstance(root.history, list) else []
    history = AlarmHistory([record for record in records if record is not None])
    return AlarmFile(tuple(rules), history, tuple(problems))


def _root_table(value: object, path: str) -> _FileTable:
    if not isinstance(value, dict):
        raise FieldPathError(_('not an alarm file; it must begin with {"format": 1, "alarms": ['))
    version = value.get("format", FORMAT_VERSION)
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise FieldPathError(_("must be {format}").format(format=FORMAT_VERSION), "format")
    if version > FORMAT_VERSION:
        template = _(
            "'{path}' was written by a newer version of nep (format {found}; this version reads "
            "{format}); update nep"
        )
        raise NewerAlarmsError(template.format(path=path, found=version, format=FORMAT_VERSION))
    missing_reason = _('the list of alarms is missing; write "alarms": [...]')
    root = convert_table(value, _FileTable, {"alarms": missing_reason})
    if "alarms" not in value:
        raise FieldPathError(missing_reason, "alarms")
    if len(root.alarms) > MAX_ALARMS:
        raise FieldPathError(_("there are more than {most} alarms").format(most=MAX_ALARMS), "alarms")
    return root


def _rule(value: object) -> AlarmRule:
    if not isinstance(value, dict):
        raise FieldPathError(_('not an alarm; write {"when": {...}, "do": [...]}'))
    when_reason = _('the condition is missing; write "when": {"topic": ..., "is": ...}')
    table = convert_table(
        value,
        _RuleTable,
        {
            "when": when_reason,
            "do": _("must be a list of actions"),
            "id": _("must be a string of at most 64 characters"),
        },
    )
    if table.when is None:
        raise FieldPathError(when_reason, "when")
    with checks("when"):
        condition = _condition(table.when)
    actions = []
    for index, each in enumerate(table.do):
        with checks("do", index):
            actions.append(_action(each))
    rule = AlarmRule(
        table.id or new_id(),
        condition,
        tuple(actions),
        table.is_on,
        table.calm_s,
        min(table.snoozed_until_s, _MAX_TIME_S),
    )
    problem = problem_of(rule)
    if problem is not None:
        raise FieldPathError(problem.message, *_path_of(problem.key, table.do))
    return rule


def _path_of(key: str, actions: Sequence[object]) -> tuple[str | int, ...]:
    # Path of a key that `problem_of` returns.
    if key in _ConditionTable.__struct_encode_fields__:
        return ("when", key)
    with_key = (index for index, each in enumerate(actions) if isinstance(each, dict) and key in each)
    index = next(with_key, None)
    return (key,) if index is None else ("do", index, key)


def _condition(value: Mapping[str, object]) -> AlarmCondition:
    table = convert_table(value, _ConditionTable)
    kind = table.kind
    if kind is None:
        raise FieldPathError(_('the condition is missing; write "is": "silent"'))
    if not isinstance(kind, str) or kind not in KINDS:
        raise FieldPathError(
            _unknown_text(_("unknown condition '{kind}'; {did_you_mean}"), kind, KINDS), "is"
        )
    subject, other_subject = ("node", "topic") if kind in NODE_KINDS else ("topic", "node")
    if other_subject in value:
        template = _("'{kind}' needs a {subject}; write \"{subject}\": ...")
        raise FieldPathError(template.format(kind=kind, subject=subject), other_subject)
    if table.value and kind not in VALUE_KINDS:
        raise FieldPathError(_("'{kind}' doesn't take a value; remove it").format(kind=kind), "value")
    if kind in KINDS_WITH_LIMIT and "than" not in value:
        raise FieldPathError(_('the limit is missing; write "than": ...'), "is")
    if table.than is not None and not isinstance(table.than, str | int | float):
        raise FieldPathError(_("must be a number, a string, true, false or null"), "than")
    for_s = _DEFAULT_FOR_S.get(kind, 0.0) if table.for_s is UNSET else table.for_s
    return AlarmCondition(kind, table.topic or table.node, table.value, table.than, for_s, table.margin)


def _action(value: object) -> AlarmAction:
    if isinstance(value, str):
        if value in _SIMPLE_ACTIONS:
            return AlarmAction(value)
        known_kinds = (*_SIMPLE_ACTIONS, *(kind for kind in ACTION_KINDS if kind not in _SIMPLE_ACTIONS))
        raise FieldPathError(_unknown_text(_("unknown action '{kind}'; {did_you_mean}"), value, known_kinds))
    key = next((each for each in _ACTION_TABLES if isinstance(value, dict) and each in value), None)
    if not isinstance(value, dict) or key is None:
        template = _(
            'an action must be {simple}, or an object with the key "call", "send", "run" or "keep_s", '
            'such as {{"call": "name", "with": {{}}}}'
        )
        raise FieldPathError(template.format(simple=", ".join(f'"{each}"' for each in _SIMPLE_ACTIONS)))
    match convert_table(value, _ACTION_TABLES[key]):
        case _KeepTable(seconds):
            return AlarmAction("keep", recording_s=seconds)
        case _RunTable(name):
            return AlarmAction("run", name)
        case _CallTable(name, payload):
            return AlarmAction("call", name, payload)
        case _SendTable(name, payload, msg_type):
            return AlarmAction("send", name, payload, msg_type)
    raise AssertionError(key)


def _unknown_text(template: str, kind: object, known_kinds: Sequence[str]) -> str:
    shown_kind = quotable(str(kind))
    return template.format(kind=shown_kind, did_you_mean=did_you_mean(shown_kind, known_kinds))
