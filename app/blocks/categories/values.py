"""Values: numbers, text, true and false, and what can be worked out from them."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ChoiceField, NumberField, TextField, ValueInput

_NUMBERS = (ValueInput("A", "Number", 1), ValueInput("B", "Number", 1))

_ARITHMETIC = {
    "+": "%A + %B",
    "-": "%A - %B",
    "*": "%A * %B",
    "/": "%A / %B",
    "%": "%A % %B",
    "**": "%A ** %B",
}
_SIGNS = (
    ("+", "+"),
    ("−", "-"),  # noqa: RUF001 (the sign that people read)
    ("×", "*"),  # noqa: RUF001 (the sign that people read)
    ("÷", "/"),
    ("remainder of ÷", "%"),
    ("to the power of", "**"),
)

_COMPARE = {
    "==": "%A == %B",
    "!=": "%A != %B",
    "<": "%A < %B",
    "<=": "%A <= %B",
    ">": "%A > %B",
    ">=": "%A >= %B",
}
_RELATIONS = (
    ("is below", "<"),
    ("is above", ">"),
    ("is", "=="),
    ("is not", "!="),
    ("is at most", "<="),
    ("is at least", ">="),
)

_PLAIN = (
    Block(
        type="values_number",
        text="%NUMBER",
        shape="value",
        style="values",
        icon="",
        tooltip="A number.",
        python="%NUMBER",
        arguments=(NumberField("NUMBER", 0),),
        check="Number",
        fails=False,
    ),
    Block(
        type="values_text",
        text="%TEXT",  # the editor puts quotation marks around it
        shape="value",
        style="values",
        icon="",
        tooltip="A text.",
        python="%TEXT",
        arguments=(TextField("TEXT", "Hello"),),
        check="String",
        fails=False,
    ),
    Block(
        type="values_boolean",
        text="%VALUE",
        shape="boolean",
        style="values",
        icon="",
        tooltip="True or false.",
        python="%VALUE",
        arguments=(ChoiceField("VALUE", (("true", True), ("false", False))),),
        check="Boolean",
        fails=False,
    ),
)

_NUMBER_BLOCKS = (
    Block(
        type="values_arithmetic",
        text="%A %SIGN %B",
        shape="value",
        style="values",
        icon="",
        tooltip="Works out a number from two numbers.",
        python=_ARITHMETIC,
        arguments=(*_NUMBERS, ChoiceField("SIGN", _SIGNS)),
        variant="SIGN",
        check="Number",
    ),
    Block(
        type="values_random",
        text="random number from %LOW to %HIGH",
        shape="value",
        style="values",
        icon="dices",
        tooltip="A number by chance; a whole one when both limits are whole.",
        python="random_number(%LOW, %HIGH)",
        arguments=(ValueInput("LOW", "Number", 1), ValueInput("HIGH", "Number", 6)),
        check="Number",
    ),
    Block(
        type="values_round",
        text="%HOW %NUMBER",
        shape="value",
        style="values",
        icon="",
        tooltip="Makes a whole number; halves go up.",
        python={
            "round": "rounded(%NUMBER)",
            "up": "rounded_up(%NUMBER)",
            "down": "rounded_down(%NUMBER)",
        },
        arguments=(
            ChoiceField("HOW", (("round", "round"), ("round up", "up"), ("round down", "down"))),
            ValueInput("NUMBER", "Number", 3.1),
        ),
        variant="HOW",
        check="Number",
    ),
)

_LOGIC_BLOCKS = (
    Block(
        type="values_compare",
        text="%A %RELATION %B",
        shape="boolean",
        style="values",
        icon="",
        tooltip="Compares two values.",
        python=_COMPARE,
        arguments=(ValueInput("A", None, 10), ValueInput("B", None, 20), ChoiceField("RELATION", _RELATIONS)),
        variant="RELATION",
        check="Boolean",
    ),
    Block(
        type="values_logic",
        text="%A %LOGIC %B",
        shape="boolean",
        style="values",
        icon="",
        tooltip="“and”: both must be so. “or”: one of them is enough.",
        python={"and": "%A and %B", "or": "%A or %B"},
        arguments=(
            ValueInput("A", "Boolean"),
            ValueInput("B", "Boolean"),
            ChoiceField("LOGIC", (("and", "and"), ("or", "or"))),
        ),
        variant="LOGIC",
        check="Boolean",
        fails=False,
    ),
    Block(
        type="values_not",
        text="not %A",
        shape="boolean",
        style="values",
        icon="",
        tooltip="So when the other is not.",
        python="not %A",
        arguments=(ValueInput("A", "Boolean"),),
        check="Boolean",
        fails=False,
    ),
    Block(
        type="values_known",
        text="%A is known",
        shape="boolean",
        style="values",
        icon="",
        tooltip="Whether a sensor or a topic has told this value yet.",
        python="is_known(%A)",
        arguments=(ValueInput("A"),),
        check="Boolean",
        fails=False,
    ),
)

_TEXT_BLOCKS = (
    Block(
        type="values_join",
        text="join %A %B",
        shape="value",
        style="values",
        icon="link",
        tooltip="Puts two texts together; numbers become text.",
        python="join(%A, %B)",
        arguments=(ValueInput("A", None, "Hello "), ValueInput("B", None, "Pepper")),
        check="String",
    ),
    Block(
        type="values_length",
        text="length of %TEXT",
        shape="value",
        style="values",
        icon="ruler",
        tooltip="How many characters a text has, or how many things a list.",
        python="length(%TEXT)",
        arguments=(ValueInput("TEXT", None, "Hello"),),
        check="Number",
    ),
)

CATEGORY = Category(
    name="values",
    title="Values",
    style="values",
    icon="hash",
    order=30,
    blocks=(*_PLAIN, *_NUMBER_BLOCKS, *_LOGIC_BLOCKS, *_TEXT_BLOCKS),
)
