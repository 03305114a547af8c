"""What programs do with values: pure functions, called by blocks of several categories."""

from __future__ import annotations

import json
import math
import random
import unicodedata
from collections.abc import Mapping, Sequence
from decimal import Decimal

from app.blocks.runtime.errors import BehaviourError, kind
from nep.i18n import _, lazy

LONGEST_TEXT = 1_000_000
MOST_BITS = 14_000
"""Python writes no whole number of more than 4300 digits; one of more bits is written as 1.2e+4932."""
_MOST_ROUNDS = 10**9
_JOINER = "\u200d"


def text(value: object) -> str:
    """A value as people say it: 2 for 2.0, yes and no, nothing for a value that is not known."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return _("yes") if value else _("no")
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return str(int(value))
    if isinstance(value, (Mapping, list, tuple)):
        try:
            return json.dumps(value, ensure_ascii=False, default=str)
        except ValueError:  # a number of too many digits somewhere, or a list that is in itself
            return json.dumps(_writable(value, ()), ensure_ascii=False, default=str)
    if isinstance(value, int) and value.bit_length() > MOST_BITS:
        return f"{Decimal(value):.16e}"
    return str(value)


def _writable(value: object, around: tuple[int, ...]) -> object:
    """The same with long numbers as their text; what is in itself, in one of ``around``, ends with "…"."""
    if isinstance(value, int) and value.bit_length() > MOST_BITS:
        return text(value)
    if not isinstance(value, (Mapping, list, tuple)):
        return value
    if id(value) in around:
        return "…"
    inside = (*around, id(value))
    if isinstance(value, Mapping):
        return {str(_writable(key, inside)): _writable(each, inside) for key, each in value.items()}
    return [_writable(each, inside) for each in value]


def is_known(value: object) -> bool:
    """Whether a sensor or topic has told this value."""
    return value is not None


def join(first: object, second: object) -> str:
    """Both as one text."""
    one, other = text(first), text(second)
    if len(one) + len(other) > LONGEST_TEXT:
        raise BehaviourError(
            _("This text is too long. Use at most {most} characters.").format(most=LONGEST_TEXT)
        )
    return one + other


def length(value: object) -> int:
    """How many letters a text has, how many things a list or message."""
    if isinstance(value, (list, tuple, Mapping)):
        return len(value)
    return len(letters(text(value)))


def letters(words: str) -> Sequence[str]:
    """The letters of a text as people see them: an accent or the colour of a skin is none of its own."""
    if words.isascii():
        return words
    found: list[str] = []
    for character in words:
        if found and _belongs(found[-1], character):
            found[-1] += character
        else:
            found.append(character)
    return found


def _belongs(before: str, character: str) -> bool:
    """Whether a character is a part of the letter before it."""
    if before[-1] == _JOINER or character in (_JOINER, "\ufe0f"):
        return True
    if "\U0001f3fb" <= character <= "\U0001f3ff" or "\U000e0020" <= character <= "\U000e007f":
        return True  # a colour of skin, the letters of a region's flag
    if "\U0001f1e6" <= character <= "\U0001f1ff":  # half a flag
        return len(before) == 1 and "\U0001f1e6" <= before <= "\U0001f1ff"
    return unicodedata.category(character) in ("Mn", "Me", "Mc")


def number(value: object, what: str) -> int | float:
    """The value, if it is a finite number; else BehaviourError, whose sentence begins with `what`."""
    if value is None:
        raise BehaviourError(
            _("{what} needs a value, but it has none yet.").format(what=_(what)), unknown=True
        )
    if not isinstance(value, (int, float)):
        raise BehaviourError(_("{what} needs a number, not {value}.").format(what=_(what), value=kind(value)))
    if not math.isfinite(value):
        raise BehaviourError(_("{what} needs a finite number.").format(what=_(what)))
    return value


def rounded(value: object) -> int:
    """The nearest whole number; halves go up."""
    return math.floor(number(value, lazy("“round”")) + 0.5)


def rounded_up(value: object) -> int:
    """The next whole number above."""
    return math.ceil(number(value, lazy("“round up”")))


def rounded_down(value: object) -> int:
    """The next whole number below."""
    return math.floor(number(value, lazy("“round down”")))


def random_number(low: object, high: object) -> int | float:
    """A number by chance between both; a whole one when both are whole."""
    first, last = number(low, lazy("“random number”")), number(high, lazy("“random number”"))
    first, last = min(first, last), max(first, last)
    if float(first).is_integer() and float(last).is_integer():
        return random.randint(int(first), int(last))  # noqa: S311 (a game, no secret)
    return random.uniform(first, last)  # noqa: S311 (a game, no secret)


def repeat(times: object) -> range:
    """So many rounds; a fraction is rounded, below 0 is none."""
    return range(max(0, min(rounded(number(times, lazy("“repeat”"))), _MOST_ROUNDS)))


def part(message: object, path: str) -> object:
    """What is at a path inside a message, such as ``faces.0.name``; None when it is not there.

    An empty path is the whole message; ``value`` of a plain value is that value. A list is a copy: what a
    program does with it does not change the message.
    """
    found = _found(message, path)
    return list(found) if isinstance(found, list) else found


def _found(message: object, path: str) -> object:
    if not path:
        return message
    if isinstance(message, Mapping) and path in message:
        return message[path]
    if path == "value" and not isinstance(message, (Mapping, list, tuple)):
        return message
    found = message
    for name in path.split("."):
        found = _member(found, name)
    return found


def _member(value: object, name: str) -> object:
    if isinstance(value, Mapping):
        return value.get(name)
    if isinstance(value, Sequence) and not isinstance(value, str) and name.lstrip("-").isdecimal():
        index = int(name)
        return value[index] if -len(value) <= index < len(value) else None
    return None
