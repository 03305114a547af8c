"""Conversion between maps and the message objects of rosbags. Errors contain the field path."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from nep.i18n import _
from nep.messages.fields import FieldPathError, wrong_type_error

_BASE, _NAME, _ARRAY = 1, 2, 3
PLACEHOLDER_FIELD = "structure_needs_at_least_one_member"
"""Name of the member that DDS requires in an otherwise empty message."""
_INTEGER_BITS = {"int8": 8, "int16": 16, "int32": 32, "int64": 64}
_INTEGER_RANGES = {
    **{name: (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for name, bits in _INTEGER_BITS.items()},
    **{f"u{name}": (0, 2**bits - 1) for name, bits in _INTEGER_BITS.items()},
    "byte": (0, 255),
}
_NUMPY_DTYPES = {
    "byte": "uint8",
    **{name: name for name in ("bool", "float32", "float64", *_INTEGER_RANGES) if name != "byte"},
}
_FLOAT_TYPES = frozenset({"float32", "float64"})
_FLOAT32_OVERFLOW = 3.4028235677973366e38
"""Smallest number that rounds to infinity as float32."""
_OCTET_TYPES = frozenset({"uint8", "byte"})


@dataclass(frozen=True, slots=True)
class RosField:
    """Field of a message.

    Attributes:
        name: Name of the field.
        kind: Type of the value, or of the items of an array or sequence.
        is_message: True if `kind` is a message type.
        length: Number of items of an array; -1 for a sequence, None for a single value.
        size: Maximum number of items of a sequence; 0 means unlimited.
        max_text_bytes: Maximum size of each string in bytes; 0 means unlimited.
    """

    name: str
    kind: str
    is_message: bool
    length: int | None = None
    size: int = 0
    max_text_bytes: int = 0


class TypeRegistry(Protocol):
    """Registry of message types."""

    def fields(self, name: str) -> tuple[RosField, ...]:
        """Return the fields of a type."""

    def message_class(self, name: str) -> Any:  # noqa: ANN401 - created by rosbags
        """Return the message class that rosbags creates for a type."""


def convert_definition(
    entries: Sequence[tuple[str, Any]],
) -> tuple[list[tuple[str, Any]], tuple[RosField, ...]]:
    """Convert a type description of rosbags. The type `char` becomes `uint8`.

    Args:
        entries: Name and type of each field, as in rosbags.

    Returns:
        The converted description, and the fields.
    """
    converted = [(name, _replace_char(each)) for name, each in entries]
    return converted, tuple(_field(name, each) for name, each in converted)


def _replace_char(description: Any) -> Any:  # noqa: ANN401 - nested pairs
    kind, details = description
    if kind == _BASE:
        return (kind, ("uint8", 0)) if details[0] == "char" else description
    return description if kind == _NAME else (kind, (_replace_char(details[0]), details[1]))


def _field(name: str, description: Any) -> RosField:  # noqa: ANN401 - nested pairs
    kind, details = description
    if kind == _NAME:
        return RosField(name, details, is_message=True)
    if kind == _BASE:
        return RosField(name, details[0], is_message=False, max_text_bytes=details[1])
    item = _field(name, details[0])
    length = details[1] if kind == _ARRAY else -1
    return RosField(name, item.kind, item.is_message, length, details[1], item.max_text_bytes)


# ---- maps to messages


def to_message(types: TypeRegistry, name: str, payload: object) -> Any:  # noqa: ANN401 - not typed
    """Convert a map to a message object of rosbags; missing fields are zero, empty or False.

    Args:
        types: Registry of message types.
        name: Name of the type.
        payload: Map to convert.

    Raises:
        FieldPathError: A value is invalid.
    """
    if not isinstance(payload, Mapping):
        raise FieldPathError(_("publish a map of the fields of '{name}'").format(name=name))
    fields = {field.name: field for field in types.fields(name) if field.name != PLACEHOLDER_FIELD}
    for key in payload:
        if key not in fields:
            raise FieldPathError(
                _("isn't a field of '{name}'; its fields: {fields}").format(
                    name=name, fields=", ".join(f"'{field}'" for field in fields) or _("none")
                ),
                str(key),
            )
    values = {}
    for field in types.fields(name):
        if field.name not in payload:
            values[field.name] = _default_value(types, field)
            continue
        try:
            values[field.name] = _convert_value(types, field, payload[field.name])
        except FieldPathError as error:
            raise error.within(field.name) from None
    return types.message_class(name)(**values)


def _default_value(types: TypeRegistry, field: RosField) -> Any:  # noqa: ANN401 - depends on the field
    if field.length is None:
        if field.is_message:
            return to_message(types, field.kind, {})
        return "" if field.kind == "string" else _NUMERIC_DEFAULTS.get(field.kind, 0)
    count = max(field.length, 0)
    if field.is_message:
        return [to_message(types, field.kind, {}) for _ in range(count)]
    return [""] * count if field.kind == "string" else _import_numpy().zeros(count, _NUMPY_DTYPES[field.kind])


_NUMERIC_DEFAULTS: Mapping[str, bool | float] = {"bool": False, "float32": 0.0, "float64": 0.0}


def _convert_value(types: TypeRegistry, field: RosField, value: object) -> Any:  # noqa: ANN401 - depends on the field
    if field.length is not None:
        return _convert_items(types, field, value)
    if not field.is_message:
        return _convert_scalar(field, value)
    if not isinstance(value, Mapping):
        raise wrong_type_error(value, _("a map of the fields"))
    return to_message(types, field.kind, value)


def _convert_scalar(field: RosField, value: object) -> str | bool | int | float:
    if field.kind == "string":
        return _convert_text(field, value)
    value = _unwrap_scalar(value)
    if field.kind == "bool":
        if not isinstance(value, bool):
            raise wrong_type_error(value, _("True or False"))
        return value
    if field.kind in _FLOAT_TYPES:
        return _convert_float(field, value)
    low, high = _INTEGER_RANGES[field.kind]
    if not isinstance(value, int) or isinstance(value, bool):
        raise wrong_type_error(value, _("a whole number"))
    if not low <= value <= high:
        raise FieldPathError(
            _("must be from {least} to {most}, the range of '{kind}'").format(
                least=low, most=high, kind=field.kind
            )
        )
    return value - 256 if field.kind == "byte" and value > 127 else value  # rosbags stores bytes as signed


def _convert_float(field: RosField, value: object) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise wrong_type_error(value, _("a number"))
    try:
        number = float(value)
    except OverflowError:
        number = math.nan
        is_in_range = False
    else:
        is_in_range = field.kind != "float32" or math.isinf(number) or not abs(number) >= _FLOAT32_OVERFLOW
    if not is_in_range:
        raise FieldPathError(_("is too large for '{kind}'").format(kind=field.kind))
    return number


def _convert_text(field: RosField, value: object) -> str:
    if not isinstance(value, str):
        raise wrong_type_error(value, _("a '{name}'").format(name="str"))
    if "\0" in value:
        raise FieldPathError(_("contains a null character, which isn't allowed in ROS strings"))
    try:
        size = len(value.encode())
    except UnicodeEncodeError:
        raise FieldPathError(_("contains an unpaired surrogate")) from None
    if field.max_text_bytes and size > field.max_text_bytes:
        raise FieldPathError(
            _("is {size} bytes; at most {most} are allowed").format(size=size, most=field.max_text_bytes)
        )
    return value


def _convert_items(types: TypeRegistry, field: RosField, value: object) -> Any:  # noqa: ANN401 - a list or an array
    if isinstance(value, str) or not (
        isinstance(value, Sequence | bytes | bytearray | memoryview) or hasattr(value, "__array__")
    ):
        raise wrong_type_error(value, _("a list"))
    dimensions = getattr(value, "ndim", 1)
    if dimensions != 1:
        raise FieldPathError(
            _("has {count} dimensions; use one dimension, for example with 'ravel()'").format(
                count=dimensions
            )
        )
    if field.is_message or field.kind == "string":
        item_field = RosField(field.name, field.kind, field.is_message, max_text_bytes=field.max_text_bytes)
        items: Any = _convert_each(list(value), lambda item: _convert_value(types, item_field, item))  # type: ignore[call-overload]
    else:
        items = _convert_array(field, value)
    if field.length is not None and field.length >= 0 and len(items) != field.length:
        raise FieldPathError(
            _("has {count} items; expected {length}").format(count=len(items), length=field.length)
        )
    if field.size and len(items) > field.size:
        raise FieldPathError(
            _("has {count} items; at most {most} are allowed").format(count=len(items), most=field.size)
        )
    return items


def _convert_each(values: list[Any], convert: Callable[[object], Any]) -> list[Any]:
    items = []
    for index, value in enumerate(values):
        try:
            items.append(convert(value))
        except FieldPathError as error:
            raise error.within(index) from None
    return items


def _convert_array(field: RosField, value: Any) -> Any:  # noqa: ANN401 - an array of numpy
    # Validates the whole array at once; item by item only to find the path of an invalid one.
    np = _import_numpy()
    dtype = np.dtype(_NUMPY_DTYPES[field.kind])
    if isinstance(value, bytes | bytearray | memoryview):
        if field.kind not in _OCTET_TYPES:
            raise wrong_type_error(value, _("a list"))
        return np.frombuffer(bytes(value), np.uint8)
    try:
        array = np.asarray(value)
    except (ValueError, OverflowError, TypeError):
        array = np.empty((), object)
    if array.ndim == 1 and (not array.size or _is_convertible(array, field, dtype)):
        return np.ascontiguousarray(array.astype(dtype))
    item_field = RosField(field.name, "uint8" if field.kind in _OCTET_TYPES else field.kind, is_message=False)
    return np.array(_convert_each(list(value), lambda item: _convert_scalar(item_field, item)), dtype)


def _is_convertible(array: Any, field: RosField, dtype: Any) -> bool:  # noqa: ANN401 - an array, a type of numbers
    # False means that the items must be checked one by one.
    if array.dtype == dtype:
        return True
    if field.kind in _FLOAT_TYPES:
        if array.dtype.kind not in "iuf":
            return False
        if field.kind == "float64" or array.dtype.kind != "f":
            return True
        finite = array[_import_numpy().isfinite(array)]
        return not finite.size or bool(abs(finite).max() < _FLOAT32_OVERFLOW)
    if field.kind == "bool" or array.dtype.kind not in "iu":
        return False
    low, high = _INTEGER_RANGES[field.kind]
    return bool(low <= int(array.min()) and int(array.max()) <= high)


def _unwrap_scalar(value: object) -> object:
    if isinstance(value, bool | int | float | str) or getattr(value, "shape", None) != ():
        return value
    return value.item() if hasattr(value, "item") else value


# ---- messages to maps


def from_message(types: TypeRegistry, name: str, message: Any) -> dict[str, object]:  # noqa: ANN401 - not typed
    """Convert a message object of rosbags to a map of maps, lists, `bytes`, numbers and strings."""
    return {
        each.name: _to_plain(types, each, getattr(message, each.name))
        for each in types.fields(name)
        if each.name != PLACEHOLDER_FIELD
    }


def _to_plain(types: TypeRegistry, field: RosField, value: Any) -> object:  # noqa: ANN401 - depends on the field
    if field.length is None:
        if field.is_message:
            return from_message(types, field.kind, value)
        return value & 255 if field.kind == "byte" else value
    if field.is_message:
        return [from_message(types, field.kind, each) for each in value]
    if field.kind == "string":
        return list(value)
    return value.tobytes() if field.kind in _OCTET_TYPES else value.tolist()


def _import_numpy() -> Any:  # noqa: ANN401 - the module numpy
    import numpy as np  # noqa: PLC0415 - optional and slow to import

    return np
