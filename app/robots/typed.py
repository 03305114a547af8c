"""From the types of a Python function to the data schemas of its description.

A parameter is ``float``, ``int``, ``bool``, ``str``, ``list[str]``, a ``Literal`` or :data:`Colour`; what the
type can't say is annotated: ``Annotated[float, Range(-2, 2, step=0.05, unit="m")]``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias, get_args, get_origin, get_type_hints

Schema: TypeAlias = dict[str, object]
_TYPES: Mapping[object, str] = {float: "number", int: "integer", bool: "boolean", str: "string"}


@dataclass(frozen=True)
class Range:
    """Limits of a number, its unit as in UCUM ("m", "deg", "s", "%"), and the step that editors offer."""

    minimum: float | None = None
    maximum: float | None = None
    step: float | None = None
    unit: str | None = None
    widget: str | None = None


@dataclass(frozen=True)
class Text:
    """How long a text may be."""

    min_length: int = 0
    max_length: int | None = None


@dataclass(frozen=True)
class Words:
    """The words that people see for the values of a ``Literal``."""

    shown: Mapping[str, str]


@dataclass(frozen=True)
class Title:
    """What a form calls the value, when its Python name won't do."""

    text: str


@dataclass(frozen=True)
class Suggested:
    """What forms and blocks start with; the caller must give the value all the same."""

    value: object


@dataclass(frozen=True)
class Advanced:
    """Folded away in forms."""


@dataclass(frozen=True)
class _HexColour:
    """A text that is a colour."""


@dataclass(frozen=True)
class _PictureText:
    """A text that is a picture."""


Colour: TypeAlias = Annotated[str, _HexColour()]
Image: TypeAlias = Annotated[str, _PictureText()]
"""A picture as ``data:image/jpeg;base64,...``, or its address."""


def schema_of(annotation: object) -> Schema:
    """The data schema of a type; TypeError names what can't be described."""
    notes: tuple[object, ...] = ()
    if get_origin(annotation) is Annotated:
        annotation, *rest = get_args(annotation)
        notes = tuple(rest)
    schema = _plain(annotation)
    for note in notes:
        schema.update(_noted(note, schema))
    return schema


def _plain(annotation: object) -> Schema:
    if annotation in _TYPES:
        return {"type": _TYPES[annotation]}
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        kind = "string" if all(isinstance(value, str) for value in arguments) else "number"
        return {"type": kind, "enum": list(arguments)}
    if origin is list and len(arguments) == 1:
        return {"type": "array", "items": schema_of(arguments[0])}
    raise TypeError(
        f"a robot's value can't be {annotation!r}; use float, int, bool, str, list[...] or Literal"
    )


def _noted(note: object, schema: Schema) -> Schema:
    if isinstance(note, Range):
        step = "multipleOf" if schema.get("type") == "integer" else "rb:step"
        found = {"minimum": note.minimum, "maximum": note.maximum, step: note.step, "unit": note.unit}
        return _given(found | {"rb:widget": note.widget})
    if isinstance(note, Text):
        return _given({"minLength": note.min_length or None, "maxLength": note.max_length})
    if isinstance(note, Words):
        values = schema.pop("enum", [])
        names = values if isinstance(values, list) else []
        return {"oneOf": [{"const": value, "title": note.shown.get(value, str(value))} for value in names]}
    if isinstance(note, Title):
        return {"title": note.text}
    if isinstance(note, Suggested):
        return {"default": note.value}
    if isinstance(note, Advanced):
        return {"rb:advanced": True}
    if isinstance(note, _HexColour):
        return {"pattern": "^#[0-9a-fA-F]{6}$", "rb:widget": "colour"}
    if isinstance(note, _PictureText):
        return {"format": "uri-reference", "contentMediaType": "image/jpeg", "rb:widget": "image"}
    raise TypeError(f"{note!r} says nothing about a robot's value")


def _given(found: Mapping[str, object]) -> Schema:
    return {name: value for name, value in found.items() if value is not None}


def input_schema(function: Callable[..., object]) -> Schema | None:
    """The schema of an action's input: the parameters but ``self`` and ``call``; None without any."""
    hints: dict[str, Any] = get_type_hints(function, include_extras=True)
    properties: dict[str, Schema] = {}
    required = []
    for name, parameter in inspect.signature(function).parameters.items():
        if name in {"self", "call"}:
            continue
        if name not in hints:
            raise TypeError(f"{function.__qualname__}: '{name}' has no type; robots need to know it")
        schema = schema_of(hints[name])
        schema.setdefault("title", name.replace("_", " "))
        if parameter.default is inspect.Parameter.empty:
            required.append(name)
        else:
            schema["default"] = parameter.default
        properties[name] = schema
    if not properties:
        return None
    return _given({"type": "object", "required": required or None, "properties": properties})


def fields_schema(fields: Mapping[str, object]) -> Schema:
    """The schema of an object with these typed fields."""
    properties = {name: {"title": name.replace("_", " "), **schema_of(kind)} for name, kind in fields.items()}
    return {"type": "object", "properties": properties}
