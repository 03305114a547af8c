"""Reading the members of a JSON document that may hold anything."""

from __future__ import annotations

import math
from collections.abc import Mapping

from nep.i18n import language, translate
from nep.text import bounded_str


def part(mapping: Mapping[str, object], name: str) -> Mapping[str, object]:
    """The object of that name inside another; empty when it is missing or something else."""
    return as_part(mapping.get(name))


def as_part(value: object) -> Mapping[str, object]:
    """The value when it is an object, else an empty one."""
    return value if isinstance(value, Mapping) else {}


def names(value: object) -> tuple[str, ...]:
    """The words of a list; none when it is something else."""
    return (
        tuple(item if isinstance(item, str) else bounded_str(item) for item in value)
        if isinstance(value, (list, tuple))
        else ()
    )


def text(value: object) -> str | None:
    """The text, or None when it is something else or empty."""
    return value if isinstance(value, str) and value else None


def spoken(owner: Mapping[str, object], member: str = "title") -> str | None:
    """A member for people in the language of now: `titles` and `descriptions` have it by language.

    What a robot does not say in this language may be known to our own translators.
    """
    words = part(owner, f"{member}s")
    own = text(owner.get(member))
    return text(words.get(language())) or (own and translate("robot", own))


def number(value: object) -> float | None:
    """The number as it is (a whole one stays whole), or None; yes and no are no numbers."""
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def number_of(value: object) -> float | None:
    """The number that RIZE may have sent as text; None when it is none."""
    if isinstance(value, bool):
        return None
    try:
        return float(value if isinstance(value, (int, float)) else text(value) or "")
    except (ValueError, OverflowError):
        return None


def finite(value: object) -> float | None:
    """Return a number as a float; None for anything else, NaN, infinity and integers beyond all floats."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        found = float(value)
    except OverflowError:
        return None
    return found if math.isfinite(found) else None
