"""Export of curves as CSV, with one row for each time at which any curve has a value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from math import inf

import numpy as np

from app.core.series.curves import Curve
from app.core.series.samples import Floats
from app.core.storage.csv_text import escape_formula, format_csv

ROWS_PER_CHUNK = 5000


@dataclass(frozen=True, slots=True)
class CsvColumn:
    """Snapshot of one curve.

    Attributes:
        name: Title of the column.
        times: Times of the numbers in seconds.
        values: Numbers.
        states: Start time and value of each state.
    """

    name: str
    times: Floats
    values: Floats
    states: tuple[tuple[float, str], ...]


def columns_of(curves: Sequence[Curve], begin_s: float = -inf, end_s: float = inf) -> list[CsvColumn]:
    """Return a snapshot of the curves in a time range, which can be written in another thread.

    Args:
        curves: Curves to export.
        begin_s: Start of the range in seconds, inclusive.
        end_s: End of the range in seconds, inclusive.
    """
    columns = []
    for curve in curves:
        first, end = curve.samples.index_range(begin_s, end_s)
        runs = curve.states.runs(begin_s, end_s) if curve.states is not None else ()
        states = tuple(
            (run.start_s, run.value)
            for run in runs
            if run.value is not None and begin_s <= run.start_s <= end_s
        )
        times, values = curve.samples.times[first:end].copy(), curve.samples.values[first:end].copy()
        columns.append(CsvColumn(curve.text, times, values, states))
    return columns


def csv_chunks(columns: Sequence[CsvColumn], origin_ns: int) -> Iterator[str]:
    """Yield a CSV file (RFC 4180) in chunks: the header, then the rows by time.

    Times are written in nanoseconds since 1970, and as ISO 8601 in UTC. A state is written in the row
    of its start.

    Args:
        columns: Snapshots of the curves.
        origin_ns: Time 0 of the curves, in ns since 1970.
    """
    yield format_csv([["stamp_ns", "time_utc", *(escape_formula(column.name) for column in columns)]])
    state_times = [np.array([time_s for time_s, _value in column.states]) for column in columns]
    times = np.unique(np.concatenate([np.empty(0), *state_times, *(column.times for column in columns)]))
    for start in range(0, len(times), ROWS_PER_CHUNK):
        chunk_times = times[start : start + ROWS_PER_CHUNK]
        cells = [
            _cells_of(column, column_state_times, float(chunk_times[0]), float(chunk_times[-1]))
            for column, column_state_times in zip(columns, state_times, strict=True)
        ]
        rows = []
        for time_s in chunk_times.tolist():
            stamp_ns = origin_ns + round(time_s * 1e9)
            rows.append([str(stamp_ns), _format_iso(stamp_ns), *(each.get(time_s, "") for each in cells)])
        yield format_csv(rows)


def _cells_of(column: CsvColumn, state_times: Floats, begin_s: float, end_s: float) -> dict[float, str]:
    # Of several values at the same time the newest counts.
    first, last = _index_range(column.times, begin_s, end_s)
    numbers = zip(column.times[first:last].tolist(), column.values[first:last].tolist(), strict=True)
    cells = {time_s: repr(value) for time_s, value in numbers}
    first, last = _index_range(state_times, begin_s, end_s)
    return cells | {time_s: escape_formula(text) for time_s, text in column.states[first:last]}


def _index_range(times: Floats, begin_s: float, end_s: float) -> tuple[int, int]:
    first, last = np.searchsorted(times, begin_s, "left"), np.searchsorted(times, end_s, "right")
    return int(first), int(last)


def _format_iso(stamp_ns: int) -> str:
    try:
        time_utc = datetime.fromtimestamp(stamp_ns // 10**9, timezone.utc)
    except (OverflowError, ValueError, OSError):
        return ""
    return f"{time_utc:%Y-%m-%dT%H:%M:%S}.{stamp_ns % 10**9:09d}Z"
