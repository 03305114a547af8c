"""Bounded history of alarms: the periods in which alarms were on, and the actions that ran."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from nep.text import shortened

MAX_RECORDS = 500
_MAX_ACTION_RESULTS = 20
_MAX_CHARACTERS = 300
_MAX_TIME_S = 3e10
"""Maximum time in a record (s since 1970; the year 2920), because some systems can't convert later times."""


class ActionResult(NamedTuple):
    """Completed action of an alarm.

    Attributes:
        kind: Kind of the action.
        text: Result as text.
    """

    kind: str
    text: str


@dataclass(slots=True, eq=False)
class AlarmRecord:
    """Period in which an alarm was on.

    Attributes:
        rule_id: Id of the rule.
        cause: Cause as text, such as "range of /distance is 0.36, below 0.4".
        at_s: Start (s since 1970).
        duration_s: Duration in seconds; None while the alarm is on, or if the end was not observed.
        is_on: True while the alarm is on.
        count: Number of times the condition became true in this period.
        was_snoozed: True if no action ran because the rule was snoozed.
        action_results: Completed actions.
    """

    rule_id: str
    cause: str
    at_s: float
    duration_s: float | None = None
    is_on: bool = False
    count: int = 1
    was_snoozed: bool = False
    action_results: list[ActionResult] = field(default_factory=list)

    def add(self, result: ActionResult) -> None:
        """Add a completed action, replacing an earlier one of the same kind."""
        remaining = [each for each in self.action_results if each.kind != result.kind]
        self.action_results = [*remaining, result][-_MAX_ACTION_RESULTS:]


class AlarmHistory:
    """Bounded list of the newest records of alarms, at most `MAX_RECORDS`. Not thread-safe.

    Iteration starts with the newest record.
    """

    def __init__(self, records: Iterable[AlarmRecord] = ()) -> None:
        self.records: deque[AlarmRecord] = deque(records, maxlen=MAX_RECORDS)
        self.revision = 0

    def __iter__(self) -> Iterator[AlarmRecord]:
        return reversed(self.records)

    def __len__(self) -> int:
        return len(self.records)

    def add(self, record: AlarmRecord) -> None:
        """Append a record, and evict the oldest one if there are more than `MAX_RECORDS`."""
        self.records.append(record)
        self.revision += 1

    def current(self, rule_id: str) -> AlarmRecord | None:
        """Return the record of an alarm that is on, or None if the alarm is off."""
        return next((each for each in self if each.rule_id == rule_id and each.is_on), None)

    def last(self, rule_id: str) -> AlarmRecord | None:
        """Return the newest record of an alarm, or None."""
        return next((each for each in self if each.rule_id == rule_id), None)

    def count_since(self, rule_id: str, at_s: float) -> int:
        """Return the number of times an alarm has turned on since `at_s` (seconds since 1970)."""
        return sum(each.rule_id == rule_id and each.at_s >= at_s for each in self.records)

    def clear(self) -> None:
        """Remove the records of all alarms that are off."""
        self.records = deque((each for each in self.records if each.is_on), maxlen=MAX_RECORDS)
        self.revision += 1


def record_to_plain(record: AlarmRecord) -> dict[str, object]:
    """Convert a record to a JSON-serializable dict."""
    result: dict[str, object] = {
        "alarm": record.rule_id,
        "words": record.cause,
        "at_s": round(record.at_s, 3),
    }
    if record.duration_s is not None:
        result["lasted_s"] = round(record.duration_s, 3)
    if record.count != 1:
        result["count"] = record.count
    if record.was_snoozed:
        result["snoozed"] = True
    if record.action_results:
        result["did"] = [[each.kind, each.text] for each in record.action_results]
    return result


def record_from_plain(value: object) -> AlarmRecord | None:
    """Convert a decoded JSON value to a record, or return None if the value is invalid.

    `AlarmRecord.is_on` is False, because the end of the period was not observed.
    """
    if not isinstance(value, Mapping):
        return None
    rule_id, cause, at_s = value.get("alarm"), value.get("words"), value.get("at_s")
    if not isinstance(rule_id, str) or not isinstance(cause, str) or not _is_valid_time(at_s):
        return None
    lasted_s, count, results = value.get("lasted_s"), value.get("count", 1), value.get("did")
    action_results = [
        ActionResult(str(each[0]), shortened(str(each[1]), _MAX_CHARACTERS))
        for each in (results if isinstance(results, list) else [])[:_MAX_ACTION_RESULTS]
        if isinstance(each, list) and len(each) == 2
    ]
    return AlarmRecord(
        rule_id,
        shortened(cause, _MAX_CHARACTERS),
        float(at_s),  # type: ignore[arg-type]
        float(lasted_s) if _is_valid_time(lasted_s) else None,  # type: ignore[arg-type]
        count=count if isinstance(count, int) and not isinstance(count, bool) and count > 0 else 1,
        was_snoozed=value.get("snoozed") is True,
        action_results=action_results,
    )


def _is_valid_time(value: object) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and 0 <= value <= _MAX_TIME_S  # type: ignore[operator]
