"""Limit for nested lists and maps in a message: 64 levels, in every codec.

Readers walk payloads recursively; a message of 2 kB with 1000 levels would raise `RecursionError` in them.
JSON is checked before decoding; most messages have too few brackets to exceed the limit, which takes less
than 1 µs to detect. msgpack is checked after decoding, with the traversal of the garbage collector, which
takes a quarter of the time of a Python loop.
"""

from __future__ import annotations

import gc
import re
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from datetime import datetime

from nep.i18n import _

MAX_LEVELS = 64
_MAX_COUNTED_BYTES = 4_096  # up to this size, all brackets or headers are counted in less than 3 µs
_TO_LIST_BRACKETS = bytes.maketrans(b"{}", b"[]")
_NON_BRACKETS = bytes(each for each in range(256) if each not in b'[]{}"')
_NON_HEADERS = bytes(each for each in range(256) if not (0x80 <= each <= 0x9F or 0xDC <= each <= 0xDF))
_CONTAINER_TYPES = (list, tuple, dict)
_PLAIN_TYPES = frozenset((*_CONTAINER_TYPES, str, bytes, int, float, bool, datetime, type(None)))
_STRING_LITERAL = re.compile(rb'"[^"]*"')


def too_deep_reason() -> str:
    """Return the reason, in the current language, for rejecting a payload with too many levels."""
    return _("the value has more than {levels} levels of lists and maps").format(levels=MAX_LEVELS)


def is_json_too_deep(data: bytes | memoryview) -> bool:
    """Return True if JSON has more than 64 levels. The result for invalid JSON is undefined."""
    size = len(data)
    if size <= 2 * MAX_LEVELS:
        return False
    data = bytes(data)
    if size <= _MAX_COUNTED_BYTES:
        if data.count(b"[") + data.count(b"{") <= MAX_LEVELS:
            return False
    elif not _has_many_brackets(data):
        return False
    return _exceeds_levels(_extract_brackets(data))


def _has_many_brackets(data: bytes) -> bool:
    remaining = MAX_LEVELS
    for bracket in (b"[", b"{"):
        position = data.find(bracket)
        while position >= 0:
            remaining -= 1
            if remaining < 0:
                return True
            position = data.find(bracket, position + 1)
    return False


def _extract_brackets(data: bytes) -> bytes:
    # Reduces JSON to its brackets, outside of strings, all as list brackets.
    if b"\\" in data:
        data = data.replace(b"\\\\", b"").replace(b'\\"', b"")
    brackets = data.translate(_TO_LIST_BRACKETS, _NON_BRACKETS).replace(b'""', b"")
    return _STRING_LITERAL.sub(b"", brackets) if b'"' in brackets else brackets


def _exceeds_levels(brackets: bytes) -> bool:
    for _level in range(MAX_LEVELS):
        inner = brackets.replace(b"[]", b"")
        if not inner:
            return False
        if len(inner) == len(brackets):  # unbalanced: invalid JSON
            return inner.count(b"[") > MAX_LEVELS
        brackets = inner
    return True


def is_packed_too_deep(data: bytes | memoryview, value: object) -> bool:
    """Return True if a value has more than 64 levels; `data` is its msgpack encoding."""
    size = len(data)
    if size <= MAX_LEVELS:
        return False
    if size <= _MAX_COUNTED_BYTES and len(bytes(data).translate(None, _NON_HEADERS)) <= MAX_LEVELS:
        return False
    return _may_be_too_deep(value) and _is_too_deep(value)


def _may_be_too_deep(value: object) -> bool:
    # False only for plain types with at most 64 levels. Keys count as values here, so tuples as keys may
    # cause a false True. Other types end the traversal: an instance would lead to its class, module and the
    # whole program.
    level: list[object] = [value]
    for _level in range(MAX_LEVELS):
        inner = gc.get_referents(*level)
        if not inner:
            return False
        if not _PLAIN_TYPES.issuperset(map(type, level)):
            return True
        level = inner
    return True


def _is_too_deep(value: object) -> bool:
    level: list[object] = [value]
    for _level in range(MAX_LEVELS + 1):
        kinds = {
            kind for kind in set(map(type, level)) if issubclass(kind, _CONTAINER_TYPES) or is_dataclass(kind)
        }
        if not kinds:
            return False
        level = [inner for each in level if type(each) in kinds for inner in _members(each)]
    return True


def _members(value: object) -> Iterable[object]:
    # Values of a list, map, or dataclass, without private fields.
    if isinstance(value, dict):
        return value.values()
    if isinstance(value, (list, tuple)):
        return value
    names = [field.name for field in fields(value)]  # type: ignore[arg-type]
    return [getattr(value, name) for name in names if not name.startswith("_")]
