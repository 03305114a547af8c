"""Lists of objects as tables: which they are, their columns, their order, and what spreadsheets get."""

from __future__ import annotations

import csv

import pytest

from app.core.messages.object_table import (
    MAX_LISTS,
    MISSING,
    MOST_COLUMNS,
    column_name,
    columns_of,
    is_list_of_objects,
    lists_of_objects,
    rows_found,
    rows_of,
    sort_key,
    table_csv,
    value_at,
)
from app.core.messages.reader import LARGE_BYTES, read
from nep.messages.message import Message

PEOPLE = [
    {"name": "Ann", "age": 7, "at": {"x": 1.5, "y": 2}},
    {"name": "Bea", "age": None, "at": {"x": -0.5, "y": 0}, "note": "late"},
    {"name": "=1+1"},
]
SEEN = {"stamp": 1, "seen": {"people": PEOPLE, "none": [], "numbers": [1, 2]}, "doors": [{"open": True}]}


def test_lists_of_objects_are_found_wherever_they_are_upper_ones_first() -> None:
    assert lists_of_objects(SEEN) == [("doors",), ("seen", "people")]
    assert lists_of_objects(PEOPLE) == [()]
    assert lists_of_objects({str(number): [{"a": 1}] for number in range(100)}) == [
        (str(number),) for number in range(MAX_LISTS)
    ]


@pytest.mark.parametrize("value", [None, 3, "words", b"bytes", [], [1, {}], [{}], {}, [[{"a": 1}]]])
def test_what_is_no_list_of_objects(value) -> None:
    assert not is_list_of_objects(value)
    assert lists_of_objects(value) == []
    assert rows_of(value) == [] or value == [1, {}] or value == [{}]


def test_each_key_is_a_column_and_those_of_small_objects_too() -> None:
    rows = rows_of(PEOPLE)
    columns = columns_of(rows)
    assert [column_name(column) for column in columns] == ["name", "age", "at.x", "at.y", "note"]
    assert [rows[0].at(column) for column in columns] == ["Ann", 7, 1.5, 2, MISSING]
    assert [rows[2].at(column) for column in columns] == ["=1+1", MISSING, MISSING, MISSING, MISSING]


def test_bounds_and_odd_keys() -> None:
    wide = rows_of([{f"k{number}": number for number in range(1000)}] * 3)
    assert len(columns_of(wide)) == MOST_COLUMNS
    assert len(rows_of([{"a": 1}] * 100_000, 10)) == 10
    numbers = rows_of([{1: "one", "a.b": 2}])
    assert [column_name(column) for column in columns_of(numbers)] == ["1", '["a.b"]']
    assert columns_of([]) == ()


def test_values_at_places_that_are_not_there_are_missing() -> None:
    assert value_at(SEEN, ("seen", "people", 1, "name")) == "Bea"
    for steps in (("seen", "people", 9), ("stamp", 0), ("seen", "people", "x"), ("nothing",), ("seen", 0)):
        assert value_at(SEEN, steps) is MISSING


def test_values_of_all_kinds_have_an_order_and_those_that_are_none_have_no_place() -> None:
    values = ["b", 10**400, 2, True, -(10**400), "A", [1, 2], {}, 1.5]
    ordered = sorted(values, key=sort_key)  # type: ignore[arg-type, return-value]
    assert ordered == [-(10**400), True, 1.5, 2, 10**400, "A", "b", {}, [1, 2]]
    assert [sort_key(value) for value in (None, float("nan"), MISSING)] == [None, None, None]


def test_as_csv_text_is_text_and_a_formula_is_none() -> None:
    rows = rows_of([*PEOPLE, {"name": 'say "hi", twice', "at": {"x": [1, 2], "y": b"\x01"}}])
    lines = list(csv.reader(table_csv("#", columns_of(rows), rows).splitlines()))
    assert lines == [
        ["#", "name", "age", "at.x", "at.y", "note"],
        ["0", "Ann", "7", "1.5", "2", ""],
        ["1", "Bea", "", "-0.5", "0", "late"],
        ["2", "'=1+1", "", "", "", ""],
        ["3", 'say "hi", twice', "", "[1, 2]", "01", ""],
    ]


def test_what_a_query_found_is_a_table_when_objects_are_among_it() -> None:
    found = {"a[0]": {"x": 1}, "a[1]": 5, "a[2]": {"x": 2}}
    assert [(row.name, row.at(("x",))) for row in rows_found(found.items())] == [("a[0]", 1), ("a[2]", 2)]
    assert [row.name for row in rows_found([("seen.people", PEOPLE)])] == ["0", "1", "2"]
    assert rows_found([]) == []


def test_a_large_message_is_a_table_without_being_decoded() -> None:
    large = read(Message("/big", b'{"a": [{"x": 1}, {"x": {"y": 2}}]}' + b" " * LARGE_BYTES, "json", "json"))
    assert lists_of_objects(large.value) == [("a",)]
    rows = rows_of(value_at(large.value, ("a",)))
    assert [column_name(column) for column in columns_of(rows)] == ["x.y"]
    assert rows[1].at(("x", "y")) == 2
