"""Variables of a running program, formatted for display as short texts even if the values are large."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Literal

from msgspec import Meta, Struct

from app.blocks.model.program import Variable
from app.blocks.runtime import values
from nep.i18n import _

ValueKind = Literal["number", "text", "boolean", "list", "unknown", "other"]

MAX_TEXT_LENGTH = 200
MAX_ITEM_LENGTH = 80
MAX_ITEMS = 100
MAX_NESTING_DEPTH = 20
"""Maximum nesting depth of displayed values."""
MAX_TOTAL_CHARACTERS = 200_000
"""Number of characters after which `VariableWatch.changes` defers further variables to the next call."""
_MAX_PRINTED_BITS = 600
"""Maximum size in bits of a printed integer.

To save time, larger ones are shown as their number of digits.
"""
_ELLIPSIS = "…"


_Text = Annotated[str, Meta(max_length=MAX_TEXT_LENGTH)]
_Item = Annotated[str, Meta(max_length=MAX_ITEM_LENGTH)]


class VariableValue(Struct, frozen=True):
    """Value of a variable for display.

    Attributes:
        id: Id of the variable.
        kind: Kind of value: "number", "text", "boolean", "list", "unknown" or "other".
        text: Value as text, truncated.
        items: First items of a list as text, truncated.
        length: Length of a list, else 0.
    """

    id: str
    kind: ValueKind
    text: _Text
    items: Annotated[tuple[_Item, ...], Meta(max_length=MAX_ITEMS)] = ()
    length: int = 0


class VariableWatch:
    """Detector of changes in the variables of a program. Works in another thread without locking the program.

    Args:
        names: Global names of the program.
        variables: Variables of the behaviour.
    """

    def __init__(self, names: dict[str, object], variables: Sequence[Variable]) -> None:
        self._names = names
        self._variables = {variable.python: variable for variable in variables if variable.python}
        self._last_values: dict[str, object] = {}
        self._reported_values: dict[str, VariableValue] = {}

    def changes(self) -> list[VariableValue]:
        """Return the variables whose displayed value has changed since the last call.

        The first call returns all variables. Beyond `MAX_TOTAL_CHARACTERS`, the rest is left to the
        next call.
        """
        changed_values, characters = [], 0
        for python, variable in self._variables.items():
            if characters > MAX_TOTAL_CHARACTERS:
                break
            value = self._names.get(python)
            if python in self._reported_values and self._is_unchanged(python, value):
                continue
            try:
                display = display_value(variable.id, value)
            except RuntimeError:
                continue  # a script is changing the value; the next read gets it
            self._last_values[python] = _comparable(value)
            if display != self._reported_values.get(python):
                self._reported_values[python] = display
                changed_values.append(display)
                characters += len(display.text) + sum(map(len, display.items))
        return changed_values

    def set_value(self, python: str, value: str | float | bool) -> None:
        """Set a variable of the program.

        Args:
            python: Python name of the variable; names of other objects are ignored.
            value: New value.
        """
        if python in self._variables:
            self._names[python] = value

    def _is_unchanged(self, python: str, value: object) -> bool:
        last_seen = self._last_values.get(python)
        if isinstance(value, list):
            return (
                isinstance(last_seen, tuple)
                and last_seen == _comparable(value)
                and all(map(_is_plain, last_seen[1]))
            )
        return last_seen is value and _is_plain(value)


def _comparable(value: object) -> object:
    return (len(value), tuple(value[:MAX_ITEMS])) if isinstance(value, list) else value


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, (str, int, float))


def display_value(id: str, value: object) -> VariableValue:
    """Format the value of a variable for display.

    Args:
        id: Id of the variable.
        value: Value.

    Raises:
        RuntimeError: A script changed the value during the call.
    """
    if value is None:
        return VariableValue(id, "unknown", _("unknown"))
    if isinstance(value, (list, tuple)):
        items = tuple(limited_text(each, MAX_ITEM_LENGTH) for each in value[:MAX_ITEMS])
        return VariableValue(id, "list", limited_text(value, MAX_TEXT_LENGTH), items, len(value))
    kind: ValueKind = "other"
    if isinstance(value, bool):
        kind = "boolean"
    elif isinstance(value, (int, float)):
        kind = "number"
    elif isinstance(value, str):
        kind = "text"
    return VariableValue(id, kind, limited_text(value, MAX_TEXT_LENGTH))


def short_text(value: object) -> str:
    """Format a value as text of at most `MAX_TEXT_LENGTH` characters."""
    return limited_text(value, MAX_TEXT_LENGTH)


def limited_text(value: object, max_length: int) -> str:
    """Format a value as text of limited length; parts of the value that exceed the length aren't read.

    A very large integer is described by its approximate number of digits.

    Args:
        value: Value.
        max_length: Maximum number of characters.
    """
    if isinstance(value, str):
        return _truncate(value[: max_length + 1], max_length)
    if isinstance(value, int) and not isinstance(value, bool) and value.bit_length() > _MAX_PRINTED_BITS:
        digit_count = round(value.bit_length() * 0.30103)
        return _("a number with about {count} digits").format(count=digit_count)
    if isinstance(value, (list, tuple, Mapping)):
        parts: list[str] = []
        remaining = max_length
        for part in _text_parts(value, 0):
            parts.append(part)
            remaining -= len(part)
            if remaining < 0:
                break
        return _truncate("".join(parts), max_length)
    return _truncate(values.text(value), max_length)


def _text_parts(value: object, depth: int) -> Iterator[str]:
    if isinstance(value, Mapping):
        yield from _bracketed_parts("{", "}", ((f"{key}: ", each) for key, each in value.items()), depth)
    elif isinstance(value, (list, tuple)):
        yield from _bracketed_parts("[", "]", (("", each) for each in value), depth)
    else:
        yield limited_text(value, MAX_ITEM_LENGTH)


def _bracketed_parts(begin: str, end: str, parts: Iterator[tuple[str, object]], depth: int) -> Iterator[str]:
    if depth >= MAX_NESTING_DEPTH:
        yield _ELLIPSIS
        return
    yield begin
    for index, (name, value) in enumerate(parts):
        yield (", " if index else "") + name[:MAX_ITEM_LENGTH]
        if index >= MAX_ITEMS:
            yield _ELLIPSIS
            break
        yield from _text_parts(value, depth + 1)
    yield end


def _truncate(text: str, max_length: int) -> str:
    text = text.replace("\n", " ")
    return text if len(text) <= max_length else text[: max_length - 1] + _ELLIPSIS
