"""The arguments of blocks: gaps for other blocks, and fields that hold a value themselves.

A field reads what a file says (`read`) and gives back a plain value or says in words what is wrong.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

from nep.i18n import _

Say = Callable[[str | None, str], str]
"""(context, English) -> what a person reads, see `app.blocks.model.block.Block.translated`."""
Check = Literal["Number", "String", "Boolean", "List"]

_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_TOPIC_LIMIT = 200


class FieldError(ValueError):
    """A field holds something that its block can't use; ``str(error)`` is the end of a sentence."""


@dataclass(frozen=True)
class Argument:
    """One place in a block's text; ``name`` is Blockly's name of the field or input."""

    name: str

    @property
    def silent(self) -> bool:
        """Whether it is for the eye only and has no part in the Python."""
        return False

    def to_blockly(self) -> dict[str, object]:
        """Its entry in Blockly's ``args``."""
        raise NotImplementedError

    def fillings(self) -> dict[str, object]:
        """What is in its gaps when the block comes out of the toolbox, by the gaps' names."""
        return {}

    def translated(self, say: Say) -> Argument:  # noqa: ARG002 (most have no words)
        """The same in a person's language: its words and what it holds at first; names and values stay."""
        return self


@dataclass(frozen=True)
class ValueInput(Argument):
    """A gap for a value block; ``default`` is what its shadow block says, None leaves the gap empty.

    ``only`` is a field and a value: the gap is there only while the field has that value. ``variable`` is
    what the toolbox puts into the gap: a variable of that name.
    """

    check: Check | None = None
    default: str | float | bool | None = None
    unit: str = ""
    only: tuple[str, str] | None = None
    variable: str | None = None

    def to_blockly(self) -> dict[str, object]:
        """A value input, with its type check."""
        entry: dict[str, object] = {"type": "input_value", "name": self.name}
        if self.check is not None:
            entry["check"] = self.check
        if self.only is not None:
            entry["only"] = list(self.only)
        return entry

    def is_there(self, fields: Mapping[str, object]) -> bool:
        """Whether the gap is there, with these saved fields."""
        return self.only is None or str(fields.get(self.only[0], self.only[1])) == self.only[1]

    def translated(self, say: Say) -> Argument:
        """What is in the gap at first."""
        variable = None if self.variable is None else say("variable", self.variable)
        default = say("example", self.default) if isinstance(self.default, str) else self.default
        return replace(self, variable=variable, default=default)

    def fillings(self) -> dict[str, object]:
        """A variable, or a shadow block."""
        if self.variable is not None:
            variable = {"VAR": {"name": self.variable, "type": ""}}
            return {self.name: {"block": {"type": "variables_get", "fields": variable}}}
        shadow = self.shadow()
        return {} if shadow is None else {self.name: {"shadow": shadow}}

    def shadow(self) -> dict[str, object] | None:
        """The shadow block that fills the gap until somebody puts a block in."""
        if self.default is None or isinstance(self.default, bool):
            return None
        if isinstance(self.default, str):
            return {"type": "values_text", "fields": {"TEXT": self.default}}
        return {"type": "values_number", "fields": {"NUMBER": self.default}}


@dataclass(frozen=True)
class StatementInput(Argument):
    """A gap for statements."""

    def to_blockly(self) -> dict[str, object]:
        """A statement input."""
        return {"type": "input_statement", "name": self.name}


@dataclass(frozen=True)
class Field(Argument):
    """A value that stands in the block itself."""

    def read(self, saved: object) -> object:
        """The plain value of what a file says; FieldError if the block can't use it."""
        raise NotImplementedError


@dataclass(frozen=True)
class NumberField(Field):
    """A number typed into the block."""

    value: float = 0
    minimum: float | None = None
    maximum: float | None = None

    def to_blockly(self) -> dict[str, object]:
        """Blockly's number field."""
        entry: dict[str, object] = {"type": "field_number", "name": self.name, "value": self.value}
        if self.minimum is not None:
            entry["min"] = self.minimum
        if self.maximum is not None:
            entry["max"] = self.maximum
        return entry

    def read(self, saved: object) -> object:
        """A finite number inside the limits; text that reads as one is taken too."""
        number = _number(self.value if saved is None else saved)
        if self.minimum is not None and number < self.minimum:
            raise FieldError(_("needs a number of at least {minimum:g}").format(minimum=self.minimum))
        if self.maximum is not None and number > self.maximum:
            raise FieldError(_("needs a number of at most {maximum:g}").format(maximum=self.maximum))
        return number


@dataclass(frozen=True)
class TextField(Field):
    """Text typed into the block."""

    value: str = ""

    def to_blockly(self) -> dict[str, object]:
        """Blockly's text field."""
        return {"type": "field_input", "name": self.name, "text": self.value}

    def translated(self, say: Say) -> Argument:
        """The text that it holds at first."""
        return replace(self, value=say("example", self.value))

    def read(self, saved: object) -> object:
        """Any text."""
        return self.value if saved is None else str(saved)


@dataclass(frozen=True)
class ChoiceField(Field):
    """A drop-down. ``options`` are (words, value) pairs; values are plain values, Blockly sees them as text.

    ``source`` says where the editor finds more of them ("robots:<model>"); then any text is taken.
    """

    options: tuple[tuple[str, object], ...] = ()
    source: str | None = None

    def to_blockly(self) -> dict[str, object]:
        """Our drop-down, which keeps a value that is not among its options."""
        entry: dict[str, object] = {
            "type": "field_choice",
            "name": self.name,
            "options": [[words, _key(value)] for words, value in self.options],
        }
        if self.source is not None:
            entry["source"] = self.source
        return entry

    def read(self, saved: object) -> object:
        """The chosen value; FieldError if it is none of the options."""
        if saved is None and self.options:
            return self.options[0][1]
        for _words, value in self.options:
            if _key(value) == _key(saved):
                return value
        if self.source is not None:
            return "" if saved is None else str(saved)
        raise FieldError(_("has no option “{saved}”").format(saved=saved))

    def translated(self, say: Say) -> Argument:
        """What people choose from, unless these are names of robots."""
        if self.source is not None:
            return self
        return replace(self, options=tuple((say("choice", words), value) for words, value in self.options))

    def words(self, value: object) -> str:
        """What people read for a value."""
        return next((words for words, option in self.options if option == value), str(value))


@dataclass(frozen=True)
class TopicField(Field):
    """A topic's name, typed or chosen from those that are live."""

    value: str = "/blackboard"

    def to_blockly(self) -> dict[str, object]:
        """Our topic field."""
        return {"type": "field_topic", "name": self.name, "value": self.value}

    def read(self, saved: object) -> object:
        """A valid topic name (`WIRE`: no white space, control characters or "{", 1 to 200 bytes)."""
        topic = self.value if saved is None else str(saved)
        if not topic:
            raise FieldError(_("needs the name of a topic"))
        if any(character.isspace() or character == "{" or not character.isprintable() for character in topic):
            raise FieldError(_("needs a topic without spaces"))
        if len(topic.encode("utf-8", "replace")) > _TOPIC_LIMIT:
            raise FieldError(_("needs a shorter topic"))
        return topic


@dataclass(frozen=True)
class BroadcastField(Field):
    """The name of a message that scripts of one behaviour send each other; chosen, or a new one typed."""

    value: str = "start"

    def to_blockly(self) -> dict[str, object]:
        """Our drop-down of the names that are used in the behaviour."""
        return {"type": "field_broadcast", "name": self.name, "value": self.value}

    def translated(self, say: Say) -> Argument:
        """The name that it holds at first."""
        return replace(self, value=say("example", self.value))

    def read(self, saved: object) -> object:
        """A name on one line; spaces around it do not count."""
        name = " ".join((self.value if saved is None else str(saved)).split())
        if not name:
            raise FieldError(_("needs the name of a message"))
        return name


@dataclass(frozen=True)
class PathField(Field):
    """The path of a field inside a topic's messages, such as ``faces.0.name``; typed or chosen."""

    value: str = "value"
    topic: str = "TOPIC"

    def to_blockly(self) -> dict[str, object]:
        """Our topic field in its second role: it suggests fields of the topic that ``of`` names."""
        return {"type": "field_topic", "name": self.name, "value": self.value, "of": self.topic}

    def read(self, saved: object) -> object:
        """Any text; empty is the whole message."""
        return self.value if saved is None else str(saved)


@dataclass(frozen=True)
class ColourField(Field):
    """A colour, "#rrggbb"."""

    value: str = "#37b6ff"

    def to_blockly(self) -> dict[str, object]:
        """Our colour chip."""
        return {"type": "field_colour_chip", "name": self.name, "value": self.value}

    def read(self, saved: object) -> object:
        """Six digits after a number sign."""
        colour = self.value if saved is None else str(saved)
        if not _COLOUR.fullmatch(colour):
            raise FieldError(_("needs a colour"))
        return colour.lower()


@dataclass(frozen=True)
class VariableField(Field):
    """One of the behaviour's variables; the compiler looks its name up."""

    value: str = "count"

    def to_blockly(self) -> dict[str, object]:
        """Blockly's own variable field."""
        return {"type": "field_variable", "name": self.name, "variable": self.value}

    def translated(self, say: Say) -> Argument:
        """The variable's name at first."""
        return replace(self, value=say("variable", self.value))

    def read(self, saved: object) -> object:
        """The variable's id; Blockly saves ``{"id": …}``, older files a name."""
        if isinstance(saved, Mapping):
            saved = saved.get("id", saved.get("name"))
        if not isinstance(saved, str) or not saved:
            raise FieldError(_("needs a variable"))
        return saved


@dataclass(frozen=True)
class LiveField(Field):
    """Shows a sensor's newest value; the editor fills it, files do not hold it."""

    @property
    def silent(self) -> bool:
        """It has no part in the Python."""
        return True

    def to_blockly(self) -> dict[str, object]:
        """Our live field."""
        return {"type": "field_live", "name": self.name}

    def read(self, saved: object) -> object:  # noqa: ARG002 (whatever a file says)
        """Nothing."""
        return None


def _key(value: object) -> str:
    """A value as Blockly's drop-downs hold it: text."""
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
    """The drop-down with which a robot's block starts: all robots of its model."""
    return _robot_field(model, tuple(names))


@lru_cache(maxsize=64)  # all blocks of all robots of a model have the same one
def _robot_field(model: str, names: tuple[str, ...]) -> ChoiceField:
    return ChoiceField("ROBOT", tuple((name, name) for name in names), source=f"robots:{model}")
