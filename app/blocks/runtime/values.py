"""Functions on values that blocks of several categories use. The functions have no side effects."""

from __future__ import annotations

import json
import math
import random
import unicodedata
from collections.abc import Mapping, Sequence
from decimal import Decimal

from app.blocks.runtime.errors import BehaviourError, type_name
from nep.i18n import _, lazy

MAX_TEXT_LENGTH = 1_000_000
MAX_BITS = 14_000
"""Maximum size in bits of an integer that is printed with all digits; larger ones are shown as 1.2e+4932.

Python doesn't print integers with more than 4300 digits.
"""
_MAX_ITERATIONS = 10**9
_ZERO_WIDTH_JOINER = "\u200d"


def text(value: object) -> str:
    """Convert a value to text for the user: "2" for 2.0, "yes" for True, "" for an unknown value.

    Lists and mappings become JSON, very large integers a number with an exponent.
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return _("yes") if value else _("no")
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return str(int(value))
    if isinstance(value, (Mapping, list, tuple)):
        try:
            return json.dumps(value, ensure_ascii=False, default=str)
        except ValueError:  # an integer with too many digits, or a list that contains itself
            return json.dumps(_to_json_safe(value, ()), ensure_ascii=False, default=str)
    if isinstance(value, int) and value.bit_length() > MAX_BITS:
        return f"{Decimal(value):.16e}"
    return str(value)


def _to_json_safe(value: object, enclosing_ids: tuple[int, ...]) -> object:
    if isinstance(value, int) and value.bit_length() > MAX_BITS:
        return text(value)
    if not isinstance(value, (Mapping, list, tuple)):
        return value
    if id(value) in enclosing_ids:
        return "…"
    ancestors = (*enclosing_ids, id(value))
    if isinstance(value, Mapping):
        return {
            str(_to_json_safe(key, ancestors)): _to_json_safe(each, ancestors) for key, each in value.items()
        }
    return [_to_json_safe(each, ancestors) for each in value]


def is_known(value: object) -> bool:
    """Return True if a value is not None, which stands for an unknown value."""
    return value is not None


def join(first: object, second: object) -> str:
    """Convert two values to text and concatenate them. Raises BehaviourError if the text is too long."""
    one, other = text(first), text(second)
    if len(one) + len(other) > MAX_TEXT_LENGTH:
        raise BehaviourError(
            _("This text is too long. Use at most {most} characters.").format(most=MAX_TEXT_LENGTH)
        )
    return one + other


def length(value: object) -> int:
    """Return the number of characters of a text, or of items of a list or message."""
    if isinstance(value, (list, tuple, Mapping)):
        return len(value)
    return len(grapheme_clusters(text(value)))


def grapheme_clusters(string: str) -> Sequence[str]:
    """Split a text into grapheme clusters: accents and skin tones belong to the previous character."""
    if string.isascii():
        return string
    clusters: list[str] = []
    for character in string:
        if clusters and _is_combining(clusters[-1], character):
            clusters[-1] += character
        else:
            clusters.append(character)
    return clusters


def _is_combining(previous: str, character: str) -> bool:
    if previous[-1] == _ZERO_WIDTH_JOINER or character in (_ZERO_WIDTH_JOINER, "\ufe0f"):
        return True
    if "\U0001f3fb" <= character <= "\U0001f3ff" or "\U000e0020" <= character <= "\U000e007f":
        return True  # skin tones, letters of a region's flag
    if "\U0001f1e6" <= character <= "\U0001f1ff":  # second half of a flag
        return len(previous) == 1 and "\U0001f1e6" <= previous <= "\U0001f1ff"
    return unicodedata.category(character) in ("Mn", "Me", "Mc")


def number(value: object, label: str) -> int | float:
    """Return a value if it is a finite number.

    Args:
        value: Value to check.
        label: Start of the error message: name of the block, marked for translation.

    Raises:
        BehaviourError: The value is unknown or not a finite number.
    """
    if value is None:
        raise BehaviourError(
            _("{what} can't run: one of its values isn't known yet.").format(what=_(label)),
            is_value_unknown=True,
        )
    if not isinstance(value, (int, float)):
        raise BehaviourError(
            _("{what} needs a number, not {value}.").format(what=_(label), value=type_name(value))
        )
    if not math.isfinite(value):
        raise BehaviourError(_("{what} needs a finite number.").format(what=_(label)))
    return value


def rounded(value: object) -> int:
    """Return the nearest integer; halves are rounded up."""
    return math.floor(number(value, lazy("“round”")) + 0.5)


def rounded_up(value: object) -> int:
    """Return the smallest integer that is not less than a number."""
    return math.ceil(number(value, lazy("“round up”")))


def rounded_down(value: object) -> int:
    """Return the largest integer that is not greater than a number."""
    return math.floor(number(value, lazy("“round down”")))


def random_number(low: object, high: object) -> int | float:
    """Return a random number between two limits, inclusive; an integer if both limits are integers."""
    first, last = number(low, lazy("“random number”")), number(high, lazy("“random number”"))
    first, last = min(first, last), max(first, last)
    if float(first).is_integer() and float(last).is_integer():
        return random.randint(int(first), int(last))  # noqa: S311 (a game, no secret)
    return random.uniform(first, last)  # noqa: S311 (a game, no secret)


def repeat(times: object) -> range:
    """Return the range for a loop; the number of iterations is rounded, and 0 if negative."""
    return range(max(0, min(rounded(number(times, lazy("“repeat”"))), _MAX_ITERATIONS)))


def part(message: object, path: str) -> object:
    """Return the value at a field path in a message, such as ``faces.0.name``; None if missing.

    A list is copied, so that changes don't affect the message.

    Args:
        message: Payload of the message.
        path: Field path; "" for the whole message. The path ``value`` of a plain value is the value itself.
    """
    value = _value_at(message, path)
    return list(value) if isinstance(value, list) else value


def _value_at(message: object, path: str) -> object:
    if not path:
        return message
    if isinstance(message, Mapping) and path in message:
        return message[path]
    if path == "value" and not isinstance(message, (Mapping, list, tuple)):
        return message
    value = message
    for name in path.split("."):
        value = _member(value, name)
    return value


def _member(value: object, name: str) -> object:
    if isinstance(value, Mapping):
        return value.get(name)
    if isinstance(value, Sequence) and not isinstance(value, str) and name.lstrip("-").isdecimal():
        index = int(name)
        return value[index] if -len(value) <= index < len(value) else None
    return None
