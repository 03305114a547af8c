from __future__ import annotations

import ast
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.model.template import expression, holes, literal, statements

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


@given(PLAIN)
def test_a_literal_is_its_value_and_nothing_else(value):
    tree = literal(value)
    ast.fix_missing_locations(ast.Expression(tree))
    assert ast.literal_eval(ast.unparse(tree)) == value


def test_a_negative_literal_keeps_its_sign_under_a_power():
    tree = expression("%A ** %B", {"A": literal(-1), "B": literal(2)})
    assert eval(ast.unparse(tree)) == 1


@pytest.mark.parametrize("value", [math.nan, math.inf, object(), b"bytes"])
def test_what_is_no_plain_value_is_refused(value):
    with pytest.raises(ValueError, match=r"program"):
        literal(value)


def test_holes_are_filled_with_trees_not_with_text():
    made = statements(
        "f(%A, **%REST)", {"A": literal("%B'); boom('")}, None, {"REST": [ast.keyword("x", literal(1))]}
    )
    text = ast.unparse(ast.fix_missing_locations(ast.Module(made, [])))
    assert ast.dump(ast.parse(text)) == ast.dump(ast.parse("f(\"%B'); boom('\", x=1)"))


def test_statements_stand_in_a_hole_of_their_own_and_nothing_becomes_pass():
    inner = statements("a()\nb()", {})
    text = ast.unparse(
        ast.Module(statements("while %A:\n    %BODY", {"A": literal(True)}, {"BODY": inner}), [])
    )
    assert text == "while True:\n    a()\n    b()"
    empty = ast.unparse(
        ast.Module(statements("while %A:\n    %BODY", {"A": literal(True)}, {"BODY": []}), [])
    )
    assert empty == "while True:\n    pass"


def test_a_variable_is_read_and_set_by_the_same_hole():
    made = statements("%X = %X", {"X": ast.Name("count", ast.Load())})
    exec(compile(ast.fix_missing_locations(ast.Module(made, [])), "", "exec"), {"count": 1})


def test_a_hole_that_got_nothing_is_named():
    with pytest.raises(KeyError, match="NOTHING"):
        expression("f(%NOTHING)", {})
    assert holes("f(%A, **%B_2)") == {"A", "B_2"}
