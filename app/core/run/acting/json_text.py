"""A message as a person types it: JSON with places for values, checked while it is typed.

A place is a name in braces where a value may stand, outside of texts: ``{"yaw": {yaw}}``. Two fill
themselves, anew for each message: ``{new id}`` is a text that nobody has used, ``{now}`` the seconds since
1970.
"""

from __future__ import annotations

import json
import re
import time
import uuid
from collections.abc import Callable, Mapping
from functools import lru_cache

from app.robots.description.typed_number import TypedNumberError, parse_number
from nep.errors import NepError
from nep.i18n import _
from nep.messages.json_fault import JsonFault, find_json_fault

MOST_LETTERS = 256 * 1024
"""Longer texts are not typed by hand, and are not read while one types."""
NEW_ID, NOW = "new id", "now"
AUTOMATIC: Mapping[str, Callable[[], object]] = {
    NEW_ID: lambda: uuid.uuid4().hex,
    NOW: lambda: round(time.time(), 6),
}
# A text comes first, so that braces inside of it are none; one that has no end goes to the end of its line.
_PLACE = re.compile(r'"(?:[^"\\\n]|\\.)*"?|\{ ?(?P<name>[^\W\d][\w ]{0,38}\w|[^\W\d]) ?\}')


class JsonText:
    """A text that was read: its ``fault`` (None: it is JSON), and the names of its ``places`` in order."""

    def __init__(self, text: str) -> None:
        """Read it; whatever it is, nothing is raised."""
        self.text = text
        self.places: tuple[str, ...] = ()
        self.fault: JsonFault | None = None
        self._spans: list[tuple[int, int, str]] = []
        if len(text) > MOST_LETTERS:
            reason = _("the text has more than {count} characters; send it with nep topic pub")
            self.fault = JsonFault(1, 1, reason.format(count=MOST_LETTERS))
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
        self.fault = find_json_fault("".join([*parts, text[after:]]))

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
        fault = find_json_fault(whole)
        if fault is not None:  # a number as the name of a field
            raise NepError(fault.sentence)
        made: object = json.loads(whole)
        return made


@lru_cache(maxsize=64)
def read_json(text: str) -> JsonText:
    """A text that was read, perhaps some time ago: lists ask for it again and again."""
    return JsonText(text)


def value_typed(text: str) -> object:
    """Return the value that a person typed: JSON or a number with a decimal comma, else the text itself."""
    said = text.strip()
    if said and find_json_fault(said) is None:
        return json.loads(said)
    try:
        return parse_number(said) if "," in said else text
    except TypedNumberError:
        return text


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
