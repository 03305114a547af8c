"""Value shapes of typed messages: conversion between Python and JSON values, with error paths.

`nep.messages.typed` creates shapes from annotations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date, datetime, time
from enum import Enum, Flag
from typing import Any

from nep.i18n import _, format_list
from nep.messages.fields import FieldPathError, wrong_type_error
from nep.text import escaped, shortened

_MIN_INT, _MAX_INT = -(1 << 63), (1 << 64) - 1
"""Minimum and maximum of ints in JSON."""
_MAX_TEXT_LENGTH = 100
"""Maximum length in characters of a key or value in an error message."""


class ValueShape:
    """Converter for the values of one type.

    Attributes:
        name: Name of the type in error messages.
        read: Converts a JSON value to a Python value. Raises `FieldPathError`. Assigned after creation,
            because a dataclass may have fields of its own type.
        write: Converts a Python value to a JSON value. Raises `FieldPathError`. Assigned after creation.
    """

    __slots__ = ("_describe", "json_types", "name", "read", "unchanged_type", "write")

    read: Callable[[Any], Any]
    write: Callable[[Any], Any]

    def __init__(
        self,
        name: str,
        unchanged_type: type | None = None,
        json_types: Iterable[type] = (),
        describe: Callable[[], str] | None = None,
    ) -> None:
        self.name = name
        self.json_types = frozenset(json_types) if unchanged_type is None else frozenset({unchanged_type})
        """Python types of the value in JSON; empty for any type."""
        self.unchanged_type = unchanged_type
        """Type whose instances are read unchanged, or None."""
        self._describe = describe

    @property
    def expected(self) -> str:
        """Description of the expected value, such as "a 'float'", in the current language."""
        return _("a '{name}'").format(name=self.name) if self._describe is None else self._describe()


def missing_value_error(shape: ValueShape) -> FieldPathError:
    """Return the error for a missing value."""
    return FieldPathError(_("is missing; expected {wanted}").format(wanted=shape.expected))


def short_repr(value: object) -> str:
    """Return the shortened `repr` of a value, for a message."""
    return escaped(shortened(repr(value), _MAX_TEXT_LENGTH))


# ---- scalars


def _from_numpy(value: object) -> object:
    # numpy scalars and arrays to Python values
    to_list = getattr(value, "tolist", None)
    return to_list() if callable(to_list) else value


def _float_shape() -> ValueShape:
    shape = ValueShape("float", float)

    def read(value: object) -> float:
        if isinstance(value, float):
            return value
        if value is None:
            return math.nan
        return write(value)

    def write(value: object) -> float:
        if isinstance(value, float):
            return float(value)
        converted = value if isinstance(value, int) else _from_numpy(value)
        if isinstance(converted, int | float) and not isinstance(converted, bool):
            try:
                return float(converted)
            except OverflowError:
                raise FieldPathError(
                    _("is too large; expected {wanted}").format(wanted=shape.expected)
                ) from None
        raise wrong_type_error(value, shape.expected)

    shape.read, shape.write = read, write
    return shape


def _int_shape() -> ValueShape:
    shape = ValueShape("int", int)

    def read(value: object) -> int:
        if isinstance(value, int) and not isinstance(value, bool):
            return value
        raise wrong_type_error(value, shape.expected)

    def write(value: object) -> int:
        converted = value if isinstance(value, int) else _from_numpy(value)
        if not isinstance(converted, int) or isinstance(converted, bool):
            raise wrong_type_error(value, shape.expected)
        if not _MIN_INT <= converted <= _MAX_INT:
            raise FieldPathError(
                _("doesn't fit into 64 bits; expected {wanted}").format(wanted=shape.expected)
            )
        return int(converted)

    shape.read, shape.write = read, write
    return shape


def _str_shape() -> ValueShape:
    shape = ValueShape("str", str)

    def read(value: object) -> str:
        if isinstance(value, str):
            return value
        raise wrong_type_error(value, shape.expected)

    def write(value: object) -> str:
        if not isinstance(value, str):
            raise wrong_type_error(value, shape.expected)
        if not value.isascii():
            _check_surrogates(value)
        return str(value)

    shape.read, shape.write = read, write
    return shape


def _check_surrogates(value: str) -> None:
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        raise FieldPathError(_("contains an unpaired surrogate; use valid Unicode text")) from None


def _bool_shape() -> ValueShape:
    shape = ValueShape("bool", bool)

    def convert(value: object) -> bool:
        converted = value if isinstance(value, bool) else _from_numpy(value)
        if isinstance(converted, bool):
            return converted
        raise wrong_type_error(value, shape.expected)

    shape.read = shape.write = convert
    return shape


def _none_shape() -> ValueShape:
    shape = ValueShape("None", json_types={type(None)}, describe=lambda: "None")

    def convert(value: object) -> None:
        if value is not None:
            raise wrong_type_error(value, shape.expected)

    shape.read = shape.write = convert
    return shape


def _any_shape() -> ValueShape:
    shape = ValueShape("Any")

    def convert(value: object) -> object:
        return value

    shape.read = shape.write = convert
    return shape


def _datetime_shape(kind: type[datetime | date | time]) -> ValueShape:
    shape = ValueShape(kind.__name__, json_types={str})

    def is_of_kind(value: object) -> bool:
        return isinstance(value, kind) and (kind is not date or not isinstance(value, datetime))

    def read(value: object) -> object:
        if is_of_kind(value):  # msgpack has times
            return value
        if not isinstance(value, str):
            raise wrong_type_error(
                value, _("a string such as {example}").format(example=_DATETIME_EXAMPLES[kind])
            )
        iso_text = f"{value[:-1]}+00:00" if value.endswith("Z") else value  # Python 3.10 does not parse "Z"
        try:
            return kind.fromisoformat(iso_text)
        except ValueError:
            raise FieldPathError(
                _("is {value}; expected a string such as {example}").format(
                    value=short_repr(value), example=_DATETIME_EXAMPLES[kind]
                )
            ) from None

    def write(value: Any) -> str:  # noqa: ANN401 - checked here
        if not is_of_kind(value):
            raise wrong_type_error(value, shape.expected)
        return str(value.isoformat())

    shape.read, shape.write = read, write
    return shape


_DATETIME_EXAMPLES: Mapping[type, str] = {
    datetime: "'2026-01-31T12:00:00+00:00'",
    date: "'2026-01-31'",
    time: "'12:00:00'",
}
ANY_SHAPE = _any_shape()
SCALAR_SHAPES: Mapping[Any, ValueShape] = {
    float: _float_shape(),
    int: _int_shape(),
    str: _str_shape(),
    bool: _bool_shape(),
    None: _none_shape(),
    type(None): _none_shape(),
    Any: ANY_SHAPE,
    object: ANY_SHAPE,
    **{each: _datetime_shape(each) for each in (datetime, date, time)},
}


# ---- alternatives


def _matches_literal(value: object, allowed: object) -> bool:
    # 1 is neither True nor 1.0; but a float may be sent as an int.
    if value != allowed or isinstance(value, bool) is not isinstance(allowed, bool):
        return False
    return isinstance(value, type(allowed)) or isinstance(allowed, float)


def literal_shape(values: Sequence[object]) -> ValueShape | None:
    """Return the shape of a Literal, or None if JSON can't represent one of its values."""
    if not all(
        (literal is None or isinstance(literal, str | int)) and not isinstance(literal, Enum)
        for literal in values
    ):
        return None
    json_types = map(type, values)
    shape = ValueShape(
        "Literal", json_types=json_types, describe=lambda: format_list([repr(each) for each in values], "or")
    )

    def convert(value: object) -> object:
        for literal in values:
            if _matches_literal(value, literal):
                return literal
        raise FieldPathError(
            _("is {value}; expected {wanted}").format(value=short_repr(value), wanted=shape.expected)
        )

    shape.read = shape.write = convert
    return shape


def enum_shape(kind: type[Enum]) -> ValueShape | None:
    """Return the shape of an Enum, sent by value, or None if JSON can't represent one of its values."""
    members = list(kind)
    if not all(isinstance(member.value, str | int | float | None) for member in members):
        return None
    shape = ValueShape(kind.__name__, json_types=(type(member.value) for member in members))
    is_flag = issubclass(kind, Flag)

    def read(value: object) -> object:
        for member in members:
            if _matches_literal(value, member.value):
                return member
        if is_flag and isinstance(value, int) and not isinstance(value, bool):
            try:
                return kind(value)
            except ValueError:
                pass
        expected = (
            shape.expected if is_flag else format_list([repr(member.value) for member in members], "or")
        )
        raise FieldPathError(
            _("is {value}; expected {wanted}").format(value=short_repr(value), wanted=expected)
        )

    def write(value: object) -> object:
        if not isinstance(value, kind):
            raise wrong_type_error(value, shape.expected)
        return value.value

    shape.read, shape.write = read, write
    return shape


def union_shape(shapes: Sequence[ValueShape]) -> ValueShape | None:
    """Return the shape of a Union, or None if two members have the same form in JSON.

    Values are read as the first matching member. None is tried first, because float would read null as
    NaN.
    """
    json_types = [form for each in shapes for form in each.json_types]
    if len(json_types) > len(set(json_types)):
        return None
    none = SCALAR_SHAPES[None]
    others = [each for each in shapes if each.name != none.name]
    others.sort(key=lambda each: float in each.json_types)  # float accepts ints, too
    nones = [none] if len(others) < len(shapes) else []
    ordered = [*nones, *others]
    shape = ValueShape(
        "Union",
        json_types=json_types,
        describe=lambda: format_list([each.expected for each in (*others, *nones)], "or"),
    )

    def convert(value: object, converters: Sequence[Callable[[Any], Any]]) -> object:
        mismatch = None
        for converter in converters:
            try:
                return converter(value)
            except FieldPathError as error:
                mismatch = error
        if mismatch is not None and mismatch.steps and len(others) == 1:
            raise mismatch  # has the path inside the member
        raise wrong_type_error(value, shape.expected)

    # looked up when used: `read` and `write` of a dataclass's shape may be assigned later
    shape.read = lambda value: convert(value, [each.read for each in ordered])
    shape.write = lambda value: convert(value, [each.write for each in ordered])
    return shape


# ---- containers


def _convert_items(converter: Callable[[Any], Any], values: Iterable[Any], first: int = 0) -> list[Any]:
    converted: list[Any] = []
    try:
        for item in values:
            converted.append(converter(item))  # noqa: PERF401 - the length gives the index for the error
    except FieldPathError as mismatch:
        raise mismatch.within(first + len(converted)) from mismatch.__cause__
    return converted


def _as_items(value: object, expected: str) -> list[Any] | tuple[Any, ...]:
    items = value if isinstance(value, list | tuple) else _from_numpy(value)
    if not isinstance(items, list | tuple):
        raise wrong_type_error(value, expected)
    return items


def list_shape(item: ValueShape, kind: type) -> ValueShape:
    """Return the shape of a list or tuple (`kind`) of any length."""
    shape = ValueShape(kind.__name__, json_types={list})
    unchanged_types = {item.unchanged_type} - {None}

    def read(value: object) -> object:
        values = _as_items(value, shape.expected)
        # fast path for thousands of numbers; the list is copied because it may be shared
        converted = (
            values
            if unchanged_types and set(map(type, values)) <= unchanged_types
            else _convert_items(item.read, values)
        )
        return kind(converted)

    def write(value: object) -> object:
        values = _as_items(value, shape.expected)
        if item.unchanged_type is float and set(map(type, values)) <= unchanged_types:
            return list(values)
        return _convert_items(item.write, values)

    shape.read, shape.write = read, write
    return shape


def tuple_shape(items: Sequence[ValueShape]) -> ValueShape:
    """Return the shape of a tuple with fixed items."""
    shape = ValueShape(
        "tuple", json_types={list}, describe=lambda: _("{count} values").format(count=len(items))
    )

    def convert(value: object, converters: Sequence[Callable[[Any], Any]]) -> list[Any]:
        values = _as_items(value, shape.expected)
        if len(values) != len(converters):
            raise FieldPathError(
                _("has {count} values; expected {wanted}").format(count=len(values), wanted=shape.expected)
            )
        converted: list[Any] = []
        for converter, part in zip(converters, values, strict=True):
            converted += _convert_items(converter, (part,), len(converted))
        return converted

    shape.read = lambda value: tuple(convert(value, [item.read for item in items]))
    shape.write = lambda value: convert(value, [item.write for item in items])
    return shape


def map_shape(item: ValueShape) -> ValueShape:
    """Return the shape of a map with text keys."""
    shape = ValueShape("dict", json_types={dict})
    key_shape = SCALAR_SHAPES[str]

    def convert(value: object, converter: Callable[[Any], Any]) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise wrong_type_error(value, shape.expected)
        converted: dict[str, Any] = {}
        for key, part in value.items():
            try:
                converted[key_shape.write(key)] = converter(part)
            except FieldPathError as mismatch:
                raise mismatch.within(str(key)) from mismatch.__cause__
        return converted

    shape.read = lambda value: convert(value, item.read)
    shape.write = lambda value: convert(value, item.write)
    return shape
