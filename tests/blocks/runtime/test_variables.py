"""Tests of reporting a program's variables: short summaries of all values, and only of changed ones."""

from __future__ import annotations

import json
import threading

import msgspec
import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.program import Program, Variable
from app.blocks.runtime.variables import (
    MAX_ITEMS,
    MAX_TEXT_LENGTH,
    MAX_TOTAL_CHARACTERS,
    VariableValue,
    VariableWatch,
    display_value,
)
from tests.blocks.samples import block, get, number, started, workspace, write


@pytest.mark.parametrize(
    ("value", "kind", "text"),
    [
        (0, "number", "0"),
        (-1, "number", "-1"),
        (2.0, "number", "2"),
        (2**64 - 1, "number", "18446744073709551615"),
        pytest.param(10**100_000, "number", "a number with about 100000 digits", id="long"),
        (float("nan"), "number", "nan"),
        (float("-inf"), "number", "-inf"),
        (True, "boolean", "yes"),
        ("", "text", ""),
        ("two\nlines", "text", "two lines"),
        ("🤖" * 3, "text", "🤖🤖🤖"),
        (None, "unknown", "unknown"),
        ([], "list", "[]"),
        ([1, "two", None, [True]], "list", "[1, two, , [yes]]"),
        ({"x": 1, "y": [2]}, "other", "{x: 1, y: [2]}"),
    ],
)
def test_values_are_formatted_as_short_summaries(value: object, kind: str, text: str) -> None:
    told = display_value("v", value)
    assert (told.kind, told.text) == (kind, text)
    assert msgspec.json.decode(msgspec.json.encode(told), type=VariableValue) == told


def test_summary_of_large_value_reads_only_the_displayed_part() -> None:
    class Counted(dict[str, object]):
        asked = 0

        def items(self):  # type: ignore[no-untyped-def]
            for pair in super().items():
                Counted.asked += 1
                yield pair

    message = Counted({str(each): each for each in range(100_000)})
    assert len(display_value("v", message).text) == MAX_TEXT_LENGTH
    assert Counted.asked < MAX_TEXT_LENGTH
    assert len(display_value("v", "x" * 10**6).text) == MAX_TEXT_LENGTH


def test_self_containing_and_deeply_nested_lists_are_truncated() -> None:
    itself: list[object] = [1]
    itself.append(itself)
    assert display_value("v", itself).text.startswith("[1, [1, [1,")
    deep: list[object] = []
    for _ in range(50_000):
        deep = [deep]
    assert "…" in display_value("v", deep).text


def test_long_list_reports_first_items_and_length() -> None:
    told = display_value("v", list(range(5000)))
    assert (len(told.items), told.length, told.items[-1]) == (MAX_ITEMS, 5000, "99")


def watch(**names: object) -> tuple[VariableWatch, dict[str, object]]:
    return VariableWatch(names, [Variable(f"id {name}", name, name) for name in names]), names


def test_only_changed_variables_are_reported() -> None:
    watched, names = watch(score=0, words=["a"], inner=[[1]], unused=None)
    assert [each.id for each in watched.changes()] == ["id score", "id words", "id inner", "id unused"]
    assert watched.changes() == []
    names["score"] = 1
    names["words"].append("b")  # type: ignore[attr-defined]
    assert [(each.id, each.text) for each in watched.changes()] == [("id score", "1"), ("id words", "[a, b]")]
    names["words"][0] = "c"  # type: ignore[index]
    names["inner"][0].append(2)  # type: ignore[index]
    assert [(each.id, each.text) for each in watched.changes()] == [
        ("id words", "[c, b]"),
        ("id inner", "[[1, 2]]"),
    ]
    names["score"] = 1.0  # the displayed text is unchanged
    assert watched.changes() == []


def test_large_changes_are_reported_in_parts_without_loss() -> None:
    many = {f"v{each}": ["x" * 80] * 100 for each in range(60)}
    watched, _names = watch(**many)
    first, rest = watched.changes(), list[VariableValue]()
    while more := watched.changes():
        rest += more
    assert 0 < len(first) < 60
    assert sum(len("".join(each.items)) for each in first) < 2 * MAX_TOTAL_CHARACTERS
    assert {each.id for each in (*first, *rest)} == {f"id v{each}" for each in range(60)}


def test_list_and_map_modified_during_read_do_not_raise() -> None:
    watched, names = watch(table={"0": 0}, row=[0])
    over = threading.Event()

    def change() -> None:
        for each in range(200_000):
            names["table"] = {**dict(list(names["table"].items())[-5:]), str(each): each}  # type: ignore[attr-defined]
            names["row"].append(each)  # type: ignore[attr-defined]
            if over.is_set():
                return
        over.set()

    thread = threading.Thread(target=change)
    thread.start()
    while not over.is_set():
        watched.changes()
        if len(names["row"]) > 20_000:  # type: ignore[arg-type]
            over.set()
    thread.join()


def test_user_can_set_only_program_variables() -> None:
    watched, names = watch(score=0)
    names["wait"] = wait = object()
    watched.set_value("score", "ten")
    watched.set_value("wait", 1)
    assert names["score"] == "ten"
    assert names["wait"] is wait


@pytest.mark.parametrize(
    "wrong",
    [
        {"id": 5},
        {"kind": "dance"},
        {"items": "x"},
        {"items": ["x"] * (MAX_ITEMS + 1)},
        {"length": "y"},
        {"text": "z" * (MAX_TEXT_LENGTH + 1)},
    ],
)
def test_invalid_variable_data_is_rejected(wrong: dict[str, object]) -> None:
    valid: dict[str, object] = {"id": "v", "kind": "text", "text": "z", "items": [], "length": 0}
    assert msgspec.convert(valid, VariableValue) == VariableValue("v", "text", "z")
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(valid | wrong, VariableValue)


def test_program_lists_all_behaviour_variables_including_unused() -> None:
    saved = workspace(
        started(block("variables_set", VAR={"id": "score"}, VALUE=number(3)), write(get("score"))),
        variables=("score", "unused"),
    )
    program = compile_behaviour(saved, [])
    assert program.variables == (Variable("score", "score", "score"), Variable("unused", "unused", ""))
    assert Program.from_json(json.loads(json.dumps(program.to_json()))).variables == program.variables
