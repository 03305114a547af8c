"""How two messages differ, level by level: what was changed, added or removed; lists by index."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

import orjson

from app.core.lazy_json import LazyList, LazyObject
from app.ui.tree_values import is_container, keys_of, size_of, values_of

Mark = Literal["", "changed", "added", "removed"]
Key = str | int
MOST = 50_000  # children of one value that are compared


class _Nothing:
    """Stands for "is not there", which is something else than null."""

    def __init__(self, words: str) -> None:
        self._words = words

    def __repr__(self) -> str:
        return self._words


OFF: Final = _Nothing("nothing to compare with")
MISSING: Final = _Nothing("missing")
Part = tuple[Key, object, object, Mark]


def differs(before: object, after: object) -> bool:
    """Whether a value has changed. NaN has not; 1 and true are equal in Python, not in JSON."""
    if before is after or (before != before and after != after):  # noqa: PLR0124
        return False
    if is_container(before) and is_container(after):
        return _kind(before) != _kind(after) or not _same(before, after)
    return type(before) is not type(after) or before != after


def mark_of(value: object, base: object) -> Mark:
    """How a value differs from the one at the same place before."""
    if base is OFF:
        return ""
    if base is MISSING:
        return "added"
    if value is MISSING:
        return "removed"
    return "changed" if differs(base, value) else ""


def parts_of(value: object, base: object, mark: Mark, *, changes_only: bool) -> list[Part]:
    """The children of a value: key, value, the value before, how they differ.

    What was removed stands after what is there, with its old value. All below something added is added, all
    below something removed is removed (``mark`` is the parent's).
    """
    keys, values = keys_of(value, MOST), values_of(value, MOST)
    if mark in {"added", "removed"} or not is_container(base) or _kind(base) != _kind(value):
        whole: Mark = "removed" if mark == "removed" else "added"
        return [(key, below, MISSING, whole) for key, below in zip(keys, values, strict=False)]
    before = dict(zip(keys_of(base, MOST), values_of(base, MOST), strict=False))
    parts: list[Part] = []
    for key, below in zip(keys, values, strict=False):
        was = before.pop(key, MISSING)
        parts.append((key, below, was, mark_of(below, was)))
    parts += [(key, was, MISSING, "removed") for key, was in before.items()]
    return [part for part in parts if part[3]] if changes_only else parts


def _kind(value: object) -> str:
    return "object" if isinstance(value, Mapping) else "list"


def _same(before: object, after: object) -> bool:
    """Containers of one kind: equal at every depth; true is not 1, the order of keys does not matter.

    Large ones that are not decoded are compared by their texts.
    """
    if isinstance(before, (LazyList, LazyObject)) and isinstance(after, (LazyList, LazyObject)):
        return before.text == after.text
    return size_of(before) == size_of(after) and _written(before) == _written(after)


def _written(value: object) -> object:
    """A value in a form whose equality is that of JSON; as it is when it has none (bytes of msgpack)."""
    try:
        return orjson.dumps(value, option=orjson.OPT_SORT_KEYS | orjson.OPT_NON_STR_KEYS)
    except (TypeError, RecursionError):
        return value
