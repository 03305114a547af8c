"""Copying, size estimates and comparison of blackboard values. Performs no input or output."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping

from nep.programs.blackboard.keys import MAX_LEVELS, Key

_MAX_DEPTH = 100
_SCALAR_TYPES = frozenset({int, float, bool, type(None)})
_NUMBER_BYTES = 40
_ITEM_BYTES = 8


def deep_copy(value: object, depth: int = _MAX_DEPTH) -> object:
    """Return a deep copy of a value's lists and maps.

    Tuples become lists, and mutable buffers become bytes. Other objects are not copied.

    Args:
        value: Value to copy.
        depth: Maximum number of nested levels.

    Raises:
        ValueError: The value is nested too deeply or contains itself.
    """
    if isinstance(value, list | tuple):
        if _has_only_numbers(value):
            return list(value)
        return [deep_copy(each, _decrement_depth(depth)) for each in value]
    if isinstance(value, Mapping):
        return {key: deep_copy(each, _decrement_depth(depth)) for key, each in value.items()}
    return bytes(value) if isinstance(value, bytearray | memoryview) else value


def _decrement_depth(depth: int) -> int:
    if depth <= 0:
        raise ValueError(f"{_MAX_DEPTH}")
    return depth - 1


def _has_only_numbers(value: list[object] | tuple[object, ...]) -> bool:
    return _SCALAR_TYPES.issuperset(map(type, value))


def size_of(value: object) -> int:
    """Return the approximate memory use of a value in bytes."""
    size, pending = 0, [value]
    while pending:
        each = pending.pop()
        if isinstance(each, list | tuple):
            size += sys.getsizeof(each)
            if _has_only_numbers(each):
                size += _NUMBER_BYTES * len(each)
            else:
                pending += each
        elif isinstance(each, Mapping):
            size += sys.getsizeof(each)
            pending += each
            pending += each.values()
        else:
            nbytes = getattr(each, "nbytes", None)  # nbytes: an array may be a view, which is small by itself
            size += nbytes if isinstance(nbytes, int) else sys.getsizeof(each, _ITEM_BYTES)
    return size


def is_same(value: object, other: object) -> bool:
    """Return True if two values are equal and of the same type; NaN equals NaN.

    Values that can't be compared, such as two arrays, are different unless they are the same object.
    """
    if value is other:
        return True
    if type(value) is not type(other):
        return False
    if isinstance(value, float) and isinstance(other, float) and math.isnan(value) and math.isnan(other):
        return True
    try:
        return bool(value == other)
    except Exception:  # noqa: BLE001 - arrays compare element-wise, and values may be of any class
        return False


def leaves(value: object, key: Key = ()) -> Iterator[tuple[Key, object]]:
    """Yield the (key, value) pairs of a nested map.

    A value that is not a map, an empty map, a map with keys other than text and whole numbers, and a map
    that is nested too deeply are yielded as one value.

    Args:
        value: Map or other value.
        key: Key of `value`, with which the yielded keys start.
    """
    if not isinstance(value, Mapping) or not value or len(key) >= MAX_LEVELS or not _has_valid_names(value):
        yield key, value
        return
    for name, child in value.items():
        yield from leaves(child, (*key, str(name)))


def _has_valid_names(value: Mapping[object, object]) -> bool:
    return all(isinstance(name, str) or type(name) is int for name in value)
