"""Parameters of actions, and validation of action inputs with messages for the user.

An example of a message is ``turn: angle must be between -360 and 360 °``.
"""

from __future__ import annotations

import difflib
import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from app.errors import InputProblem
from app.robots.description.json_access import (
    as_object,
    display_text,
    names,
    number,
    object_member,
    text,
    to_number,
)
from nep.i18n import _, format_list, ngettext, translate
from nep.i18n import number as number_text
from nep.text import bounded_str, quotable

_HEX_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_LENGTH_KEYS, _ITEM_COUNT_KEYS = ("minLength", "maxLength"), ("minItems", "maxItems")
_MAX_DEPTH = 40
_MAX_WORD_LENGTH = 100
_MAX_UNKNOWN_REPORTED = 5  # a similarity search takes 20 µs, and untrusted input may have any number of names
NUMBER_KINDS = frozenset({"number", "integer", "angle"})
_UNIT_SYMBOLS = {"deg": "°", "deg/s": "°/s", "Cel": "°C", "degC": "°C", "um": "µm"}


@dataclass(frozen=True)
class Choice:
    """Allowed value of a parameter, with the text shown for it."""

    value: str | int | float
    title: str


@dataclass(frozen=True)
class Parameter:
    """Parameter of an action, or field of an event.

    Attributes:
        name: Name in messages.
        title: Display name.
        kind: text, number, integer, choice, colour, boolean, angle (degrees), image, list or object.
        minimum: Minimum of a number.
        maximum: Maximum of a number.
        step: Step for editors. Values between steps are valid too.
        unit: Unit as displayed.
        default: Default value.
        choices: Allowed values of a choice.
        is_required: True if the value must be given.
        is_advanced: True if forms collapse the parameter.
        options_from: Name of the sensor that lists possible values.
        min_length: Minimum length of a text in characters, or of a list in items.
        max_length: Maximum length of a text in characters, or of a list in items.
        widget: Preferred editor.
        is_bare_base64: True for an image sent as base64 without a ``data:`` prefix.
        is_nullable: True if the value may be None.
        item: Schema of the items of a list or of the values of an object.
        prefix_items: Schemas of a list's items by position.
        fields: Schemas of an object's named values.
    """

    name: str
    title: str
    kind: str
    minimum: float | None = None
    maximum: float | None = None
    step: float | None = None
    unit: str | None = None
    default: object = None
    choices: tuple[Choice, ...] = ()
    is_required: bool = False
    is_advanced: bool = False
    options_from: str | None = None
    min_length: int = 0
    max_length: int | None = None
    widget: str | None = None
    is_bare_base64: bool = False
    is_nullable: bool = False
    item: Parameter | None = None
    prefix_items: tuple[Parameter, ...] = ()
    fields: tuple[Parameter, ...] = ()


def display_unit(unit: str | None) -> str | None:
    """Return a unit as displayed, such as "°" for "deg"; None for None."""
    return None if unit is None else _UNIT_SYMBOLS.get(unit, unit)


def format_number(value: float) -> str:
    """Format a number without trailing zeros, such as "360" or "-0.05"."""
    return f"{value:.10g}"


def closest_match(name: str, candidates: Iterable[str]) -> str:
    """Return the known word that is most similar to a wrong one; "" if none is similar."""
    if len(name) > _MAX_WORD_LENGTH:
        return ""
    return next(iter(difflib.get_close_matches(name, list(candidates), n=1)), "")


def parameter_of(name: str, data: Mapping[str, object], *, is_required: bool = False) -> Parameter:
    """Convert a data schema to a parameter.

    Args:
        name: Name of the parameter.
        data: JSON object with the data schema.
        is_required: True if the value must be given.
    """
    is_list = data.get("type") == "array"
    length_keys = _ITEM_COUNT_KEYS if is_list else _LENGTH_KEYS
    min_length, max_length = (number(data.get(key)) for key in length_keys)
    item_schema = data.get("items") if is_list else data.get("additionalProperties")
    prefix_schemas = item_schema if isinstance(item_schema, (list, tuple)) else ()
    return Parameter(
        name=name,
        title=display_text(data) or translate("robot", name.replace("_", " ")),
        kind=kind_of(data),
        minimum=number(data.get("minimum")),
        maximum=number(data.get("maximum")),
        step=number(data.get("rb:step")) or number(data.get("multipleOf")),
        unit=display_unit(text(data.get("unit"))),
        default=data.get("default"),
        choices=choices_of(data),
        is_required=is_required,
        is_advanced=data.get("rb:advanced") is True,
        options_from=text(data.get("rb:optionsFrom")),
        min_length=int(min_length or 0),
        max_length=None if max_length is None else int(max_length),
        widget=text(data.get("rb:widget")),
        is_bare_base64=data.get("contentEncoding") == "base64" and "format" not in data,
        is_nullable=data.get("rb:nullable") is True,
        item=parameter_of("value", item_schema) if isinstance(item_schema, Mapping) and item_schema else None,
        prefix_items=tuple(
            parameter_of(f"value {index}", as_object(each)) for index, each in enumerate(prefix_schemas, 1)
        ),
        fields=fields_of(data),
    )


def fields_of(data: Mapping[str, object]) -> tuple[Parameter, ...]:
    """Return a parameter for each named value of an object schema."""
    required = names(data.get("required"))
    return tuple(
        parameter_of(name, as_object(each), is_required=name in required)
        for name, each in object_member(data, "properties").items()
    )


def kind_of(data: Mapping[str, object]) -> str:
    """Return the kind of a data schema (see `Parameter.kind`); "text" for unknown schemas."""
    widget, kind = data.get("rb:widget"), data.get("type")
    if choices_of(data):
        return "choice"
    if widget == "colour" or "pattern" in data:
        return "colour"
    if widget == "image" or str(data.get("contentMediaType", "")).startswith("image/"):
        return "image"
    if kind in {"number", "integer"}:
        return "angle" if widget == "angle" else str(kind)
    return {"boolean": "boolean", "array": "list", "object": "object"}.get(str(kind), "text")


def choices_of(data: Mapping[str, object]) -> tuple[Choice, ...]:
    """Return the choices of a data schema with their texts; empty if the schema isn't limited to choices."""
    enum = data.get("enum")
    pairs: list[tuple[object, str | None]] = []
    if isinstance(enum, (list, tuple)):
        pairs = [(value, None) for value in enum]
    one_of = data.get("oneOf")
    if isinstance(one_of, (list, tuple)):
        pairs = [(as_object(item).get("const"), display_text(as_object(item))) for item in one_of]
    return tuple(
        Choice(value, title or translate("robot", bounded_str(value).replace("_", " ")))
        for value, title in pairs
        if isinstance(value, (str, int, float))
    )


def parse_value(parameter: Parameter, typed: str) -> object:
    """Parse a list or object that the user typed, such as ``1, 2.5`` or JSON.

    Numbers with a decimal comma are separated by semicolons: ``1; 2,5``.

    Args:
        parameter: Parameter for the value.
        typed: Typed text.

    Returns:
        The value, or the unchanged text if it is invalid or ambiguous such as ``0,2, 0,5``, so that the
        validation rejects it.
    """
    if parameter.kind == "object" or typed.lstrip().startswith(("[", "{")):
        try:
            parsed: object = json.loads(typed)
        except (ValueError, RecursionError):
            return typed
        return parsed
    kinds = {each.kind for each in parameter.prefix_items or filter(None, (parameter.item,))}
    is_numeric = bool(kinds) and kinds <= NUMBER_KINDS
    if is_numeric and re.search(r"\d,\d", typed) and re.search(r",\s", typed):
        return typed
    if is_numeric and ";" in typed:
        typed = typed.replace(",", ".").replace(";", ",")
    items = [part.strip() for part in typed.split(",") if part.strip()]
    if parameter.prefix_items:
        return [
            _parse_item(each, item) for each, item in zip(parameter.prefix_items, items, strict=False)
        ] + items[len(parameter.prefix_items) :]
    return items if parameter.item is None else [_parse_item(parameter.item, item) for item in items]


def format_for_editing(value: object) -> str:
    """Format a list or object for editing; the inverse of :func:`parse_value`."""
    if isinstance(value, (list, tuple)) and all(isinstance(item, (str, int, float)) for item in value):
        parts = [str(item).lower() if isinstance(item, bool) else str(item) for item in value]
        if not any("," in part or not part.strip() or part.startswith(("[", "{")) for part in parts):
            return ", ".join(parts)
    return json.dumps(value, ensure_ascii=False)


def _parse_item(parameter: Parameter, typed: str) -> object:
    matching = [choice.value for choice in parameter.choices if typed in {str(choice.value), choice.title}]
    if matching:
        return matching[0]
    if parameter.kind == "boolean":
        return {"yes": True, "true": True, "no": False, "false": False}.get(typed.lower(), typed)
    if parameter.kind not in NUMBER_KINDS:
        return typed
    parsed = to_number(typed)
    if parsed is None:
        return typed
    return int(parsed) if parsed.is_integer() and "." not in typed else parsed


def check_input(action: str, parameters: tuple[Parameter, ...], values: object) -> tuple[str, ...]:
    """Return one message per problem of an input; empty if it is valid.

    Each message starts with the name of the action.
    """
    return tuple(f"{action}: {problem.message}" for problem in input_problems(parameters, values))


def input_problems(parameters: tuple[Parameter, ...], values: object) -> tuple[InputProblem, ...]:
    """Return the problems of an input; empty if it is valid.

    Unknown names come first, followed by problems of values in the order of the parameters.
    """
    if not isinstance(values, Mapping):
        return (InputProblem("", _("the input must be an object with named values")),)
    parameters_by_name = {parameter.name: parameter for parameter in parameters}
    unknown_names = [name for name in values if name not in parameters_by_name]
    problems = []
    for name in unknown_names[:_MAX_UNKNOWN_REPORTED]:
        close = closest_match(str(name), parameters_by_name)
        template = (
            _("unknown name “{word}”; did you mean “{close}”?") if close else _("unknown name “{word}”")
        )
        problems.append(InputProblem("", template.format(word=quotable(name), close=close)))
    if len(unknown_names) > _MAX_UNKNOWN_REPORTED:
        count = len(unknown_names) - _MAX_UNKNOWN_REPORTED
        template = ngettext("{count} more name is unknown", "{count} more names are unknown", count)
        problems.append(InputProblem("", template.format(count=count)))
    for name, parameter in parameters_by_name.items():
        if name in values and values[name] is None and parameter.is_nullable:
            continue
        if name in values:
            problem = value_problem(parameter, values[name])
            if problem is not None:
                problems.append(InputProblem(name, problem))
        elif parameter.is_required:
            problems.append(InputProblem(name, _("{place} is missing").format(place=parameter.title)))
    return tuple(problems)


def value_problem(parameter: Parameter, value: object, label: str = "") -> str | None:
    """Return an error message such as "speed must be a number"; None if the value is valid.

    Args:
        parameter: Parameter for the value.
        value: Value to check.
        label: Name of the value in the message (default: the title of the parameter).
    """
    label = label or parameter.title
    if parameter.choices:
        if any(_is_json_equal(choice.value, value) for choice in parameter.choices):
            return None
        return _("{place} must be {choices}").format(
            place=label, choices=format_list([choice.title for choice in parameter.choices], "or")
        )
    if parameter.kind in {"number", "integer", "angle"}:
        return _number_problem(parameter, value, label)
    if parameter.kind == "boolean":
        return None if isinstance(value, bool) else _("{place} must be yes or no").format(place=label)
    if parameter.kind == "colour":
        is_valid = isinstance(value, str) and _HEX_COLOUR.fullmatch(value) is not None
        return None if is_valid else _("{place} must be a colour such as #20c0e0").format(place=label)
    if parameter.kind == "list":
        return _list_problem(parameter, value, label)
    if parameter.kind == "object":
        return _object_problem(parameter, value, label)
    return _text_problem(parameter, value, label)


def _list_problem(parameter: Parameter, value: object, label: str) -> str | None:
    if not isinstance(value, (list, tuple)):
        return _("{place} must be a list").format(place=label)
    min_length, max_length = parameter.min_length, parameter.max_length
    if min_length == max_length and len(value) != min_length:
        template = ngettext("{place} must have {count} value", "{place} must have {count} values", min_length)
        return template.format(place=label, count=min_length)
    if len(value) < min_length:
        template = ngettext(
            "{place} must have at least {count} value",
            "{place} must have at least {count} values",
            min_length,
        )
        return template.format(place=label, count=min_length)
    if max_length is not None and len(value) > max_length:
        template = ngettext(
            "{place} must have at most {count} value", "{place} must have at most {count} values", max_length
        )
        return template.format(place=label, count=max_length)
    for index, item in enumerate(value):
        item_parameter = (
            parameter.prefix_items[index] if index < len(parameter.prefix_items) else parameter.item
        )
        item_label = _("{place} value {number}").format(place=label, number=index + 1)
        problem = None if item_parameter is None else value_problem(item_parameter, item, item_label)
        if item_parameter is None and not _is_json(item):
            problem = _("{place} can't be an item of a list").format(place=item_label)
        if problem is not None:
            return problem
    return None


def _object_problem(parameter: Parameter, value: object, label: str) -> str | None:
    if not isinstance(value, Mapping):
        return _("{place} must be an object with named values").format(place=label)
    fields_by_name = {field.name: field for field in parameter.fields}
    for name, field in fields_by_name.items():
        if name not in value and not field.is_required:
            continue
        if name in value and value[name] is None and field.is_nullable:
            continue
        field_label = _("{place} {inner}").format(place=label, inner=field.title)
        if name not in value:
            return _("{place} is missing").format(place=field_label)
        problem = value_problem(field, value[name], field_label)
        if problem is not None:
            return problem
    other_values = {name: item for name, item in value.items() if name not in fields_by_name}
    return _other_values_problem(parameter, other_values, label)


def _other_values_problem(parameter: Parameter, other_values: Mapping[str, object], label: str) -> str | None:
    field_names = [field.name for field in parameter.fields]
    for name, item in other_values.items():
        if parameter.item is not None:
            problem = value_problem(
                parameter.item, item, _("{place} “{name}”").format(place=label, name=quotable(name))
            )
            if problem is not None:
                return problem
        elif field_names:
            close = closest_match(str(name), field_names)
            template = (
                _("{place} has no “{word}”; did you mean “{close}”?")
                if close
                else _("{place} has no “{word}”")
            )
            return template.format(place=label, word=quotable(name), close=close)
    return None


def _is_json(value: object, depth: int = 0) -> bool:
    if isinstance(value, (list, tuple)):
        return depth < _MAX_DEPTH and all(_is_json(item, depth + 1) for item in value)
    if isinstance(value, Mapping):
        return depth < _MAX_DEPTH and all(_is_json(item, depth + 1) for item in value.values())
    return value is None or isinstance(value, (str, int, float))


def _is_json_equal(allowed: object, value: object) -> bool:
    # 1 == True in Python, but they are different choices.
    return allowed == value and isinstance(allowed, bool) == isinstance(value, bool)


def _number_problem(parameter: Parameter, value: object, label: str) -> str | None:
    is_integer = parameter.kind == "integer"
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not _is_finite(value):
        template = _("{place} must be a whole number") if is_integer else _("{place} must be a number")
        return template.format(place=label)
    if is_integer and float(value) != int(value):
        return _("{place} must be a whole number").format(place=label)
    low, high = parameter.minimum, parameter.maximum
    if (low is None or value >= low) and (high is None or value <= high):
        return None
    unit = "" if parameter.unit is None else f" {parameter.unit}"
    if low is not None and high is not None:
        template = _("{place} must be between {low} and {high}")
        return template.format(place=label, low=_format_limit(low), high=f"{_format_limit(high)}{unit}")
    if low is not None:
        return _("{place} must be at least {limit}").format(place=label, limit=f"{_format_limit(low)}{unit}")
    return _("{place} must be at most {limit}").format(
        place=label, limit=f"{_format_limit(high or 0.0)}{unit}"
    )


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer too large for a float
        return False


def _text_problem(parameter: Parameter, value: object, label: str) -> str | None:
    if not isinstance(value, str):
        return _("{place} must be text").format(place=label)
    if len(value) < parameter.min_length:
        template = (
            _("{place} must not be empty")
            if parameter.min_length == 1
            else _("{place} must be at least {count} characters long")
        )
        return template.format(place=label, count=parameter.min_length)
    if parameter.max_length is not None and len(value) > parameter.max_length:
        template = ngettext(
            "{place} must be at most {count} character long",
            "{place} must be at most {count} characters long",
            parameter.max_length,
        )
        return template.format(place=label, count=parameter.max_length)
    return None


def _format_limit(value: float) -> str:
    return number_text(value, ".10g")
