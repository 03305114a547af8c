"""Category Functions: user-defined blocks with a name and inputs."""

from __future__ import annotations

from functools import partial

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import StatementInput, TextField, ValueInput
from app.blocks.model.mutators import InputField, Inputs

_definition = partial(Block, shape="definition", style="functions")
_statement = partial(Block, shape="statement", style="functions")
_value = partial(Block, shape="value", style="functions")

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
        _definition(
            "functions_define",
            "to %NAME %INPUTS %BODY",
            icon="square-function",
            tooltip="Makes a block of your own: its name, its inputs, and what it does.",
            help="Its block is in this category then. The buttons add an input and take the last one away; "
            "rename function and inputs by clicking on their names: the blocks that use it follow. "
            "A function may use itself, up to 200 times deep.",
            python="",
            arguments=(_NAME, _INPUTS, _BODY),
            mutator="function",
            words="function, define, procedure, method, own block, my block, block, make, create, subroutine",
        ),
        _definition(
            "functions_define_result",
            "to %NAME %INPUTS %BODY give back %RESULT",
            icon="square-function",
            tooltip="Makes a value block of your own, which works out a result.",
            help="For example “double” with the input “number” gives back number × 2.",  # noqa: RUF001
            python="",
            arguments=(TextField("NAME", "my result"), _INPUTS, _BODY, ValueInput("RESULT")),
            mutator="function",
            words="function, define, return, procedure, own block, my block, block, make, result, calculate",
        ),
        _statement(
            "functions_return_if",
            "if %CONDITION give back %VALUE",
            icon="corner-down-left",
            tooltip="Ends the function with this result if this is so.",
            help="Only inside a function that gives back a result.",
            python="if %CONDITION:\n    return %VALUE",
            arguments=(ValueInput("CONDITION", "Boolean"), ValueInput("VALUE")),
            needs_function="result",
            words="return, result, exit",
        ),
        _statement(
            "functions_leave_if",
            "if %CONDITION leave the function",
            icon="corner-down-left",
            tooltip="Ends the function if this is so; the script goes on where it was used.",
            help="Only inside a function without a result.",
            python="if %CONDITION:\n    return",
            arguments=(ValueInput("CONDITION", "Boolean"),),
            needs_function="plain",
            words="return, exit, end, break, quit",
        ),
        _statement(
            "functions_call",
            "%INPUTS",
            icon="square-function",
            tooltip="Runs your function.",
            python="",
            arguments=(_INPUTS,),
            mutator="call",
            in_toolbox=False,
            words="call, run, do, use, procedure, own block",
        ),
        _value(
            "functions_result",
            "%INPUTS",
            icon="square-function",
            tooltip="Runs your function and is what it gives back.",
            python="",
            arguments=(_INPUTS,),
            mutator="call",
            in_toolbox=False,
            words="call, run, use, result, procedure, own block",
        ),
        _value(
            "functions_input",
            "%INPUT",
            icon="",
            tooltip="What was put into this gap of the function.",
            python="%INPUT",
            arguments=(InputField("INPUT"),),
            fails=False,
            in_toolbox=False,
            words="input, parameter, argument, value",
        ),
    ),
)
