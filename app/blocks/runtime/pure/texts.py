"""Functions of the category "Text and answers".

Characters are grapheme clusters (`values.grapheme_clusters`), numbered from 1. All values are converted to
text first.
"""

from __future__ import annotations

import math
import random
import re
import unicodedata

from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.values import MAX_TEXT_LENGTH, grapheme_clusters, number, text
from nep.i18n import _, lazy, ngettext

__all__ = [
    "backwards", "ends_with", "has_in_it", "has_number", "in_capitals", "in_small_letters", "is_empty",
    "letter", "number_in", "part_of_text", "position_in_text", "replaced", "same_words", "starts_with",
    "without_spaces_around",
]  # fmt: skip

_NUMBER = re.compile(r"(?<![\d.,])[-−]?\d+(?:[.,]\d+)*")  # noqa: RUF001 (the sign that people read)
_GROUPED_NUMBER = re.compile(r"[1-9]\d{0,2}(?:,\d{3})+(?:\.\d+)?")
_MAX_DIGITS = 300


def letter(value: object, selector: object) -> str:
    """Return a character of a text.

    Args:
        value: Text.
        selector: Number of the character, "first", "last" or "random".

    Raises:
        BehaviourError: The text is empty, or it has no character with this number.
    """
    characters = grapheme_clusters(text(value))
    if not characters:
        raise BehaviourError(_("The text is empty."))
    if selector == "random":
        return random.choice(characters)  # noqa: S311 (a game, no secret)
    number_by_name = {"first": 1, "last": len(characters)}
    named_number = number_by_name.get(selector) if isinstance(selector, str) else None
    letter_number = number(selector, lazy("“letter number”")) if named_number is None else named_number
    if letter_number != int(letter_number):
        raise BehaviourError(
            _("“letter number” needs a whole number, not {place}.").format(place=text(letter_number))
        )
    if not 1 <= letter_number <= len(characters):
        message = ngettext(
            "The text has only {count} letter; it has no letter {number}.",
            "The text has only {count} letters; it has no letter {number}.",
            len(characters),
        )
        raise BehaviourError(message.format(count=len(characters), number=text(letter_number)))
    return characters[int(letter_number) - 1]


def part_of_text(value: object, first: object, last: object) -> str:
    """Return the characters from one number to another, inclusive; the range is limited to the text."""
    begin, end = (math.floor(number(each, lazy("“letters”"))) for each in (first, last))
    return "".join(grapheme_clusters(text(value))[max(begin, 1) - 1 : max(end, 0)])


def position_in_text(value: object, piece: object) -> int:
    """Return the number of the character at which `piece` first occurs; 0 if empty or not in the text."""
    full_text, substring = text(value), text(piece)
    index = full_text.find(substring) if substring else -1
    return 0 if index < 0 else len(grapheme_clusters(full_text[:index])) + 1


def has_in_it(value: object, piece: object) -> bool:
    """Return True if a text contains another text."""
    return text(piece) in text(value)


def starts_with(value: object, piece: object) -> bool:
    """Return True if a text starts with another text."""
    return text(value).startswith(text(piece))


def ends_with(value: object, piece: object) -> bool:
    """Return True if a text ends with another text."""
    return text(value).endswith(text(piece))


def same_words(one: object, other: object) -> bool:
    """Return True if two texts are equal, ignoring case and surrounding white space."""
    return _normalize(one) == _normalize(other)


def is_empty(value: object) -> bool:
    """Return True if a text contains nothing but white space."""
    return not text(value).strip()


def in_capitals(value: object) -> str:
    """Return a text in upper case."""
    return text(value).upper()


def in_small_letters(value: object) -> str:
    """Return a text in lower case."""
    return text(value).lower()


def without_spaces_around(value: object) -> str:
    """Return a text without leading and trailing white space."""
    return text(value).strip()


def backwards(value: object) -> str:
    """Return a text with its characters in reverse order."""
    return "".join(reversed(grapheme_clusters(text(value))))


def replaced(value: object, old: object, new: object) -> str:
    """Return a text with all occurrences of `old` replaced; the text itself if `old` is empty.

    Raises:
        BehaviourError: The result is too long.
    """
    full_text, before, after = text(value), text(old), text(new)
    if not before:
        return full_text
    if len(full_text) + full_text.count(before) * (len(after) - len(before)) > MAX_TEXT_LENGTH:
        raise BehaviourError(
            _("This text is too long. Use at most {most} characters.").format(most=MAX_TEXT_LENGTH)
        )
    return full_text.replace(before, after)


def has_number(value: object) -> bool:
    """Return True if a text contains a number."""
    return _parse_number(value) is not None


def number_in(value: object) -> int | float:
    """Return the first number in a text; a number is returned unchanged.

    Raises:
        BehaviourError: The text contains no number, or the value is None.
    """
    if isinstance(value, (int, float)) or value is None:
        return number(value, lazy("“number in”"))
    parsed = _parse_number(value)
    if parsed is None:
        raise BehaviourError(_("“{text}” doesn't contain a number.").format(text=text(value)[:60]))
    return parsed


def _parse_number(value: object) -> int | float | None:
    # “12”, “2,5” and “1,000” are numbers: a comma before three digits separates thousands.
    match = _NUMBER.search(text(value))
    if match is None or len(match[0]) > _MAX_DIGITS:
        return None
    is_negative, digits = match[0][0] in "-−", match[0].lstrip("-−")  # noqa: RUF001 (the sign that people read)
    if _GROUPED_NUMBER.fullmatch(digits):
        digits = digits.replace(",", "")
    pieces = re.split(r"[.,]", digits)
    parsed = int(pieces[0]) if len(pieces) == 1 else float(f"{pieces[0]}.{pieces[1]}")
    return -parsed if is_negative else parsed


def _normalize(value: object) -> str:
    return unicodedata.normalize("NFKC", text(value)).casefold().strip()
