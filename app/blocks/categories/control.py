"""Control: waiting, repeating, choosing, stopping."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ChoiceField, StatementInput, ValueInput

_CONDITION = ValueInput("CONDITION", "Boolean")
_BODY = StatementInput("BODY")

CATEGORY = Category(
    name="control",
    title="Control",
    style="control",
    icon="repeat",
    order=20,
    blocks=(
        Block(
            type="control_wait",
            text="wait %SECONDS s",
            shape="statement",
            style="control",
            icon="timer",
            tooltip="Waits that many seconds; the other scripts go on.",
            python="wait(%SECONDS)",
            arguments=(ValueInput("SECONDS", "Number", 2, unit="s"),),
        ),
        Block(
            type="control_wait_until",
            text="wait until %CONDITION",
            shape="statement",
            style="control",
            icon="hourglass",
            tooltip="Waits until this is so; the other scripts go on.",
            python="wait_until(lambda: %CONDITION)",
            arguments=(_CONDITION,),
        ),
        Block(
            type="control_wait_until_at_most",
            text="wait until %CONDITION at most %SECONDS s",
            shape="statement",
            style="control",
            icon="hourglass",
            tooltip="Waits until this is so, but not longer than that many seconds.",
            python="wait_until(lambda: %CONDITION, at_most_s=%SECONDS)",
            arguments=(_CONDITION, ValueInput("SECONDS", "Number", 10, unit="s")),
        ),
        Block(
            type="control_repeat",
            text="repeat %TIMES times %BODY",
            shape="statement",
            style="control",
            icon="repeat",
            tooltip="Runs the blocks inside that many times.",
            python="for _ in repeat(%TIMES):\n    %BODY",
            arguments=(ValueInput("TIMES", "Number", 3), _BODY),
        ),
        Block(
            type="control_forever",
            text="repeat forever %BODY",
            shape="cap",
            style="control",
            icon="infinity",
            tooltip="Runs the blocks inside again and again, until the behaviour is stopped.",
            python="while True:\n    %BODY",
            arguments=(_BODY,),
        ),
        Block(
            type="control_while",
            text="repeat %MODE %CONDITION %BODY",
            shape="statement",
            style="control",
            icon="refresh-cw",
            tooltip="Runs the blocks inside again and again, while this is so or until it is so.",
            python={
                "while": "while %CONDITION:\n    %BODY",
                "until": "while not (%CONDITION):\n    %BODY",
            },
            arguments=(ChoiceField("MODE", (("while", "while"), ("until", "until"))), _CONDITION, _BODY),
            variant="MODE",
        ),
        Block(
            type="control_if",
            text="if %CONDITION %BODY",
            shape="statement",
            style="control",
            icon="split",
            tooltip="Runs the blocks inside only if this is so.",
            python="if %CONDITION:\n    %BODY",
            arguments=(_CONDITION, _BODY),
        ),
        Block(
            type="control_if_else",
            text="if %CONDITION %BODY else %ELSE",
            shape="statement",
            style="control",
            icon="split",
            tooltip="Runs the first blocks if this is so, the others if not.",
            python="if %CONDITION:\n    %BODY\nelse:\n    %ELSE",
            arguments=(_CONDITION, _BODY, StatementInput("ELSE")),
        ),
        Block(
            type="control_stop_script",
            text="stop this script",
            shape="cap",
            style="control",
            icon="corner-down-left",
            tooltip="Ends this script; the others go on. An event starts it again.",
            python="return",
            python_in_function="stop_script()",
        ),
        Block(
            type="control_stop_program",
            text="stop the behaviour",
            shape="cap",
            style="control",
            icon="octagon-x",
            tooltip="Ends all scripts and tells the robots to stop.",
            python="stop_program()",
        ),
    ),
)
