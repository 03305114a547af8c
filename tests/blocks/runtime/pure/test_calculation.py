from __future__ import annotations

import math

import pytest

from app.blocks.runtime.errors import BehaviourError, explain
from app.blocks.runtime.pure import calculation
from tests.blocks.fakes import play
from tests.blocks.samples import block, number, started, text, workspace, write

LARGE = 2**64 - 1


def worked_out(name: str, *values: object) -> object:
    """Return the function's result, or the error message that is shown on its block."""
    try:
        return getattr(calculation, name)(*values)
    except (BehaviourError, ArithmeticError) as error:
        return explain(error, name, None).sentence


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("square_root", (9,), 3),
        ("square_root", (0,), 0),
        ("square_root", (LARGE,), 2**32),
        ("square_root", (-1,), "“square root” has no result for -1."),
        ("absolute", (-5,), 5),
        ("absolute", (-LARGE,), LARGE),
        ("sign", (-0.5,), -1),
        ("sign", (0,), 0),
        ("sign", (LARGE,), 1),
        ("sine", (30,), 0.5),
        ("sine", (-180,), 0),
        ("cosine", (60,), 0.5),
        ("cosine", (360 * 10**12,), 1),
        ("tangent", (45,), 1),
        ("tangent", (-90,), "“tan” has no result for -90."),
        ("tangent", (270,), "“tan” has no result for 270."),
        ("arc_sine", (1,), 90),
        ("arc_sine", (2,), "“asin” has no result for 2."),
        ("arc_cosine", (-1,), 180),
        ("arc_tangent", (1,), 45),
        ("natural_logarithm", (1,), 0),
        ("natural_logarithm", (0,), "“ln” has no result for 0."),
        ("logarithm", (1000,), 3),
        ("logarithm", (-1,), "“log” has no result for -1."),
        ("e_to_the", (0,), 1),
        ("e_to_the", (1000,), "The result of “e_to_the” is too large."),
        ("ten_to_the", (3,), 1000),
        ("ten_to_the", (-2,), 0.01),
        ("ten_to_the", (LARGE,), "The result of “ten_to_the” is too large."),
        ("rounded_to", (3.14159, 2), 3.14),
        ("rounded_to", (1.005, 2), 1.01),
        ("rounded_to", (2.5, 0), 3),
        ("rounded_to", (-2.5, 0), -2),  # halves are rounded up, as by “round”
        ("rounded_to", (1234, -2), 1200),
        ("rounded_to", (LARGE, 2), LARGE),
        ("rounded_to", (1e-300, 400), 0),
        ("smaller", (2, -LARGE), -LARGE),
        ("larger", (2, -LARGE), 2),
        ("limited", (120, 0, 100), 100),
        ("limited", (-1, 100, 0), 0),  # limits in reverse order
        ("limited", (50, 0, 100), 50),
        ("mapped", (50, 0, 100, 0, 1), 0.5),
        ("mapped", (0, 0, 1023, 4, 0), 4),
        ("mapped", (1, 5, 5, 0, 1), "The first range of “map” needs two different numbers."),
        ("is_even", (0,), True),
        ("is_even", (LARGE,), False),
        ("is_even", (2.5,), False),
        ("is_odd", (LARGE,), True),
        ("is_odd", (-3,), True),
        ("is_odd", (2.5,), False),
        ("is_whole", (2.0,), True),
        ("is_whole", (2.5,), False),
        ("is_positive", (0,), False),
        ("is_negative", (0,), False),
        ("is_negative", (-0.1,), True),
        ("is_divisible", (12, 3), True),
        ("is_divisible", (0.3, 0.1), True),
        ("is_divisible", (LARGE, 2), False),
        ("is_divisible", (1, 0), "“is_divisible” can't divide by 0."),
    ],
)
def test_calculations_return_expected_results(name, values, expected):
    assert worked_out(name, *values) == expected


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, None, "", "two", [1], {"a": 1}])
def test_non_number_is_rejected_with_explanation(wrong):
    functions = [name for name in calculation.__all__ if name != "counting"]
    wide = {"mapped": 5, "limited": 3}
    two = ("smaller", "larger", "is_divisible", "rounded_to")
    for name in functions:
        count = wide.get(name, 2 if name in two else 1)
        with pytest.raises(BehaviourError, match=r"needs a|isn't known yet"):
            getattr(calculation, name)(*[wrong] * count)
    with pytest.raises(BehaviourError, match=r"“count” (needs a|can't run)"):
        calculation.counting(wrong, wrong, wrong)


@pytest.mark.parametrize(
    ("first", "last", "step", "expected"),
    [
        (1, 3, 1, [1, 2, 3]),
        (1, 10, 4, [1, 5, 9]),
        (3, 1, 1, [3, 2, 1]),
        (3, 1, -1, [3, 2, 1]),
        (1, 3, -1, [1, 2, 3]),
        (0, 0.3, 0.1, [0, 0.1, 0.2, 0.3]),
        (5, 5, 1, [5]),
        (0, 1, 5, [0]),
        (LARGE, LARGE + 2, 2, [LARGE, LARGE + 2]),
    ],
)
def test_counting_range_includes_both_ends(first, last, step, expected):
    assert list(calculation.counting(first, last, step)) == expected


def test_counting_with_step_zero_is_rejected():
    with pytest.raises(BehaviourError, match="“count” needs a step other than 0"):
        calculation.counting(1, 3, 0)


def test_number_blocks_run_and_error_names_its_block():
    root = block("numbers_function", "root", FUNCTION="sqrt", NUMBER=number(-4))
    count = block(
        "control_count", VAR={"id": "n"}, FIRST=number(3), LAST=number(1), STEP=number(1),
        BODY=[write(block("variables_get", VAR={"id": "n"}))],
    )  # fmt: skip
    run = play(workspace(started(count, write(root)), variables=("n",)))
    assert run.lines == ["3", "2", "1"]
    assert run.runtime.error is not None
    assert (run.runtime.error.block, run.runtime.error.sentence) == (
        "root",
        "“square root” has no result for -4.",
    )


def test_every_option_of_number_text_and_date_blocks_runs():
    from app.blocks.toolbox.catalogue import Catalogue

    known = Catalogue([]).blocks
    for kind, field in (
        ("numbers_function", "FUNCTION"),
        ("numbers_of_two", "WHICH"),
        ("numbers_is", "KIND"),
        ("texts_change", "CHANGE"),
        ("texts_contains", "HOW"),
        ("sensing_now", "PART"),
    ):
        gaps = {
            "NUMBER": number(0.5),
            "A": number(1),
            "B": number(2),
            "TEXT": text("Ada"),
            "PIECE": text("a"),
        }
        wanted = {name: gap for name, gap in gaps.items() if known[kind].argument(name)}
        for _words, value in known[kind].argument(field).options:
            run = play(workspace(started(write(block(kind, **wanted, **{field: value})))))
            assert (run.runtime.error, len(run.lines)) == (None, 1)
