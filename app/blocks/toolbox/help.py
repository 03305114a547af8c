"""What people are told who ask about a block: what it does, what goes into its gaps, an example."""

from __future__ import annotations

import re
from collections.abc import Mapping

from app.blocks.model.block import Block
from app.blocks.model.block_text import reading
from app.blocks.model.fields import (
    Argument,
    ChoiceField,
    ColourField,
    LiveField,
    NumberField,
    PathField,
    StatementInput,
    TextField,
    TopicField,
    ValueInput,
    VariableField,
)
from app.blocks.model.growing import Inputs, Items
from app.blocks.model.workspace import parse_workspace
from app.blocks.toolbox.examples import EXAMPLES

_HOLE = re.compile(r"%([A-Z][A-Z0-9_]*)")
_NAMES = {
    "A": "first gap",
    "B": "second gap",
    "BODY": "inside",
    "ELSE": "inside, below “else”",
    "VAR": "variable",
}
_TAKES = {
    "Number": "a number",
    "String": "a text",
    "Boolean": "yes or no, such as a comparison",
    "List": "a list",
}
_MOST_CHOICES = 6


def help_of(block: Block) -> dict[str, object]:
    """``title``, ``does``, ``more``, ``gaps`` as (name, words), ``example``, and ``words`` to find it by."""
    gaps = [
        [name_of_gap(block, argument), words]
        for argument in block.arguments
        if (words := _takes(block, argument))
    ]
    return {
        "title": title(block),
        "does": block.tooltip,
        "more": block.help,
        "gaps": gaps,
        "example": EXAMPLES.get(block.type) or f"For example: {_filled(block)}.",
        "words": " ".join(block.words),
    }


def title(block: Block) -> str:
    """What stands on the block, with its gaps in brackets: "wait (seconds) s"."""

    def place(hole: re.Match[str]) -> str:
        argument = block.argument(hole[1])
        if argument is None or isinstance(argument, (LiveField, StatementInput)):
            return ""
        return f"({name_of_gap(block, argument)})"

    return " ".join(_HOLE.sub(place, block.text).split())


def name_of_gap(block: Block, argument: Argument) -> str:
    """What a gap or field is called in words."""
    told = block.about.get(argument.name)
    if told:
        return told[0]
    return _NAMES.get(argument.name, argument.name.lower().replace("_", " "))


def _takes(block: Block, argument: Argument) -> str:
    """What goes into it; "" for what needs no words."""
    words = _kind(argument)
    told = block.about.get(argument.name)
    return f"{words}, {told[1]}" if words and told and told[1] else words


def _kind(argument: Argument) -> str:
    if argument.name == "ROBOT":
        return "which robot"
    if isinstance(argument, ValueInput):
        return _value(argument)
    if isinstance(argument, ChoiceField):
        return _choice(argument)
    if isinstance(argument, NumberField):
        return f"a number{_limits(argument)}"
    for kind, words in _PLAIN.items():
        if isinstance(argument, kind):
            return words
    return ""


_PLAIN: Mapping[type[Argument], str] = {
    StatementInput: "blocks",
    TextField: "a text, typed into the block",
    TopicField: "the name of a topic; choose one or type it",
    PathField: "the name of a field in the topic's messages",
    ColourField: "a colour; click on it to choose",
    VariableField: "one of the behaviour's variables",
    Items: "as many gaps as you like",
    Inputs: "what the function is given",
}


def _value(gap: ValueInput) -> str:
    words = _TAKES.get(gap.check or "", "any value")
    if isinstance(gap.default, (int, float)) and not isinstance(gap.default, bool):
        words += f"; {gap.default:g} unless you change it"
    return words if gap.only is None else f"{words}; it is there for an item by its number"


def _choice(field: ChoiceField) -> str:
    names = [f"“{words}”" for words, _ in field.options]
    if len(names) > _MOST_CHOICES:
        return f"one of {len(names)} choices: {', '.join(names[: _MOST_CHOICES - 1])} and others"
    if len(names) < 2:
        return "choose one"
    return f"{', '.join(names[:-1])} or {names[-1]}"


def _limits(field: NumberField) -> str:
    if field.minimum is not None and field.maximum is not None:
        return f" from {field.minimum:g} to {field.maximum:g}"
    if field.minimum is not None:
        return f" of at least {field.minimum:g}"
    return "" if field.maximum is None else f" of at most {field.maximum:g}"


def _filled(block: Block) -> str:
    """The block as it comes out of the toolbox, in words."""
    workspace = parse_workspace({"blocks": {"blocks": [block.to_toolbox()]}})
    return reading(workspace.scripts[0][0], _readable(block), {})


def _readable(block: Block) -> dict[str, Block]:
    """The block itself, and the two that stand in gaps."""
    number = Block("values_number", "%NUMBER", "value", "", "", "", "", (NumberField("NUMBER"),))
    words = Block("values_text", "%TEXT", "value", "", "", "", "", (TextField("TEXT"),))
    variable = Block("variables_get", "%VAR", "value", "", "", "", "", (VariableField("VAR"),))
    return {each.type: each for each in (number, words, variable, block)}
