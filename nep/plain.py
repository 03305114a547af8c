"""Frozen dataclasses ↔ maps and lists: how requests, replies and views are parsed at the edge, once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from nep.errors import WireError

__all__ = ["read", "write"]

T = TypeVar("T")


def write(value: object) -> object:
    """`value` as maps, lists and plain values; fields that have their default are left out."""
    if is_dataclass(value) and not isinstance(value, type):
        out: dict[str, object] = {}
        for field in fields(value):
            item = getattr(value, field.name)
            if field.default is MISSING or item != field.default:
                out[field.name] = write(item)
        return out
    if isinstance(value, Mapping):
        return {key: write(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [write(item) for item in value]
    return value


def read(kind: type[T], value: object) -> T:
    """A `kind` from what `write` made of one. Unknown fields are ignored (newer peers may send more).

    Raises `WireError` that names the field when something is missing or of another type.
    """
    hint: Any = kind
    return cast("T", _reader(hint)(value, kind.__name__))


Reader = Callable[[object, str], object]


@cache
def _reader(hint: Any) -> Reader:  # noqa: ANN401 - a type hint is any object
    if isinstance(hint, type) and is_dataclass(hint):
        return _of_dataclass(hint)
    origin, args = get_origin(hint), get_args(hint)
    if origin in {UnionType, Union}:
        inner = _reader(next(arg for arg in args if arg is not type(None)))
        return lambda value, where: None if value is None else inner(value, where)
    if origin is tuple:
        return _of_tuple(_reader(args[0]))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _of_mapping(_reader(args[0]), _reader(args[1]))
    return _of_plain(hint)


def _of_plain(hint: type) -> Reader:
    def parse(value: object, where: str) -> object:
        if hint is float and isinstance(value, int) and not isinstance(value, bool):
            return float(value)
        if not isinstance(value, hint) or (hint is int and isinstance(value, bool)):
            raise WireError(f"'{where}' is a '{type(value).__name__}', not '{hint.__name__}'")
        return value

    return parse


def _of_tuple(item: Reader) -> Reader:
    def parse(value: object, where: str) -> object:
        if not isinstance(value, list | tuple):
            raise WireError(f"'{where}' is a '{type(value).__name__}', not a list")
        return tuple(item(each, where) for each in value)

    return parse


def _of_mapping(key: Reader, item: Reader) -> Reader:
    def parse(value: object, where: str) -> object:
        if not isinstance(value, Mapping):
            raise WireError(f"'{where}' is a '{type(value).__name__}', not a map")
        return {key(name, where): item(each, where) for name, each in value.items()}

    return parse


def _of_dataclass(kind: type) -> Reader:
    hints = get_type_hints(kind)
    readers = [(field.name, _reader(hints[field.name]), field) for field in fields(kind)]

    def parse(value: object, where: str) -> object:
        if not isinstance(value, Mapping):
            raise WireError(f"'{where}' is a '{type(value).__name__}', not a map")
        found: dict[str, object] = {}
        for name, reader, field in readers:
            if name in value:
                found[name] = reader(value[name], f"{where}.{name}")
            elif field.default is MISSING and field.default_factory is MISSING:
                raise WireError(f"'{where}.{name}' is missing")
        return kind(**found)

    return parse
