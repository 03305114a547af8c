"""Tests of lists of objects as tables: detection, columns, order and export to spreadsheets."""

from __future__ import annotations

import csv

import pytest

from app.core.messages.object_table import (
    MAX_COLUMNS,
    MAX_LISTS,
    MISSING,
    column_name,
    columns_of,
    format_table_csv,
    is_list_of_objects,
    lists_of_objects,
    query_rows,
    rows_of,
    sort_key,
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


def test_lists_of_objects_are_found_at_any_depth_outer_first() -> None:
    assert lists_of_objects(SEEN) == [("doors",), ("seen", "people")]
    assert lists_of_objects(PEOPLE) == [()]
    assert lists_of_objects({str(number): [{"a": 1}] for number in range(100)}) == [
        (str(number),) for number in range(MAX_LISTS)
    ]


@pytest.mark.parametrize("value", [None, 3, "words", b"bytes", [], [1, {}], [{}], {}, [[{"a": 1}]]])
def test_scalars_maps_and_empty_mixed_or_nested_lists_are_not_lists_of_objects(value) -> None:
    assert not is_list_of_objects(value)
    assert lists_of_objects(value) == []
    assert rows_of(value) == [] or value == [1, {}] or value == [{}]


def test_keys_and_nested_keys_become_columns() -> None:
    rows = rows_of(PEOPLE)
    columns = columns_of(rows)
    assert [column_name(column) for column in columns] == ["name", "age", "at.x", "at.y", "note"]
    assert [rows[0].at(column) for column in columns] == ["Ann", 7, 1.5, 2, MISSING]
    assert [rows[2].at(column) for column in columns] == ["=1+1", MISSING, MISSING, MISSING, MISSING]


def test_table_size_is_limited_and_unusual_keys_are_quoted() -> None:
    wide = rows_of([{f"k{number}": number for number in range(1000)}] * 3)
    assert len(columns_of(wide)) == MAX_COLUMNS
    assert len(rows_of([{"a": 1}] * 100_000, 10)) == 10
    numbers = rows_of([{1: "one", "a.b": 2}])
    assert [column_name(column) for column in columns_of(numbers)] == ["1", '["a.b"]']
    assert columns_of([]) == ()


def test_missing_paths_give_missing_value() -> None:
    assert value_at(SEEN, ("seen", "people", 1, "name")) == "Bea"
    for steps in (("seen", "people", 9), ("stamp", 0), ("seen", "people", "x"), ("nothing",), ("seen", 0)):
        assert value_at(SEEN, steps) is MISSING


def test_values_of_mixed_types_are_sortable_and_missing_values_have_no_sort_key() -> None:
    values = ["b", 10**400, 2, True, -(10**400), "A", [1, 2], {}, 1.5]
    ordered = sorted(values, key=sort_key)  # type: ignore[arg-type, return-value]
    assert ordered == [-(10**400), True, 1.5, 2, 10**400, "A", "b", {}, [1, 2]]
    assert [sort_key(value) for value in (None, float("nan"), MISSING)] == [None, None, None]


def test_csv_export_escapes_text_and_formulas() -> None:
    rows = rows_of([*PEOPLE, {"name": 'say "hi", twice', "at": {"x": [1, 2], "y": b"\x01"}}])
    lines = list(csv.reader(format_table_csv("#", columns_of(rows), rows).splitlines()))
    assert lines == [
        ["#", "name", "age", "at.x", "at.y", "note"],
        ["0", "Ann", "7", "1.5", "2", ""],
        ["1", "Bea", "", "-0.5", "0", "late"],
        ["2", "'=1+1", "", "", "", ""],
        ["3", 'say "hi", twice', "", "[1, 2]", "01", ""],
    ]


def test_query_result_with_objects_is_a_table() -> None:
    found = {"a[0]": {"x": 1}, "a[1]": 5, "a[2]": {"x": 2}}
    assert [(row.name, row.at(("x",))) for row in query_rows(found.items())] == [("a[0]", 1), ("a[2]", 2)]
    assert [row.name for row in query_rows([("seen.people", PEOPLE)])] == ["0", "1", "2"]
    assert query_rows([]) == []


def test_lazily_read_large_message_becomes_a_table() -> None:
    large = read(Message("/big", b'{"a": [{"x": 1}, {"x": {"y": 2}}]}' + b" " * LARGE_BYTES, "json", "json"))
    assert lists_of_objects(large.value) == [("a",)]
    rows = rows_of(value_at(large.value, ("a",)))
    assert [column_name(column) for column in columns_of(rows)] == ["x.y"]
    assert rows[1].at(("x", "y")) == 2
