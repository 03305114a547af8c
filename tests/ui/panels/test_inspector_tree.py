from __future__ import annotations

import pytest
from PySide6.QtCore import QModelIndex, QPoint, Qt
from PySide6.QtTest import QSignalSpy, QTest

from app.ui.panels.watch.inspector.tree_model import TreeModel
from app.ui.panels.watch.inspector.tree_view import TreeView
from app.ui.panels.watch.inspector.values import search, value_text
from app.ui.theme.theme import Theme

FIRST = {"stamp": 1.5, "robots": {"Pepper": {"pose": {"x": 1, "y": 2}, "on": True}}, "list": [1, "two", None]}


@pytest.fixture
def model() -> TreeModel:
    made = TreeModel()
    made.set_value(FIRST, 0.0)
    return made


def at(model: TreeModel, *path: str | int) -> QModelIndex:
    index = model.index_of_path(path)
    assert index.isValid(), path
    return index


def test_model_obeys_qt_rules_while_messages_change_shape(qtmodeltester, model) -> None:
    at(model, "robots", "Pepper", "pose", "x")
    at(model, "list", 2)
    qtmodeltester.check(model)  # keeps checking: a violation is a Qt warning, which fails the test
    for value in (
        {"stamp": 2, "robots": {"Pepper": {"pose": {"x": 1, "z": 3, "y": 2}}}, "list": [1, 2, 3, 4]},
        {"list": [], "stamp": 3, "robots": {"Pepper": 5}},  # other key order; a container became a value
        {"list": [[1], [2]], "new": {}, "robots": {"Pepper": {"pose": {"x": 1}}}},
        [1, 2, 3],
        "only a word",
        {},
        {"again": [FIRST]},
    ):
        model.set_value(value, 1.0)
    assert [model.node(model.index(row, 0)).key for row in range(model.rowCount())] == ["again"]


def test_tree_nodes_are_created_lazily() -> None:
    model = TreeModel()
    model.set_value({"large": list(range(100_000)), "other": {"deep": {}}}, 0.0)
    large = at(model, "large")
    assert model.hasChildren(large)
    assert model.rowCount(large) == 0
    model.fetchMore(large)
    assert model.rowCount(large) == 500
    assert model.canFetchMore(large)
    model.fetchMore(large)
    assert model.rowCount(large) == 1000


def test_expansion_and_selection_are_kept_across_messages(qtbot, model) -> None:
    view = TreeView(Theme("light"), model)
    qtbot.addWidget(view)
    view.resize(300, 400)
    view.show()
    y = at(model, "robots", "Pepper", "pose", "y")
    for path in (("robots",), ("robots", "Pepper"), ("robots", "Pepper", "pose")):
        view.expand(at(model, *path))
    view.setCurrentIndex(y)
    # A key is inserted before the current one, the order of others changes, values change.
    model.set_value(
        {"robots": {"Pepper": {"on": False, "pose": {"w": 0, "x": 3, "y": 4}}}, "stamp": 2.5}, 1.0
    )
    assert view.isExpanded(at(model, "robots", "Pepper", "pose"))
    assert model.node(view.currentIndex()).path == "robots.Pepper.pose.y"
    assert model.node(view.currentIndex()).value == 4


def test_scroll_position_is_kept_across_messages(qtbot) -> None:
    model = TreeModel()
    model.set_value({f"key{number}": number for number in range(300)}, 0.0)
    view = TreeView(Theme("light"), model)
    qtbot.addWidget(view)
    view.resize(300, 200)
    view.show()
    view.verticalScrollBar().setValue(2000)
    model.set_value({f"key{number}": number + 1 for number in range(300)}, 1.0)
    assert view.verticalScrollBar().value() == 2000


def test_only_changed_values_are_marked(model) -> None:
    for path in (("stamp",), ("robots", "Pepper", "pose", "x"), ("list", 0)):
        assert model.node(at(model, *path)).changed_s is None  # the first message marks no changes
    told = QSignalSpy(model.dataChanged)
    model.set_value({**FIRST, "stamp": 1.6, "list": [True, "two", None]}, 7.0)
    assert model.node(at(model, "stamp")).changed_s == 7.0
    assert model.node(at(model, "list", 0)).changed_s == 7.0  # 1 and true differ in JSON
    assert model.node(at(model, "list", 1)).changed_s is None
    assert model.node(at(model, "robots", "Pepper", "pose", "x")).changed_s is None
    assert told.count() == 2  # one signal per container with changes


def test_nan_followed_by_nan_is_not_a_change() -> None:
    model = TreeModel()
    model.set_value({"x": float("nan")}, 0.0)
    model.set_value({"x": float("nan")}, 1.0)
    assert model.node(at(model, "x")).changed_s is None


def test_change_mark_fades_and_with_reduced_motion_stays_for_a_second(qtbot, model) -> None:
    now = [7.0]
    theme = Theme("light")
    view = TreeView(theme, model, clock=lambda: now[0])
    qtbot.addWidget(view)
    model.set_value({**FIRST, "stamp": 9}, 7.0)
    node = model.node(at(model, "stamp"))
    shares = []
    for now[0] in (7.0, 7.4, 7.9):
        shares.append(view.highlight_opacity(node))
    assert shares == [1.0, pytest.approx(0.5), 0.0]
    theme.is_motion_reduced = True
    now[0] = 7.9
    assert view.highlight_opacity(node) == 1.0
    now[0] = 8.1
    assert view.highlight_opacity(node) == 0.0


def test_changed_values_are_painted_differently(qtbot, model) -> None:
    now = [7.0]
    view = TreeView(Theme("light"), model, clock=lambda: now[0])
    qtbot.addWidget(view)
    view.resize(300, 200)
    view.show()
    model.set_value({**FIRST, "stamp": 1.6}, 7.0)
    marked = view.grab().toImage()
    now[0] = 9.0
    assert view.grab().toImage() != marked


def test_chevron_and_keyboard_expand_and_collapse(qtbot, model) -> None:
    view = TreeView(Theme("light"), model)
    qtbot.addWidget(view)
    view.resize(300, 300)
    view.show()
    robots = at(model, "robots")
    box = view.visualRect(robots)
    QTest.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(14, box.center().y()))
    assert view.isExpanded(robots)
    QTest.keyClick(view, Qt.Key.Key_Left)
    assert not view.isExpanded(robots)


def test_steps_resolve_to_tree_items_with_their_field_paths(model) -> None:
    assert model.node(at(model, "list", 1)).path == "list[1]"
    assert model.node(at(model, "robots", "Pepper", "pose", "x")).path == "robots.Pepper.pose.x"
    assert not model.index_of_path(("robots", "nobody")).isValid()


def test_search_finds_keys_and_values_in_tree_order() -> None:
    assert list(search(FIRST, "p")) == [("stamp",), ("robots", "Pepper"), ("robots", "Pepper", "pose")]
    assert list(search(FIRST, "TWO")) == [("list", 1)]
    assert list(search({"a": list(range(1000))}, "999", limit=100)) == []


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "null"), (True, "true"), (False, "false"), (3, "3"), (0.82, "0.82"), ("hi", '"hi"'),
        ("a\nb", '"a⏎b"'), ({}, "{}"), ({"a": 1}, "{1}"), ([], "[]"), ([1, 2], "[2]"),
        (b"\x00\xff", "00 ff  (2 bytes)"),
    ],
)  # fmt: skip
def test_values_are_formatted_as_text(value: object, words: str) -> None:
    assert value_text(value) == words


def test_very_long_text_is_truncated() -> None:
    assert len(value_text("x" * 100_000)) < 500
