"""A block: one description from which come its look in the editor, its Python and its words."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from app.blocks.model.fields import Argument, Say, StatementInput, ValueInput
from app.blocks.model.template import holes

Shape = Literal["hat", "definition", "statement", "cap", "value", "boolean"]
Kind = Literal["action", "sensor", "event"]

_HOLE = re.compile(r"%([A-Z][A-Z0-9_]*)")


@dataclass(frozen=True)
class RobotUse:
    """What a robot's block asks of its robot: which of its actions, sensors or events."""

    kind: Kind
    name: str
    title: str
    model: str


@dataclass(frozen=True)
class Block:
    """One kind of block.

    ``text`` is what people read, with ``%NAME`` where an argument stands. ``python`` is a template
    (`app.blocks.model.template`), or one template for each value of the field ``variant``; for a hat it is
    the decorator. ``constants`` are values for holes that are no arguments, ``keywords`` are holes that take
    arguments by name: hole -> (argument, Python's keyword).
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
    check: str | None = None  # what a value is: "Number", "String", or None for anything
    constants: Mapping[str, object] = field(default_factory=dict)
    trees: Mapping[str, ast.expr] = field(default_factory=dict)  # constants that are trees already
    keywords: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    robot: RobotUse | None = None
    parameters: tuple[str, ...] = ()  # a hat's: names that its function gets
    fails: bool = True  # a value's: may its Python raise?
    needs_message: bool = False  # reads the message that started its script
    publishes: bool = False  # its topics are published on, not listened to
    python_in_function: str = ""  # its Python inside a function, when that differs
    mutator: str = ""  # how the editor lets people change its gaps: "items", "branches", "function", "call"
    extra: Mapping[str, object] = field(default_factory=dict)  # what the editor keeps of that, in the toolbox
    needs_function: str = ""  # stands only inside a function: "result" or "plain" ones
    calls: bool = False  # runs blocks of another place
    undefined: str = ""  # why it can't run: nobody defined what it calls
    in_toolbox: bool = True
    about: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # argument -> its name, more about it
    help: str = ""  # for people who ask: more than the tooltip, with an example
    words: str = (
        ""  # other words that people look for it by, with commas between; after one with ! it comes first
    )
    english_words: str = ""  # the English ones, where its words are in another language

    def argument(self, name: str) -> Argument | None:
        """The argument of that name."""
        return next((argument for argument in self.arguments if argument.name == name), None)

    @property
    def templates(self) -> tuple[str, ...]:
        """All its Python templates."""
        return (self.python,) if isinstance(self.python, str) else tuple(self.python.values())

    def problems(self) -> tuple[str, ...]:
        """What is wrong with the description itself; empty when it is sound."""
        known = {argument.name for argument in self.arguments} | {
            *self.constants,
            *self.trees,
            *self.keywords,
        }
        named = {argument for pairs in self.keywords.values() for argument, _ in pairs}
        missing = {hole for text in self.templates for hole in holes(text)} - known
        found = [f"{self.type}: its Python needs %{name}" for name in sorted(missing)]
        shown = set(_HOLE.findall(self.text))
        found += [f"{self.type}: its text needs %{name}" for name in sorted(shown - known)]
        used = {hole for text in self.templates for hole in holes(text)} | named | {self.variant}
        found += [
            f"{self.type}: %{argument.name} is used nowhere"
            for argument in self.arguments
            if argument.name not in used and not argument.silent and self.shape != "definition"
        ]
        return tuple(found)

    def translated(self, say: Say) -> Block:
        """The same block with the words that `say` gives for its English ones; type and Python stay.

        `say` is called for every word that a person reads: ``tools/words.py`` collects them by it.
        """
        words = say(f"words to find {self.type}", self.words) if self.words else ""
        return replace(
            self,
            text=say("block", self.text),
            tooltip=say(None, self.tooltip),
            help=say(None, self.help),
            arguments=tuple(argument.translated(say) for argument in self.arguments),
            words=words,
            english_words="" if words == self.words else f"{_plain(self.text)}, {self.words}",
        )

    def to_blockly(self) -> dict[str, object]:
        """Blockly's JSON definition; statement inputs stand on lines of their own."""
        definition: dict[str, object] = {"type": self.type, "style": self.style, "tooltip": self.tooltip}
        definition.update(_messages(self))
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
        """Its entry in the toolbox, with a shadow in each gap that has a default."""
        entry: dict[str, object] = {"kind": "block", "type": self.type}
        if fields:
            entry["fields"] = dict(fields)
        inputs: dict[str, object] = {}
        for argument in self.arguments:
            inputs |= argument.fillings()
        if self.extra:
            entry["extraState"] = dict(self.extra)
        if inputs:
            entry["inputs"] = inputs
        return entry


def _plain(text: str) -> str:
    """The words between its gaps."""
    return " ".join(_HOLE.sub(" ", text).split())


def _messages(block: Block) -> dict[str, object]:
    """``message0``, ``args0``, ...: a new line after each statement input."""
    lines: list[tuple[str, list[Mapping[str, object]]]] = [("", [])]
    if block.icon:
        lines[0] = ("%1 ", [{"type": "field_icon", "name": "ICON", "icon": block.icon}])
    position = 0
    for match in _HOLE.finditer(block.text):
        argument = block.argument(match[1])
        if argument is None:
            continue
        words = _escaped(block.text[position : match.start()])
        position = match.end()
        if isinstance(argument, StatementInput):
            if words.strip():
                lines[-1] = (lines[-1][0] + words, lines[-1][1])
            lines += [("%1", [argument.to_blockly()]), ("", [])]
            continue
        text, arguments = lines[-1]
        if isinstance(argument, ValueInput) and argument.only is not None:
            # Words and fields before a gap belong to it and would go with it.
            words = f"{words}%{len(arguments) + 1} "
            arguments = [*arguments, {"type": "input_dummy", "name": f"BEFORE_{argument.name}"}]
        lines[-1] = (f"{text}{words}%{len(arguments) + 1}", [*arguments, argument.to_blockly()])
    lines[-1] = (lines[-1][0] + _escaped(block.text[position:]), lines[-1][1])
    return _numbered(lines)


def _numbered(lines: Sequence[tuple[str, list[Mapping[str, object]]]]) -> dict[str, object]:
    result: dict[str, object] = {}
    shown = [(text.strip(), arguments) for text, arguments in lines if text.strip()]
    for number, (text, arguments) in enumerate(shown):
        result[f"message{number}"] = text
        if arguments:
            result[f"args{number}"] = arguments
    return result


def _escaped(words: str) -> str:
    """Words as Blockly's messages want them: a bare per cent sign before a digit would be an argument."""
    return words.replace("%", "%%")
