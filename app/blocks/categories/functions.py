"""Functions: blocks of one's own, with a name and inputs."""

from __future__ import annotations

from app.blocks.block import Block
from app.blocks.category import Category
from app.blocks.fields import StatementInput, TextField, ValueInput
from app.blocks.growing import InputField, Inputs

_NAME = TextField("NAME", "my function")
_INPUTS = Inputs("INPUTS")
_BODY = StatementInput("BODY")

CATEGORY = Category(
    name="functions",
    title="Functions",
    style="functions",
    icon="square-function",
    order=50,
    dynamic="functions",
    blocks=(
        Block(
            type="functions_define",
            text="to %NAME %INPUTS %BODY",
            shape="definition",
            style="functions",
            icon="square-function",
            tooltip="Makes a block of your own: its name, its inputs, and what it does.",
            help="Its block is in this category then. The buttons add an input and take the last one away; "
            "rename function and inputs by clicking on their names: the blocks that use it follow. "
            "A function may use itself, up to 200 times deep.",
            python="",
            arguments=(_NAME, _INPUTS, _BODY),
            mutator="function",
            words=("define", "procedure", "method", "own", "block", "make"),
        ),
        Block(
            type="functions_define_result",
            text="to %NAME %INPUTS %BODY give back %RESULT",
            shape="definition",
            style="functions",
            icon="square-function",
            tooltip="Makes a value block of your own, which works out a result.",
            help="For example “double” with the input “number” gives back number × 2.",  # noqa: RUF001
            python="",
            arguments=(TextField("NAME", "my result"), _INPUTS, _BODY, ValueInput("RESULT")),
            mutator="function",
            words=("define", "return", "procedure", "own", "block", "make"),
        ),
        Block(
            type="functions_return_if",
            text="if %CONDITION give back %VALUE",
            shape="statement",
            style="functions",
            icon="corner-down-left",
            tooltip="Ends the function with this result if this is so.",
            help="Only inside a function that gives back a result.",
            python="if %CONDITION:\n    return %VALUE",
            arguments=(ValueInput("CONDITION", "Boolean"), ValueInput("VALUE")),
            needs_function="result",
            words=("return",),
        ),
        Block(
            type="functions_leave_if",
            text="if %CONDITION leave the function",
            shape="statement",
            style="functions",
            icon="corner-down-left",
            tooltip="Ends the function if this is so; the script goes on where it was used.",
            help="Only inside a function without a result.",
            python="if %CONDITION:\n    return",
            arguments=(ValueInput("CONDITION", "Boolean"),),
            needs_function="plain",
            words=("return", "exit", "end"),
        ),
        Block(
            type="functions_call",
            text="%INPUTS",
            shape="statement",
            style="functions",
            icon="square-function",
            tooltip="Runs your function.",
            python="",
            arguments=(_INPUTS,),
            mutator="call",
            in_toolbox=False,
        ),
        Block(
            type="functions_result",
            text="%INPUTS",
            shape="value",
            style="functions",
            icon="square-function",
            tooltip="Runs your function and is what it gives back.",
            python="",
            arguments=(_INPUTS,),
            mutator="call",
            in_toolbox=False,
        ),
        Block(
            type="functions_input",
            text="%INPUT",
            shape="value",
            style="functions",
            icon="",
            tooltip="What was put into this gap of the function.",
            python="%INPUT",
            arguments=(InputField("INPUT"),),
            fails=False,
            in_toolbox=False,
        ),
    ),
)
