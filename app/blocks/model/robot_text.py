"""Conversion of texts and parameters in a robot description to texts and arguments of blocks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from app.blocks.model.fields import (
    Argument,
    ChoiceField,
    ColourField,
    Field,
    NumberField,
    TextField,
    ValueInput,
)
from app.robots.description.description import Parameter
from app.robots.description.inputs import display_unit, format_for_editing, format_number
from nep.i18n import _, pgettext

_PLACEHOLDER = re.compile(r"%([A-Za-z_][A-Za-z0-9_]*)")
_RESERVED = ("ROBOT", "LIVE", "FIELD", "SENSOR", "SIDE", "LIMIT", "X_NAME", "X_INPUT", "X_FIELD", "ICON")
_NUMBER_KINDS = ("number", "integer", "angle")


class BlockTemplate:
    """Text of a block, made from a text in a robot description.

    Attributes:
        text: Text in which parameters are replaced by names of block arguments.
        arguments: Names of the block arguments by parameter.
        shown_parameters: Parameters that occur in the text.
    """

    def __init__(self, text: str, parameters: Sequence[str]) -> None:
        self.arguments: dict[str, str] = {}
        used_names = set(_RESERVED)
        for name in parameters:
            self.arguments[name] = _argument_name(name, used_names)
        self.shown_parameters: frozenset[str] = frozenset(
            name for name in _PLACEHOLDER.findall(text) if name in self.arguments
        )
        self._inserted_arguments: set[str] = set()
        self.text = _PLACEHOLDER.sub(self._replace_placeholder, text)
        if "%ROBOT" not in self.text:
            self.text = f"%ROBOT {self.text}"

    def _replace_placeholder(self, match: re.Match[str]) -> str:
        name = "ROBOT" if match[1] == "robot" else self.arguments.get(match[1])
        # Drop unknown placeholders, which would be read as block arguments, and duplicates.
        if name is None or name in self._inserted_arguments:
            return ""
        self._inserted_arguments.add(name)
        return f"%{name}"


def block_type_of(model: str, verb: str, name: str, *, without_verb: bool = False) -> str:
    """Return the type of a robot block, such as ``robot_pepper_do_say``.

    Args:
        model: Model of the robot.
        verb: "do", "get" or "when".
        name: Name of the action, sensor or event.
        without_verb: True to omit the verb, for blocks of no particular action, sensor or event:
            ``robot_pepper_changes``.
    """
    middle = "" if without_verb else f"{verb}_"
    return f"robot_{_type_part(model)}_{middle}{_type_part(name)}"


def input_of(parameter: Parameter, name: str) -> Argument:
    """Return the slot or field for a parameter of an action.

    Args:
        parameter: Parameter of the action.
        name: Name of the block argument.
    """
    default = parameter.default
    if parameter.kind in _NUMBER_KINDS:
        number = default if isinstance(default, (int, float)) else (parameter.minimum or 0)
        return ValueInput(name, "Number", number, unit=parameter.unit or "")
    if parameter.kind in ("choice", "boolean", "colour"):
        return field_of(parameter, name)
    if isinstance(default, (list, tuple, Mapping)):
        return ValueInput(name, None, format_for_editing(default))
    text = default if isinstance(default, str) else ""
    # Any value is accepted and converted to text.
    return ValueInput(name, None, text)


def field_of(parameter: Parameter | None, name: str) -> Field:
    """Return the field for a parameter with a fixed set of values, or for the filter of an event.

    Args:
        parameter: Parameter or event field; None for a text field.
        name: Name of the block argument.
    """
    if parameter is None:
        return TextField(name)
    default = parameter.default
    if parameter.kind == "choice":
        options = [(choice.title, choice.value) for choice in parameter.choices]
        options.sort(key=lambda option: option[1] != default)
        return ChoiceField(name, tuple(options))
    if parameter.kind == "boolean":
        title = parameter.title or parameter.name
        yes_no_options = (
            (_("{what}: yes").format(what=title), True),
            (_("{what}: no").format(what=title), False),
        )
        return ChoiceField(name, yes_no_options if default is not False else yes_no_options[::-1])
    if parameter.kind == "colour":
        return ColourField(name, default if isinstance(default, str) else "#37b6ff")
    if parameter.kind in _NUMBER_KINDS:
        number = default if isinstance(default, (int, float)) else 0
        return NumberField(name, number, parameter.minimum, parameter.maximum)
    return TextField(name, default if isinstance(default, str) else "hello")


def format_limits(parameter: Parameter) -> str:
    """Format the limits and the unit of a parameter, such as "from 0 to 100 %"; "" if there are none."""
    unit = f" {display_unit(parameter.unit)}" if parameter.unit else ""
    low = None if parameter.minimum is None else format_number(parameter.minimum)
    high = None if parameter.maximum is None else format_number(parameter.maximum)
    if low is not None and high is not None:
        return _("from {low} to {high_and_unit}").format(low=low, high_and_unit=f"{high}{unit}")
    if low is not None:
        return _("at least {number_and_unit}").format(number_and_unit=f"{low}{unit}")
    if high is not None:
        return _("at most {number_and_unit}").format(number_and_unit=f"{high}{unit}")
    return pgettext("of a number", "in {unit}").format(unit=unit.strip()) if unit else ""


def _argument_name(name: str, used_names: set[str]) -> str:
    base_name = re.sub(r"[^A-Z0-9_]", "_", name.upper())
    if not base_name[:1].isalpha():
        base_name = f"P_{base_name}"
    candidate, number = base_name, 2
    while candidate in used_names:
        candidate, number = f"{base_name}_{number}", number + 1
    used_names.add(candidate)
    return candidate


def _type_part(name: str) -> str:
    return re.sub(r"\W+", "_", name.lower()).strip("_") or "x"
