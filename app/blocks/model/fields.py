"""Arguments of blocks: slots for other blocks, and fields with a value.

`Field.read` validates the saved value of a field and converts it to a plain value.
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
"""Function that translates a text, given its context and the English text; see `Block.translated`."""
Check = Literal["Number", "String", "Boolean", "List"]

_HEX_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_MAX_TOPIC_BYTES = 200


class FieldError(ValueError):
    """Raised for an invalid field value. The message is the end of a sentence, such as "needs a number"."""


@dataclass(frozen=True)
class Argument:
    """Argument in the text of a block.

    Attributes:
        name: Name of the field or input in Blockly.
    """

    name: str

    @property
    def is_display_only(self) -> bool:
        """True if the argument is only displayed and not part of the Python code."""
        return False

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of the argument for the ``args`` of a block in Blockly's JSON format."""
        raise NotImplementedError

    def initial_inputs(self) -> dict[str, object]:
        """Return the initial content of the argument's slots in the toolbox, by name of the slot.

        The content is in Blockly's JSON format.
        """
        return {}

    def translated(self, translate: Translate) -> Argument:  # noqa: ARG002 (most have no words)
        """Return the argument with translated texts and initial values; name and values are unchanged."""
        return self


@dataclass(frozen=True)
class ValueInput(Argument):
    """Slot for a value block.

    Attributes:
        check: Type of the accepted values; None for any.
        default: Value of the shadow block; None or a boolean leaves the slot empty.
        unit: Unit of the value, for the help.
        only_if: Name and value of a field; the slot exists only while the field has this value.
        variable: Name of a variable whose block is in the slot in the toolbox.
    """

    check: Check | None = None
    default: str | float | bool | None = None
    unit: str = ""
    only_if: tuple[str, str] | None = None
    variable: str | None = None

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Blockly's value input, with its type check."""
        entry: dict[str, object] = {"type": "input_value", "name": self.name}
        if self.check is not None:
            entry["check"] = self.check
        if self.only_if is not None:
            entry["only"] = list(self.only_if)
        return entry

    def is_present(self, fields: Mapping[str, object]) -> bool:
        """Return True if the slot exists on a block with these saved field values; see `only_if`."""
        return self.only_if is None or str(fields.get(self.only_if[0], self.only_if[1])) == self.only_if[1]

    def translated(self, translate: Translate) -> Argument:
        """Return the slot with its initial content translated."""
        variable = None if self.variable is None else translate("variable", self.variable)
        default = translate("example", self.default) if isinstance(self.default, str) else self.default
        return replace(self, variable=variable, default=default)

    def initial_inputs(self) -> dict[str, object]:
        """Return the initial content of the slot: a variable block, a shadow block, or nothing."""
        if self.variable is not None:
            variable = {"VAR": {"name": self.variable, "type": ""}}
            return {self.name: {"block": {"type": "variables_get", "fields": variable}}}
        shadow = self.shadow()
        return {} if shadow is None else {self.name: {"shadow": shadow}}

    def shadow(self) -> dict[str, object] | None:
        """Return the shadow block that is shown while the slot is empty.

        Returns None if there is no default, or if it is a boolean.
        """
        if self.default is None or isinstance(self.default, bool):
            return None
        if isinstance(self.default, str):
            return {"type": "values_text", "fields": {"TEXT": self.default}}
        return {"type": "values_number", "fields": {"NUMBER": self.default}}


@dataclass(frozen=True)
class StatementInput(Argument):
    """Slot for a sequence of statement blocks."""

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Blockly's statement input."""
        return {"type": "input_statement", "name": self.name}


@dataclass(frozen=True)
class Field(Argument):
    """Argument whose value is entered or selected on the block."""

    def read(self, saved: object) -> object:
        """Convert a saved value to a plain value. Raises FieldError if the value is invalid."""
        raise NotImplementedError


@dataclass(frozen=True)
class NumberField(Field):
    """Field for a number."""

    value: float = 0
    minimum: float | None = None
    maximum: float | None = None

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Blockly's number field."""
        entry: dict[str, object] = {"type": "field_number", "name": self.name, "value": self.value}
        if self.minimum is not None:
            entry["min"] = self.minimum
        if self.maximum is not None:
            entry["max"] = self.maximum
        return entry

    def read(self, saved: object) -> object:
        """Return a finite number within the limits. Accepts text that represents a number.

        Raises:
            FieldError: The value is not a number or is outside the limits.
        """
        number = _parse_number(self.value if saved is None else saved)
        if self.minimum is not None and number < self.minimum:
            raise FieldError(_("needs a number of at least {minimum:g}").format(minimum=self.minimum))
        if self.maximum is not None and number > self.maximum:
            raise FieldError(_("needs a number of at most {maximum:g}").format(maximum=self.maximum))
        return number


@dataclass(frozen=True)
class TextField(Field):
    """Field for a text."""

    value: str = ""

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Blockly's text field."""
        return {"type": "field_input", "name": self.name, "text": self.value}

    def translated(self, translate: Translate) -> Argument:
        """Return the field with its initial text translated."""
        return replace(self, value=translate("example", self.value))

    def read(self, saved: object) -> object:
        """Return the saved value as text."""
        return self.value if saved is None else str(saved)


@dataclass(frozen=True)
class ChoiceField(Field):
    """Drop-down field.

    Attributes:
        options: Pairs of text and value; Blockly stores the values as text.
        source: Source of further options in the editor, such as "robots:<model>"; any text is valid then.
    """

    options: tuple[tuple[str, object], ...] = ()
    source: str | None = None

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Studio's drop-down field.

        Unlike Blockly's field, it preserves a value that is not among the options.
        """
        entry: dict[str, object] = {
            "type": "field_choice",
            "name": self.name,
            "options": [[option_text, _option_key(value)] for option_text, value in self.options],
        }
        if self.source is not None:
            entry["source"] = self.source
        return entry

    def read(self, saved: object) -> object:
        """Return the selected value; the first option if nothing is saved.

        With a `source`, a value that is not an option is returned as text, and an empty text is
        returned if nothing is saved and there are no options.

        Raises:
            FieldError: The value is not an option, and there is no `source`.
        """
        if saved is None and self.options:
            return self.options[0][1]
        for _words, value in self.options:
            if _option_key(value) == _option_key(saved):
                return value
        if self.source is not None:
            return "" if saved is None else str(saved)
        raise FieldError(_("has no option “{saved}”").format(saved=saved))

    def translated(self, translate: Translate) -> Argument:
        """Return the field with translated options; names of robots are not translated."""
        if self.source is not None:
            return self
        return replace(
            self,
            options=tuple((translate("choice", option_text), value) for option_text, value in self.options),
        )

    def option_text(self, value: object) -> str:
        """Return the text of the option with this value; the value as text if there is no such option."""
        return next((text for text, option in self.options if option == value), str(value))


@dataclass(frozen=True)
class TopicField(Field):
    """Field for the name of a topic, entered or selected from the existing topics."""

    value: str = "/blackboard"

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Studio's topic field."""
        return {"type": "field_topic", "name": self.name, "value": self.value}

    def read(self, saved: object) -> object:
        """Return a valid topic name: 1 to 200 bytes without white space, control characters or "{".

        Raises:
            FieldError: The name is invalid.
        """
        topic = self.value if saved is None else str(saved)
        if not topic:
            raise FieldError(_("needs the name of a topic"))
        if any(character.isspace() or character == "{" or not character.isprintable() for character in topic):
            raise FieldError(_("needs a topic name without spaces, control characters or “{”"))
        if len(topic.encode("utf-8", "replace")) > _MAX_TOPIC_BYTES:
            raise FieldError(_("needs a shorter topic name"))
        return topic


@dataclass(frozen=True)
class BroadcastField(Field):
    """Field for the name of a broadcast within one behaviour, entered or selected."""

    value: str = "start"

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Studio's drop-down field with the broadcast names of the behaviour."""
        return {"type": "field_broadcast", "name": self.name, "value": self.value}

    def translated(self, translate: Translate) -> Argument:
        """Return the field with its initial name translated."""
        return replace(self, value=translate("example", self.value))

    def read(self, saved: object) -> object:
        """Return the name on one line, without surrounding white space.

        Raises FieldError if the name is empty.
        """
        name = " ".join((self.value if saved is None else str(saved)).split())
        if not name:
            raise FieldError(_("needs the name of a message"))
        return name


@dataclass(frozen=True)
class PathField(Field):
    """Field for a field path in the messages of a topic, such as ``faces.0.name``, entered or selected.

    Attributes:
        value: Initial path.
        topic_field: Name of the block's topic field, whose topic determines the suggested paths.
    """

    value: str = "value"
    topic_field: str = "TOPIC"

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Studio's topic field, which suggests field paths of the topic."""
        return {"type": "field_topic", "name": self.name, "value": self.value, "of": self.topic_field}

    def read(self, saved: object) -> object:
        """Return the path; "" means the whole message."""
        return self.value if saved is None else str(saved)


@dataclass(frozen=True)
class ColourField(Field):
    """Field for a colour in the form "#rrggbb"."""

    value: str = "#37b6ff"

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Studio's colour field."""
        return {"type": "field_colour_chip", "name": self.name, "value": self.value}

    def read(self, saved: object) -> object:
        """Return the colour as "#" and six hexadecimal digits. Raises FieldError if it is invalid."""
        colour = self.value if saved is None else str(saved)
        if not _HEX_COLOUR.fullmatch(colour):
            raise FieldError(_("needs a colour"))
        return colour.lower()


@dataclass(frozen=True)
class VariableField(Field):
    """Field for a variable of the behaviour; the compiler resolves its name."""

    value: str = "count"

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Blockly's variable field."""
        return {"type": "field_variable", "name": self.name, "variable": self.value}

    def translated(self, translate: Translate) -> Argument:
        """Return the field with the initial name translated."""
        return replace(self, value=translate("variable", self.value))

    def read(self, saved: object) -> object:
        """Return the id of the variable; older files contain its name instead.

        Raises:
            FieldError: The value is missing or invalid.
        """
        if isinstance(saved, Mapping):
            saved = saved.get("id", saved.get("name"))
        if not isinstance(saved, str) or not saved:
            raise FieldError(_("needs a variable"))
        return saved


@dataclass(frozen=True)
class LiveField(Field):
    """Display of a sensor's newest value on the block, updated by the editor and not saved."""

    @property
    def is_display_only(self) -> bool:
        """True, because the display is not part of the Python code."""
        return True

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of Studio's field that displays a live value."""
        return {"type": "field_live", "name": self.name}

    def read(self, saved: object) -> object:  # noqa: ARG002 (saved values are ignored)
        """Return None, because nothing is saved."""
        return None


def _option_key(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def _parse_number(saved: object) -> int | float:
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
    """Return the drop-down field with all robots of a model, the first field of each robot block.

    Args:
        model: Model of the robots.
        names: Names of the robots.
    """
    return _robot_field(model, tuple(names))


@lru_cache(maxsize=64)  # shared by all blocks of all robots of a model
def _robot_field(model: str, names: tuple[str, ...]) -> ChoiceField:
    return ChoiceField("ROBOT", tuple((name, name) for name in names), source=f"robots:{model}")
