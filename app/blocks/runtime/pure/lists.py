"""Functions of the category "Lists".

Items are numbered from 1. A list holds at most `MAX_ITEMS` items, including the items of nested lists.
Inserted lists are copied, so that no list contains itself. Functions raise BehaviourError for values that
aren't lists and for positions that don't exist.
"""

from __future__ import annotations

import math
import random
import statistics
from collections.abc import Sequence

from app.blocks.runtime.errors import BehaviourError, type_name
from app.blocks.runtime.values import MAX_TEXT_LENGTH, grapheme_clusters, number, text
from nep.i18n import _, lazy, ngettext

__all__ = [
    "add_item", "average_of", "clear_list", "contains", "copy_of", "each", "insert_item", "is_empty_list",
    "item", "join_items", "largest_of", "middle_of", "new_list", "part_of_list", "position", "remove_item",
    "set_item", "shuffled", "smallest_of", "sorted_down", "sorted_up", "split_text", "sum_of", "turned_round",
]  # fmt: skip

MAX_ITEMS = 10_000
FIRST, LAST, RANDOM = "first", "last", "random"


def new_list(*items: object) -> list[object]:
    """Return a list with copies of the given values."""
    return _copy_list(items)


def item(values: object, selector: object) -> object:
    """Return an item of a list.

    Args:
        values: List.
        selector: Number of the item, "first", "last" or "random".
    """
    items = _as_list(values)
    return items[_index(items, selector)]


def set_item(values: object, selector: object, value: object) -> None:
    """Replace an item of a list; see `item` for positions."""
    items = _mutable_list(values)
    index = _index(items, selector)
    items[index] = _copy_if_room(items, value)


def insert_item(values: object, selector: object, value: object) -> None:
    """Insert a value before an item of a list, or at the end.

    Args:
        values: List.
        selector: Number of the item, "first" or "random"; "last" or the number after the last item appends.
        value: Value to insert.
    """
    items = _mutable_list(values)
    if selector == LAST or (selector != FIRST and selector == len(items) + 1):
        index = len(items)
    elif selector == FIRST:
        index = 0
    else:
        index = _index(items, selector)
    items.insert(index, _copy_if_room(items, value))


def add_item(values: object, value: object) -> None:
    """Append a value to a list."""
    items = _mutable_list(values)
    items.append(_copy_if_room(items, value))


def remove_item(values: object, selector: object) -> object:
    """Remove and return an item of a list; see `item` for positions."""
    items = _mutable_list(values)
    return items.pop(_index(items, selector))


def contains(container: object, value: object) -> bool:
    """Return True if a list contains an item, or a text contains another text."""
    if isinstance(container, str):
        return text(value) in container
    return any(_are_equal(each, value) for each in _as_list(container))


def position(values: object, value: object) -> int:
    """Return the number of the first item that equals a value; 0 if there is none."""
    return next((index for index, each in enumerate(_as_list(values), 1) if _are_equal(each, value)), 0)


def each(values: object) -> list[object]:
    """Return a shallow copy of a list for a loop, so that changes during the loop don't affect it."""
    return list(_as_list(values))


def join_items(values: object, between: object) -> str:
    """Convert all items of a list to text and join them with a separator.

    Raises:
        BehaviourError: The text is too long.
    """
    separator_text, pieces, size = text(between), [], 0
    for value in _as_list(values):
        pieces.append(text(value))
        size += len(pieces[-1]) + len(separator_text)
        if size > MAX_TEXT_LENGTH:
            raise BehaviourError(
                _("This text is too long. Use at most {most} characters.").format(most=MAX_TEXT_LENGTH)
            )
    return separator_text.join(pieces)


def split_text(value: object, separator: object) -> list[object]:
    """Split a text at a separator; into single characters if the separator is empty."""
    full_text, separator_text = text(value), text(separator)
    pieces = full_text.split(separator_text) if separator_text else grapheme_clusters(full_text)
    if len(pieces) > MAX_ITEMS:
        raise _full_error()
    return [*pieces]


def part_of_list(values: object, first: object, last: object) -> list[object]:
    """Return the items from one number to another, inclusive; the range is limited to the list."""
    begin, end = (math.floor(number(each, lazy("“items”"))) for each in (first, last))
    return _copy_list(_as_list(values)[max(begin, 1) - 1 : max(end, 0)])


def is_empty_list(values: object) -> bool:
    """Return True if a list is empty."""
    return not _as_list(values)


def clear_list(values: object) -> None:
    """Remove all items from a list."""
    _mutable_list(values).clear()


def copy_of(values: object) -> list[object]:
    """Return a deep copy of a list."""
    return _copy_list(_as_list(values))


def sorted_up(values: object) -> list[object]:
    """Return a list sorted in ascending order: numbers, then texts (ignoring case), then other values."""
    return sorted(_copy_list(_as_list(values)), key=_sort_key)


def sorted_down(values: object) -> list[object]:
    """Return a list sorted in descending order; see `sorted_up`."""
    return sorted_up(values)[::-1]


def turned_round(values: object) -> list[object]:
    """Return a list in reverse order."""
    return _copy_list(_as_list(values))[::-1]


def shuffled(values: object) -> list[object]:
    """Return a list in random order."""
    items = _copy_list(_as_list(values))
    random.shuffle(items)
    return items


def sum_of(values: object) -> int | float:
    """Return the sum of a list of numbers; 0 if the list is empty."""
    return sum(_numbers(values, lazy("“sum”")))


def average_of(values: object) -> float:
    """Return the mean of a list of numbers. Raises BehaviourError if the list is empty."""
    items = _non_empty(_numbers(values, lazy("“average”")))
    return sum(items) / len(items)


def smallest_of(values: object) -> int | float:
    """Return the smallest number of a list. Raises BehaviourError if the list is empty."""
    return min(_non_empty(_numbers(values, lazy("“smallest number”"))))


def largest_of(values: object) -> int | float:
    """Return the largest number of a list. Raises BehaviourError if the list is empty."""
    return max(_non_empty(_numbers(values, lazy("“largest number”"))))


def middle_of(values: object) -> int | float:
    """Return the median of a list of numbers. Raises BehaviourError if the list is empty."""
    return statistics.median(_non_empty(_numbers(values, lazy("“middle number”"))))


def _numbers(values: object, label: str) -> list[int | float]:
    return [number(each, label) for each in _as_list(values)]


def _non_empty(items: list[int | float]) -> list[int | float]:
    if not items:
        raise BehaviourError(_("The list is empty."))
    return items


def _sort_key(value: object) -> tuple[int, float, str]:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return (0, math.inf if math.isnan(value) else value, "")
    return (1 if isinstance(value, str) else 2, 0, text(value).casefold())


def _as_list(value: object) -> Sequence[object]:
    if isinstance(value, (list, tuple)):
        return value
    if value is None:
        raise BehaviourError(_("This list has no value yet."), is_value_unknown=True)
    message = _("This block needs a list, not {kind}.")
    if value == 0 and isinstance(value, int):
        message = _("This block needs a list, not {kind}. Set the variable to an empty list first.")
    raise BehaviourError(message.format(kind=type_name(value)))


def _mutable_list(values: object) -> list[object]:
    items = _as_list(values)
    if not isinstance(items, list):
        raise BehaviourError(
            _("This list can't be changed. Set a variable to a copy of it and change the copy.")
        )
    return items


def _index(items: Sequence[object], selector: object) -> int:
    if not items:
        raise BehaviourError(_("The list is empty."))
    if selector == FIRST:
        return 0
    if selector == LAST:
        return len(items) - 1
    if selector == RANDOM:
        return random.randrange(len(items))  # noqa: S311 (a game, no secret)
    item_number = number(selector, lazy("“item number”"))
    if item_number != int(item_number):
        raise BehaviourError(
            _("“item number” needs a whole number, not {place}.").format(place=text(item_number))
        )
    if not 1 <= item_number <= len(items):
        message = ngettext(
            "The list has only {count} item; it has no item {number}.",
            "The list has only {count} items; it has no item {number}.",
            len(items),
        )
        raise BehaviourError(message.format(count=len(items), number=text(item_number)))
    return int(item_number) - 1


def _are_equal(one: object, other: object) -> bool:
    return one == other and isinstance(one, bool) == isinstance(other, bool)


def _copy_if_room(items: list[object], value: object) -> object:
    if len(items) >= MAX_ITEMS:
        raise _full_error()
    if not isinstance(value, (list, tuple)):
        return value
    room = MAX_ITEMS - _count_items(items, MAX_ITEMS)
    if room <= 0 or _count_items(value, room) > room:
        raise _full_error()
    return _deep_copy(value)


def _copy_list(items: Sequence[object]) -> list[object]:
    room = MAX_ITEMS - len(items)
    for value in items:
        room -= _count_items(value, MAX_ITEMS)
        if room < 0:
            raise _full_error()
    return [_deep_copy(value) for value in items]


def _deep_copy(value: object) -> object:
    if isinstance(value, (list, tuple)):
        return [_deep_copy(each) for each in value]
    return value


def _count_items(value: object, max_count: int) -> int:
    if not isinstance(value, (list, tuple)):
        return 0
    item_count, pending = 0, [value]
    while pending and item_count <= max_count:
        current = pending.pop()
        item_count += len(current)
        pending += [each for each in current if isinstance(each, (list, tuple)) and each]
    return item_count


def _full_error() -> BehaviourError:
    return BehaviourError(_("The list is full: it can have at most {most} items.").format(most=MAX_ITEMS))
