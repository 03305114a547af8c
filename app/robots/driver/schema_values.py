"""Values of typed Python: inspection of types, and conversion from and to JSON.

:func:`from_json` converts valid JSON to an argument of a function. :func:`to_json` converts a value of a
driver to JSON and raises RobotValueError if the value is invalid: "the value must be a number, not 'far'".
"""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Mapping, Sequence
from enum import Enum
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints, is_typeddict

from app.errors import RobotValueError
from nep.i18n import _, format_list, lazy

_MAX_DISPLAYED_LENGTH = 40
_TYPE_MESSAGES = {
    bool: lazy("{place} must be True or False, not {value}"),
    str: lazy("{place} must be text, not {value}"),
    int: lazy("{place} must be a whole number, not {value}"),
    float: lazy("{place} must be a number, not {value}"),
}
_MAX_DEPTH = 40


def split_annotated(annotation: object) -> tuple[object, tuple[object, ...]]:
    """Split an ``Annotated`` type into the type and its annotations."""
    if get_origin(annotation) is Annotated:
        bare_type, *notes = get_args(annotation)
        return bare_type, tuple(notes)
    return annotation, ()


def split_optional(annotation: object) -> tuple[object, bool]:
    """Split an ``Optional`` type into the inner type and True; other types are returned with False.

    The union ``int | float`` is returned as ``float``. Raises TypeError for other unions.
    """
    if get_origin(annotation) not in {Union, UnionType}:
        return annotation, False
    kinds = [kind for kind in get_args(annotation) if kind is not type(None)]
    is_optional = len(kinds) < len(get_args(annotation))
    if set(kinds) == {int, float}:
        return float, is_optional
    if len(kinds) != 1:
        raise TypeError(
            _("a union of several types isn't supported: {annotation}").format(
                annotation=format_type(annotation)
            )
        )
    return kinds[0], is_optional


def fields_of(annotation: object) -> Mapping[str, tuple[object, bool]] | None:
    """Return type and required flag of each field of a dataclass or TypedDict; None for other types."""
    if not isinstance(annotation, type):
        return None
    if dataclasses.is_dataclass(annotation):
        hints = get_type_hints(annotation, include_extras=True)
        missing = dataclasses.MISSING
        return {
            each.name: (hints[each.name], each.default is missing and each.default_factory is missing)
            for each in dataclasses.fields(annotation)
            if each.init
        }
    if is_typeddict(annotation):
        required: frozenset[str] = getattr(annotation, "__required_keys__", frozenset())
        hints = get_type_hints(annotation, include_extras=True)
        return {name: _field_type(kind, name in required) for name, kind in hints.items()}
    return None


def _field_type(kind: object, is_required: bool) -> tuple[object, bool]:
    # Required and NotRequired take precedence over `__required_keys__`, which misses them in modules with
    # string annotations.
    origin_name = str(get_origin(kind))
    return (
        (get_args(kind)[0], "Not" not in origin_name)
        if origin_name.endswith("Required")
        else (kind, is_required)
    )


def choices_in(annotation: object) -> tuple[tuple[object, object, str | None], ...] | None:
    """Return the choices of a Literal or Enum type; None for other types.

    An Enum whose values JSON can't represent is represented by the names of its members.

    Returns:
        Tuples of JSON value, Python value, and text (None for a Literal).
    """
    if get_origin(annotation) is Literal:
        return tuple((value, value, None) for value in get_args(annotation))
    if not (isinstance(annotation, type) and issubclass(annotation, Enum)):
        return None
    members = list(annotation)
    has_plain_values = all(isinstance(each.value, (str, int, float)) for each in members)
    has_plain_values = has_plain_values and not any(isinstance(each.value, bool) for each in members)
    titles = [each.name.lower().replace("_", " ") for each in members]
    return tuple(
        (each.value if has_plain_values else each.name, each, title)
        for each, title in zip(members, titles, strict=True)
    )


def format_type(annotation: object) -> str:
    """Format a type as in source code, such as ``float``, ``list[str]`` or ``Pose``."""
    if isinstance(annotation, type) and get_origin(annotation) is None:
        return annotation.__name__
    return str(annotation).replace("typing.", "")


def from_json(annotation: object, value: object) -> object:
    """Convert a valid JSON value to an argument of a function.

    Args:
        annotation: Type of the parameter.
        value: JSON value.

    Raises:
        ValueError: The constructor of a dataclass rejected the value.
    """
    kind, is_optional = split_optional(split_annotated(annotation)[0])
    kind = split_annotated(kind)[0]
    if value is None and is_optional:
        return None
    choices = choices_in(kind)
    if choices is not None:
        return next((python for json, python, _title in choices if is_json_equal(json, value)), value)
    if kind is float and isinstance(value, (int, float)):
        return float(value)
    if kind is int and isinstance(value, (int, float)):
        return int(value)
    fields = fields_of(kind)
    if fields is not None and isinstance(value, Mapping):
        arguments_by_name = {
            name: from_json(each, value[name])
            for name, (each, _is_required) in fields.items()
            if name in value
        }
        if not dataclasses.is_dataclass(kind):
            return arguments_by_name
        omitted = {
            name: None
            for name, (each, is_required) in fields.items()
            if is_required and name not in arguments_by_name
        }
        return kind(**omitted, **arguments_by_name)  # type: ignore[operator]  # fields_of returns fields only for classes
    arguments = get_args(kind)
    if isinstance(value, (list, tuple)) and arguments:
        if get_origin(kind) is tuple and arguments[1:] != (Ellipsis,):
            return tuple(from_json(each, item) for each, item in zip(arguments, value, strict=False))
        items = [from_json(arguments[0], item) for item in value]
        return tuple(items) if get_origin(kind) is tuple else items
    if isinstance(value, Mapping) and len(arguments) == 2:
        return {str(name): from_json(arguments[1], item) for name, item in value.items()}
    return value


def to_json(annotation: object, value: object) -> object:
    """Convert a value of a driver to JSON.

    Args:
        annotation: Declared type.
        value: Value.

    Raises:
        RobotValueError: The value doesn't match the type.
    """
    kind, is_optional = split_optional(split_annotated(annotation)[0])
    kind = split_annotated(kind)[0]
    if value is None and is_optional:
        return None
    if kind in (Any, object):
        return any_to_json(value)
    value = _from_numpy(value)
    choices = choices_in(kind)
    if choices is not None:
        matches = [json for json, python, _title in choices if python is value or is_json_equal(json, value)]
        if not matches:
            choice_texts = [str(json) for json, _python, _title in choices]
            raise RobotValueError(
                lazy("{place} must be {choices}, not {value}"),
                choices=format_list(choice_texts, "or"),
                value=_format_value(value),
            )
        return matches[0]
    if kind in (float, int, bool, str):
        return _scalar_to_json(kind, value)
    fields = fields_of(kind)
    if fields is not None:
        return fields_to_json(
            {name: each for name, (each, _is_required) in fields.items()}, value, _required_names(fields)
        )
    return _collection_to_json(kind, value)


def fields_to_json(
    kinds: Mapping[str, object], value: object, required: Sequence[str] = ()
) -> dict[str, object]:
    """Convert a mapping or dataclass instance with declared fields to a JSON object.

    Undeclared fields are included. None is allowed for fields that aren't required and means unknown.

    Args:
        kinds: Declared types of the fields by name.
        value: Value.
        required: Names of required fields.

    Raises:
        RobotValueError: A field is invalid or missing; the error names the field.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {item.name: getattr(value, item.name) for item in dataclasses.fields(value)}
    if not isinstance(value, Mapping):
        names = format_list(list(kinds)) or _("named values")
        raise RobotValueError(
            lazy("{place} must be an object with {names}, not {value}"),
            names=names,
            value=_format_value(value),
        )
    encoded: dict[str, object] = {}
    for name, item in value.items():
        try:
            is_unknown = item is None and name not in required
            encoded[str(name)] = (
                to_json(kinds[name], item) if name in kinds and not is_unknown else any_to_json(item)
            )
        except RobotValueError as error:
            raise error.nested_in(str(name)) from error
    for name in required:
        if name not in encoded:
            raise RobotValueError(lazy("{place} is missing"), name)
    return encoded


def any_to_json(value: object, depth: int = 0) -> object:
    """Convert a value of any type to JSON. Raises RobotValueError if JSON can't represent it."""
    value = _from_numpy(value)
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, Enum):
        return any_to_json(value.value, depth + 1)
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        return float(value)
    if depth > _MAX_DEPTH:
        raise RobotValueError(lazy("{place} is nested too deeply"))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {each.name: getattr(value, each.name) for each in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(name): any_to_json(item, depth + 1) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [any_to_json(item, depth + 1) for item in value]
    raise RobotValueError(lazy("{place} must be a JSON value, not {value}"), value=_format_value(value))


def check_encodable(value: object) -> None:
    """Raise RobotValueError for NaN, infinity and lone surrogates, which messages can't contain."""
    if isinstance(value, str) and not value.isascii() and any("\ud800" <= each <= "\udfff" for each in value):
        raise RobotValueError(lazy("{place} must be valid Unicode text"))
    if isinstance(value, float) and not math.isfinite(value):
        raise RobotValueError(lazy("{place} must be a finite number, not {value}"), value=value)
    if isinstance(value, Mapping):
        for item in value.values():
            check_encodable(item)
    elif isinstance(value, list):
        for item in value:
            check_encodable(item)


def is_json_equal(allowed: object, value: object) -> bool:
    """Return True if two values are equal in JSON, where 1 differs from true."""
    return allowed == value and isinstance(allowed, bool) == isinstance(value, bool)


def _scalar_to_json(kind: object, value: object) -> object:
    expected, message = next((each, message) for each, message in _TYPE_MESSAGES.items() if each is kind)
    if expected is bool or expected is str:
        is_valid = isinstance(value, expected)
    else:
        number = _number(value)
        is_valid = number is not None and (expected is float or float(number).is_integer())
        if is_valid and number is not None:
            return number if expected is float else int(number)
    if not is_valid:
        raise RobotValueError(message, value=_format_value(value))
    return value


def _number(value: object) -> int | float | None:
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return None
    return int(value) if isinstance(value, numbers.Integral) else float(value)


def _collection_to_json(kind: object, value: object) -> object:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in {dict, Mapping}:
        if not isinstance(value, Mapping):
            raise RobotValueError(
                lazy("{place} must be an object with named values, not {value}"), value=_format_value(value)
            )
        return {str(name): _element_to_json(arguments[1], item, str(name)) for name, item in value.items()}
    if not isinstance(value, (list, tuple)):
        raise RobotValueError(lazy("{place} must be a list, not {value}"), value=_format_value(value))
    if origin is tuple and arguments[1:] != (Ellipsis,):
        if len(value) != len(arguments):
            raise RobotValueError(
                lazy("{place} must have {count} values, not {given}"), count=len(arguments), given=len(value)
            )
        return [
            _element_to_json(each, item, position)
            for position, (each, item) in enumerate(zip(arguments, value, strict=True), 1)
        ]
    return [_element_to_json(arguments[0], item, position) for position, item in enumerate(value, 1)]


def _element_to_json(kind: object, value: object, location: int | str) -> object:
    try:
        return to_json(kind, value)
    except RobotValueError as error:
        location_text = (
            f"“{location}”" if isinstance(location, str) else _("value {number}").format(number=location)
        )
        raise error.nested_in(location_text) from error


def _required_names(fields: Mapping[str, tuple[object, bool]]) -> list[str]:
    return [
        name
        for name, (kind, is_required) in fields.items()
        if is_required and not split_optional(split_annotated(kind)[0])[1]
    ]


def _from_numpy(value: object) -> object:
    if type(value).__module__ == "numpy" and hasattr(value, "tolist"):
        return value.tolist()
    return value


def _format_value(value: object) -> str:
    text = repr(value) if isinstance(value, (str, int, float, bool, type(None))) else type(value).__name__
    return text if len(text) <= _MAX_DISPLAYED_LENGTH else f"{text[:_MAX_DISPLAYED_LENGTH]}…"
