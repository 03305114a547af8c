"""CSV (RFC 4180) that is safe for spreadsheets: values received from robots can't become formulas."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

_START = ("=", "+", "-", "@", "\t", "\r")


def escape_formula(text: str) -> str:
    """Prefix a text with an apostrophe if a spreadsheet would interpret it as a formula."""
    return f"'{text}" if text.startswith(_START) else text


def csv_text(rows: Iterable[Sequence[str]]) -> str:
    """Return the rows as CSV; each row ends with a line break."""
    out = io.StringIO(newline="")
    csv.writer(out).writerows(rows)
    return out.getvalue()
