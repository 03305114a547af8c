"""Rows as CSV (RFC 4180) that spreadsheets open without taking a robot's words for formulas."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

_START = ("=", "+", "-", "@", "\t", "\r")


def harmless(text: str) -> str:
    """A text that no spreadsheet takes for a formula: one that begins like one gets an apostrophe."""
    return f"'{text}" if text.startswith(_START) else text


def csv_text(rows: Iterable[Sequence[str]]) -> str:
    """The rows, each with its line end."""
    out = io.StringIO(newline="")
    csv.writer(out).writerows(rows)
    return out.getvalue()
