"""Tests of the list blocks and their error messages."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.pure import lists
from app.blocks.runtime.values import MAX_TEXT_LENGTH
from tests.blocks.fakes import play
from tests.blocks.samples import block, get, list_of, number, started, text, workspace, write
from tests.examples import examples

FRUITS = list_of(text("apple"), text("pear"), text("fig"))


def test_list_operations_index_items_from_1() -> None:
    fruits = lists.new_list("apple", "pear", "fig")
    assert [lists.item(fruits, where) for where in (1, 2.0, "first", "last")] == [
        "apple", "pear", "apple", "fig",
    ]  # fmt: skip
    assert lists.item(fruits, "random") in fruits
    lists.set_item(fruits, 2, "plum")
    lists.insert_item(fruits, "first", 0)
    lists.insert_item(fruits, 5, "end")
    lists.insert_item(fruits, "last", "very end")
    lists.add_item(fruits, True)
    assert fruits == [0, "apple", "plum", "fig", "end", "very end", True]
    assert lists.remove_item(fruits, "last") is True
    assert lists.remove_item(fruits, 1) == 0
    assert lists.position(fruits, "fig") == 3
    assert lists.position(fruits, "none") == 0
    assert lists.contains(fruits, "plum")
    assert lists.contains("plum tree", "tree")
    assert not lists.contains([1], True)


@pytest.mark.parametrize(
    ("act", "sentence"),
    [
        (lambda: lists.item([1, 2, 3], 5), "The list has only 3 items; it has no item 5."),
        (lambda: lists.item([1], 0), "The list has only 1 item; it has no item 0."),
        (lambda: lists.item([], "first"), "The list is empty."),
        (lambda: lists.remove_item([], "random"), "The list is empty."),
        (lambda: lists.item([1, 2], 1.5), "“item number” needs a whole number, not 1.5."),
        (lambda: lists.item([1, 2], "two"), "“item number” needs a number, not a text."),
        (lambda: lists.item("abc", 1), "This block needs a list, not a text."),
        (
            lambda: lists.add_item(0, 1),
            "This block needs a list, not a number. Set the variable to an empty list first.",
        ),
        (lambda: lists.item(None, 1), "This list has no value yet."),
        (
            lambda: lists.add_item((1, 2), 3),
            "This list can't be changed. Set a variable to a copy of it and change the copy.",
        ),
        (
            lambda: lists.add_item([0] * lists.MAX_ITEMS, 1),
            "The list is full: it can have at most 10000 items.",
        ),
        (lambda: lists.split_text("a" * 20_000, ""), "The list is full: it can have at most 10000 items."),
        (
            lambda: lists.join_items(["a" * MAX_TEXT_LENGTH], "b"),
            "This text is too long. Use at most 1000000 characters.",
        ),
    ],
)  # fmt: skip
def test_invalid_list_operation_is_explained(act, sentence) -> None:
    with pytest.raises(BehaviourError) as caught:
        act()
    assert caught.value.sentence == sentence


def test_list_is_copied_when_added_to_itself_and_list_size_is_limited() -> None:
    mine: list[object] = []
    lists.add_item(mine, mine)
    lists.add_item(mine, mine)
    assert mine == [[], [[]]]

    def double_for_ever(mine: list[object]) -> None:
        while True:
            mine = lists.new_list(mine, mine)

    def grow_for_ever(mine: list[object]) -> None:
        while True:
            lists.add_item(mine, mine)

    for act in (double_for_ever, grow_for_ever):
        with pytest.raises(BehaviourError, match="full"):
            act(mine)


@settings(max_examples=examples(300), deadline=None)
@given(st.lists(st.text(max_size=4)), st.text(min_size=1, max_size=2))
def test_joining_the_split_parts_restores_the_text(items, between) -> None:
    whole = lists.join_items(items, between)
    assert between.join(map(str, lists.split_text(whole, between))) == whole


operations = st.lists(
    st.tuples(st.sampled_from(["add", "insert", "set", "remove"]), st.integers(-1, 6), st.integers())
)


@settings(max_examples=examples(500), deadline=None)
@given(operations)
def test_list_changes_match_reference_implementation(steps) -> None:
    """The reference uses indices from 0 and raises no errors."""
    mine: list[object] = []
    reference: list[object] = []
    for what, place, value in steps:
        sound = 1 <= place <= len(reference) + (what == "insert")
        try:
            if what == "add":
                lists.add_item(mine, value)
            elif what == "insert":
                lists.insert_item(mine, place, value)
            elif what == "set":
                lists.set_item(mine, place, value)
            else:
                lists.remove_item(mine, place)
        except BehaviourError:
            assert not sound
            assert what != "add"
            continue
        if what == "add":
            reference.append(value)
        elif what == "insert":
            reference[place - 1 : place - 1] = [value]
        elif what == "set":
            reference[place - 1] = value
        else:
            del reference[place - 1]
        assert mine == reference


def test_behaviour_with_lists_runs() -> None:
    fruits = {"id": "fruits"}
    run = play(
        workspace(
            started(
                block("variables_set", VAR=fruits, VALUE=FRUITS),
                block("lists_add", VALUE=text("kiwi"), LIST=get("fruits")),
                block("lists_remove", WHERE="first", LIST=get("fruits")),
                block(
                    "lists_each", VAR={"id": "fruit"}, LIST=get("fruits"),
                    BODY=[
                        write(get("fruit")),
                        write(block("lists_take", WHERE="last", LIST=get("fruits"))),
                    ],
                ),
                write(block("lists_length", LIST=get("fruits"))),
                write(block("lists_join", LIST=list_of(number(1), number(2)), BETWEEN=text(" and "))),
            ),
            variables=("fruits", "fruit"),
        )
    )  # fmt: skip
    assert run.runtime.error is None
    assert run.lines == ["pear", "kiwi", "fig", "fig", "kiwi", "pear", "0", "1 and 2"]
    assert "for fruit in each(fruits):" in run.program.source
    assert "new_list('apple', 'pear', 'fig')" in run.program.source


def test_error_in_list_names_its_block() -> None:
    gone = block("lists_get", "it", WHERE="number", NUMBER=number(5), LIST=FRUITS)
    run = play(workspace(started(write(gone))))
    assert run.runtime.error is not None
    assert run.runtime.error.block == "it"
    assert run.runtime.error.sentence == "The list has only 3 items; it has no item 5."


def test_hidden_item_number_slot_of_list_block_is_not_required() -> None:
    first = block("lists_get", WHERE="first", LIST=FRUITS)
    run = play(workspace(started(write(first))))
    assert run.lines == ["apple"]
    readings = set(run.program.readings.values())
    assert "first item of list of “apple” “pear” “fig”" in readings


def test_empty_slot_of_new_list_is_reported() -> None:
    run = play(workspace(started(write(list_of() | {"extraState": {"items": 2}}))))
    assert run.program.problems[0].message == "list of needs a value. Drag one into its slot."


def test_nested_list_is_deep_copied_when_added() -> None:
    inner: list[object] = [1]
    outer = lists.new_list([inner])
    lists.add_item(outer, [[inner]])
    inner.append(2)
    assert outer == [[[1]], [[[1]]]]


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("sum_of", ([],), 0),
        ("sum_of", ([1, 2.5, -3],), 0.5),
        ("sum_of", ([2**64 - 1, 1],), 2**64),
        ("sum_of", (["a"],), "“sum” needs a number, not a text."),
        ("sum_of", ([math.nan],), "“sum” needs a finite number."),
        ("sum_of", ([[1]],), "“sum” needs a number, not a list."),
        ("sum_of", (0,), "This block needs a list, not a number. Set the variable to an empty list first."),
        ("average_of", ([1, 2],), 1.5),
        ("average_of", ([],), "The list is empty."),
        ("smallest_of", ([3, -1, 2],), -1),
        ("largest_of", ([3, -1, 2],), 3),
        ("largest_of", ([],), "The list is empty."),
        ("middle_of", ([9, 1, 5],), 5),
        ("middle_of", ([1, 2],), 1.5),
        ("sorted_up", (["b", 10, "A", 2, True],), [2, 10, "A", "b", True]),
        ("sorted_down", ([1, 3, 2],), [3, 2, 1]),
        ("sorted_up", ([math.inf, 1, -math.inf],), [-math.inf, 1, math.inf]),
        ("sorted_up", ([],), []),
        ("turned_round", (["a", "👍"],), ["👍", "a"]),
        ("copy_of", ([[1], 2],), [[1], 2]),
        ("copy_of", (None,), "This list has no value yet."),
        ("part_of_list", ([1, 2, 3], 2, 99), [2, 3]),
        ("part_of_list", ([1, 2, 3], -1, 2), [1, 2]),
        ("part_of_list", ([1, 2, 3], 3, 1), []),
        ("part_of_list", ([1, 2, 3], "a", 1), "“items” needs a number, not a text."),
        ("is_empty_list", ([],), True),
        ("is_empty_list", ([0],), False),
        ("is_empty_list", ("",), "This block needs a list, not a text."),
    ],
)
def test_list_calculations_return_expected_results(name, given, expected):
    try:
        result = getattr(lists, name)(*given)
    except BehaviourError as error:
        result = error.sentence
    assert (type(result), result) == (type(expected), expected)


def test_copied_list_is_independent():
    inner: list[object] = [1]
    items: list[object] = [inner]
    copied = lists.copy_of(items)
    lists.clear_list(items)
    inner.append(2)
    assert (items, copied) == ([], [[1]])


def test_shuffled_list_has_same_items_in_another_order():
    items: list[object] = [*range(100)]
    mixed = lists.shuffled(items)
    assert mixed != items
    assert sorted(mixed, key=str) == sorted(items, key=str)
