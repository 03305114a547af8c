from __future__ import annotations

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.series.field_path import (
    ALL,
    MISSING,
    FieldPath,
    complete,
    fields_of,
    kind_of_value,
    nearest_field,
)
from app.core.series.formula import ExpressionSource, FieldSource, parse
from app.errors import CurveError

MESSAGE = {
    "pose": {"x": [1.0, 2.0, 3.5], "first name": "Ada", "a.b": 4},
    "joints": [{"position": 1, "name": "hip"}, {"position": 2}, {"name": "knee"}],
    "ok": True,
    "nothing": None,
    "large": 2**64 - 1,
}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("pose.x[2]", 3.5),
        ("pose.x[-1]", 3.5),
        ("pose.x[3]", MISSING),
        ('pose["first name"]', "Ada"),
        ('pose["a.b"]', 4),
        ("joints[0].position", 1),
        ("joints[2].position", MISSING),
        ("ok", True),
        ("nothing", None),
        ("nothing.more", MISSING),
        ("large", 2**64 - 1),
        ("pose[0]", MISSING),
        ("joints.position", MISSING),
    ],
)
def test_field_path_returns_its_value_or_missing(text, value) -> None:
    path = FieldPath.parse(text)
    assert path.value_in(MESSAGE) == value
    assert str(path) == text


@pytest.mark.parametrize(
    "text", ["", ".", "a..b", "a.", "a[", "a[x]", "a]b", "a b", "a[0]b", 'a["b]', "a" * 500, "[[0]]"]
)
def test_invalid_field_path_is_rejected(text) -> None:
    with pytest.raises(CurveError):
        FieldPath.parse(text)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.one_of(st.text(min_size=1, max_size=12), st.integers(0, 10**8), st.just(ALL)),
        min_size=1,
        max_size=8,
    )
)
def test_field_path_text_round_trips(steps) -> None:
    path = FieldPath(tuple(steps))
    assert FieldPath.parse(str(path)) == path


values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5)),
    lambda below: st.one_of(
        st.lists(below, max_size=5), st.dictionaries(st.text(min_size=1, max_size=5), below, max_size=5)
    ),
    max_leaves=30,
)


@settings(max_examples=40, deadline=None)
@given(values)
def test_every_suggested_field_is_found_at_its_path(payload) -> None:
    for found in fields_of(payload):
        assert len(str(found.path)) > 0
        for one in found.path.expand(payload):
            value = one.value_in(payload)
            assert kind_of_value(value) in {"number", "state"}
        assert len(found.path.expand(payload)) == min(found.count, 65)


def test_wildcard_expands_to_every_list_element() -> None:
    assert [str(p) for p in FieldPath.parse("pose.x[*]").expand(MESSAGE)] == [
        f"pose.x[{n}]" for n in range(3)
    ]
    assert len(FieldPath.parse("joints[*].position").expand(MESSAGE)) == 3
    assert FieldPath.parse("ok[*]").expand(MESSAGE) == []
    assert len(FieldPath.parse("a[*][*]").expand({"a": [[1] * 100] * 100})) == 65, "one more than fit"


@pytest.mark.parametrize(
    "key", ["head-yaw", "a+b", "1/2", "50%", "x^2", "f(x)", "a,b", "*", "x y", "a.b", ""]
)
def test_key_that_looks_like_an_expression_can_be_typed_as_suggested(key) -> None:
    (found,) = fields_of({key: 3})
    typed = str(FieldSource("/head", found.path))
    assert parse(typed, ["/head"]) == FieldSource("/head", FieldPath((key,)))
    doubled = parse(f"{typed} * 2", ["/head"])
    assert isinstance(doubled, ExpressionSource)
    assert doubled.inputs == (FieldSource("/head", FieldPath((key,))),)


def test_non_text_keys_are_not_suggested() -> None:
    assert list(fields_of({1: 2, b"x": 3, None: 4})) == []


def test_fields_of_a_message_are_suggested_with_their_kind() -> None:
    offered = {str(each.path): each.kind for each in fields_of(MESSAGE)}
    assert offered["pose.x[*]"] == "list"
    assert offered["joints[0].position"] == "number"
    assert offered["ok"] == "state"
    assert "nothing" not in offered
    assert [str(each.path) for each in fields_of(3.5)] == ["value"]
    assert FieldPath.parse("value").value_in(3.5) == 3.5
    assert FieldPath.parse("value").value_in({"value": 4}) == 4


def test_number_and_depth_of_suggested_fields_are_limited() -> None:
    wide = {f"k{n}": n for n in range(100_000)}
    assert len(list(fields_of(wide))) == 2000
    deep: object = 1
    for _ in range(500):
        deep = {"a": deep}
    assert list(fields_of(deep)) == []


def test_tab_completes_the_common_prefix() -> None:
    known = ["/odom.pose.x", "/odom.pose.y", "/odometer.km"]
    assert complete("/o", known) == "/odom"
    assert complete("/odom.", known) == "/odom.pose."
    assert complete("/odom.pose.x", known) == "/odom.pose.x"
    assert complete("/x", known) == "/x"
    assert complete("/odome", known) == "/odometer."


def test_similar_field_is_suggested() -> None:
    assert nearest_field(FieldPath.parse("pose.y[0]"), MESSAGE) is not None
    assert nearest_field(FieldPath.parse("okk"), MESSAGE) == "ok"
    assert nearest_field(FieldPath.parse("zzzzzz"), json.loads("{}")) is None
