"""Parsing of numbers typed by the user: comma and point are both decimal separators.

``app/blocks/editor/src/typed_number.ts`` implements the same rules for number fields of blocks;
``tests/data/typed_numbers.json`` contains test cases for both.
"""

from __future__ import annotations

import math
import re
import unicodedata

from nep.i18n import _, lazy

NOT_A_NUMBER_MESSAGE = lazy("Enter a number.")
AMBIGUOUS_SEPARATORS_MESSAGE = lazy(
    "Enter a number with at most one decimal comma or point, such as 1234.5 or 1234,5."
)
_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_GROUPED_NUMBER = re.compile("[+-]?[0-9][0-9.,' _\N{RIGHT SINGLE QUOTATION MARK}]*", re.ASCII)


class TypedNumberError(ValueError):
    """Raised for a text that is not a number. The message is for the user.

    Attributes:
        has_separators: True if the text is ambiguous because of its separators.
    """

    def __init__(self, *, has_separators: bool) -> None:
        super().__init__(_(AMBIGUOUS_SEPARATORS_MESSAGE if has_separators else NOT_A_NUMBER_MESSAGE))
        self.has_separators = has_separators


def parse_number(text: str) -> float:
    """Parse a number typed by the user.

    A single comma or point is the decimal separator. Thousands separators, as in "1.234,5", are
    rejected instead of removed, because it can't be undone if a robot moves a thousand times too far.

    Raises:
        TypedNumberError: The text is not a finite number.
    """
    typed = unicodedata.normalize("NFKC", text).strip().replace("\N{MINUS SIGN}", "-")
    if _NUMBER.fullmatch(typed):
        number = float(typed.replace(",", "."))
        if math.isfinite(number):
            return number
    raise TypedNumberError(has_separators=_GROUPED_NUMBER.fullmatch(typed) is not None)
