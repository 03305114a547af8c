"""Category Variables: values shared by all scripts, stored as variables of Blockly."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ValueInput, VariableField

CATEGORY = Category(
    name="variables",
    title="Variables",
    style="variables",
    icon="variable",
    order=40,
    dynamic="variables",
    button=("New variable", "CREATE_VARIABLE"),
    blocks=(
        Block(
            type="variables_set",
            text="set %VAR to %VALUE",
            shape="statement",
            style="variables",
            icon="variable",
            tooltip="Sets the variable to this value. All scripts share the variable.",
            example="For example: set “count” to 0 when started.",
            python="%VAR = %VALUE",
            arguments=(VariableField("VAR"), ValueInput("VALUE", None, 0)),
            search_words="variable, assign, store, save, put!, remember, initialize, let, make, equals, =",
        ),
        Block(
            type="variables_change",
            text="change %VAR by %BY",
            shape="statement",
            style="variables",
            icon="diff",
            tooltip="Adds this number to the variable.",
            example="For example: change “count” by 1 each time the head is touched.",
            python="%VAR += %BY",
            arguments=(VariableField("VAR"), ValueInput("BY", "Number", 1)),
            search_words="variable, increase, decrease, add!, sum!, increment, decrement, count up, "
            "counter, score, "
            "points, +=",
        ),
        Block(
            type="variables_get",
            text="%VAR",
            shape="value",
            style="variables",
            icon="variable",
            tooltip="The value of the variable.",
            example="For example: say “count”.",
            python="%VAR",
            arguments=(VariableField("VAR"),),
            can_fail=False,
            search_words="variable, value, read, use, box",
        ),
    ),
)
