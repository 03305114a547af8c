"""CSV (RFC 4180) that is safe for spreadsheets: received values are never evaluated as formulas."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

_FORMULA_PREFIXES = ("=", "+", "-", "@", "\t", "\r")


def escape_formula(text: str) -> str:
    """Return a text with an apostrophe in front if a spreadsheet would evaluate the text as a formula."""
    return f"'{text}" if text.startswith(_FORMULA_PREFIXES) else text


def format_csv(rows: Iterable[Sequence[str]]) -> str:
    """Return the rows as CSV; each row ends with a line break."""
    out = io.StringIO(newline="")
    csv.writer(out).writerows(rows)
    return out.getvalue()
