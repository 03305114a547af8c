"""How deep lists and maps may be nested in a message: 64 levels, in every codec.

Readers walk payloads recursively; a message of 2 kB with 1000 levels would end them with `RecursionError`.
The check of JSON reads the bytes before they are decoded: most messages have too few brackets to be deep, and
seeing that takes less than a microsecond.
"""

from __future__ import annotations

import re
from itertools import chain

from nep.i18n import _

__all__ = ["MAX_LEVELS", "json_is_too_deep", "packed_is_too_deep", "too_deep"]

MAX_LEVELS = 64
_COUNTED_BYTES = 4_096  # below this, counting all brackets takes less time than looking for the first ones
_SCANNED_BYTES = 65_536  # below this, counting the headers of lists and maps takes less time than a walk
_AS_LISTS = bytes.maketrans(b"{}", b"[]")
_NO_BRACKETS = bytes(each for each in range(256) if each not in b'[]{}"')
_NO_HEADERS = bytes(each for each in range(256) if not (0x80 <= each <= 0x9F or 0xDC <= each <= 0xDF))
_LISTS, _CONTAINERS, _NUMBERS = (list, tuple), (list, tuple, dict), (int, float)
_TEXT = re.compile(rb'"[^"]*"')


def too_deep() -> str:
    """Return the sentence for it."""
    return _("it has more than {levels} levels of lists and maps").format(levels=MAX_LEVELS)


def json_is_too_deep(data: bytes | memoryview) -> bool:
    """Return whether JSON has more than 64 levels. Anything else may give either answer."""
    size = len(data)
    if size <= 2 * MAX_LEVELS:
        return False
    data = bytes(data)
    if size <= _COUNTED_BYTES:
        if data.count(b"[") + data.count(b"{") <= MAX_LEVELS:
            return False
    elif not _has_many_brackets(data):
        return False
    return _levels_exceeded(_brackets(data))


def _has_many_brackets(data: bytes) -> bool:
    left = MAX_LEVELS
    for bracket in (b"[", b"{"):
        at = data.find(bracket)
        while at >= 0:
            left -= 1
            if left < 0:
                return True
            at = data.find(bracket, at + 1)
    return False


def _brackets(data: bytes) -> bytes:
    """All that is left of JSON but its brackets, as those of lists; without what is inside texts."""
    if b"\\" in data:
        data = data.replace(b"\\\\", b"").replace(b'\\"', b"")
    brackets = data.translate(_AS_LISTS, _NO_BRACKETS).replace(b'""', b"")
    return _TEXT.sub(b"", brackets) if b'"' in brackets else brackets


def _levels_exceeded(brackets: bytes) -> bool:
    for _level in range(MAX_LEVELS):
        inner = brackets.replace(b"[]", b"")
        if not inner:
            return False
        if len(inner) == len(brackets):  # they don't match: it is no JSON
            return inner.count(b"[") > MAX_LEVELS
        brackets = inner
    return True


def packed_is_too_deep(data: bytes | memoryview, value: object) -> bool:
    """Return whether a value has more than 64 levels; `data` is the value as msgpack."""
    size = len(data)
    if size <= MAX_LEVELS:
        return False
    if size <= _SCANNED_BYTES and len(bytes(data).translate(None, _NO_HEADERS)) <= MAX_LEVELS:
        return False
    return _value_is_too_deep(value)


def _value_is_too_deep(value: object) -> bool:
    level: list[object] = [value]
    for _level in range(MAX_LEVELS + 1):
        if _is_numbers(level):
            return False
        kinds = set(map(type, level))
        if not any(issubclass(kind, _CONTAINERS) for kind in kinds):
            return False
        lists = [each for each in level if isinstance(each, _LISTS)]
        maps = [each for each in level if isinstance(each, dict)]
        level = list(chain.from_iterable(lists))
        if maps:
            level.extend(chain.from_iterable(map(dict.values, maps)))
    return True


def _is_numbers(values: list[object]) -> bool:
    """Whether all are numbers, at the speed of C: a list or a map can't be added to a number."""
    if values and not isinstance(values[0], _NUMBERS):
        return False
    try:
        sum(values)  # type: ignore[arg-type]
    except TypeError:
        return False
    return True
