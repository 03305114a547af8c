"""Description of a kind of block: its appearance in the editor, its Python code and its texts."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from app.blocks.model.fields import Argument, StatementInput, Translate, ValueInput
from app.blocks.model.template import placeholders

Shape = Literal["hat", "definition", "statement", "cap", "value", "boolean"]
Kind = Literal["action", "sensor", "event"]

_PLACEHOLDER = re.compile(r"%([A-Z][A-Z0-9_]*)")


@dataclass(frozen=True)
class RobotUse:
    """Action, sensor or event of a robot that a block uses.

    Attributes:
        kind: "action", "sensor" or "event".
        name: Name in the robot's description; "" if the block can use any sensor.
        title: Display name.
        model: Model of the robot.
    """

    kind: Kind
    name: str
    title: str
    model: str


@dataclass(frozen=True)
class Block:
    """Description of a kind of block.

    Attributes:
        text: Text on the block, with ``%NAME`` for an argument.
        python: Template (`app.blocks.model.template`), or one template for each value of the field `variant`.
            For an event block, the template of the decorator.
        constants: Values of placeholders that aren't arguments.
        keywords: Placeholders that take keyword arguments: placeholder -> (argument, Python keyword).
    """

    type: str
    text: str
    shape: Shape
    style: str
    icon: str
    tooltip: str
    python: str | Mapping[str, str]
    arguments: tuple[Argument, ...] = ()
    variant: str | None = None
    check: str | None = None  # type of a value: "Number", "String", or None for any
    constants: Mapping[str, object] = field(default_factory=dict)
    constant_trees: Mapping[str, ast.expr] = field(default_factory=dict)  # constants that are syntax trees
    keywords: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    robot: RobotUse | None = None
    parameters: tuple[str, ...] = ()  # event blocks: parameters of the function
    can_fail: bool = True  # values: the Python code may raise
    needs_message: bool = False  # reads the message that started its script
    is_publisher: bool = False  # publishes on its topics instead of subscribing to them
    python_in_function: str = ""  # Python code inside a function, if different
    mutator: str = ""  # how the user changes its slots: "items", "branches", "function", "call"
    extra_state: Mapping[str, object] = field(default_factory=dict)  # initial extraState in the toolbox
    needs_function: str = ""  # only allowed in a function: "result" or "plain"
    is_function_call: bool = False  # runs blocks elsewhere
    undefined_message: str = ""  # why it can't run: the function is undefined
    is_in_toolbox: bool = True
    slot_texts: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # argument -> (name, details)
    help: str = ""  # longer description than the tooltip
    example: str = ""  # example in the help, beginning with "For example: "
    search_words: str = ""  # search words separated by commas; those with ! rank first
    english_search_words: str = ""  # English search words, if the language differs

    def argument(self, name: str) -> Argument | None:
        """Return the argument with this name, or None."""
        return next((argument for argument in self.arguments if argument.name == name), None)

    @property
    def templates(self) -> tuple[str, ...]:
        """All Python templates of the block."""
        return (self.python,) if isinstance(self.python, str) else tuple(self.python.values())

    def problems(self) -> tuple[str, ...]:
        """Return the inconsistencies of the description, one message each; empty if it is consistent."""
        argument_names = {argument.name for argument in self.arguments} | {
            *self.constants,
            *self.constant_trees,
            *self.keywords,
        }
        keyword_arguments = {argument for pairs in self.keywords.values() for argument, _ in pairs}
        missing_names = {name for text in self.templates for name in placeholders(text)} - argument_names
        messages = [f"{self.type}: its Python needs %{name}" for name in sorted(missing_names)]
        text_placeholders = set(_PLACEHOLDER.findall(self.text))
        messages += [
            f"{self.type}: its text needs %{name}" for name in sorted(text_placeholders - argument_names)
        ]
        used_names = (
            {name for text in self.templates for name in placeholders(text)}
            | keyword_arguments
            | {self.variant}
        )
        messages += [
            f"{self.type}: %{argument.name} is used nowhere"
            for argument in self.arguments
            if argument.name not in used_names and not argument.is_display_only and self.shape != "definition"
        ]
        return tuple(messages)

    def translated(self, translate: Translate) -> Block:
        """Return the block with translated texts; type and Python code are unchanged.

        ``tools/words.py`` calls this method to collect the texts.

        Args:
            translate: Called with the context and the English text of everything that the user reads;
                returns the translation.
        """
        search_words = translate(f"words to find {self.type}", self.search_words) if self.search_words else ""
        return replace(
            self,
            text=translate("block", self.text),
            tooltip=translate(None, self.tooltip),
            help=translate(None, self.help),
            example=translate(None, self.example),
            arguments=tuple(argument.translated(translate) for argument in self.arguments),
            search_words=search_words,
            english_search_words=""
            if search_words == self.search_words
            else f"{_text_without_placeholders(self.text)}, {self.search_words}",
        )

    def to_blockly(self) -> dict[str, object]:
        """Return the definition of the block in Blockly's JSON format.

        Each statement input is on a separate line.
        """
        definition: dict[str, object] = {"type": self.type, "style": self.style, "tooltip": self.tooltip}
        definition.update(_message_json(self))
        definition["inputsInline"] = True
        if self.mutator:
            definition["mutator"] = f"nep_{self.mutator}"
        if self.shape in ("value", "boolean"):
            definition["output"] = "Boolean" if self.shape == "boolean" else self.check
        if self.shape in ("statement", "cap"):
            definition["previousStatement"] = None
        if self.shape in ("hat", "statement"):
            definition["nextStatement"] = None
        return definition

    def to_toolbox(self, fields: Mapping[str, object] | None = None) -> dict[str, object]:
        """Return the toolbox entry of the block in Blockly's JSON format, with initial content in its slots.

        Args:
            fields: Preset values of fields.
        """
        entry: dict[str, object] = {"kind": "block", "type": self.type}
        if fields:
            entry["fields"] = dict(fields)
        inputs: dict[str, object] = {}
        for argument in self.arguments:
            inputs |= argument.initial_inputs()
        if self.extra_state:
            entry["extraState"] = dict(self.extra_state)
        if inputs:
            entry["inputs"] = inputs
        return entry


def _text_without_placeholders(text: str) -> str:
    return " ".join(_PLACEHOLDER.sub(" ", text).split())


def _message_json(block: Block) -> dict[str, object]:
    # Starts a new line after each statement input.
    lines: list[tuple[str, list[Mapping[str, object]]]] = [("", [])]
    if block.icon:
        lines[0] = ("%1 ", [{"type": "field_icon", "name": "ICON", "icon": block.icon}])
    position = 0
    for match in _PLACEHOLDER.finditer(block.text):
        argument = block.argument(match[1])
        if argument is None:
            continue
        text_part = _escape_percent(block.text[position : match.start()])
        position = match.end()
        if isinstance(argument, StatementInput):
            if text_part.strip():
                lines[-1] = (lines[-1][0] + text_part, lines[-1][1])
            lines += [("%1", [argument.to_blockly()]), ("", [])]
            continue
        text, arguments = lines[-1]
        if isinstance(argument, ValueInput) and argument.only_if is not None:
            # An optional slot must not remove the words and fields before it.
            text_part = f"{text_part}%{len(arguments) + 1} "
            arguments = [*arguments, {"type": "input_dummy", "name": f"BEFORE_{argument.name}"}]
        lines[-1] = (f"{text}{text_part}%{len(arguments) + 1}", [*arguments, argument.to_blockly()])
    lines[-1] = (lines[-1][0] + _escape_percent(block.text[position:]), lines[-1][1])
    return _numbered_messages(lines)


def _numbered_messages(lines: Sequence[tuple[str, list[Mapping[str, object]]]]) -> dict[str, object]:
    result: dict[str, object] = {}
    visible_lines = [(text.strip(), arguments) for text, arguments in lines if text.strip()]
    for number, (text, arguments) in enumerate(visible_lines):
        result[f"message{number}"] = text
        if arguments:
            result[f"args{number}"] = arguments
    return result


def _escape_percent(text: str) -> str:
    # Blockly would treat a per cent sign before a digit as an argument.
    return text.replace("%", "%%")
