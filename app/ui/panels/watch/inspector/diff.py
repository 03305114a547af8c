"""Comparison of two messages, level by level; lists are compared by index."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Final, Literal

import orjson

from app.core.messages.inspected import NO_BASE, Sentinel
from app.core.messages.lazy_json import LazyList, LazyObject
from app.ui.panels.watch.inspector.values import is_container, keys_of, size_of, values_of
from nep.i18n import _, lazy, ngettext

Mark = Literal["", "changed", "added", "removed"]
Key = str | int
MAX_CHILDREN = 5000  # maximum number of a value's children that are checked for changes
MAX_COUNTED_VALUES = 20_000  # maximum number of a message's values that are counted
ChildDiff = tuple[Key, object, object, Mark]
Counts = dict[Mark, int]
MARK_TEXTS: Mapping[Mark, str] = {
    "changed": lazy("changed"),
    "added": lazy("added"),
    "removed": lazy("removed"),
}


MISSING: Final = Sentinel("missing")


def differs(before: object, after: object) -> bool:
    """Return True if two values differ. NaN equals NaN; 1 differs from true and from 1.0."""
    if before is after or (before != before and after != after):  # noqa: PLR0124
        return False
    if is_container(before) and is_container(after):
        return _kind(before) != _kind(after) or not _are_equal(before, after)
    return type(before) is not type(after) or before != after


def mark_of(value: object, base: object) -> Mark:
    """Return the kind of difference between a value and its counterpart in the base message.

    Args:
        value: Value in the message shown; `MISSING` if it was removed.
        base: Value in the base message; `MISSING` if it was added, `NO_BASE` without a base message.

    Returns:
        "changed", "added" or "removed"; "" for equal values and without a base message.
    """
    if base is NO_BASE:
        return ""
    if base is MISSING:
        return "added"
    if value is MISSING:
        return "removed"
    return "changed" if differs(base, value) else ""


def child_diffs(
    value: object, base: object, mark: Mark, count: int, *, changes_only: bool
) -> tuple[list[ChildDiff], int]:
    """Return the first children of a value with their differences.

    Removed children follow the present ones, with their old values. All children of an added value count as
    added, and all children of a removed value as removed. If an object became a list or vice versa, or
    wasn't a container before, all of its children count as added.

    Args:
        value: Object or list.
        base: Its counterpart in the base message.
        mark: Kind of difference between `value` and `base`.
        count: Maximum number of children to return.
        changes_only: True to omit equal children. Only the first `MAX_CHILDREN` children are compared.

    Returns:
        Key, value, base value (`MISSING` for added and removed children) and kind of difference of each
        child, and the total number of children, with `changes_only` only of those that differ.
    """
    if mark in {"added", "removed"} or not is_container(base) or _kind(base) != _kind(value):
        child_mark: Mark = "removed" if mark == "removed" else "added"
        pairs = zip(keys_of(value, count), values_of(value, count), strict=False)
        return [(key, below, MISSING, child_mark) for key, below in pairs], size_of(value)
    if changes_only:
        changed = [part for part in islice(_compare_children(value, base), MAX_CHILDREN) if part[3]]
        return changed[:count], len(changed)
    return list(islice(_compare_children(value, base), count)), _child_count(value, base)


def count_changes(value: object, base: object, max_values: int = MAX_COUNTED_VALUES) -> tuple[Counts, bool]:
    """Count the changed, added and removed values of a message.

    An added or removed object or list counts as one value.

    Args:
        value: Message to check.
        base: Base message.
        max_values: Maximum number of values to compare. In long lists only the beginning is compared.

    Returns:
        The counts by kind of difference, and True if they are complete.
    """
    counts: Counts = {"changed": 0, "added": 0, "removed": 0}
    if base is NO_BASE:
        return counts, True
    is_complete = True
    waiting: list[tuple[object, object, Mark]] = [(value, base, mark_of(value, base))]
    compared_count = 0
    while waiting and compared_count < max_values:
        current, before, mark = waiting.pop()
        compared_count += 1
        if mark == "changed" and is_container(current) and is_container(before):
            parts, _total = child_diffs(current, before, mark, max_values, changes_only=True)
            is_complete = is_complete and max(size_of(current), size_of(before)) <= MAX_CHILDREN
            waiting += [(below, was, how) for _key, below, was, how in parts]
        elif mark:
            counts[mark] += 1
    return counts, is_complete and not waiting


def changes_text(counts: Counts, is_complete: bool = True) -> str:
    """Format counts as ``3 changed, 1 added`` or ``no difference``.

    Args:
        counts: Number of values by kind of difference.
        is_complete: False if the counts are incomplete; "at least" is added then.
    """
    text = ", ".join(_count_text(mark, count) for mark, count in counts.items() if count)
    if not text:
        return _("no difference") if is_complete else _("no difference at the start of long lists")
    return text if is_complete else _("at least {changes}").format(changes=text)


def _count_text(mark: Mark, count: int) -> str:
    if mark == "added":
        return ngettext("{count} added", "{count} added", count).format(count=count)
    if mark == "removed":
        return ngettext("{count} removed", "{count} removed", count).format(count=count)
    return ngettext("{count} changed", "{count} changed", count).format(count=count)


def _compare_children(value: object, base: object) -> Iterator[ChildDiff]:
    # Lazy, because callers may need only the first children.
    if isinstance(value, Mapping) and isinstance(base, Mapping):
        before = {str(key): key for key in base}
        for key, below in value.items():
            base_key = before.pop(str(key), MISSING)
            was = MISSING if base_key is MISSING else base[base_key]
            yield str(key), below, was, mark_of(below, was)
        for name, key in before.items():
            yield name, base[key], MISSING, "removed"
    elif isinstance(value, Sequence) and isinstance(base, Sequence):
        for row, below in enumerate(value):
            was = base[row] if row < len(base) else MISSING
            yield row, below, was, mark_of(below, was)
        for row in range(len(value), len(base)):
            yield row, base[row], MISSING, "removed"


def _child_count(value: object, base: object) -> int:
    if isinstance(value, Mapping) and isinstance(base, Mapping):
        return len({str(key) for key in value} | {str(key) for key in base})
    return max(size_of(value), size_of(base))


def _kind(value: object) -> str:
    return "object" if isinstance(value, Mapping) else "list"


def _are_equal(before: object, after: object) -> bool:
    # Equality at every depth, in which true is not 1 and the order of keys is ignored. Lazy containers
    # compare their JSON texts.
    if isinstance(before, (LazyList, LazyObject)) and isinstance(after, (LazyList, LazyObject)):
        return before == after
    if size_of(before) != size_of(after):
        return False
    serialized = _serialize(before)
    if serialized != _serialize(after):
        return False
    may_have_nan = isinstance(serialized, bytes) and b"null" in serialized  # orjson serializes NaN as null
    return not may_have_nan or _dump_with_nan(before) == _dump_with_nan(after)


def _dump_with_nan(value: object) -> str:
    # JSON text with NaN; "" if keys of several types can't be sorted or the nesting is too deep.
    try:
        return json.dumps(value, sort_keys=True)
    except (TypeError, RecursionError):
        return ""


def _serialize(value: object) -> object:
    # Serialized values compare as JSON does: true isn't 1, and the order of keys is ignored. Values that
    # JSON lacks (bytes in msgpack) are returned unchanged.
    try:
        return orjson.dumps(value, option=orjson.OPT_SORT_KEYS | orjson.OPT_NON_STR_KEYS)
    except (TypeError, RecursionError):
        return value
