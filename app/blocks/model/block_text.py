"""Formatting of blocks as text, such as "wait 2 s" or "say “Touch my head.”"."""

from __future__ import annotations

import re
from collections.abc import Mapping

from app.blocks.model.block import Block
from app.blocks.model.fields import (
    ChoiceField,
    Field,
    FieldError,
    StatementInput,
    TextField,
    ValueInput,
    VariableField,
)
from app.blocks.model.workspace import PlacedBlock
from nep.i18n import _

_PLACEHOLDER = re.compile(r"%([A-Z][A-Z0-9_]*)")
_JAPANESE_CHARACTER = re.compile(r"[\u3040-\u30ff\u4e00-\u9fff]")
_MAX_LENGTH = 80


def block_text(
    placed_block: PlacedBlock,
    blocks: Mapping[str, Block],
    variables: Mapping[str, str],
    *,
    with_robot: bool = True,
) -> str:
    """Return a block with its arguments as one line of text, truncated to 80 characters.

    A block without description is represented by the result of `label_of_unknown`.

    Args:
        placed_block: Block in the workspace.
        blocks: Descriptions of blocks by type.
        variables: Names of variables by id.
        with_robot: False to omit the name of the robot.
    """
    block = blocks.get(placed_block.type)
    if block is None:
        return label_of_unknown(placed_block)

    def replacement(match: re.Match[str]) -> str:
        argument = block.argument(match[1])
        if argument is None:
            return match[0]
        if match[1] == "ROBOT" and not with_robot:
            return ""
        if isinstance(argument, VariableField):
            id = _variable_id(argument, placed_block)
            return variables.get(id, id or argument.value)
        if isinstance(argument, Field) and not argument.is_display_only:
            text = _field_text(argument, placed_block)
            is_quoted = is_text and isinstance(argument, TextField)
            return _("“{name}”").format(name=text) if is_quoted else text
        if isinstance(argument, ValueInput):
            if not argument.is_present(placed_block.fields):
                return ""
            inner = placed_block.inputs.get(argument.name, ())
            return block_text(inner[0], blocks, variables) if inner else "…"
        return ""

    is_text = block.shape == "value"
    text = " ".join(_PLACEHOLDER.sub(replacement, block.text).split())
    return text if len(text) <= _MAX_LENGTH else f"{text[: _MAX_LENGTH - 1]}…"


def label(placed_block: PlacedBlock, block: Block) -> str:
    """Return the label of a block: its first words, up to a slot, such as "wait until".

    Selected choices are included, but not the robot. The label of an action block is the title of the
    action. In Japanese, where the verb comes last, the label is the whole text with "…" for slots. If
    the label would be empty, it is derived from the block's type.
    """
    if block.robot is not None and block.robot.kind == "action":
        return block.robot.title
    pieces = _PLACEHOLDER.split(block.text)  # words, argument, words, argument, …, words
    label_text, is_verb_last = "", bool(_JAPANESE_CHARACTER.search(block.text))
    for number, piece in enumerate(pieces):
        argument = block.argument(piece) if number % 2 else None
        if isinstance(argument, (ValueInput, StatementInput)):
            if is_verb_last:
                label_text += "…"
            elif label_text.strip():
                break
        elif isinstance(argument, ChoiceField) and argument.name != "ROBOT":
            label_text += _field_text(argument, placed_block)
        elif argument is None:
            label_text += piece
    if is_verb_last:
        return "".join(label_text.split()) or label_of_type(block.type)
    return " ".join(label_text.split()) or label_of_type(block.type)


def label_of_type(block_type: str) -> str:
    """Derive a label from the type of a block without description: "wave" for ``robot_nao_do_wave``."""
    for verb in ("_do_", "_get_", "_when_"):
        if block_type.startswith("robot_") and verb in block_type:
            return block_type.partition(verb)[2].replace("_", " ")
    return block_type.partition("_")[2].replace("_", " ") or block_type


def label_of_unknown(placed_block: PlacedBlock) -> str:
    """Return the label of a block without description; the editor shows the same text on the grey block."""
    if placed_block.type.startswith("robot_"):
        return label_of_type(placed_block.type)
    type_text = re.sub(r"[_\s]+", " ", placed_block.type).strip()
    values = [
        str(each)
        for each in placed_block.fields.values()
        if isinstance(each, (str, int, float)) and not isinstance(each, bool)
    ]
    return " ".join([type_text, *values])[:_MAX_LENGTH]


def _field_text(argument: Field, placed_block: PlacedBlock) -> str:
    try:
        value = argument.read(placed_block.fields.get(argument.name))
    except FieldError:
        return str(placed_block.fields.get(argument.name))
    if isinstance(argument, ChoiceField):
        return argument.option_text(value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _variable_id(argument: VariableField, placed_block: PlacedBlock) -> str:
    try:
        return str(argument.read(placed_block.fields.get(argument.name)))
    except FieldError:
        return ""
