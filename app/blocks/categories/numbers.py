"""Category Numbers and logic: arithmetic and mathematical functions. For logic, see `logic`."""

from __future__ import annotations

from functools import partial

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ChoiceField, NumberField, ValueInput

_number = partial(Block, shape="value", style="values", check="Number")
_boolean = partial(Block, shape="boolean", style="values", check="Boolean")

_OPERANDS = (ValueInput("A", "Number", 1), ValueInput("B", "Number", 1))

_ARITHMETIC = {
    "+": "%A + %B",
    "-": "%A - %B",
    "*": "%A * %B",
    "/": "%A / %B",
    "%": "%A % %B",
    "**": "%A ** %B",
}
_OPERATORS = (
    ("+", "+"),
    ("−", "-"),  # noqa: RUF001 (the sign that people read)
    ("×", "*"),  # noqa: RUF001 (the sign that people read)
    ("÷", "/"),
    ("remainder of ÷", "%"),
    ("to the power of", "**"),
)

_FUNCTIONS = (
    ("square root", "sqrt", "square_root(%NUMBER)"),
    ("absolute value", "abs", "absolute(%NUMBER)"),
    ("sign", "sign", "sign(%NUMBER)"),
    ("sin", "sin", "sine(%NUMBER)"),
    ("cos", "cos", "cosine(%NUMBER)"),
    ("tan", "tan", "tangent(%NUMBER)"),
    ("asin", "asin", "arc_sine(%NUMBER)"),
    ("acos", "acos", "arc_cosine(%NUMBER)"),
    ("atan", "atan", "arc_tangent(%NUMBER)"),
    ("ln", "ln", "natural_logarithm(%NUMBER)"),
    ("log", "log", "logarithm(%NUMBER)"),
    ("e to the power", "e^", "e_to_the(%NUMBER)"),
    ("10 to the power", "10^", "ten_to_the(%NUMBER)"),
)

_BASIC_BLOCKS = (
    Block(
        type="values_number",
        text="%NUMBER",
        shape="value",
        style="values",
        icon="",
        tooltip="A number.",
        example="For example: 2, 0.5 or −10.",  # noqa: RUF001
        python="%NUMBER",
        arguments=(NumberField("NUMBER", 0),),
        check="Number",
        can_fail=False,
        search_words="digit, figure, integer, decimal, value, amount",
    ),
    Block(
        type="values_arithmetic",
        text="%A %SIGN %B",
        shape="value",
        style="values",
        icon="",
        tooltip="Calculates with two numbers.",
        example="For example: set “steps” to steps + 1.",
        python=_ARITHMETIC,
        arguments=(*_OPERANDS, ChoiceField("SIGN", _OPERATORS)),
        variant="SIGN",
        check="Number",
        search_words="calculate, sum!, add!, plus!, addition, subtract, minus, difference, multiply, times, "
        "product, divide, division, math, maths, "
        "mathematics, formula, remainder, modulo, power, operator, +, -, "
        "*, /, %, ^",
    ),
    Block(
        type="values_random",
        text="random number from %LOW to %HIGH",
        shape="value",
        style="values",
        icon="dices",
        tooltip="A random number; a whole number if both limits are whole.",
        example="For example: turn by a random number from 10 to 90.",
        python="random_number(%LOW, %HIGH)",
        arguments=(ValueInput("LOW", "Number", 1), ValueInput("HIGH", "Number", 6)),
        check="Number",
        search_words="dice, die, chance, luck, lottery, coin, pick, surprise, draw lots",
    ),
    Block(
        type="values_round",
        text="%HOW %NUMBER",
        shape="value",
        style="values",
        icon="",
        tooltip="Rounds to a whole number; “round” rounds halves up.",
        example="For example: round 2.5 gives 3, round down 2.5 gives 2.",
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
        search_words="round!, round up, round down, whole, integer, ceiling, floor, nearest, decimals",
    ),
)

_FURTHER_BLOCKS = (
    _number(
        "numbers_function",
        "%FUNCTION of %NUMBER",
        icon="square-radical",
        tooltip="Calculates a mathematical function of a number.",
        help="sin, cos and tan take an angle in degrees; asin, acos and atan return an angle in degrees. "
        "“log” is the base-10 logarithm, “ln” the natural logarithm. The absolute value of −5 is 5; "  # noqa: RUF001
        "the sign is 1, 0 or −1.",  # noqa: RUF001
        example="For example: square root of 9 gives 3, sin of 90 gives 1.",
        python={value: python for _words, value, python in _FUNCTIONS},
        arguments=(
            ChoiceField("FUNCTION", tuple((words, value) for words, value, _python in _FUNCTIONS)),
            ValueInput("NUMBER", "Number", 9),
        ),
        variant="FUNCTION",
        search_words="square root, sqrt, root, absolute, abs, sine, cosine, tangent, logarithm, exponent, "
        "angle, "
        "math, trigonometry",
    ),
    _number(
        "numbers_round_to",
        "round %NUMBER to %PLACES decimal places",
        icon="decimals-arrow-left",
        tooltip="Rounds to a number of decimal places; halves are rounded up.",
        help="With 0 places, the result is a whole number; with −1, it is rounded to tens.",  # noqa: RUF001
        example="For example: round 3.14159 to 2 decimal places gives 3.14.",
        python="rounded_to(%NUMBER, %PLACES)",
        arguments=(ValueInput("NUMBER", "Number", 3.14159), ValueInput("PLACES", "Number", 2)),
        search_words="digits, decimals, precision, places",
    ),
    _number(
        "numbers_of_two",
        "%WHICH of %A and %B",
        icon="scale",
        tooltip="The smaller or the larger of two numbers.",
        example="For example: set “points” to larger of “points” and 0, so that it is never negative.",
        python={"smaller": "smaller(%A, %B)", "larger": "larger(%A, %B)"},
        arguments=(
            ChoiceField("WHICH", (("smaller", "smaller"), ("larger", "larger"))),
            ValueInput("A", "Number", 1),
            ValueInput("B", "Number", 2),
        ),
        variant="WHICH",
        search_words="min, max, minimum, maximum, least, most, bigger, highest, lowest",
    ),
    _number(
        "numbers_limit",
        "limit %NUMBER to between %LOW and %HIGH",
        icon="between-vertical-start",
        tooltip="Keeps a number between two limits, both included.",
        help="Useful for a speed or an angle: the number that the robot receives is never outside its "
        "limits.",
        example="For example: limit 120 to between 0 and 100 gives 100.",
        python="limited(%NUMBER, %LOW, %HIGH)",
        arguments=(
            ValueInput("NUMBER", "Number", 120),
            ValueInput("LOW", "Number", 0),
            ValueInput("HIGH", "Number", 100),
        ),
        search_words="constrain, clamp, range, minimum, maximum, at least, at most, restrict",
    ),
    _number(
        "numbers_map",
        "map %NUMBER from %LOW – %HIGH to %NEW_LOW – %NEW_HIGH",  # noqa: RUF001 (from … to …)
        icon="scaling",
        tooltip="Scales a number from one range to another.",
        help="A number outside the first range is also outside the second; use “limit” to prevent that.",
        example="For example: map 50 from 0 – 100 to 0 – 1 gives 0.5.",  # noqa: RUF001
        python="mapped(%NUMBER, %LOW, %HIGH, %NEW_LOW, %NEW_HIGH)",
        arguments=(
            ValueInput("NUMBER", "Number", 50),
            ValueInput("LOW", "Number", 0),
            ValueInput("HIGH", "Number", 100),
            ValueInput("NEW_LOW", "Number", 0),
            ValueInput("NEW_HIGH", "Number", 1),
        ),
        search_words="scale, convert, range, proportion, rescale",
    ),
    _number(
        "numbers_constant",
        "%CONSTANT",
        icon="pi",
        tooltip="A mathematical constant.",
        help="π is the circumference of a circle divided by its diameter.",
        example="For example: the circumference of a wheel is its diameter × π.",  # noqa: RUF001
        python={"pi": "3.141592653589793", "e": "2.718281828459045", "golden": "1.618033988749895"},
        arguments=(
            ChoiceField("CONSTANT", (("π (3.1416)", "pi"), ("e (2.7183)", "e"), ("φ (1.618)", "golden"))),
        ),
        variant="CONSTANT",
        can_fail=False,
        search_words="pi, circle, constant, golden, ratio, e",
    ),
    _boolean(
        "numbers_is",
        "%NUMBER is %KIND",
        icon="binary",
        tooltip="Checks if a number is even, odd, whole, positive or negative.",
        help="0 is even, and neither positive nor negative.",
        example="For example: if “round is even”, turn left; else turn right.",
        python={
            "even": "is_even(%NUMBER)",
            "odd": "is_odd(%NUMBER)",
            "whole": "is_whole(%NUMBER)",
            "positive": "is_positive(%NUMBER)",
            "negative": "is_negative(%NUMBER)",
        },
        arguments=(
            ValueInput("NUMBER", "Number", 4),
            ChoiceField(
                "KIND",
                (
                    ("even", "even"),
                    ("odd", "odd"),
                    ("whole", "whole"),
                    ("positive", "positive"),
                    ("negative", "negative"),
                ),
            ),
        ),
        variant="KIND",
        search_words="even, odd, whole, positive, negative, integer, sign, check",
    ),
    _boolean(
        "numbers_divisible",
        "%NUMBER is divisible by %BY",
        icon="divide",
        tooltip="True if the division leaves no remainder.",
        example="For example: if “points is divisible by 10”, play a sound.",
        python="is_divisible(%NUMBER, %BY)",
        arguments=(ValueInput("NUMBER", "Number", 12), ValueInput("BY", "Number", 3)),
        search_words="multiple, remainder, modulo, divided",
    ),
)

CATEGORY = Category(
    name="numbers",
    title="Numbers and logic",
    style="values",
    icon="hash",
    order=30,
    blocks=(*_BASIC_BLOCKS, *_FURTHER_BLOCKS),
    headings={"values_number": "Calculate", "numbers_is": "Questions about numbers"},
)
