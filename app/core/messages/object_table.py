"""Lists of objects as tables: which lists of a message are such, their columns, how they sort, and CSV.

Nothing is looked at that is not asked for: a row of a large message is decoded when somebody sees it.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TypeAlias

from app.core.messages.lazy_json import LazyList, LazyObject
from app.core.storage.csv_text import csv_text, harmless
from nep.messages.fields import path_text

Steps: TypeAlias = tuple[str | int, ...]
MOST_ROWS = 2000
MOST_COLUMNS = 40
LOOKED_AT = 50
"""Rows from which the columns are taken: they come with the first rows or not at all."""
MOST_LISTS = 20
_SEARCHED = 2000
"""Values of a message in which lists of objects are looked for."""
_FEW = 8
"""An object of so many keys has a column for each of them in the table that it is in."""
MISSING = object()


@dataclass(frozen=True, slots=True, eq=False)
class ObjectRow:
    """One object: where it stands among the others, its ``name`` there ("0", or a path), its value."""

    place: int
    name: str
    value: Mapping[object, object]

    def at(self, column: Steps) -> object:
        """What it has in a column; `MISSING` when it has nothing there."""
        here: object = self.value
        for step in column:
            if not isinstance(here, Mapping):
                return MISSING
            here = here.get(step, MISSING)
        return here


def is_list(value: object) -> bool:
    """Whether it is a list; texts and bytes are none."""
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview))


def is_list_of_objects(value: object) -> bool:
    """Whether it is a list whose first values are objects with something in them."""
    if not is_list(value) or not len(value):  # type: ignore[arg-type]
        return False
    first = list(islice(value, 5))  # type: ignore[call-overload]
    return all(isinstance(each, Mapping) for each in first) and any(first)


def lists_of_objects(value: object, most: int = MOST_LISTS) -> list[Steps]:
    """The ways to the lists of objects in a message, upper ones first; ``()`` is the message itself."""
    found: list[Steps] = []
    waiting: deque[tuple[Steps, object]] = deque([((), value)])
    for _each in range(_SEARCHED):
        if not waiting or len(found) >= most:
            break
        steps, here = waiting.popleft()
        if is_list_of_objects(here):
            found.append(steps)
        elif isinstance(here, Mapping):
            room = max(0, _SEARCHED - len(waiting))
            waiting.extend(((*steps, str(key)), below) for key, below in islice(here.items(), room))
    return found


def value_at(value: object, steps: Steps) -> object:
    """What stands there in a message; `MISSING` when nothing does."""
    for step in steps:
        if isinstance(step, int):
            if not is_list(value) or not 0 <= step < len(value):  # type: ignore[arg-type]
                return MISSING
            value = value[step]  # type: ignore[index]
        elif isinstance(value, Mapping):
            value = value.get(step, MISSING)
        else:
            return MISSING
    return value


def rows_of(value: object, most: int = MOST_ROWS) -> list[ObjectRow]:
    """The first objects of a list of objects; what is no object in it is left out."""
    if not is_list(value):
        return []
    return [
        ObjectRow(place, str(place), each)
        for place, each in enumerate(islice(value, most))  # type: ignore[call-overload]
        if isinstance(each, Mapping)
    ]


def rows_found(found: Iterable[tuple[str, object]], most: int = MOST_ROWS) -> list[ObjectRow]:
    """The objects among what a query found, by their paths; of a list of objects alone its objects."""
    pairs = list(found)
    if len(pairs) == 1 and is_list_of_objects(pairs[0][1]):
        return rows_of(pairs[0][1], most)
    every = (
        ObjectRow(place, str(name), each)
        for place, (name, each) in enumerate(pairs)
        if isinstance(each, Mapping)
    )
    return list(islice(every, most))


def columns_of(rows: Sequence[ObjectRow], most: int = MOST_COLUMNS) -> tuple[Steps, ...]:
    """The keys of the first rows in the order in which they come; each key of a small object has its own."""
    columns: dict[Steps, None] = {}
    for row in rows[:LOOKED_AT]:
        for key, value in row.value.items():
            if isinstance(value, Mapping) and 0 < len(value) <= _FEW:
                columns.update(dict.fromkeys((key, below) for below in value))  # type: ignore[misc]
            else:
                columns[(key,)] = None  # type: ignore[index]
            if len(columns) >= most:
                return tuple(columns)[:most]
    inner = {column[0] for column in columns if len(column) > 1}
    return tuple(column for column in columns if len(column) > 1 or column[0] not in inner)


def column_name(column: Steps) -> str:
    """The head of a column: ``at.x``."""
    return path_text(tuple(str(step) for step in column))


def sort_key(value: object) -> tuple[int, float, str] | None:
    """By what values of a column are sorted, of whatever kinds they are; None for what has no place.

    Numbers and yes or no first, then texts, then objects and lists by their length. NaN has no place.
    """
    if value is MISSING or value is None or value != value:  # noqa: PLR0124
        return None
    if isinstance(value, (bool, int, float)):
        try:
            return 0, float(value), ""
        except OverflowError:  # an integer of a thousand digits
            return 0, float("inf") if value > 0 else float("-inf"), ""
    if isinstance(value, str):
        return 1, 0.0, value.casefold()
    size = len(value) if isinstance(value, (Mapping, Sequence)) else 0
    return 2, float(size), ""


def cell_text(value: object) -> str:
    """A value in a cell of a CSV file: text as it is, what is missing blank, everything else as JSON."""
    if value is MISSING or value is None:
        return ""
    if isinstance(value, str):
        return harmless(value)
    if isinstance(value, (bytes, bytearray, memoryview)):
        return bytes(value).hex()
    if isinstance(value, (LazyList, LazyObject)):
        return str(value.text, "utf-8", "replace")
    return json.dumps(value, ensure_ascii=False, default=str)


def table_csv(first: str, columns: Sequence[Steps], rows: Iterable[ObjectRow]) -> str:
    """The table as CSV; ``first`` is the head of the rows' names."""
    head = [first, *(harmless(column_name(column)) for column in columns)]
    lines = ([harmless(row.name), *(cell_text(row.at(column)) for column in columns)] for row in rows)
    return csv_text([head, *lines])
