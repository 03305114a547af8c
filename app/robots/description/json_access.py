"""Access to members of untrusted JSON documents without exceptions."""

from __future__ import annotations

import math
from collections.abc import Mapping

from nep.i18n import language, translate
from nep.text import bounded_str


def object_member(mapping: Mapping[str, object], name: str) -> Mapping[str, object]:
    """Return the member of a mapping with this name if it is an object, else an empty object."""
    return as_object(mapping.get(name))


def as_object(value: object) -> Mapping[str, object]:
    """Return the value if it is an object, else an empty object."""
    return value if isinstance(value, Mapping) else {}


def names(value: object) -> tuple[str, ...]:
    """Return the items of a list as strings; an empty tuple for values of other types."""
    return (
        tuple(item if isinstance(item, str) else bounded_str(item) for item in value)
        if isinstance(value, (list, tuple))
        else ()
    )


def text(value: object) -> str | None:
    """Return the value if it is a non-empty string, else None."""
    return value if isinstance(value, str) and value else None


def display_text(owner: Mapping[str, object], member: str = "title") -> str | None:
    """Return a text for the user from a robot description, in the current language; None if there is none.

    The members ``titles`` and ``descriptions`` contain translations; without them, Studio's message catalogue
    is used.

    Args:
        owner: JSON object with the text.
        member: "title" or "description".
    """
    translations = object_member(owner, f"{member}s")
    original = text(owner.get(member))
    return text(translations.get(language())) or (original and translate("robot", original))


def number(value: object) -> float | None:
    """Return the value if it is a number (int or float), else None. Booleans are not numbers."""
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def to_number(value: object) -> float | None:
    """Convert a number, or a text that represents a number, to float; return None for other values.

    RIZE sends numbers as text.
    """
    if isinstance(value, bool):
        return None
    try:
        return float(value if isinstance(value, (int, float)) else text(value) or "")
    except (ValueError, OverflowError):
        return None


def finite_float(value: object) -> float | None:
    """Convert a number to float.

    Returns None for other types, NaN, infinity, and integers too large for a float.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        result = float(value)
    except OverflowError:
        return None
    return result if math.isfinite(result) else None
