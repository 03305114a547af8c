"""A message as a person types it: JSON with places for values, checked while it is typed.

A place is a name in braces where a value may stand, outside of texts: ``{"yaw": {yaw}}``. Two fill
themselves, anew for each message: ``{new id}`` is a text that nobody has used, ``{now}`` the seconds since
1970.
"""

from __future__ import annotations

import json
import math
import re
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

from nep.errors import NepError
from nep.i18n import _
from nep.text import shortened

MOST_LETTERS = 256 * 1024
"""Longer texts are not typed by hand, and are not read while one types."""
NEW_ID, NOW = "new id", "now"
AUTOMATIC: Mapping[str, Callable[[], object]] = {
    NEW_ID: lambda: uuid.uuid4().hex,
    NOW: lambda: round(time.time(), 6),
}
_SHOWN = 30
# A text comes first, so that braces inside of it are none; one that has no end goes to the end of its line.
_PLACE = re.compile(r'"(?:[^"\\\n]|\\.)*"?|\{ ?(?P<name>[^\W\d][\w ]{0,38}\w|[^\W\d]) ?\}')
_TEXT_OR_CONSTANT = re.compile(r'"(?:[^"\\\n]|\\.)*"?|(?P<constant>-?\b(?:NaN|Infinity)\b)')
_WORD = re.compile(r"[^\W\d][\w.-]*")
_CLOSING = {"{": "}", "[": "]"}
_OTHER_LANGUAGES = {"True": "true", "False": "false", "None": "null", "undefined": "null", "nil": "null"}


@dataclass(frozen=True, slots=True)
class JsonMend:
    """What makes it right: the letters from ``start`` to ``end`` become ``text``."""

    start: int
    end: int
    text: str


@dataclass(frozen=True, slots=True)
class JsonFault:
    """Where a text is no JSON: ``line`` and ``column`` from 1, a ``sentence``, and perhaps what mends it."""

    line: int
    column: int
    sentence: str
    mend: JsonMend | None = None


class JsonText:
    """A text that was read: its ``fault`` (None: it is JSON), and the names of its ``places`` in order."""

    def __init__(self, text: str) -> None:
        """Read it; whatever it is, nothing is raised."""
        self.text = text
        self.places: tuple[str, ...] = ()
        self.fault: JsonFault | None = None
        self._spans: list[tuple[int, int, str]] = []
        if len(text) > MOST_LETTERS:
            said = _("The text has more than {count} letters; send it by nep topic pub.")
            self.fault = JsonFault(1, 1, said.format(count=MOST_LETTERS))
            return
        for found in _PLACE.finditer(text):
            if found["name"] is not None:
                self._spans.append((found.start(), found.end(), found["name"]))
        self.places = tuple(dict.fromkeys(name for _start, _end, name in self._spans))
        # as texts of the same length they are values, and every letter stays where it is
        parts, after = [], 0
        for start, end, _name in self._spans:
            parts += [text[after:start], '"', text[start + 1 : end - 1], '"']
            after = end
        self.fault = _fault_of("".join([*parts, text[after:]]))

    @property
    def to_fill(self) -> tuple[str, ...]:
        """The places that a person fills."""
        return tuple(name for name in self.places if name not in AUTOMATIC)

    @property
    def fills_itself(self) -> bool:
        """Whether it is another message each time."""
        return any(name in AUTOMATIC for name in self.places)

    def filled(self, values: Mapping[str, object]) -> object:
        """The value with these in its places. Raises `NepError` with a sentence for what can't be made."""
        if self.fault is not None:
            raise NepError(self.fault.sentence)
        missing = [name for name in self.to_fill if name not in values]
        if missing:
            raise NepError(_("Fill in “{name}” first.").format(name=missing[0]))
        parts, after = [], 0
        for start, end, name in self._spans:
            value = AUTOMATIC[name]() if name in AUTOMATIC else values[name]
            parts += [self.text[after:start], json.dumps(value, ensure_ascii=False, allow_nan=False)]
            after = end
        whole = "".join([*parts, self.text[after:]])
        fault = _fault_of(whole)
        if fault is not None:  # a number as the name of a field
            raise NepError(fault.sentence)
        made: object = json.loads(whole)
        return made


@lru_cache(maxsize=64)
def read_json(text: str) -> JsonText:
    """A text that was read, perhaps some time ago: lists ask for it again and again."""
    return JsonText(text)


def value_typed(text: str) -> object:
    """What a person means by a value: JSON where it is some, else the text itself."""
    said = text.strip()
    return json.loads(said) if said and _fault_of(said) is None else text


def pretty(value: object) -> str:
    """A value as a person reads and changes it; what no JSON has stands as text."""
    return json.dumps(value, indent=2, ensure_ascii=False, default=_otherwise)


def _otherwise(value: object) -> object:
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, (bytes, bytearray, memoryview)):
        return bytes(value).hex(" ")
    try:
        return list(value)  # type: ignore[call-overload]  # whatever can be listed
    except TypeError:
        return str(value)


# ---- why it is no JSON


def _fault_of(text: str) -> JsonFault | None:
    try:
        json.loads(text, parse_constant=_refuse, parse_float=_finite)
    except json.JSONDecodeError as error:
        return _explained(text, error)
    except _ConstantError:
        return _constant(text)
    except RecursionError:
        return JsonFault(1, 1, _("It has too many levels."))
    except ValueError:  # Python reads no numbers of thousands of digits, and 1e999 as infinity
        return JsonFault(1, 1, _("A number is too large to be sent."))
    return None


class _ConstantError(Exception):
    pass


def _refuse(_constant: str) -> object:
    raise _ConstantError


def _finite(digits: str) -> float:
    value = float(digits)
    if math.isinf(value):
        raise ValueError(digits)
    return value


def _constant(text: str) -> JsonFault:
    found = next(each for each in _TEXT_OR_CONSTANT.finditer(text) if each["constant"] is not None)
    said = _("Line {line} has {word}, which JSON does not know; null stands for no value.")
    return _at(text, found.start(), said, word=found[0], mend=JsonMend(found.start(), found.end(), "null"))


def _at(text: str, place: int, sentence: str, *, mend: JsonMend | None = None, **holes: str) -> JsonFault:
    line = text.count("\n", 0, place) + 1
    column = place - (text.rfind("\n", 0, place) + 1) + 1
    return JsonFault(line, column, sentence.format(line=line, **holes), mend)


def _explained(text: str, error: json.JSONDecodeError) -> JsonFault:
    place, said = error.pos, error.msg
    if not text.strip():
        return _at(text, 0, _("Write the message as JSON, such as {example}."), example='{"x": 1}')
    if said.startswith(("Unterminated", "Invalid control")):
        return _open_text(text, place)
    if said.startswith("Invalid \\"):
        mend = JsonMend(place, place, "\\") if text[place : place + 1] == "\\" else None
        return _at(text, place, _("Line {line} has a single \\; inside a text write \\\\."), mend=mend)
    if said.startswith("Extra data"):
        return _at(text, place, _("Line {line} goes on after the end of the message."))
    if said.startswith("Illegal trailing comma"):
        return _comma_too_many(text, text.rfind(",", 0, place + 1))
    return _unexpected(text, place, said)


def _unexpected(text: str, place: int, said: str) -> JsonFault:
    """Something else stands there than must."""
    here, end = text[place : place + 1], len(text[:place].rstrip())
    last = text[end - 1 : end]
    if here in {"}", "]"} and last == ",":
        return _comma_too_many(text, end - 1)
    if said.startswith("Expecting ':'"):
        return _at(text, end, _("Line {line} needs a colon after the name."), mend=JsonMend(end, end, ":"))
    if not here:
        return _no_end(text, end)
    if said.startswith("Expecting ','"):
        return _no_comma(text, place, end)
    if here in {"}", "]", ","} and last == ":":
        return _at(text, end, _("Line {line} has no value after the colon."))
    return _no_value(text, place, is_name=said.startswith("Expecting property name"))


def _comma_too_many(text: str, place: int) -> JsonFault:
    return _at(
        text, place, _("Line {line} has a comma too many at its end."), mend=JsonMend(place, place + 1, "")
    )


def _no_comma(text: str, place: int, end: int) -> JsonFault:
    here = text[place]
    if here in {"}", "]"}:
        return _at(text, place, _("Line {line} closes with {sign} what was opened otherwise."), sign=here)
    if place == end and (here.isalnum() or here in "._"):
        return _at(text, place, _("Line {line} has a number that JSON does not know."))
    goes_on = text[end : text.find("\n", end) if "\n" in text[end:] else len(text)].strip()
    said = (
        _("Line {line} needs a comma between two values.")
        if goes_on
        else _("Line {line} needs a comma at its end.")
    )
    return _at(text, end, said, mend=JsonMend(end, end, ","))


def _no_end(text: str, end: int) -> JsonFault:
    """The text ends before the message does."""
    opened: list[str] = []
    for found in re.finditer(r'"(?:[^"\\\n]|\\.)*"|[{}\[\]]', text):
        sign = found[0]
        if sign in _CLOSING:
            opened.append(sign)
        elif sign in {"}", "]"} and opened:
            opened.pop()
    if not opened:
        return _at(text, end, _("Line {line} has no value at its end."))
    missing = "".join(_CLOSING[sign] for sign in reversed(opened))
    mend = JsonMend(end, end, missing) if text[end - 1] not in ",:" else None
    return _at(text, end, _("{signs} is missing at the end, after line {line}."), signs=missing, mend=mend)


def _no_value(text: str, place: int, *, is_name: bool) -> JsonFault:
    here = text[place]
    word = _WORD.match(text, place)
    if here == "'":
        end = text.find("'", place + 1)
        inside = text[place + 1 : end] if end > place else ""
        is_plain = bool(inside) and not any(sign in inside for sign in '"\\\n')
        mend = JsonMend(place, end + 1, f'"{inside}"') if is_plain else None
        return _at(text, place, _("Line {line} has single quotes; JSON takes double ones."), mend=mend)
    if word is None:
        said = (
            _("Line {line} needs a name in quotes here.") if is_name else _("Line {line} needs a value here.")
        )
        return _at(text, place, said)
    known = _OTHER_LANGUAGES.get(word[0])
    if known is not None and not is_name:
        said = _("Line {line} has {word}; JSON writes {right}.")
        mend = JsonMend(place, word.end(), known)
        return _at(text, place, said, word=word[0], right=known, mend=mend)
    said = _("Line {line} needs quotes around {word}.")
    mend = JsonMend(place, word.end(), f'"{word[0]}"')
    return _at(text, place, said, word=shortened(word[0], _SHOWN), mend=mend)


def _open_text(text: str, place: int) -> JsonFault:
    """A text has no closing quote, or a sign inside that no text has."""
    sign = text[place : place + 1]
    if sign == "\t":
        mend = JsonMend(place, place + 1, "\\t")
        return _at(text, place, _("Line {line} has a tab inside a text; write \\t."), mend=mend)
    if sign and sign not in {'"', "\n", "\r"}:
        return _at(text, place, _("Line {line} has a sign inside a text that can't be seen; delete it."))
    start = text.rfind("\n", 0, place) + 1
    end = text.find("\n", place)
    line = text[start : end if end >= 0 else len(text)].rstrip()
    close = start + len(line[:-1].rstrip() if line.endswith(",") else line)
    said = _("Line {line} has a text without a closing quote.")
    return _at(text, place, said, mend=JsonMend(close, close, '"'))
