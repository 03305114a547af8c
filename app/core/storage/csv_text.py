"""CSV (RFC 4180) that is safe for spreadsheets: values of robots are not interpreted as formulas."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

_START = ("=", "+", "-", "@", "\t", "\r")


def harmless(text: str) -> str:
    """Prefix a text that a spreadsheet would interpret as a formula with an apostrophe."""
    return f"'{text}" if text.startswith(_START) else text


def csv_text(rows: Iterable[Sequence[str]]) -> str:
    """Return the rows as CSV, each with a line end."""
    out = io.StringIO(newline="")
    csv.writer(out).writerows(rows)
    return out.getvalue()
