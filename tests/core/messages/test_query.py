"""Tests of JSONPath queries over messages: results, syntax errors and limits on their run time."""

from __future__ import annotations

import pytest

from app.core.messages.query import MAX_LENGTH, FoundPath, JsonQuery, QueryResult
from app.core.messages.reader import LARGE_BYTES, read
from app.errors import QueryError
from nep.messages.message import Message

SEEN = {
    "people": [
        {"name": "Ann", "age": 7, "at": {"x": 1.5}},
        {"name": "Bea", "age": 41, "at": {"x": -0.5}},
        {"name": "Cy", "at": None},
    ],
    "on": True,
    "one": 1,
    "odd key": {"a.b": "dots"},
    "picture": b"\x00\x01" * 1000,
}


def found(text: str, value: object = SEEN) -> dict[str, object]:
    return {str(path): each for path, each in JsonQuery(text).evaluate(value).values.items()}


def test_jsonpath_queries_find_matching_values() -> None:
    assert found("$.people[*].name") == {
        "people[0].name": "Ann",
        "people[1].name": "Bea",
        "people[2].name": "Cy",
    }
    assert found("$.people[?@.age > 18].at.x") == {"people[1].at.x": -0.5}
    assert found("$.people[-1].name") == {"people[2].name": "Cy"}
    assert found("$..x") == {"people[0].at.x": 1.5, "people[1].at.x": -0.5}
    assert found("$['odd key']['a.b']") == {'["odd key"]["a.b"]': "dots"}
    assert found("$.people[?!@.age].at") == {"people[2].at": None}


def test_query_results_are_the_message_values_with_their_paths() -> None:
    answer = JsonQuery("$.people[?@.name=='Bea'].at").evaluate(SEEN)
    (path,) = answer.values
    assert path.steps == ("people", 1, "at")
    assert answer.values[path] is SEEN["people"][1]["at"]  # type: ignore[index]
    assert FoundPath.from_steps(()) == "$"


def test_filter_compares_lists_by_value_and_distinguishes_true_from_one() -> None:
    lists = {"a": [1, {"b": [2]}], "b": [1, {"b": [2]}], "c": [True, {"b": [2]}]}
    assert list(found("$[?@ == $.a]", lists)) == ["a", "b"]
    assert list(found("$[?@ == true]")) == ["on"]


@pytest.mark.parametrize("value", [3, None, "words", '{"a": 1}', "[", b"\x00\x01"])
def test_query_of_scalar_finds_only_the_root(value) -> None:
    assert found("$", value) == {"$": value}
    assert found("$.a", value) == {}
    assert found("$..*", value) == {}


def test_bytes_are_a_single_value_and_numeric_keys_are_supported() -> None:
    assert found("$.picture") == {"picture": SEEN["picture"]}
    assert found("$.picture[*]") == {}
    assert list(found("$..*", {1: {2: "x"}}).values()) == [{2: "x"}, "x"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("$.people[", "the query is incomplete: "),
        ("$.people[?@.age >]", "the query isn't valid from "),
        ("people", "the query isn't valid from people on: "),
        ("", "the query is incomplete: "),
        ("$[?match(@.name, '(a+)+$')]", "the query isn't valid from match(@.name, '(a+)+"),
        ("$[?search(@.name, 'a')]", "the query isn't valid from search("),
        ("$[99999999999999999999999]", "the query isn't valid from 9999"),
        ("$." + "x" * MAX_LENGTH, f"a query can have at most {MAX_LENGTH} characters"),
        ("$[?" + "(" * 400, "the query "),
        ("$\x00", "the query "),
        ("$[?@.x > 1e9999]", "a number in the query is too large"),
        ("$[?@.x == -1e9999]", "a number in the query is too large"),
        ("$.a\x1b[2J b", "the query isn't valid from \\x1b[2J b on: "),
    ],
)
def test_invalid_query_is_rejected_with_explanation(text, sentence) -> None:
    with pytest.raises(QueryError) as told:
        JsonQuery(text)
    assert told.value.sentence.startswith(sentence)
    assert "\n" not in told.value.sentence
    assert "\x1b" not in told.value.sentence


MANY = {"people": [{"name": "Ann", "age": number} for number in range(1000)]}


@pytest.mark.parametrize(
    "text",
    [
        "$..*..*..*..*",
        "$..[?count(@..*) > 1]",
        "$..[?@..[?@..[?@..[?@.x]]]]",
        "$.people[?count($..age) == 3]",
    ],
)
def test_expensive_query_stops_at_step_limit_with_explanation(text) -> None:
    answer = JsonQuery(text).evaluate(MANY, max_steps=5000)
    assert answer.incomplete_reason == (
        "The search stopped after 5000 values. Only the matches found until then are shown."
    )


def test_comparing_long_lists_counts_towards_step_limit() -> None:
    lists = {"a": list(range(4000)), "b": list(range(4000))}
    answer = JsonQuery("$[?$.a == $.b]").evaluate(lists, max_steps=3000)
    assert answer.incomplete_reason.startswith("The search stopped after 3000 values")


def test_number_of_results_and_depth_are_limited() -> None:
    answer = JsonQuery("$..age").evaluate(MANY, max_results=10)
    assert (len(answer.values), answer.incomplete_reason) == (10, "Only the first 10 matches are shown.")
    deep: dict[str, object] = {}
    for _each in range(500):
        deep = {"a": deep}
    answer = JsonQuery("$..*").evaluate(deep)
    assert answer.values
    assert answer.incomplete_reason


def test_query_works_on_lazy_large_message() -> None:
    large = read(Message("/big", b'{"a": [{"x": 1}, {"x": 2}]}' + b" " * LARGE_BYTES, "json", "json"))
    assert found("$.a[?@.x > 1].x", large.value) == {"a[1].x": 2}
    assert JsonQuery("$.a").evaluate(large.value) == QueryResult(
        {FoundPath.from_steps(("a",)): large.value["a"]}
    )  # type: ignore[index]
