"""Arguments of blocks: slots for other blocks, and fields with a value.

A field converts its saved value (`Field.read`) to a plain value, or raises an exception with the reason.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

from nep.i18n import _

Translate = Callable[[str | None, str], str]
"""Translates (context, English text); see `app.blocks.model.block.Block.translated`."""
Check = Literal["Number", "String", "Boolean", "List"]

_HEX_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_MAX_TOPIC_BYTES = 200


class FieldError(ValueError):
    """Raised for a field value that the block can't use. The message completes a sentence."""


@dataclass(frozen=True)
class Argument:
    """Argument in the text of a block; ``name`` is the name of Blockly's field or input."""

    name: str

    @property
    def is_display_only(self) -> bool:
        """True if the argument is only displayed and not part of the Python code."""
        return False

    def to_blockly(self) -> dict[str, object]:
        """Return the entry of the argument in Blockly's ``args``."""
        raise NotImplementedError

    def initial_inputs(self) -> dict[str, object]:
        """Return the initial content of the argument's slots in the toolbox, by name of the slot."""
        return {}

    def translated(self, say: Translate) -> Argument:  # noqa: ARG002 (most have no words)
        """Return the argument with texts and initial values translated; names and values are unchanged."""
        return self


@dataclass(frozen=True)
class ValueInput(Argument):
    """Slot for a value block.

    Attributes:
        default: Value of the shadow block; None leaves the slot empty.
        only: Field and value; the slot exists only while the field has this value.
        variable: Name of a variable that the toolbox puts into the slot.
    """

    check: Check | None = None
    default: str | float | bool | None = None
    unit: str = ""
    only_if: tuple[str, str] | None = None
    variable: str | None = None

    def to_blockly(self) -> dict[str, object]:
        """Return a value input with its type check."""
        entry: dict[str, object] = {"type": "input_value", "name": self.name}
        if self.check is not None:
            entry["check"] = self.check
        if self.only_if is not None:
            entry["only"] = list(self.only_if)
        return entry

    def is_present(self, fields: Mapping[str, object]) -> bool:
        """Return True if the slot exists with these saved fields."""
        return self.only_if is None or str(fields.get(self.only_if[0], self.only_if[1])) == self.only_if[1]

    def translated(self, say: Translate) -> Argument:
        """Return the slot with its initial content translated."""
        variable = None if self.variable is None else say("variable", self.variable)
        default = say("example", self.default) if isinstance(self.default, str) else self.default
        return replace(self, variable=variable, default=default)

    def initial_inputs(self) -> dict[str, object]:
        """Return a variable block, or a shadow block."""
        if self.variable is not None:
            variable = {"VAR": {"name": self.variable, "type": ""}}
            return {self.name: {"block": {"type": "variables_get", "fields": variable}}}
        shadow = self.shadow()
        return {} if shadow is None else {self.name: {"shadow": shadow}}

    def shadow(self) -> dict[str, object] | None:
        """Return the shadow block that fills the slot while it is empty."""
        if self.default is None or isinstance(self.default, bool):
            return None
        if isinstance(self.default, str):
            return {"type": "values_text", "fields": {"TEXT": self.default}}
        return {"type": "values_number", "fields": {"NUMBER": self.default}}


@dataclass(frozen=True)
class StatementInput(Argument):
    """Slot for statements."""

    def to_blockly(self) -> dict[str, object]:
        """Return a statement input."""
        return {"type": "input_statement", "name": self.name}


@dataclass(frozen=True)
class Field(Argument):
    """Argument whose value is entered in the block."""

    def read(self, saved: object) -> object:
        """Convert a saved value to a plain value. Raises FieldError if the value is invalid."""
        raise NotImplementedError


@dataclass(frozen=True)
class NumberField(Field):
    """Number entered in the block."""

    value: float = 0
    minimum: float | None = None
    maximum: float | None = None

    def to_blockly(self) -> dict[str, object]:
        """Return Blockly's number field."""
        entry: dict[str, object] = {"type": "field_number", "name": self.name, "value": self.value}
        if self.minimum is not None:
            entry["min"] = self.minimum
        if self.maximum is not None:
            entry["max"] = self.maximum
        return entry

    def read(self, saved: object) -> object:
        """Return a finite number within the limits; text that represents a number is accepted."""
        number = _number(self.value if saved is None else saved)
        if self.minimum is not None and number < self.minimum:
            raise FieldError(_("needs a number of at least {minimum:g}").format(minimum=self.minimum))
        if self.maximum is not None and number > self.maximum:
            raise FieldError(_("needs a number of at most {maximum:g}").format(maximum=self.maximum))
        return number


@dataclass(frozen=True)
class TextField(Field):
    """Text entered in the block."""

    value: str = ""

    def to_blockly(self) -> dict[str, object]:
        """Return Blockly's text field."""
        return {"type": "field_input", "name": self.name, "text": self.value}

    def translated(self, say: Translate) -> Argument:
        """Return the field with its initial text translated."""
        return replace(self, value=say("example", self.value))

    def read(self, saved: object) -> object:
        """Return the text."""
        return self.value if saved is None else str(saved)


@dataclass(frozen=True)
class ChoiceField(Field):
    """Drop-down. ``options`` are (text, value) pairs; Blockly stores the values as text.

    ``source`` tells the editor where to find further options ("robots:<model>"); then any text is valid.
    """

    options: tuple[tuple[str, object], ...] = ()
    source: str | None = None

    def to_blockly(self) -> dict[str, object]:
        """Return our drop-down field, which preserves a value that is not among the options."""
        entry: dict[str, object] = {
            "type": "field_choice",
            "name": self.name,
            "options": [[words, _option_key(value)] for words, value in self.options],
        }
        if self.source is not None:
            entry["source"] = self.source
        return entry

    def read(self, saved: object) -> object:
        """Return the selected value. Raises FieldError if the value is not an option."""
        if saved is None and self.options:
            return self.options[0][1]
        for _words, value in self.options:
            if _option_key(value) == _option_key(saved):
                return value
        if self.source is not None:
            return "" if saved is None else str(saved)
        raise FieldError(_("has no option “{saved}”").format(saved=saved))

    def translated(self, say: Translate) -> Argument:
        """Return the field with translated options; names of robots are not translated."""
        if self.source is not None:
            return self
        return replace(self, options=tuple((say("choice", words), value) for words, value in self.options))

    def option_text(self, value: object) -> str:
        """Return the text of the option with this value."""
        return next((words for words, option in self.options if option == value), str(value))


@dataclass(frozen=True)
class TopicField(Field):
    """Name of a topic, entered or selected from the existing ones."""

    value: str = "/blackboard"

    def to_blockly(self) -> dict[str, object]:
        """Return our topic field."""
        return {"type": "field_topic", "name": self.name, "value": self.value}

    def read(self, saved: object) -> object:
        """Return a valid topic name (`WIRE`: no white space, control characters or "{", 1 to 200 bytes)."""
        topic = self.value if saved is None else str(saved)
        if not topic:
            raise FieldError(_("needs the name of a topic"))
        if any(character.isspace() or character == "{" or not character.isprintable() for character in topic):
            raise FieldError(_("needs a topic without spaces"))
        if len(topic.encode("utf-8", "replace")) > _MAX_TOPIC_BYTES:
            raise FieldError(_("needs a shorter topic"))
        return topic


@dataclass(frozen=True)
class BroadcastField(Field):
    """Name of a broadcast within one behaviour, selected or entered."""

    value: str = "start"

    def to_blockly(self) -> dict[str, object]:
        """Return our drop-down of the broadcast names of the behaviour."""
        return {"type": "field_broadcast", "name": self.name, "value": self.value}

    def translated(self, say: Translate) -> Argument:
        """Return the field with its initial name translated."""
        return replace(self, value=say("example", self.value))

    def read(self, saved: object) -> object:
        """Return a name on one line, without surrounding spaces."""
        name = " ".join((self.value if saved is None else str(saved)).split())
        if not name:
            raise FieldError(_("needs the name of a message"))
        return name


@dataclass(frozen=True)
class PathField(Field):
    """Path of a field in the messages of a topic, such as ``faces.0.name``, entered or selected."""

    value: str = "value"
    topic_field: str = "TOPIC"

    def to_blockly(self) -> dict[str, object]:
        """Return our topic field, which suggests fields of the topic in ``of``."""
        return {"type": "field_topic", "name": self.name, "value": self.value, "of": self.topic_field}

    def read(self, saved: object) -> object:
        """Return the path; empty means the whole message."""
        return self.value if saved is None else str(saved)


@dataclass(frozen=True)
class ColourField(Field):
    """Colour in the form "#rrggbb"."""

    value: str = "#37b6ff"

    def to_blockly(self) -> dict[str, object]:
        """Return our colour field."""
        return {"type": "field_colour_chip", "name": self.name, "value": self.value}

    def read(self, saved: object) -> object:
        """Return the colour as "#" and six hexadecimal digits. Raises FieldError if it is invalid."""
        colour = self.value if saved is None else str(saved)
        if not _HEX_COLOUR.fullmatch(colour):
            raise FieldError(_("needs a colour"))
        return colour.lower()


@dataclass(frozen=True)
class VariableField(Field):
    """Variable of the behaviour; the compiler resolves its name."""

    value: str = "count"

    def to_blockly(self) -> dict[str, object]:
        """Return Blockly's variable field."""
        return {"type": "field_variable", "name": self.name, "variable": self.value}

    def translated(self, say: Translate) -> Argument:
        """Return the field with the initial name translated."""
        return replace(self, value=say("variable", self.value))

    def read(self, saved: object) -> object:
        """Return the id of the variable. Blockly saves ``{"id": …}``, older files contain a name."""
        if isinstance(saved, Mapping):
            saved = saved.get("id", saved.get("name"))
        if not isinstance(saved, str) or not saved:
            raise FieldError(_("needs a variable"))
        return saved


@dataclass(frozen=True)
class LiveField(Field):
    """Display of a sensor's newest value, filled by the editor and not saved."""

    @property
    def is_display_only(self) -> bool:
        """True: the display is not part of the Python code."""
        return True

    def to_blockly(self) -> dict[str, object]:
        """Return our field that displays a live value."""
        return {"type": "field_live", "name": self.name}

    def read(self, saved: object) -> object:  # noqa: ARG002 (saved values are ignored)
        """Return None, because nothing is saved."""
        return None


def _option_key(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def _number(saved: object) -> int | float:
    if isinstance(saved, bool) or not isinstance(saved, (int, float, str)):
        raise FieldError(_("needs a number"))
    try:
        number = float(saved)
    except (ValueError, OverflowError):
        raise FieldError(_("needs a number")) from None
    if not math.isfinite(number):
        raise FieldError(_("needs a finite number"))
    return int(number) if number.is_integer() and abs(number) < 2**53 else number


def robot_field(model: str, names: Sequence[str]) -> ChoiceField:
    """Return the drop-down of all robots of a model, which is the first field of each robot block."""
    return _robot_field(model, tuple(names))


@lru_cache(maxsize=64)  # shared by all blocks of all robots of a model
def _robot_field(model: str, names: tuple[str, ...]) -> ChoiceField:
    return ChoiceField("ROBOT", tuple((name, name) for name in names), source=f"robots:{model}")
