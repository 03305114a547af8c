from __future__ import annotations

import ast
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.model.template import expression, literal, placeholders, statements

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


@given(PLAIN)
def test_literal_evaluates_to_its_value(value):
    tree = literal(value)
    ast.fix_missing_locations(ast.Expression(tree))
    assert ast.literal_eval(ast.unparse(tree)) == value


def test_negative_literal_keeps_its_sign_under_a_power():
    tree = expression("%A ** %B", {"A": literal(-1), "B": literal(2)})
    assert eval(ast.unparse(tree)) == 1


@pytest.mark.parametrize("value", [math.nan, math.inf, object(), b"bytes"])
def test_literal_of_unsupported_value_is_rejected(value):
    with pytest.raises(ValueError, match=r"can't be part of a program|is not a finite number"):
        literal(value)


def test_placeholders_are_replaced_by_syntax_trees():
    made = statements(
        "f(%A, **%REST)", {"A": literal("%B'); boom('")}, None, {"REST": [ast.keyword("x", literal(1))]}
    )
    text = ast.unparse(ast.fix_missing_locations(ast.Module(made, [])))
    assert ast.dump(ast.parse(text)) == ast.dump(ast.parse("f(\"%B'); boom('\", x=1)"))


def test_statement_placeholder_is_replaced_by_body_or_pass():
    inner = statements("a()\nb()", {})
    text = ast.unparse(
        ast.Module(statements("while %A:\n    %BODY", {"A": literal(True)}, {"BODY": inner}), [])
    )
    assert text == "while True:\n    a()\n    b()"
    empty = ast.unparse(
        ast.Module(statements("while %A:\n    %BODY", {"A": literal(True)}, {"BODY": []}), [])
    )
    assert empty == "while True:\n    pass"


def test_variable_placeholder_is_used_for_reading_and_setting():
    made = statements("%X = %X", {"X": ast.Name("count", ast.Load())})
    exec(compile(ast.fix_missing_locations(ast.Module(made, [])), "", "exec"), {"count": 1})


def test_missing_placeholder_value_is_named():
    with pytest.raises(KeyError, match="NOTHING"):
        expression("f(%NOTHING)", {})
    assert placeholders("f(%A, **%B_2)") == {"A", "B_2"}
