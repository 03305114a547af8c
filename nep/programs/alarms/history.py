"""What alarms saw: when each came on, for how long, and what was done. Bounded."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from nep.text import shortened

__all__ = ["MOST_RECORDS", "AlarmDeed", "AlarmHistory", "AlarmRecord", "record_from", "record_plain"]

MOST_RECORDS = 500
_MOST_DEEDS = 20
_MOST_LETTERS = 300
_LATEST_S = 3e10
"""Later times (the year 2920) are none: not every system has a date for them."""


class AlarmDeed(NamedTuple):
    """Something that was done: which kind of action, and what came of it in words."""

    kind: str
    words: str


@dataclass(slots=True, eq=False)
class AlarmRecord:
    """One time that an alarm was on.

    `rule_id`: which alarm. `words`: what was seen, "range of /distance is 0.36, below 0.4". `at_s`: when, in
    seconds since 1970. `lasted_s`: for how long, None while it is on or when nobody saw its end. `is_on`:
    whether it is on now. `count`: how often it came within this time. `was_snoozed`: nothing was done.
    `deeds`: what was done.
    """

    rule_id: str
    words: str
    at_s: float
    lasted_s: float | None = None
    is_on: bool = False
    count: int = 1
    was_snoozed: bool = False
    deeds: list[AlarmDeed] = field(default_factory=list)

    def add(self, deed: AlarmDeed) -> None:
        """Something was done; the same kind said anew takes the place of what was said before."""
        kept = [each for each in self.deeds if each.kind != deed.kind]
        self.deeds = [*kept, deed][-_MOST_DEEDS:]


class AlarmHistory:
    """The last `MOST_RECORDS` times, oldest first. One thread uses it."""

    def __init__(self, records: Iterable[AlarmRecord] = ()) -> None:
        self.records: deque[AlarmRecord] = deque(records, maxlen=MOST_RECORDS)
        self.revision = 0

    def __iter__(self) -> Iterator[AlarmRecord]:
        """Newest first."""
        return reversed(self.records)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.records)

    def add(self, record: AlarmRecord) -> None:
        """One more; the oldest goes when there are too many."""
        self.records.append(record)
        self.revision += 1

    def current(self, rule_id: str) -> AlarmRecord | None:
        """The record of an alarm that is on."""
        return next((each for each in self if each.rule_id == rule_id and each.is_on), None)

    def last(self, rule_id: str) -> AlarmRecord | None:
        """The newest record of an alarm."""
        return next((each for each in self if each.rule_id == rule_id), None)

    def since(self, rule_id: str, at_s: float) -> int:
        """How often an alarm came on since then."""
        return sum(each.rule_id == rule_id and each.at_s >= at_s for each in self.records)

    def clear(self) -> None:
        """Forget all but those that are on."""
        self.records = deque((each for each in self.records if each.is_on), maxlen=MOST_RECORDS)
        self.revision += 1


def record_plain(record: AlarmRecord) -> dict[str, object]:
    """The record as it is kept in a file."""
    plain: dict[str, object] = {"alarm": record.rule_id, "words": record.words, "at_s": round(record.at_s, 3)}
    if record.lasted_s is not None:
        plain["lasted_s"] = round(record.lasted_s, 3)
    if record.count != 1:
        plain["count"] = record.count
    if record.was_snoozed:
        plain["snoozed"] = True
    if record.deeds:
        plain["did"] = [[deed.kind, deed.words] for deed in record.deeds]
    return plain


def record_from(told: object) -> AlarmRecord | None:
    """The record that a file holds; None for what is none. None of them is on: nobody saw its end."""
    if not isinstance(told, Mapping):
        return None
    rule_id, words, at_s = told.get("alarm"), told.get("words"), told.get("at_s")
    if not isinstance(rule_id, str) or not isinstance(words, str) or not _is_number(at_s):
        return None
    lasted_s, count, did = told.get("lasted_s"), told.get("count", 1), told.get("did")
    deeds = [
        AlarmDeed(str(each[0]), shortened(str(each[1]), _MOST_LETTERS))
        for each in (did if isinstance(did, list) else [])[:_MOST_DEEDS]
        if isinstance(each, list) and len(each) == 2
    ]
    return AlarmRecord(
        rule_id,
        shortened(words, _MOST_LETTERS),
        float(at_s),  # type: ignore[arg-type]
        float(lasted_s) if _is_number(lasted_s) else None,  # type: ignore[arg-type]
        count=count if isinstance(count, int) and not isinstance(count, bool) and count > 0 else 1,
        was_snoozed=told.get("snoozed") is True,
        deeds=deeds,
    )


def _is_number(value: object) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and 0 <= value <= _LATEST_S  # type: ignore[operator]
