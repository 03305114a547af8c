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
        required: True if the value must be given.
        advanced: True if forms collapse the parameter.
        options_from: Name of the sensor that lists possible values.
        min_length: Minimum length of a text in characters, or of a list in items.
        max_length: Maximum length of a text in characters, or of a list in items.
        widget: Preferred editor.
        is_bare_base64: True for an image sent as base64 without a ``data:`` prefix.
        nullable: True if the value may be None.
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
    required: bool = False
    advanced: bool = False
    options_from: str | None = None
    min_length: int = 0
    max_length: int | None = None
    widget: str | None = None
    is_bare_base64: bool = False
    nullable: bool = False
    item: Parameter | None = None
    prefix_items: tuple[Parameter, ...] = ()
    fields: tuple[Parameter, ...] = ()


def display_unit(unit: str | None) -> str | None:
    """Return a unit as displayed, such as "°" for "deg"; None for None."""
    return None if unit is None else _UNIT_SYMBOLS.get(unit, unit)


def format_number(value: float) -> str:
    """Format a number without trailing zeros, such as "360" or "-0.05"."""
    return f"{value:.10g}"


def closest_match(wrong: str, known: Iterable[str]) -> str:
    """Return the known word that is most similar to a wrong one; "" if none is similar."""
    if len(wrong) > _MAX_WORD_LENGTH:
        return ""
    return next(iter(difflib.get_close_matches(wrong, list(known), n=1)), "")


def parameter_of(name: str, data: Mapping[str, object], *, required: bool = False) -> Parameter:
    """Convert a data schema to a parameter.

    Args:
        name: Name of the parameter.
        data: JSON object with the data schema.
        required: True if the value must be given.
    """
    is_list = data.get("type") == "array"
    shortest, longest = (number(data.get(rule)) for rule in (_ITEM_COUNT_KEYS if is_list else _LENGTH_KEYS))
    held = data.get("items") if is_list else data.get("additionalProperties")
    places = held if isinstance(held, (list, tuple)) else ()
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
        required=required,
        advanced=data.get("rb:advanced") is True,
        options_from=text(data.get("rb:optionsFrom")),
        min_length=int(shortest or 0),
        max_length=None if longest is None else int(longest),
        widget=text(data.get("rb:widget")),
        is_bare_base64=data.get("contentEncoding") == "base64" and "format" not in data,
        nullable=data.get("rb:nullable") is True,
        item=parameter_of("value", held) if isinstance(held, Mapping) and held else None,
        prefix_items=tuple(parameter_of(f"value {at}", as_object(each)) for at, each in enumerate(places, 1)),
        fields=fields_of(data),
    )


def fields_of(data: Mapping[str, object]) -> tuple[Parameter, ...]:
    """Return a parameter for each named value of an object schema."""
    required = names(data.get("required"))
    return tuple(
        parameter_of(name, as_object(each), required=name in required)
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
    named = data.get("oneOf")
    if isinstance(named, (list, tuple)):
        pairs = [(as_object(item).get("const"), display_text(as_object(item))) for item in named]
    return tuple(
        Choice(value, title or translate("robot", bounded_str(value).replace("_", " ")))
        for value, title in pairs
        if isinstance(value, (str, int, float))
    )


def parse_value(parameter: Parameter, words: str) -> object:
    """Parse a list or object that the user typed, such as ``1, 2.5`` or JSON.

    Numbers with a decimal comma are separated by semicolons: ``1; 2,5``.

    Args:
        parameter: Parameter for the value.
        words: Typed text.

    Returns:
        The value, or the unchanged text if it is invalid or ambiguous such as ``0,2, 0,5``, so that the
        validation rejects it.
    """
    if parameter.kind == "object" or words.lstrip().startswith(("[", "{")):
        try:
            found: object = json.loads(words)
        except (ValueError, RecursionError):
            return words
        return found
    kinds = {each.kind for each in parameter.prefix_items or filter(None, (parameter.item,))}
    is_numeric = bool(kinds) and kinds <= NUMBER_KINDS
    if is_numeric and re.search(r"\d,\d", words) and re.search(r",\s", words):
        return words
    if is_numeric and ";" in words:
        words = words.replace(",", ".").replace(";", ",")
    items = [word.strip() for word in words.split(",") if word.strip()]
    if parameter.prefix_items:
        return [
            _parse_item(each, item) for each, item in zip(parameter.prefix_items, items, strict=False)
        ] + items[len(parameter.prefix_items) :]
    return items if parameter.item is None else [_parse_item(parameter.item, item) for item in items]


def format_for_editing(value: object) -> str:
    """Format a list or object for editing; the inverse of :func:`parse_value`."""
    if isinstance(value, (list, tuple)) and all(isinstance(item, (str, int, float)) for item in value):
        words = [str(item).lower() if isinstance(item, bool) else str(item) for item in value]
        if not any("," in word or not word.strip() or word.startswith(("[", "{")) for word in words):
            return ", ".join(words)
    return json.dumps(value, ensure_ascii=False)


def _parse_item(parameter: Parameter, word: str) -> object:
    known = [choice.value for choice in parameter.choices if word in {str(choice.value), choice.title}]
    if known:
        return known[0]
    if parameter.kind == "boolean":
        return {"yes": True, "true": True, "no": False, "false": False}.get(word.lower(), word)
    if parameter.kind not in NUMBER_KINDS:
        return word
    found = to_number(word)
    if found is None:
        return word
    return int(found) if found.is_integer() and "." not in word else found


def check_input(action: str, parameters: tuple[Parameter, ...], given: object) -> tuple[str, ...]:
    """Return one message per problem of an input; empty if it is valid.

    Each message starts with the name of the action.
    """
    return tuple(f"{action}: {problem.message}" for problem in input_problems(parameters, given))


def input_problems(parameters: tuple[Parameter, ...], given: object) -> tuple[InputProblem, ...]:
    """Return the problems of an input; empty if it is valid.

    Unknown names come first, followed by problems of values in the order of the parameters.
    """
    if not isinstance(given, Mapping):
        return (InputProblem("", _("the input must be an object with named values")),)
    known = {parameter.name: parameter for parameter in parameters}
    unknown = [name for name in given if name not in known]
    problems = []
    for name in unknown[:_MAX_UNKNOWN_REPORTED]:
        close = closest_match(str(name), known)
        words = _("unknown name “{word}”; did you mean “{close}”?") if close else _("unknown name “{word}”")
        problems.append(InputProblem("", words.format(word=quotable(name), close=close)))
    if len(unknown) > _MAX_UNKNOWN_REPORTED:
        count = len(unknown) - _MAX_UNKNOWN_REPORTED
        words = ngettext("{count} more name is unknown", "{count} more names are unknown", count)
        problems.append(InputProblem("", words.format(count=count)))
    for name, parameter in known.items():
        if name in given and given[name] is None and parameter.nullable:
            continue
        if name in given:
            wrong = value_problem(parameter, given[name])
            if wrong is not None:
                problems.append(InputProblem(name, wrong))
        elif parameter.required:
            problems.append(InputProblem(name, _("{place} is missing").format(place=parameter.title)))
    return tuple(problems)


def value_problem(parameter: Parameter, value: object, place: str = "") -> str | None:
    """Return an error message such as "speed must be a number"; None if the value is valid.

    Args:
        parameter: Parameter for the value.
        value: Value to check.
        place: Name of the value in the message (default: the title of the parameter).
    """
    place = place or parameter.title
    if parameter.choices:
        if any(_is_json_equal(choice.value, value) for choice in parameter.choices):
            return None
        return _("{place} must be {choices}").format(
            place=place, choices=format_list([choice.title for choice in parameter.choices], "or")
        )
    if parameter.kind in {"number", "integer", "angle"}:
        return _number_problem(parameter, value, place)
    if parameter.kind == "boolean":
        return None if isinstance(value, bool) else _("{place} must be yes or no").format(place=place)
    if parameter.kind == "colour":
        good = isinstance(value, str) and _HEX_COLOUR.fullmatch(value) is not None
        return None if good else _("{place} must be a colour such as #20c0e0").format(place=place)
    if parameter.kind == "list":
        return _list_problem(parameter, value, place)
    if parameter.kind == "object":
        return _object_problem(parameter, value, place)
    return _text_problem(parameter, value, place)


def _list_problem(parameter: Parameter, value: object, place: str) -> str | None:
    if not isinstance(value, (list, tuple)):
        return _("{place} must be a list").format(place=place)
    least, most = parameter.min_length, parameter.max_length
    if least == most and len(value) != least:
        words = ngettext("{place} must have {count} value", "{place} must have {count} values", least)
        return words.format(place=place, count=least)
    if len(value) < least:
        words = ngettext(
            "{place} must have at least {count} value", "{place} must have at least {count} values", least
        )
        return words.format(place=place, count=least)
    if most is not None and len(value) > most:
        words = ngettext(
            "{place} must have at most {count} value", "{place} must have at most {count} values", most
        )
        return words.format(place=place, count=most)
    for at, item in enumerate(value):
        held = parameter.prefix_items[at] if at < len(parameter.prefix_items) else parameter.item
        inner = _("{place} value {number}").format(place=place, number=at + 1)
        wrong = None if held is None else value_problem(held, item, inner)
        if held is None and not _is_json(item):
            wrong = _("{place} can't be an item of a list").format(place=inner)
        if wrong is not None:
            return wrong
    return None


def _object_problem(parameter: Parameter, value: object, place: str) -> str | None:
    if not isinstance(value, Mapping):
        return _("{place} must be an object with named values").format(place=place)
    known = {field.name: field for field in parameter.fields}
    for name, field in known.items():
        if name not in value and not field.required:
            continue
        if name in value and value[name] is None and field.nullable:
            continue
        inner = _("{place} {inner}").format(place=place, inner=field.title)
        if name not in value:
            return _("{place} is missing").format(place=inner)
        wrong = value_problem(field, value[name], inner)
        if wrong is not None:
            return wrong
    others = {name: item for name, item in value.items() if name not in known}
    return _other_values_problem(parameter, others, place)


def _other_values_problem(parameter: Parameter, others: Mapping[str, object], place: str) -> str | None:
    known = [field.name for field in parameter.fields]
    for name, item in others.items():
        if parameter.item is not None:
            wrong = value_problem(
                parameter.item, item, _("{place} “{name}”").format(place=place, name=quotable(name))
            )
            if wrong is not None:
                return wrong
        elif known:
            close = closest_match(str(name), known)
            words = (
                _("{place} has no “{word}”; did you mean “{close}”?")
                if close
                else _("{place} has no “{word}”")
            )
            return words.format(place=place, word=quotable(name), close=close)
    return None


def _is_json(value: object, depth: int = 0) -> bool:
    if isinstance(value, (list, tuple)):
        return depth < _MAX_DEPTH and all(_is_json(item, depth + 1) for item in value)
    if isinstance(value, Mapping):
        return depth < _MAX_DEPTH and all(_is_json(item, depth + 1) for item in value.values())
    return value is None or isinstance(value, (str, int, float))


def _is_json_equal(allowed: object, given: object) -> bool:
    # 1 == True in Python, but they are different choices.
    return allowed == given and isinstance(allowed, bool) == isinstance(given, bool)


def _number_problem(parameter: Parameter, value: object, place: str) -> str | None:
    whole = parameter.kind == "integer"
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not _is_finite(value):
        words = _("{place} must be a whole number") if whole else _("{place} must be a number")
        return words.format(place=place)
    if whole and float(value) != int(value):
        return _("{place} must be a whole number").format(place=place)
    low, high = parameter.minimum, parameter.maximum
    if (low is None or value >= low) and (high is None or value <= high):
        return None
    unit = "" if parameter.unit is None else f" {parameter.unit}"
    if low is not None and high is not None:
        words = _("{place} must be between {low} and {high}")
        return words.format(place=place, low=_format_limit(low), high=f"{_format_limit(high)}{unit}")
    if low is not None:
        return _("{place} must be at least {limit}").format(place=place, limit=f"{_format_limit(low)}{unit}")
    return _("{place} must be at most {limit}").format(
        place=place, limit=f"{_format_limit(high or 0.0)}{unit}"
    )


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer too large for a float
        return False


def _text_problem(parameter: Parameter, value: object, place: str) -> str | None:
    if not isinstance(value, str):
        return _("{place} must be text").format(place=place)
    if len(value) < parameter.min_length:
        words = (
            _("{place} must not be empty")
            if parameter.min_length == 1
            else _("{place} must be at least {count} characters long")
        )
        return words.format(place=place, count=parameter.min_length)
    if parameter.max_length is not None and len(value) > parameter.max_length:
        words = ngettext(
            "{place} must be at most {count} character long",
            "{place} must be at most {count} characters long",
            parameter.max_length,
        )
        return words.format(place=place, count=parameter.max_length)
    return None


def _format_limit(value: float) -> str:
    return number_text(value, ".10g")
