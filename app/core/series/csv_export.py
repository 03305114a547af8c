"""Curves as CSV: one row for each time at which any of them has something, blank where one has nothing."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from math import inf

from app.core.series.curves import Curve

ROWS_AT_ONCE = 5000
_START = ("=", "+", "-", "@", "\t", "\r")


def csv_lines(
    curves: Sequence[Curve], origin_ns: int, begin_s: float = -inf, end_s: float = inf
) -> Iterator[str]:
    """The lines of a CSV file (RFC 4180), some thousands at a time: the head, then rows by their time.

    Times are nanoseconds since 1970 and ISO 8601 in UTC; a state stands where it begins.
    """
    yield _line(["stamp_ns", "time_utc", *(_harmless(curve.text) for curve in curves)])
    cells = [_cells_of(curve, begin_s, end_s) for curve in curves]
    times = sorted({time_s for each in cells for time_s in each})
    for begin in range(0, len(times), ROWS_AT_ONCE):
        out = []
        for time_s in times[begin : begin + ROWS_AT_ONCE]:
            stamp_ns = origin_ns + round(time_s * 1e9)
            out.append(_line([str(stamp_ns), _iso(stamp_ns), *(each.get(time_s, "") for each in cells)]))
        yield "".join(out)


def _cells_of(curve: Curve, begin_s: float, end_s: float) -> dict[float, str]:
    first, end = curve.samples.places(begin_s, end_s)
    times, values = curve.samples.times[first:end], curve.samples.values[first:end]
    cells = {
        time_s: repr(value) for time_s, value in zip(times.tolist(), values.tolist(), strict=True)
    }  # of several at the same time the newest
    if curve.states is not None:
        for run in curve.states.runs(begin_s, end_s):
            if run.word is not None and begin_s <= run.begin_s <= end_s:
                cells[run.begin_s] = _harmless(run.word)
    return cells


def _iso(stamp_ns: int) -> str:
    try:
        at = datetime.fromtimestamp(stamp_ns // 10**9, timezone.utc)
    except (OverflowError, ValueError, OSError):
        return ""
    return f"{at:%Y-%m-%dT%H:%M:%S}.{stamp_ns % 10**9:09d}Z"


def _harmless(text: str) -> str:
    """A text that no spreadsheet takes for a formula: one that begins like one gets an apostrophe."""
    return f"'{text}" if text.startswith(_START) else text


def _line(cells: Sequence[str]) -> str:
    out = io.StringIO()
    csv.writer(out).writerow(cells)
    return out.getvalue()
