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


def item(of: object, where: object) -> object:
    """Return an item of a list.

    Args:
        of: List.
        where: Number of the item, "first", "last" or "random".
    """
    items = _as_list(of)
    return items[_index(items, where)]


def set_item(of: object, where: object, value: object) -> None:
    """Replace an item of a list; see `item` for positions."""
    items = _mutable_list(of)
    place = _index(items, where)
    items[place] = _copy_if_room(items, value)


def insert_item(of: object, where: object, value: object) -> None:
    """Insert a value before an item of a list, or at the end.

    Args:
        of: List.
        where: Number of the item, "first" or "random"; "last" or the number after the last item appends.
        value: Value to insert.
    """
    items = _mutable_list(of)
    if where == LAST or (where != FIRST and where == len(items) + 1):
        place = len(items)
    elif where == FIRST:
        place = 0
    else:
        place = _index(items, where)
    items.insert(place, _copy_if_room(items, value))


def add_item(of: object, value: object) -> None:
    """Append a value to a list."""
    items = _mutable_list(of)
    items.append(_copy_if_room(items, value))


def remove_item(of: object, where: object) -> object:
    """Remove and return an item of a list; see `item` for positions."""
    items = _mutable_list(of)
    return items.pop(_index(items, where))


def contains(where: object, value: object) -> bool:
    """Return True if a list contains an item, or a text contains another text."""
    if isinstance(where, str):
        return text(value) in where
    return any(_are_equal(each, value) for each in _as_list(where))


def position(of: object, value: object) -> int:
    """Return the number of the first item that equals a value; 0 if there is none."""
    return next((place for place, each in enumerate(_as_list(of), 1) if _are_equal(each, value)), 0)


def each(of: object) -> list[object]:
    """Return a shallow copy of a list for a loop, so that changes during the loop don't affect it."""
    return list(_as_list(of))


def join_items(of: object, between: object) -> str:
    """Convert all items of a list to text and join them with a separator.

    Raises:
        BehaviourError: The text is too long.
    """
    joint, pieces, size = text(between), [], 0
    for one in _as_list(of):
        pieces.append(text(one))
        size += len(pieces[-1]) + len(joint)
        if size > MAX_TEXT_LENGTH:
            raise BehaviourError(
                _("This text is too long. Use at most {most} characters.").format(most=MAX_TEXT_LENGTH)
            )
    return joint.join(pieces)


def split_text(words: object, at: object) -> list[object]:
    """Split a text at a separator; into single characters if the separator is empty."""
    whole, joint = text(words), text(at)
    pieces = whole.split(joint) if joint else grapheme_clusters(whole)
    if len(pieces) > MAX_ITEMS:
        raise _full_error()
    return [*pieces]


def part_of_list(of: object, first: object, last: object) -> list[object]:
    """Return the items from one number to another, inclusive; the range is limited to the list."""
    begin, end = (math.floor(number(each, lazy("“items”"))) for each in (first, last))
    return _copy_list(_as_list(of)[max(begin, 1) - 1 : max(end, 0)])


def is_empty_list(of: object) -> bool:
    """Return True if a list is empty."""
    return not _as_list(of)


def clear_list(of: object) -> None:
    """Remove all items from a list."""
    _mutable_list(of).clear()


def copy_of(of: object) -> list[object]:
    """Return a deep copy of a list."""
    return _copy_list(_as_list(of))


def sorted_up(of: object) -> list[object]:
    """Return a list sorted in ascending order: numbers, then texts (ignoring case), then other values."""
    return sorted(_copy_list(_as_list(of)), key=_sort_key)


def sorted_down(of: object) -> list[object]:
    """Return a list sorted in descending order; see `sorted_up`."""
    return sorted_up(of)[::-1]


def turned_round(of: object) -> list[object]:
    """Return a list in reverse order."""
    return _copy_list(_as_list(of))[::-1]


def shuffled(of: object) -> list[object]:
    """Return a list in random order."""
    items = _copy_list(_as_list(of))
    random.shuffle(items)
    return items


def sum_of(of: object) -> int | float:
    """Return the sum of a list of numbers; 0 if the list is empty."""
    return sum(_numbers(of, lazy("“sum”")))


def average_of(of: object) -> float:
    """Return the mean of a list of numbers. Raises BehaviourError if the list is empty."""
    items = _non_empty(_numbers(of, lazy("“average”")))
    return sum(items) / len(items)


def smallest_of(of: object) -> int | float:
    """Return the smallest number of a list. Raises BehaviourError if the list is empty."""
    return min(_non_empty(_numbers(of, lazy("“smallest number”"))))


def largest_of(of: object) -> int | float:
    """Return the largest number of a list. Raises BehaviourError if the list is empty."""
    return max(_non_empty(_numbers(of, lazy("“largest number”"))))


def middle_of(of: object) -> int | float:
    """Return the median of a list of numbers. Raises BehaviourError if the list is empty."""
    return statistics.median(_non_empty(_numbers(of, lazy("“middle number”"))))


def _numbers(of: object, what: str) -> list[int | float]:
    return [number(each, what) for each in _as_list(of)]


def _non_empty(items: list[int | float]) -> list[int | float]:
    if not items:
        raise BehaviourError(_("The list is empty."))
    return items


def _sort_key(value: object) -> tuple[int, float, str]:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return (0, math.inf if math.isnan(value) else value, "")
    return (1 if isinstance(value, str) else 2, 0, text(value).casefold())


def _as_list(of: object) -> Sequence[object]:
    if isinstance(of, (list, tuple)):
        return of
    if of is None:
        raise BehaviourError(_("This list has no value yet."), unknown=True)
    said = _("This block needs a list, not {kind}.")
    if of == 0 and isinstance(of, int):
        said = _("This block needs a list, not {kind}. Set the variable to an empty list first.")
    raise BehaviourError(said.format(kind=type_name(of)))


def _mutable_list(of: object) -> list[object]:
    items = _as_list(of)
    if not isinstance(items, list):
        raise BehaviourError(
            _("This list can't be changed. Set a variable to a copy of it and change the copy.")
        )
    return items


def _index(items: Sequence[object], where: object) -> int:
    if not items:
        raise BehaviourError(_("The list is empty."))
    if where == FIRST:
        return 0
    if where == LAST:
        return len(items) - 1
    if where == RANDOM:
        return random.randrange(len(items))  # noqa: S311 (a game, no secret)
    place = number(where, lazy("“item number”"))
    if place != int(place):
        raise BehaviourError(_("“item number” needs a whole number, not {place}.").format(place=text(place)))
    if not 1 <= place <= len(items):
        said = ngettext(
            "The list has only {count} item; it has no item {number}.",
            "The list has only {count} items; it has no item {number}.",
            len(items),
        )
        raise BehaviourError(said.format(count=len(items), number=text(place)))
    return int(place) - 1


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
    for one in items:
        room -= _count_items(one, MAX_ITEMS)
        if room < 0:
            raise _full_error()
    return [_deep_copy(one) for one in items]


def _deep_copy(value: object) -> object:
    if isinstance(value, (list, tuple)):
        return [_deep_copy(each) for each in value]
    return value


def _count_items(value: object, enough: int) -> int:
    if not isinstance(value, (list, tuple)):
        return 0
    found, waiting = 0, [value]
    while waiting and found <= enough:
        here = waiting.pop()
        found += len(here)
        waiting += [each for each in here if isinstance(each, (list, tuple)) and each]
    return found


def _full_error() -> BehaviourError:
    return BehaviourError(_("The list is full: it can have at most {most} items.").format(most=MAX_ITEMS))
