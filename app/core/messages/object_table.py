"""Arrays of objects as tables: search in a message, columns, sorting, and CSV export.

Rows are decoded on demand, so that a large message is never decoded as a whole.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TypeAlias

from app.core.messages.lazy_json import LazyList, LazyObject
from app.core.storage.csv_text import escape_formula, format_csv
from nep.messages.fields import path_text

Steps: TypeAlias = tuple[str | int, ...]
MAX_ROWS = 2000
MAX_COLUMNS = 40
MAX_ROWS_CHECKED = 50
"""Number of rows that are searched for columns."""
MAX_LISTS = 20
_MAX_SEARCHED_VALUES = 2000
"""Maximum number of values of a message that are searched for arrays of objects."""
_MAX_FLATTENED_KEYS = 8
"""Maximum number of keys in a nested object whose keys become separate columns."""
MISSING = object()


@dataclass(frozen=True, slots=True, eq=False)
class ObjectRow:
    """Row of a table.

    Attributes:
        index: Index of the object in its array, or in the query result.
        name: Index as text, or the path of the object in the message.
        value: The object.
    """

    index: int
    name: str
    value: Mapping[object, object]

    def at(self, column: Steps) -> object:
        """Return the value in a column; `MISSING` if there is none."""
        current: object = self.value
        for step in column:
            if not isinstance(current, Mapping):
                return MISSING
            current = current.get(step, MISSING)
        return current


def is_list(value: object) -> bool:
    """Return True if a value is an array; strings and bytes are not arrays."""
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview))


def is_list_of_objects(value: object) -> bool:
    """Return True if a value is an array whose first five elements are objects, not all of them empty."""
    if not is_list(value) or not len(value):  # type: ignore[arg-type]
        return False
    first = list(islice(value, 5))  # type: ignore[call-overload]
    return all(isinstance(each, Mapping) for each in first) and any(first)


def lists_of_objects(value: object, max_paths: int = MAX_LISTS) -> list[Steps]:
    """Return the paths of the arrays of objects in a message, outermost first.

    The path ``()`` is the message itself. Arrays inside of other arrays are not found. At most
    ``max_paths`` paths are returned; the search stops after `_MAX_SEARCHED_VALUES` values.
    """
    paths: list[Steps] = []
    queue: deque[tuple[Steps, object]] = deque([((), value)])
    for _each in range(_MAX_SEARCHED_VALUES):
        if not queue or len(paths) >= max_paths:
            break
        steps, current = queue.popleft()
        if is_list_of_objects(current):
            paths.append(steps)
        elif isinstance(current, Mapping):
            capacity = max(0, _MAX_SEARCHED_VALUES - len(queue))
            queue.extend(((*steps, str(key)), nested) for key, nested in islice(current.items(), capacity))
    return paths


def value_at(value: object, steps: Steps) -> object:
    """Return the value at a path of a message; `MISSING` if there is none."""
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


def rows_of(value: object, max_rows: int = MAX_ROWS) -> list[ObjectRow]:
    """Return the first ``max_rows`` objects of an array as rows; other elements are skipped."""
    if not is_list(value):
        return []
    return [
        ObjectRow(index, str(index), each)
        for index, each in enumerate(islice(value, max_rows))  # type: ignore[call-overload]
        if isinstance(each, Mapping)
    ]


def query_rows(matches: Iterable[tuple[str, object]], max_rows: int = MAX_ROWS) -> list[ObjectRow]:
    """Return the objects in a query result as rows, named by their paths.

    If the result is a single array of objects, the rows are its elements.

    Args:
        matches: Pairs of path and value.
        max_rows: Maximum number of rows.
    """
    pairs = list(matches)
    if len(pairs) == 1 and is_list_of_objects(pairs[0][1]):
        return rows_of(pairs[0][1], max_rows)
    rows = (
        ObjectRow(index, str(name), each)
        for index, (name, each) in enumerate(pairs)
        if isinstance(each, Mapping)
    )
    return list(islice(rows, max_rows))


def columns_of(rows: Sequence[ObjectRow], max_columns: int = MAX_COLUMNS) -> tuple[Steps, ...]:
    """Return the columns for some rows: the keys of the first rows, in order of appearance.

    The keys of small nested objects become separate columns.
    """
    columns: dict[Steps, None] = {}
    for row in rows[:MAX_ROWS_CHECKED]:
        for key, value in row.value.items():
            if isinstance(value, Mapping) and 0 < len(value) <= _MAX_FLATTENED_KEYS:
                columns.update(dict.fromkeys((key, nested) for nested in value))  # type: ignore[misc]
            else:
                columns[(key,)] = None  # type: ignore[index]
            if len(columns) >= max_columns:
                return tuple(columns)[:max_columns]
    flattened_keys = {column[0] for column in columns if len(column) > 1}
    return tuple(column for column in columns if len(column) > 1 or column[0] not in flattened_keys)


def column_name(column: Steps) -> str:
    """Return the title of a column, such as ``at.x``."""
    return path_text(tuple(str(step) for step in column))


def sort_key(value: object) -> tuple[int, float, str] | None:
    """Return the sort key of a value; None for a missing value, null or NaN, which can't be ordered.

    Numbers and booleans come first, then strings, then objects and arrays by length.
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
    """Format a value for CSV: missing values and null empty, bytes as hex digits, others as JSON.

    Strings are unchanged, except that those that a spreadsheet would read as a formula are escaped.
    """
    if value is MISSING or value is None:
        return ""
    if isinstance(value, str):
        return escape_formula(value)
    if isinstance(value, (bytes, bytearray, memoryview)):
        return bytes(value).hex()
    if isinstance(value, (LazyList, LazyObject)):
        return str(value.text, "utf-8", "replace")
    return json.dumps(value, ensure_ascii=False, default=str)


def format_table_csv(name_title: str, columns: Sequence[Steps], rows: Iterable[ObjectRow]) -> str:
    """Return a table as CSV.

    Args:
        name_title: Title of the column with the row names.
        columns: Further columns.
        rows: Rows in order.
    """
    header = [name_title, *(escape_formula(column_name(column)) for column in columns)]
    lines = ([escape_formula(row.name), *(cell_text(row.at(column)) for column in columns)] for row in rows)
    return format_csv([header, *lines])
