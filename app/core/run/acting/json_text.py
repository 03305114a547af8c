"""Text of a message that the user edits: JSON with placeholders, parsed while typing.

A placeholder is a name in braces in place of a value, outside of strings: ``{"yaw": {yaw}}``. Two
placeholders are filled in automatically for each message: ``{new id}`` is a unique string, ``{now}``
the time in seconds since 1970.
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

MAX_LENGTH = 256 * 1024
"""Maximum length of an editable text in characters; a longer text is not parsed while typing."""
NEW_ID, NOW = "new id", "now"
AUTOMATIC_PLACEHOLDERS: Mapping[str, Callable[[], object]] = {
    NEW_ID: lambda: uuid.uuid4().hex,
    NOW: lambda: round(time.time(), 6),
}
# Strings are matched first, so that braces inside them don't count; an open one ends with its line.
_PLACEHOLDER = re.compile(r'"(?:[^"\\\n]|\\.)*"?|\{ ?(?P<name>[^\W\d][\w ]{0,38}\w|[^\W\d]) ?\}')


class JsonText:
    """Parsed text of a message.

    Attributes:
        fault: Syntax error; None for valid JSON.
        placeholders: Names of the placeholders, in order of appearance.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.placeholders: tuple[str, ...] = ()
        self.fault: JsonFault | None = None
        self._spans: list[tuple[int, int, str]] = []
        if len(text) > MAX_LENGTH:
            reason = _("the text has more than {count} characters; send it with nep topic pub")
            self.fault = JsonFault(1, 1, reason.format(count=MAX_LENGTH))
            return
        for match in _PLACEHOLDER.finditer(text):
            if match["name"] is not None:
                self._spans.append((match.start(), match.end(), match["name"]))
        self.placeholders = tuple(dict.fromkeys(name for _start, _end, name in self._spans))
        # replaced by strings of the same length, so that every character stays in its position
        parts, position = [], 0
        for start, end, _name in self._spans:
            parts += [text[position:start], '"', text[start + 1 : end - 1], '"']
            position = end
        self.fault = find_json_fault("".join([*parts, text[position:]]))

    @property
    def manual_placeholders(self) -> tuple[str, ...]:
        """Names of the placeholders that the user must fill in."""
        return tuple(name for name in self.placeholders if name not in AUTOMATIC_PLACEHOLDERS)

    @property
    def has_automatic_placeholders(self) -> bool:
        """True if the text contains automatic placeholders, so that each message has different values."""
        return any(name in AUTOMATIC_PLACEHOLDERS for name in self.placeholders)

    def fill(self, values: Mapping[str, object]) -> object:
        """Return the value with all placeholders filled in.

        Raises `NepError` for invalid JSON or a missing value.

        Args:
            values: Values of the placeholders, by name.
        """
        if self.fault is not None:
            raise NepError(self.fault.message)
        missing = [name for name in self.manual_placeholders if name not in values]
        if missing:
            raise NepError(_("Fill in “{name}” first.").format(name=missing[0]))
        parts, position = [], 0
        for start, end, name in self._spans:
            value = AUTOMATIC_PLACEHOLDERS[name]() if name in AUTOMATIC_PLACEHOLDERS else values[name]
            parts += [self.text[position:start], json.dumps(value, ensure_ascii=False, allow_nan=False)]
            position = end
        filled = "".join([*parts, self.text[position:]])
        fault = find_json_fault(filled)
        if fault is not None:  # a number as a field name
            raise NepError(fault.message)
        parsed: object = json.loads(filled)
        return parsed


@lru_cache(maxsize=64)
def parse_json_text(text: str) -> JsonText:
    """Parse JSON text with placeholders. Cached, because lists request the same text on every refresh."""
    return JsonText(text)


def parse_typed_value(text: str) -> object:
    """Parse a value that the user typed: JSON, a number with a decimal comma, or else a string."""
    stripped = text.strip()
    if stripped and find_json_fault(stripped) is None:
        return json.loads(stripped)
    try:
        return parse_number(stripped) if "," in stripped else text
    except TypedNumberError:
        return text


def format_json(value: object) -> str:
    """Format a value as indented JSON.

    Of the values that JSON doesn't support, bytes become hexadecimal text, other iterables become
    arrays, and all others become strings.
    """
    return json.dumps(value, indent=2, ensure_ascii=False, default=_to_json_value)


def _to_json_value(value: object) -> object:
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, (bytes, bytearray, memoryview)):
        return bytes(value).hex(" ")
    try:
        return list(value)  # type: ignore[call-overload]  # any iterable
    except TypeError:
        return str(value)
