"""Property tests of compiled expressions.

Random expressions are compiled and run. Their results are compared with a reference evaluator that
generates no Python source.
"""

from __future__ import annotations

import math
import operator

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.runtime import Runtime
from app.blocks.runtime.values import grapheme_clusters
from app.blocks.runtime.values import text as as_text
from tests.blocks.samples import block, boolean, list_of, number, started, text, workspace, write
from tests.examples import examples

ARITHMETIC = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "%": operator.mod,
    "**": operator.pow,
}  # fmt: skip
COMPARE = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt,
    ">=": operator.ge,
}  # fmt: skip

CHOSEN = {
    "arithmetic": ("values_arithmetic", "SIGN"),
    "compare": ("values_compare", "RELATION"),
    "logic": ("values_logic", "LOGIC"),
}

numbers_plain = st.integers(-9, 9) | st.floats(-20, 20, width=16)
booleans_plain = st.booleans()
texts_plain = st.text(max_size=6)


class NoResultError(Exception):
    """Error of an expression for which the reference has no result."""


def arithmetic(inner):
    return st.tuples(st.just("arithmetic"), st.sampled_from(sorted(ARITHMETIC)), inner, inner)


def rounding(inner):
    return st.tuples(st.just("round"), st.sampled_from(["round", "up", "down"]), inner, st.none())


number_trees = st.recursive(numbers_plain, lambda inner: arithmetic(inner) | rounding(inner), max_leaves=8)
comparisons = st.tuples(st.just("compare"), st.sampled_from(sorted(COMPARE)), number_trees, number_trees)


def logic(inner):
    both = st.tuples(st.just("logic"), st.sampled_from(["and", "or"]), inner, inner)
    return both | st.tuples(st.just("not"), st.none(), inner, st.none())


boolean_trees = st.recursive(booleans_plain | comparisons, logic, max_leaves=6)
joins = st.tuples(st.just("join"), st.none(), texts_plain | number_trees, texts_plain | boolean_trees)
lengths = st.tuples(st.just("length"), st.none(), texts_plain | joins, st.none())
rows = st.tuples(st.just("list"), st.none(), number_trees | texts_plain, boolean_trees | joins)
items = st.tuples(st.just("item"), st.sampled_from(["first", "last", "number"]), rows, st.integers(-1, 3))
inside = st.tuples(st.just("contains"), st.none(), rows, numbers_plain | texts_plain | booleans_plain)
trees = number_trees | boolean_trees | joins | lengths | rows | items | inside


def reference(tree):
    """Evaluate an expression tree without compiling it."""
    if not isinstance(tree, tuple):
        # A field holds 2.0 as 2, as Blockly saves it.
        return int(tree) if isinstance(tree, float) and tree.is_integer() else tree
    kind, how, first, second = tree
    if kind == "logic":
        left = reference(first)
        return (left and reference(second)) if how == "and" else (left or reference(second))
    if kind == "not":
        return not reference(first)
    if kind == "join":
        return as_text(reference(first)) + as_text(reference(second))
    if kind == "length":
        told = reference(first)
        return len(grapheme_clusters(told) if isinstance(told, str) else told)
    if kind in ("list", "item", "contains"):
        return of_list(kind, how, first, second)
    left = reference(first)
    if kind == "round":
        return rounded(how, left)
    right = reference(second)
    table = ARITHMETIC if kind == "arithmetic" else COMPARE
    try:
        result = table[how](left, right)
    except (ZeroDivisionError, OverflowError) as error:
        raise NoResultError from error
    if isinstance(result, complex):
        raise NoResultError
    return result


def of_list(kind, how, first, second):
    if kind == "list":
        return [reference(first), reference(second)]
    both = reference(first)
    if kind == "contains":
        wanted = reference(second)
        return any(each == wanted and isinstance(each, bool) is isinstance(wanted, bool) for each in both)
    if how == "number" and second not in (1, 2):
        raise NoResultError
    return both[{"first": 0, "last": 1}.get(how, second - 1)]


def rounded(how, value):
    if not math.isfinite(value):
        raise NoResultError
    return {"round": lambda x: math.floor(x + 0.5), "up": math.ceil, "down": math.floor}[how](value)


def blocks(tree):
    """Convert an expression tree to blocks."""
    if isinstance(tree, bool):
        return boolean(tree)
    if isinstance(tree, str):
        return text(tree)
    if not isinstance(tree, tuple):
        return number(tree)
    kind, how, first, second = tree
    if kind in CHOSEN:
        named, field = CHOSEN[kind]
        return block(named, A=blocks(first), B=blocks(second), **{field: how})
    if kind == "not":
        return block("values_not", A=blocks(first))
    if kind == "round":
        return block("values_round", HOW=how, NUMBER=blocks(first))
    if kind == "length":
        return block("values_length", TEXT=blocks(first))
    if kind in ("list", "item", "contains"):
        return list_blocks(kind, how, first, second)
    return block("values_join", A=blocks(first), B=blocks(second))


def list_blocks(kind, how, first, second):
    if kind == "list":
        return list_of(blocks(first), blocks(second))
    if kind == "item":
        return block("lists_get", WHERE=how, NUMBER=number(second), LIST=blocks(first))
    return block("lists_contains", LIST=blocks(first), VALUE=blocks(second))


def small(tree):
    """Return whether no power has two compound operands, whose result could take too long to compute."""
    if not isinstance(tree, tuple):
        return True
    if tree[1] == "**" and isinstance(tree[2], tuple) and isinstance(tree[3], tuple):
        return False
    return all(small(part) for part in tree[2:])


@pytest.mark.timeout(180)  # a thousand programs; a busy computer may need more than a minute
@settings(
    max_examples=examples(1000),
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
@given(trees.filter(small))
def test_compiled_expression_matches_reference_result(tree):
    program = compile_behaviour(workspace(started(write(blocks(tree)))), [])
    assert not program.problems
    written: list[object] = []
    scripts: list = []
    names = Runtime(lambda line: None, labels=program.labels).namespace()
    names |= {"step": lambda id: None, "write": written.append, "on_start": scripts.append}
    exec(compile(program.runnable, "", "exec"), names)
    try:
        expected = reference(tree)
    except NoResultError:
        with pytest.raises(BehaviourError) as caught:
            scripts[0]()
        assert caught.value.block is not None
        return
    scripts[0]()
    assert written == [expected] or (math.isnan(written[0]) and math.isnan(expected))
    assert type(written[0]) is type(expected)


def test_number_with_thousands_of_digits_is_converted_to_text() -> None:
    assert as_text(2**16384) == "1.1897314953572318e+4932"
    assert as_text(-(2**13999)).startswith("-")
    assert len(as_text(2**13999)) == 4215


def test_list_with_number_of_thousands_of_digits_is_converted_to_text() -> None:
    assert as_text([1, 2**16384, "a"]) == '[1, "1.1897314953572318e+4932", "a"]'
    assert as_text({"big": (2**16384,), 2**16384: 1}) == (
        '{"big": ["1.1897314953572318e+4932"], "1.1897314953572318e+4932": 1}'
    )


def test_self_containing_list_is_converted_to_text() -> None:
    items: list[object] = [1]
    items.append(items)
    assert as_text(items) == '[1, "…"]'
    assert as_text([[1], [1]]) == "[[1], [1]]"
