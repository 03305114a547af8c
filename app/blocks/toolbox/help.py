"""Help for a block: a description, the values that its slots accept, and an example."""

from __future__ import annotations

import re
from collections.abc import Mapping

from app.blocks.model.block import Block
from app.blocks.model.block_text import block_text
from app.blocks.model.fields import (
    Argument,
    BroadcastField,
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
from app.blocks.model.mutators import Inputs, Items
from app.blocks.model.workspace import parse_workspace
from nep.i18n import _, format_list, lazy, translate

_PLACEHOLDER = re.compile(r"%([A-Z][A-Z0-9_]*)")
_SLOT_NAMES = {
    "A": "first value",
    "B": "second value",
    "BODY": "inside",
    "ELSE": "inside, below “else”",
    "VAR": "variable",
}
_TYPE_TEXTS = {
    "Number": lazy("a number"),
    "String": lazy("a text"),
    "Boolean": lazy("yes or no, such as a comparison"),
    "List": lazy("a list"),
}
_ANY_TYPE_TEXT = lazy("any value")
_MAX_CHOICES = 6
_MAX_UNIT_LENGTH = 3  # maximum length of a unit


def help_of(block: Block) -> dict[str, object]:
    """Return the help for a block as a JSON object.

    The members are ``title``, ``name``, ``does`` (short description), ``more`` (long description), ``gaps``
    (pairs of slot name and accepted values), and ``example``. Only for search: ``words`` and ``english``
    (search words in both languages) and ``choices`` (options of the drop-downs).
    """
    gaps = [
        [slot_name(block, argument), accepted_values]
        for argument in block.arguments
        if (accepted_values := _argument_text(block, argument))
    ]
    return {
        "title": title(block),
        "name": name(block),
        "does": block.tooltip,
        "more": block.help,
        "gaps": gaps,
        "example": _example(block),
        "words": block.search_words,
        "english": block.english_search_words,
        "choices": _choice_texts(block),
    }


def _example(block: Block) -> str:
    return block.example or _("For example: {block}.").format(block=_block_with_defaults(block))


def title(block: Block) -> str:
    """Return the text on a block with the names of slots in parentheses, such as ``wait (seconds) s``."""

    def slot_text(match: re.Match[str]) -> str:
        argument = block.argument(match[1])
        if argument is None or isinstance(argument, (LiveField, StatementInput)):
            return ""
        return f"({slot_name(block, argument)})"

    return " ".join(_PLACEHOLDER.sub(slot_text, block.text).split())


def name(block: Block) -> str:
    """Return the name of a block for use in a sentence, such as "walk" or "repeat … times".

    The robot slot and a unit after the last slot are left out. Returns "" if the block contains no words.
    """
    text_parts = [part.strip() for part in _PLACEHOLDER.split(block.text.removeprefix("%ROBOT "))[::2]]
    if len(text_parts) > 1 and len(text_parts[-1]) <= _MAX_UNIT_LENGTH:
        text_parts[-1] = ""
    block_name = re.sub(r"\s*…[\s…]*", " … ", "…".join(text_parts)).strip().removesuffix(" …")
    return (
        block_name
        if sum(letter.isalpha() for letter in block_name) >= _MAX_UNIT_LENGTH - 1 and block_name != "…"
        else ""
    )


def slot_name(block: Block, argument: Argument) -> str:
    """Return the display name of a slot or field."""
    gap_texts = block.slot_texts.get(argument.name)
    if gap_texts:
        return gap_texts[0]
    return translate("gap", english_slot_name(argument))


def english_slot_name(argument: Argument) -> str:
    """Return the default display name of a slot or field, in English."""
    return _SLOT_NAMES.get(argument.name, argument.name.lower().replace("_", " "))


def _argument_text(block: Block, argument: Argument) -> str:
    kind_text = _kind_text(argument)
    gap_texts = block.slot_texts.get(argument.name)
    if kind_text and gap_texts and gap_texts[1]:
        return _("{kind}, {more}").format(kind=kind_text, more=gap_texts[1])
    return kind_text


def _kind_text(argument: Argument) -> str:
    if argument.name == "ROBOT":
        return _("which robot")
    if isinstance(argument, ValueInput):
        return _value_text(argument)
    if isinstance(argument, ChoiceField):
        return _choice_text(argument)
    if isinstance(argument, NumberField):
        return _number_text(argument)
    for kind, field_text in _FIELD_TEXTS.items():
        if isinstance(argument, kind):
            return _(field_text)
    return ""


_FIELD_TEXTS: Mapping[type[Argument], str] = {
    StatementInput: lazy("blocks"),
    TextField: lazy("a text, typed into the block"),
    BroadcastField: lazy("name of a message; choose one or create a new one"),
    TopicField: lazy("name of a topic; choose or type one"),
    PathField: lazy("name of a field in the topic's messages"),
    ColourField: lazy("a colour; click on it to choose"),
    VariableField: lazy("one of the behaviour's variables"),
    Items: lazy("up to 50 slots"),
    Inputs: lazy("inputs of the function"),
}


def _value_text(gap: ValueInput) -> str:
    value_text = _(_TYPE_TEXTS.get(gap.check or "", _ANY_TYPE_TEXT))
    if isinstance(gap.default, (int, float)) and not isinstance(gap.default, bool):
        value_text = _("{kind}; {value} by default").format(kind=value_text, value=f"{gap.default:g}")
    if gap.only_if is None:
        return value_text
    return _("{kind}; used only if you choose by number").format(kind=value_text)


def _choice_text(field: ChoiceField) -> str:
    names = [f"“{option_text}”" for option_text, _value in field.options]
    if len(names) > _MAX_CHOICES:
        first_names = ", ".join(names[: _MAX_CHOICES - 1])
        return _("one of {count} choices: {few} and others").format(count=len(names), few=first_names)
    return format_list(names, "or") if len(names) > 1 else _("choose one")


def _choice_texts(block: Block) -> list[str]:
    fields = [each for each in block.arguments if isinstance(each, ChoiceField) and each.name != "ROBOT"]
    return [option_text for field in fields for option_text, _value in field.options]


def _number_text(field: NumberField) -> str:
    low, high = (None if each is None else f"{each:g}" for each in (field.minimum, field.maximum))
    if low is not None and high is not None:
        return _("a number from {low} to {high}").format(low=low, high=high)
    if low is not None:
        return _("a number of at least {low}").format(low=low)
    return _("a number") if high is None else _("a number of at most {high}").format(high=high)


def _block_with_defaults(block: Block) -> str:
    workspace = parse_workspace({"blocks": {"blocks": [block.to_toolbox()]}})
    return block_text(workspace.scripts[0][0], _blocks_for_text(block), {})


def _blocks_for_text(block: Block) -> dict[str, Block]:
    number = Block("values_number", "%NUMBER", "value", "", "", "", "", (NumberField("NUMBER"),))
    text_block = Block("values_text", "%TEXT", "value", "", "", "", "", (TextField("TEXT"),))
    variable = Block("variables_get", "%VAR", "value", "", "", "", "", (VariableField("VAR"),))
    return {each.type: each for each in (number, text_block, variable, block)}
