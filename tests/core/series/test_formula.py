from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.series.formula import ExpressionSource, FieldSource, WindowSource, parse
from app.errors import CurveError
from tests.examples import examples

TOPICS = ["/a", "/a/b", "/odom", "/cmd.vel", "ros2 /odom"]


def value(text: str, *numbers: float) -> float:
    source = parse(text, TOPICS)
    assert isinstance(source, ExpressionSource)
    assert len(source.inputs) == len(numbers)
    with np.errstate(all="ignore"):
        return float(np.asarray(source.calculate([np.array([each]) for each in numbers])).ravel()[0])


@pytest.mark.parametrize(
    ("text", "topic", "path"),
    [
        ("/odom.pose.x", "/odom", "pose.x"),
        ("/a/b.c[2]", "/a/b", "c[2]"),
        ("/cmd.vel.linear", "/cmd.vel", "linear"),
        ("ros2 /odom.x", "ros2 /odom", "x"),
        ('/a["b c"].d', "/a", '["b c"].d'),
        ("/a[*].d", "/a", "[*].d"),
        ("  /a.b ", "/a", "b"),
    ],
)
def test_topic_and_field_path_are_parsed_from_text(text, topic, path) -> None:
    found = parse(text, TOPICS)
    assert isinstance(found, FieldSource)
    assert (found.topic, str(found.path)) == (topic, path)
    assert parse(str(found), TOPICS) == found


@pytest.mark.parametrize(
    ("text", "numbers", "result"),
    [
        ("/odom.x + 2 * /odom.y", (3, 4), 11),
        ("/odom.x / /odom.y", (3, 4), 0.75),
        ("/a.x/2", (3,), 1.5),
        ("/a.x/(/a.y)", (3, 2), 1.5),
        ("hypot(/odom.x, /odom.y)", (3, 4), 5),
        ("/a.x^2", (3,), 9),
        ("-/a.x", (3,), -3),
        ("/a.x - /a.x", (3,), 0),
        ("(/a.x + 1) % 2", (4,), 1),
        ("min(/a.x, 1e400) + pi - pi", (3,), 3),
        ("/a.x[0] - /a.x[1]", (3, 1), 2),
        ("deg(/a.x)", (np.pi,), 180),
        ("ros2 /odom.x - /odom.x", (5, 3), 2),
        ("/a.x + 250 ms", (1,), 1.25),
        ("/a.x ^ /a.y ^ 2", (2, 2), 16),
        ("99^999 * /a.x", (1,), np.inf),
    ],
)
def test_expression_is_evaluated(text, numbers, result) -> None:
    assert value(text, *numbers) == pytest.approx(result)


def test_window_functions_can_be_nested() -> None:
    found = parse("mean(derivative(/odom.x) - /odom.v, 2 s)", TOPICS)
    assert isinstance(found, WindowSource)
    assert (found.kind, found.window_s) == ("mean", 2.0)
    assert isinstance(found.source, ExpressionSource)
    assert str(found.source.inputs[0]) == "derivative(/odom.x)"
    assert str(found) == "mean(derivative(/odom.x) - /odom.v, 2 s)"
    assert str(parse(str(found), TOPICS)) == str(found)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/odon.x", "did you mean /odom"),
        ("/nothing.like.it", "topic /nothing"),
        ("/odom", "field"),
        ("hypott(/odom.x, 1)", "did you mean 'hypot'?"),
        ("hypot(/odom.x)", "needs 2 numbers"),
        ("1 + 2", "field"),
        ("mean(/odom.x)", "mean(/odom.speed, 2 s)"),
        ("mean(/odom.x, 0 s)", "at most 600 s"),
        ("mean(/odom.x, 601)", "at most 600 s"),
        ("mean(/odom.x, /odom.y)", "at most 600 s"),
        ("difference(/odom.x, 2)", "difference(/odom.speed)"),
        ("", "enter a field"),
        ("/odom.x +", "isn't a valid formula"),
        ("(" * 300, "isn't a valid formula"),
        ("/odom.x" + "+1" * 150, "too complex"),
        ("/a[*].x + 1", "can't use [*]"),
        ("__import__('os')", "isn't a valid formula"),
        ("_0", "isn't a valid formula"),
        ("().__class__", "can't be"),
        ("[x for x in (1,)]", "can't be evaluated"),
        ("(lambda: 1)()", "doesn't exist"),
        ("/odom.x if 1 else 2", "can't be evaluated"),
        ("/odom.x == 1", "can't be evaluated"),
        ("abs(/odom.x).real", "can't be evaluated"),
        ("f'{1}'", "can't be evaluated"),
        ("'a' * 3", "can't be evaluated"),
        ("True + /odom.x", "can't be evaluated"),
        ("abs(*[/odom.x])", "isn't a valid formula"),
        ("(y := /odom.x)", "isn't a valid formula"),
        ("[_0]", "isn't a valid formula"),
        ("/odom.x[_0] + (y := _0)", "isn't a valid formula"),
        ("1" * 350 + " * /odom.x", "can't be evaluated"),
    ],
)
def test_invalid_formula_is_rejected_with_reason(text, said) -> None:
    with pytest.raises(CurveError) as told:
        parse(text, TOPICS)
    assert said in str(told.value)


@settings(max_examples=examples(60), deadline=None)
@given(st.text(alphabet="/odomax.[]*(),+-^%0123456789 s_'\"=:lambdaimport\n\\", max_size=60))
def test_any_formula_text_is_parsed_or_rejected(text) -> None:
    try:
        source = parse(text, TOPICS)
    except CurveError:
        return
    assert isinstance(source, (FieldSource, WindowSource, ExpressionSource))
    assert str(source)
