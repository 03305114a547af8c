"""Frozen dataclasses ↔ maps and lists: how requests, replies and views are parsed at the edge, once.

The classes have no `__post_init__` and no slots.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from operator import itemgetter
from types import UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from nep.errors import WireError

__all__ = ["made", "read", "write"]

T = TypeVar("T")

_PLAIN = frozenset({str, int, float, bool, bytes, type(None)})


def write(value: object) -> object:
    """`value` as maps, lists and plain values; fields that have their default are left out."""
    if type(value) in _PLAIN:
        return value
    if is_dataclass(value) and not isinstance(value, type):
        out: dict[str, object] = {}
        for name, default in _fields_of(type(value)):
            item = getattr(value, name)
            if default is MISSING or item != default:
                out[name] = item if type(item) in _PLAIN else write(item)
        return out
    if isinstance(value, Mapping):
        return {key: write(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [write(item) for item in value]
    return value


@cache
def _fields_of(kind: type) -> tuple[tuple[str, object], ...]:
    return tuple((field.name, field.default) for field in fields(kind))


def read(kind: type[T], value: object) -> T:
    """A `kind` from what `write` made of one. Unknown fields are ignored (newer peers may send more).

    Raises `WireError` that names the field when something is missing or of another type.
    """
    hint: Any = kind
    try:
        return cast("T", _reader(hint)(value))
    except _MisfitError as misfit:
        where = ".".join((kind.__name__, *reversed(misfit.path)))
        raise WireError(f"'{where}' {misfit.reason}") from None


class _MisfitError(Exception):
    """A value that is none of its type. The way to it is noted on the way out: there is one rarely."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason
        self.path: list[str] = []


def made(kind: type[T], every_field: dict[str, object]) -> T:
    """A frozen `kind` of all its fields, in a fifth of the time: its own way to set them is slow.

    It keeps `every_field`, which nobody else may change from now on.
    """
    value = object.__new__(kind)
    object.__setattr__(value, "__dict__", every_field)
    return value


Reader = Callable[[object], object]


@cache
def _reader(hint: Any) -> Reader:  # noqa: ANN401 - a type hint is any object
    if isinstance(hint, type) and is_dataclass(hint):
        return _of_dataclass(hint)
    origin, args = get_origin(hint), get_args(hint)
    if origin in {UnionType, Union}:
        inner = _reader(next(arg for arg in args if arg is not type(None)))
        return lambda value: None if value is None else inner(value)
    if origin is tuple:
        return _of_tuple(_reader(args[0]))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _of_mapping(_reader(args[0]), _reader(args[1]))
    return _of_plain(hint)


def _of_plain(hint: type) -> Reader:
    def parse(value: object) -> object:
        if hint is float and isinstance(value, int) and not isinstance(value, bool):
            return float(value)
        if not isinstance(value, hint) or (hint is int and isinstance(value, bool)):
            raise _MisfitError(f"is a '{type(value).__name__}', not '{hint.__name__}'")
        return value

    return parse


def _of_tuple(item: Reader) -> Reader:
    def parse(value: object) -> object:
        if not isinstance(value, list | tuple):
            raise _MisfitError(f"is a '{type(value).__name__}', not a list")
        return tuple([item(each) for each in value])

    return parse


def _of_mapping(key: Reader, item: Reader) -> Reader:
    def parse(value: object) -> object:
        if not isinstance(value, Mapping):
            raise _MisfitError(f"is a '{type(value).__name__}', not a map")
        return {key(name): item(each) for name, each in value.items()}

    return parse


def _of_dataclass(kind: type) -> Reader:
    hints = get_type_hints(kind)
    # The type that a value has nearly always: then nothing needs to be called for it.
    readers = [
        (each.name, hints[each.name] if hints[each.name] in _PLAIN else None, _reader(hints[each.name]), each)
        for each in fields(kind)
    ]
    quickly = _quickly(kind, hints)

    def parse(value: object) -> object:
        made_quickly = quickly(value) if type(value) is dict else None
        if made_quickly is not None:
            return made_quickly
        if not isinstance(value, Mapping):
            raise _MisfitError(f"is a '{type(value).__name__}', not a map")
        found: dict[str, object] = {}
        for name, usual, reader, field in readers:
            item = value.get(name, MISSING)
            if item is MISSING:
                found[name] = _default(field)
            elif type(item) is usual:
                found[name] = item
            else:
                try:
                    found[name] = reader(item)
                except _MisfitError as misfit:
                    misfit.path.append(name)
                    raise
        return made(kind, found)

    return parse


def _quickly(kind: type, hints: Mapping[str, Any]) -> Callable[[dict[str, object]], object | None]:
    """Makes a `kind` of a map with just its fields, each of just its type: nearly all are so in a graph.

    None for all others, also for those with something wrong deeper down: who asks finds out what.
    """
    plain = {name: _plain_types(hint) for name, hint in hints.items()}
    names = [name for name, types in plain.items() if types]
    others = [(name, _reader(hints[name])) for name, types in plain.items() if not types]
    of_plain = itemgetter(*names) if len(names) > 1 else lambda value: tuple(value[name] for name in names)
    known: set[tuple[type, ...]] = set()
    """Combinations of types that were found right; there are two for each field that may be None."""

    def quickly(value: dict[str, object]) -> object | None:
        if len(value) != len(plain):
            return None
        try:
            types = tuple(map(type, of_plain(value)))
            if types not in known:
                if not all(each in plain[name] for name, each in zip(names, types, strict=True)):
                    return None
                known.add(types)
            fields_of_it = dict(value)
            for name, reader in others:
                fields_of_it[name] = reader(value[name])
        except (LookupError, _MisfitError):
            return None
        fresh: object = made(kind, fields_of_it)
        return fresh

    return quickly


def _plain_types(hint: Any) -> frozenset[type]:  # noqa: ANN401 - a type hint is any object
    """The types of which values are taken as they are; none when values have to be looked into."""
    if hint in _PLAIN:
        return frozenset({hint})
    if get_origin(hint) in {UnionType, Union} and set(get_args(hint)) <= _PLAIN:
        return frozenset(get_args(hint))
    return frozenset()


def _default(field: Field[Any]) -> object:
    if field.default is not MISSING:
        return field.default
    if field.default_factory is not MISSING:
        return field.default_factory()
    misfit = _MisfitError("is missing")
    misfit.path.append(field.name)
    raise misfit
