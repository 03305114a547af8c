"""Conversion of the types in a Python declaration to the data schemas of the robot's description.

A type is ``float``, ``int``, ``bool``, ``str``, :data:`Colour`, ``list``, ``tuple``, ``dict``, ``Optional``,
a ``Literal`` or Enum, a dataclass or TypedDict. Constraints are annotations: ``Annotated[float, Range(-2, 2,
step=0.05, unit="m")]``.
"""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NoReturn, TypeAlias, get_args, get_origin, get_type_hints

from app.errors import RobotValueError
from app.robots.description.json_access import as_object
from app.robots.driver.schema_values import (
    choices_in,
    fields_of,
    format_type,
    split_annotated,
    split_optional,
    to_json,
)
from nep.i18n import _

Schema: TypeAlias = dict[str, object]
_MAX_UNIT_LENGTH = 16
_UNIT_SPELLINGS = {
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "centimeter": "cm", "centimeters": "cm",
    "millimeter": "mm", "millimeters": "mm", "degree": "deg", "degrees": "deg", "°": "deg", "radian": "rad",
    "radians": "rad", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "minute": "min",
    "minutes": "min", "hour": "h", "hours": "h", "percent": "%", "percentage": "%", "°c": "Cel",
    "celsius": "Cel", "meters/second": "m/s", "m/sec": "m/s", "mps": "m/s", "degrees/second": "deg/s",
    "°/s": "deg/s", "hertz": "Hz", "volt": "V", "volts": "V", "kilogram": "kg", "kilograms": "kg",
}  # fmt: skip
_TYPES: Mapping[object, str] = {float: "number", int: "integer", bool: "boolean", str: "string"}


@dataclass(frozen=True)
class Range:
    """Limits and unit of a number.

    Attributes:
        minimum: Smallest value.
        maximum: Largest value.
        step: Step of editors; values between steps are valid too.
        unit: Unit as in UCUM ("m", "deg", "s", "%").
        widget: Preferred editor, such as "slider" or "angle".
    """

    minimum: float | None = None
    maximum: float | None = None
    step: float | None = None
    unit: str | None = None
    widget: str | None = None


@dataclass(frozen=True)
class Text:
    """Limits for the length of a text in characters."""

    min_length: int = 0
    max_length: int | None = None


@dataclass(frozen=True)
class Words:
    """Texts shown for the values of a ``Literal``, by value."""

    labels: Mapping[str, str]


@dataclass(frozen=True)
class Title:
    """Display name of a parameter or field, instead of its name in Python."""

    text: str


@dataclass(frozen=True)
class Suggested:
    """Initial value of a required parameter in forms and blocks."""

    value: object


@dataclass(frozen=True)
class Advanced:
    """Marker of a parameter that forms collapse."""


@dataclass(frozen=True)
class _HexColour:
    """Marker of a text that is a colour."""


@dataclass(frozen=True)
class _ImageText:
    """Marker of a text that is an image."""


Colour: TypeAlias = Annotated[str, _HexColour()]
Image: TypeAlias = Annotated[str, _ImageText()]
"""Image as ``data:image/jpeg;base64,...``, or as the address of an image."""


def schema_of(annotation: object) -> Schema:
    """Return the data schema of a type. Raises TypeError for unsupported types."""
    return _schema_of(annotation, ())


def _schema_of(annotation: object, enclosing: tuple[object, ...]) -> Schema:
    annotation, notes = split_annotated(annotation)
    inner_type, is_optional = split_optional(annotation)
    schema = (
        _type_schema(annotation, enclosing) if inner_type is annotation else _schema_of(inner_type, enclosing)
    )
    if is_optional:
        schema["rb:nullable"] = True
    for note in notes:
        schema.update(_annotation_schema(note, schema))
    return schema


def _type_schema(annotation: object, enclosing: tuple[object, ...]) -> Schema:
    if isinstance(annotation, type) and annotation in _TYPES:
        return {"type": _TYPES[annotation]}
    choices = choices_in(annotation)
    if choices is not None:
        return _choice_schema(annotation, choices)
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in {list, Sequence} and len(arguments) == 1:
        return {"type": "array", "items": _element_schema(arguments[0], enclosing)}
    if origin is tuple and len(arguments) == 2 and arguments[1] is Ellipsis:
        return {"type": "array", "items": _element_schema(arguments[0], enclosing)}
    if origin is tuple and arguments:
        element_schemas = [_element_schema(each, enclosing) for each in arguments]
        return {
            "type": "array",
            "items": element_schemas,
            "minItems": len(element_schemas),
            "maxItems": len(element_schemas),
        }
    if origin in {dict, Mapping} and len(arguments) == 2 and arguments[0] is str:
        is_unrestricted = arguments[1] in (Any, object)
        return {"type": "object"} | (
            {} if is_unrestricted else {"additionalProperties": _element_schema(arguments[1], enclosing)}
        )
    if annotation in enclosing:
        raise TypeError(
            _("recursive types aren't supported: {annotation}").format(annotation=format_type(annotation))
        )
    fields = fields_of(annotation)
    if fields is not None:
        return _object_schema(fields, (*enclosing, annotation))
    raise TypeError(
        _(
            "unsupported type {annotation}; use float, int, bool, str, list[...], tuple[...], "
            "dict[str, ...], Literal, Optional, an Enum, a dataclass or a TypedDict"
        ).format(annotation=format_type(annotation))
    )


def _element_schema(annotation: object, enclosing: tuple[object, ...]) -> Schema:
    # Elements of a list or map: None is not allowed.
    if split_optional(split_annotated(annotation)[0])[1]:
        raise TypeError(
            _("items of a list or dict can't be None: {annotation}; leave them out").format(
                annotation=format_type(annotation)
            )
        )
    return _schema_of(annotation, enclosing)


def _choice_schema(annotation: object, choices: tuple[tuple[object, object, str | None], ...]) -> Schema:
    values = [value for value, _, _ in choices]
    if not all(isinstance(value, (str, int, float)) and not isinstance(value, bool) for value in values):
        raise TypeError(
            _("choices must be strings or numbers, not {annotation}; for true or false, use bool").format(
                annotation=format_type(annotation)
            )
        )
    are_texts = [isinstance(value, str) for value in values]
    schema: Schema = (
        {} if any(are_texts) and not all(are_texts) else {"type": "string" if all(are_texts) else "number"}
    )
    if any(title is not None for _, _, title in choices):
        return schema | {"oneOf": [{"const": value, "title": title} for value, _, title in choices]}
    return schema | {"enum": values}


def _object_schema(fields: Mapping[str, tuple[object, bool]], enclosing: tuple[object, ...]) -> Schema:
    properties = {
        name: {"title": name.replace("_", " "), **_schema_of(kind, enclosing)}
        for name, (kind, _) in fields.items()
    }
    required = [
        name
        for name, (kind, is_required) in fields.items()
        if is_required and not split_optional(split_annotated(kind)[0])[1]
    ]
    return _without_none({"type": "object", "required": required or None, "properties": properties})


def _annotation_schema(note: object, schema: Schema) -> Schema:
    if isinstance(note, Range):
        _check_unit(note.unit)
        step = "multipleOf" if schema.get("type") == "integer" else "rb:step"
        keywords = {"minimum": note.minimum, "maximum": note.maximum, step: note.step, "unit": note.unit}
        return _without_none(keywords | {"rb:widget": note.widget})
    if isinstance(note, Text):
        return _without_none({"minLength": note.min_length or None, "maxLength": note.max_length})
    if isinstance(note, Words):
        values = schema.pop("enum", None)
        if values is None:
            titled_choices = schema.get("oneOf")
            values = (
                [as_object(each).get("const") for each in titled_choices]
                if isinstance(titled_choices, list)
                else []
            )
        choices = values if isinstance(values, list) else []
        return {"oneOf": [{"const": value, "title": note.labels.get(value, str(value))} for value in choices]}
    if isinstance(note, Title):
        return {"title": note.text}
    if isinstance(note, Suggested):
        return {"default": note.value}
    if isinstance(note, Advanced):
        return {"rb:advanced": True}
    if isinstance(note, _HexColour):
        return {"pattern": "^#[0-9a-fA-F]{6}$", "rb:widget": "colour"}
    if isinstance(note, _ImageText):
        return {"format": "uri-reference", "contentMediaType": "image/jpeg", "rb:widget": "image"}
    raise TypeError(_("{note} isn't a valid annotation for a robot's value").format(note=repr(note)))


def _without_none(keywords: Mapping[str, object]) -> Schema:
    return {name: value for name, value in keywords.items() if value is not None}


def _check_unit(unit: object) -> None:
    if unit is None:
        return
    if not isinstance(unit, str):
        raise TypeError(
            _("a unit must be a string such as 'm', not {unit}; use Range(0, 1, unit='m')").format(
                unit=repr(unit)
            )
        )
    sign = _UNIT_SPELLINGS.get(unit.lower())
    if sign is not None:
        raise TypeError(_("unknown unit {unit}; write {sign}").format(unit=repr(unit), sign=repr(sign)))
    if not unit or len(unit) > _MAX_UNIT_LENGTH or not unit.isprintable() or " " in unit:
        raise TypeError(
            _("unknown unit {unit}; use UCUM: 'm', 'deg', 's', 'm/s', '%'").format(unit=repr(unit))
        )


def input_types(function: Callable[..., object]) -> dict[str, object]:
    """Return the types of an action's parameters by name, without ``self`` and ``call``.

    Raises:
        TypeError: A parameter has no type, or is variadic or positional-only.
    """
    hints: dict[str, Any] = get_type_hints(function, include_extras=True)
    types_by_name: dict[str, object] = {}
    parameters = list(inspect.signature(function).parameters.values())
    for index, parameter in enumerate(parameters):
        name = parameter.name
        if name in {"self", "call"}:
            continue
        if parameter.kind is parameter.VAR_POSITIONAL or parameter.kind is parameter.VAR_KEYWORD:
            raise TypeError(
                _(
                    "'{name}' can't take a variable number of arguments; declare each parameter, or use a "
                    "list"
                ).format(name=name)
            )
        if parameter.kind is parameter.POSITIONAL_ONLY:
            raise TypeError(_("'{name}' can't be positional-only; remove the '/'").format(name=name))
        if name not in hints:
            message = (
                _("{function}: '{value}' has no type; the first parameter after 'self' must be 'call: Call'")
                if index < 2 and "call" not in {each.name for each in parameters}
                else _("{function}: '{value}' needs a type annotation")
            )
            raise TypeError(message.format(function=function.__qualname__, value=name))
        types_by_name[name] = hints[name]
    return types_by_name


def return_type(function: Callable[..., object]) -> object:
    """Return the annotated return type of a function; None if there is none or it has no particular schema.

    For a coroutine, the type of its result is returned. Types such as ``object`` or ``dict`` have no
    particular schema.
    """
    kind = get_type_hints(function, include_extras=True).get("return")
    if get_origin(kind) in {Awaitable, Coroutine}:
        kind = get_args(kind)[-1]
    bare_type, _ = split_annotated(kind)
    is_unrestricted = bare_type in (None, type(None), Any, object, dict, Mapping, NoReturn)
    return None if is_unrestricted or get_args(bare_type)[1:] in ((object,), (Any,)) else kind


def input_schema(function: Callable[..., object]) -> Schema | None:
    """Return the object schema of an action's input; None if the action has no parameters."""
    properties: dict[str, Schema] = {}
    required = []
    parameters = inspect.signature(function).parameters
    for name, kind in input_types(function).items():
        schema = schema_of(kind)
        schema.setdefault("title", name.replace("_", " "))
        default = parameters[name].default
        if default is inspect.Parameter.empty:
            if not split_optional(split_annotated(kind)[0])[1]:
                required.append(name)
        elif default is not None:
            schema["default"] = _default_json(kind, default, name)
        properties[name] = schema
    if not properties:
        return None
    return _without_none({"type": "object", "required": required or None, "properties": properties})


def _default_json(kind: object, default: object, name: str) -> object:
    try:
        return to_json(kind, default)
    except RobotValueError as error:
        raise TypeError(str(error.nested_in(_("the default of '{name}'").format(name=name)))) from error


def fields_schema(fields: Mapping[str, object]) -> Schema:
    """Return the schema of an object.

    Args:
        fields: Types of the fields by name.
    """
    properties = {name: {"title": name.replace("_", " "), **schema_of(kind)} for name, kind in fields.items()}
    return {"type": "object", "properties": properties}
