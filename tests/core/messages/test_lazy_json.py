"""Tests of reading parts of large JSON lazily; the values must equal those of full decoding."""

from __future__ import annotations

import json
from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.messages import lazy_json
from app.core.messages.lazy_json import JsonIndex, LazyList, LazyObject, UnreadableValue
from tests.examples import examples

TEXTS = st.text(alphabet=st.sampled_from('ab"\\{}[],: \n\u00e9\u20ac'), max_size=12)
NUMBERS = st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXTS,
    lambda inside: (
        st.lists(inside, max_size=5) | st.dictionaries(st.text('k"\\{,:', max_size=4), inside, max_size=5)
    ),
    max_leaves=25,
)


def whole(value: object) -> object:
    """Return a lazy value completely decoded."""
    if isinstance(value, Mapping):
        return {key: whole(value[key]) for key in value}
    if isinstance(value, LazyList):
        return [whole(each) for each in value]
    return value


def index(text: str) -> JsonIndex:
    return JsonIndex(memoryview(text.encode()))


@settings(max_examples=examples(150), deadline=None)
@given(VALUES, st.sampled_from([None, 1]), st.sampled_from([7, 64, 1 << 20]))
def test_lazy_json_equals_full_decoding(value: object, indent: int | None, chunk: int) -> None:
    text = json.dumps([value], indent=indent, ensure_ascii=False)
    before = lazy_json.CHUNK_BYTES
    lazy_json.CHUNK_BYTES = chunk  # texts and escapes cross the chunk boundaries
    try:
        found = index(text).root
    finally:
        lazy_json.CHUNK_BYTES = before
    assert whole(found) == json.loads(text)


def test_containers_know_their_size_without_decoding_values() -> None:
    root = index('{"a": [1, oops, 3], "b": {}, "c": [ ], "d": {"e": "}"}}').root
    assert isinstance(root, LazyObject)
    assert list(root) == ["a", "b", "c", "d"]
    assert [len(root[key]) for key in root] == [3, 0, 0, 1]  # type: ignore[arg-type]
    a = root["a"]
    assert isinstance(a, LazyList)
    assert (a[0], a[2], a[-1]) == (1, 3, 3)
    assert a[0:1] == [1]
    with pytest.raises(IndexError):
        a[3]


def test_invalid_value_is_marked_and_other_values_are_readable() -> None:
    root = index('{"good": 1, "bad": oops, "none" , "last": 2}').root
    assert isinstance(root, LazyObject)
    assert (root["good"], root["last"]) == (1, 2)
    assert str(root["bad"]) == "invalid JSON: oops"
    assert isinstance(root["none"], UnreadableValue)


@pytest.mark.parametrize("broken", ["[1, 2", "]", "][", '["a]', "", "{]]", "[" * 1001 + "]" * 1001])
def test_mismatched_brackets_raise(broken: str) -> None:
    with pytest.raises(ValueError, match=r"unbalanced|nested|unterminated"):
        index(broken)


def test_text_offset_maps_to_path_of_its_value() -> None:
    text = '{"people": [{"name": "Aiko"}, {"name": "Jo\\"e", "age": 7}], "n": 12}'
    found = index(text)
    assert found.path_to(text.index("Aiko")) == ("people", 0, "name")
    assert found.path_to(text.index("Jo")) == ("people", 1, "name")
    assert found.path_to(text.index("12")) == ("n",)
    assert found.path_to(0) == ()


def test_lazy_values_with_equal_text_are_equal() -> None:
    one, two = index('[{"a": 1}, {"a": 1}, {"a": 2}, [1]]').root, index('[{"a": 1}]').root
    assert isinstance(one, LazyList)
    assert isinstance(two, LazyList)
    assert one[0] == one[1] == two[0]
    assert one[0] != one[2]
    assert one[0] != one[3]
    assert one != two
    assert len({one[0], two[0]}) == 1


def test_last_duplicate_key_wins() -> None:
    root = index('{"a": 1, "a": 2}').root
    assert isinstance(root, LazyObject)
    assert (dict(root), len(root)) == ({"a": 2}, 1)
