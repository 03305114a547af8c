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
            tooltip="Creates your own block: its name, its inputs and what it does.",
            help="The new block appears in this category. The buttons add an input and remove the last "
            "one. To rename the function or an input, click its name; the blocks that use it are updated. "
            "A function can call itself, up to 200 levels deep.",
            example="For example: to greet with “name”: say join “Hello ” and “name”.",
            python="",
            arguments=(_NAME, _INPUTS, _BODY),
            mutator="function",
            search_words="function, define, procedure, method, own block, my block, block, make, create, "
            "subroutine",
        ),
        _definition(
            "functions_define_result",
            "to %NAME %INPUTS %BODY return %RESULT",
            icon="square-function",
            tooltip="Creates your own value block, which calculates a result.",
            help="For example, “double” with the input “number” returns number × 2.",  # noqa: RUF001
            example="For example: to double with “number”: return number × 2.",  # noqa: RUF001
            python="",
            arguments=(TextField("NAME", "my result"), _INPUTS, _BODY, ValueInput("RESULT")),
            mutator="function",
            search_words="function, define, return, procedure, own block, my block, block, make, result, "
            "calculate",
        ),
        _statement(
            "functions_return_if",
            "if %CONDITION return %VALUE",
            icon="corner-down-left",
            tooltip="Ends the function with this result if the condition is true.",
            help="Works only inside a function that returns a result.",
            example="For example: if number is below 2, return 1.",
            python="if %CONDITION:\n    return %VALUE",
            arguments=(ValueInput("CONDITION", "Boolean"), ValueInput("VALUE")),
            needs_function="result",
            search_words="return, result, exit",
        ),
        _statement(
            "functions_leave_if",
            "if %CONDITION leave the function",
            icon="corner-down-left",
            tooltip="Ends the function if the condition is true; the script continues after the block "
            "that called it.",
            help="Works only inside a function without a result.",
            example="For example: if “greeted” is true, leave the function.",
            python="if %CONDITION:\n    return",
            arguments=(ValueInput("CONDITION", "Boolean"),),
            needs_function="plain",
            search_words="return, exit, end, break, quit",
        ),
        _statement(
            "functions_call",
            "%INPUTS",
            icon="square-function",
            tooltip="Runs your function.",
            example="For example: greet “Ada”.",
            python="",
            arguments=(_INPUTS,),
            mutator="call",
            is_in_toolbox=False,
            search_words="call, run, do, use, procedure, own block",
        ),
        _value(
            "functions_result",
            "%INPUTS",
            icon="square-function",
            tooltip="Runs your function and returns its result.",
            example="For example: say double 21.",
            python="",
            arguments=(_INPUTS,),
            mutator="call",
            is_in_toolbox=False,
            search_words="call, run, use, result, procedure, own block",
        ),
        _value(
            "functions_input",
            "%INPUT",
            icon="",
            tooltip="The value of this input of the function.",
            example="For example: say “name” inside the function “greet”.",
            python="%INPUT",
            arguments=(InputField("INPUT"),),
            can_fail=False,
            is_in_toolbox=False,
            search_words="input, parameter, argument, value",
        ),
    ),
)
