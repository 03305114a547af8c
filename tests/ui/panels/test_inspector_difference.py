"""Tests of the difference between two messages and of its display in the tree."""

from __future__ import annotations

import json
import math

import pytest
from PySide6.QtCore import QModelIndex

from app.core.messages.inspected import NO_BASE
from app.core.messages.lazy_json import JsonIndex
from app.ui.panels.watch.inspector.diff import MISSING, child_diffs, differs, mark_of
from app.ui.panels.watch.inspector.tree_model import TreeModel, TreeNode


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [
        (1, 1, False), (1, 1.0, True), (1, True, True), (math.nan, math.nan, False), (None, 0, True),
        ([1], [1], False), ([1], [True], True), ({"a": [0]}, {"a": [False]}, True), ({}, [], True),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}, False), ([math.nan], [math.nan], False),
        ([math.nan], [None], True), ({1: None, "a": 2}, {1: None, "a": 2}, False),
        ({"a": b"x"}, {"a": b"x"}, False), ({"a": b"x"}, {"a": b"y"}, True), ("a", "a", False),
    ],
)  # fmt: skip
def test_differences_follow_json_semantics(before: object, after: object, wanted: bool) -> None:
    assert differs(before, after) is wanted


def test_lazy_json_objects_are_compared_by_content() -> None:
    def lazy(value: object) -> object:
        return JsonIndex(memoryview(json.dumps(value).encode())).root

    assert not differs(lazy({"a": [1]}), lazy({"a": [1]}))
    assert differs(lazy({"a": [1]}), lazy({"a": [2]}))


def test_missing_value_differs_from_null() -> None:
    assert mark_of(None, MISSING) == "added"
    assert mark_of(MISSING, None) == "removed"
    assert mark_of(None, None) == ""
    assert mark_of(None, NO_BASE) == ""


def test_changed_children_are_marked_and_removed_children_are_listed_last() -> None:
    before, after = {"x": 1, "gone": 2, "same": 3}, {"x": 5, "same": 3, "new": {"deep": 1}}
    parts, total = child_diffs(after, before, "changed", 9, changes_only=False)
    assert total == 4
    assert [(key, value, mark) for key, value, _base, mark in parts] == [
        ("x", 5, "changed"), ("same", 3, ""), ("new", {"deep": 1}, "added"), ("gone", 2, "removed"),
    ]  # fmt: skip
    only, total = child_diffs(after, before, "changed", 2, changes_only=True)
    assert total == 3
    assert [part[0] for part in only] == ["x", "new"]
    below, _total = child_diffs({"deep": 1}, MISSING, "added", 9, changes_only=True)
    assert [(part[0], part[3]) for part in below] == [("deep", "added")]


def test_lists_are_compared_by_index() -> None:
    parts, total = child_diffs([1, 9], [1, 2, 3], "changed", 9, changes_only=False)
    assert total == 3
    assert [(key, value, mark) for key, value, _base, mark in parts] == [
        (0, 1, ""), (1, 9, "changed"), (2, 3, "removed"),
    ]  # fmt: skip


def shown(model: TreeModel, above: QModelIndex | None = None) -> list[tuple[object, str]]:
    parent = above if above is not None else QModelIndex()
    found: list[tuple[object, str]] = []
    for row in range(model.rowCount(parent)):
        index = model.index(row, 0, parent)
        node = model.node(index)
        found.append((node.path, node.mark))
        if model.canFetchMore(index) and node.children is None:
            model.fetchMore(index)
        found += shown(model, index)
    return found


BEFORE = {"pose": {"x": 1, "y": 2}, "words": ["a", "b"], "old": {"k": 1}, "same": {"q": [1]}}
AFTER = {"pose": {"x": 1, "y": 3}, "words": ["a"], "same": {"q": [1]}, "new": 4}


def test_tree_marks_differences_from_another_message(qtmodeltester) -> None:
    model = TreeModel()
    model.set_value(AFTER, 0.0, BEFORE)
    qtmodeltester.check(model)
    assert shown(model) == [
        ("pose", "changed"), ("pose.x", ""), ("pose.y", "changed"),
        ("words", "changed"), ("words[0]", ""), ("words[1]", "removed"),
        ("same", ""), ("same.q", ""), ("same.q[0]", ""),
        ("new", "added"), ("old", "removed"), ("old.k", "removed"),
    ]  # fmt: skip


def test_changes_only_hides_equal_items_and_switching_back_shows_all(qtmodeltester) -> None:
    model = TreeModel()
    model.set_value(AFTER, 0.0)
    shown(model)  # fetches all items
    model.set_value(AFTER, 1.0, BEFORE, changes_only=True)
    assert shown(model) == [
        ("pose", "changed"), ("pose.y", "changed"), ("words", "changed"), ("words[1]", "removed"),
        ("new", "added"), ("old", "removed"), ("old.k", "removed"),
    ]  # fmt: skip
    model.set_value(AFTER, 2.0)
    assert {mark for _path, mark in shown(model)} == {""}
    assert model.rowCount() == 4
    qtmodeltester.check(model)


def test_changes_only_view_is_empty_without_differences() -> None:
    model = TreeModel()
    model.set_value(AFTER, 0.0)
    model.set_value(AFTER, 1.0, dict(AFTER), changes_only=True)
    assert model.rowCount() == 0


def test_scalar_messages_are_compared() -> None:
    model = TreeModel()
    model.set_value(5, 0.0, 4)
    node = model.node(model.index(0, 0))
    assert isinstance(node, TreeNode)
    assert (node.key, node.value, node.base, node.mark) == ("value", 5, 4, "changed")


def test_expanded_items_are_kept_during_comparison() -> None:
    model = TreeModel()
    model.set_value(AFTER, 0.0, BEFORE)
    pose = model.index(0, 0)
    model.fetchMore(pose)
    first = model.node(pose)
    for x in range(5):
        model.set_value({**AFTER, "pose": {"x": x, "y": 3}}, float(x), AFTER)
    assert model.node(model.index(0, 0)) is first
    assert [child.key for child in first.children or ()] == ["x", "y"]


def test_only_requested_items_of_a_long_list_are_compared() -> None:
    class Watched(list[object]):
        asked = 0

        def __getitem__(self, row: object) -> object:
            Watched.asked += 1
            return super().__getitem__(row)  # type: ignore[index]

    model = TreeModel()
    model.set_value({"rows": list(range(100_000))}, 0.0, {"rows": Watched(range(1, 100_001))})
    rows = model.index(0, 0)
    before = Watched.asked
    model.fetchMore(rows)
    assert model.rowCount(rows) == 500
    assert Watched.asked - before == 500
    assert model.index_of_path(("rows", 700)).isValid()
    assert model.rowCount(rows) == 701
    assert not model.index_of_path(("rows", 100_000)).isValid()
