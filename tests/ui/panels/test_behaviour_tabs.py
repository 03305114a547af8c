"""Tests of the tab bar of open behaviours: contents, mouse and keyboard."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QContextMenuEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QToolTip

from app.ui.intents import CloseBehaviour, DuplicateTab
from app.ui.panels.build.behaviour.tab import TabState
from app.ui.panels.build.behaviour.tabs import NEW_TAB, BehaviourTabs
from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu

A, B, C = (TabState(key, name) for key, name in (("a", "Greeting"), ("b", "Tour guide"), ("c", "Quiz")))


@pytest.fixture
def theme(qapp) -> Theme:
    return Theme("light")


@pytest.fixture
def tabs(qtbot, theme) -> BehaviourTabs:
    made = BehaviourTabs(theme)
    qtbot.addWidget(made)
    made.resize(700, 32)
    made.show_tabs([A, B, C], "a")
    made.show()
    return made


def heard(signal) -> list[tuple[object, ...]]:
    found: list[tuple[object, ...]] = []
    signal.connect(lambda *given: found.append(given))
    return found


def press(tab, place=None, button=Qt.MouseButton.LeftButton) -> None:
    QTest.mouseClick(tab, button, pos=place if place is not None else QPoint(14, 14))


def test_tab_shows_name_unsaved_state_and_running_state(tabs) -> None:
    tabs.show_tabs([A, TabState("b", "Tour guide", is_dirty=True, is_running=True)], "a")
    assert [tab.accessibleName() for tab in tabs.tabs.values()] == [
        "Greeting",
        "Tour guide, not saved, running",
    ]
    assert [tab.isChecked() for tab in tabs.tabs.values()] == [True, False]


def test_tab_is_selected_and_closed_by_mouse(tabs) -> None:
    chosen, closed = heard(tabs.selected), heard(tabs.close_requested)
    press(tabs.tabs["b"])
    press(tabs.tabs["c"], button=Qt.MouseButton.MiddleButton)
    press(tabs.tabs["b"], tabs.tabs["b"].close_rect().center().toPoint())
    assert chosen == [("b",)]
    assert closed == [("c",), ("b",)]


def test_press_on_the_close_button_released_outside_does_not_close_the_tab(tabs) -> None:
    closed, chosen = heard(tabs.close_requested), heard(tabs.selected)
    tab = tabs.tabs["b"]
    QTest.mousePress(tab, Qt.MouseButton.LeftButton, pos=tab.close_rect().center().toPoint())
    QTest.mouseRelease(tab, Qt.MouseButton.LeftButton, pos=QPoint(5, 5))
    assert (closed, chosen) == ([], [])


def test_tab_dragged_past_the_middle_of_its_neighbour_swaps_places(tabs) -> None:
    moved = heard(tabs.moved)
    tab, other = tabs.tabs["a"], tabs.tabs["b"]
    QTest.mousePress(tab, Qt.MouseButton.LeftButton, pos=QPoint(14, 14))
    QTest.mouseMove(tab, tab.mapFromParent(other.geometry().center() - QPoint(8, 0)))
    assert moved == []
    QTest.mouseMove(tab, tab.mapFromParent(other.geometry().center() + QPoint(8, 0)))
    assert moved == [("a", 1)]
    QTest.mouseRelease(tab, Qt.MouseButton.LeftButton)


def test_tabs_are_navigated_and_closed_by_keyboard(tabs) -> None:
    chosen, closed = heard(tabs.selected), heard(tabs.close_requested)
    tab = tabs.tabs["a"]
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Left, Qt.Key.Key_Return, Qt.Key.Key_Delete):
        QTest.keyClick(tab, key)
    assert chosen == [("b",), ("c",), ("a",)]
    assert closed == [("a",)]
    policies = [tab.focusPolicy() for tab in tabs.tabs.values()]
    assert policies.count(Qt.FocusPolicy.StrongFocus) == 1, "Tab stops once"


def test_focus_follows_the_current_tab(qtbot, tabs) -> None:
    tabs.activateWindow()
    tabs.tabs["a"].setFocus()
    qtbot.waitUntil(tabs.tabs["a"].hasFocus)
    tabs.show_tabs([A, B, C], "b")
    assert tabs.tabs["b"].hasFocus()


def test_closed_tab_is_removed_and_the_other_tabs_move_left(tabs) -> None:
    before = tabs.tabs["c"].x()
    tabs.show_tabs([A, C], "a")
    assert set(tabs.tabs) == {"a", "c"}
    assert tabs.tabs["c"].x() < before


def test_narrow_tab_bar_scrolls_to_the_current_tab_and_keeps_a_minimum_tab_width(tabs) -> None:
    many = [TabState(str(number), f"A rather long name {number}") for number in range(12)]
    tabs.show_tabs(many, "11")
    room = tabs.add.x()
    assert tabs.tabs["11"].geometry().right() <= room
    assert tabs.tabs["0"].x() < 0
    tabs.show_tabs(many, "0")
    assert tabs.tabs["0"].x() == 0
    assert all(tab.width() >= 76 for tab in tabs.tabs.values())


@pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
def test_menu_lists_all_tabs_when_some_are_hidden(tabs) -> None:
    tabs.show_tabs([TabState("0", "One"), TabState("1", "Two")], "1")
    assert tabs.list.isHidden(), "all are in sight"
    many = [TabState(str(number), f"A rather long name {number}") for number in range(12)]
    tabs.show_tabs(many, "11")
    assert not tabs.list.isHidden()
    assert tabs.add.geometry().right() < tabs.list.geometry().left() <= tabs.width()
    chosen = []
    tabs.selected.connect(chosen.append)
    tabs.list.click()
    (menu,) = tabs.findChildren(Menu)
    assert [entry.text() for entry in menu.actions()] == [each.name for each in many]
    assert [entry.isChecked() for entry in menu.actions()].index(True) == 11
    menu.actions()[2].trigger()
    assert chosen == ["2"]
    menu.close()


def test_current_tab_is_never_wider_than_the_tab_bar(tabs) -> None:
    facts = [TabState("0", "One"), TabState("1", "The rather long name of a behaviour")]
    tabs.resize(180, 32)
    tabs.show_tabs(facts, "1")
    tab = tabs.tabs["1"]
    assert tab.x() >= 0
    assert tab.geometry().right() < tabs.add.x() < tabs.list.x() < tabs.width()


def test_wheel_scrolls_the_tab_bar(tabs) -> None:
    many = [TabState(str(number), f"A rather long name {number}") for number in range(12)]
    tabs.show_tabs(many, "0")
    wheel = QWheelEvent(
        QPointF(5, 5), QPointF(5, 5), QPoint(), QPoint(0, -120), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(tabs, wheel)
    assert tabs.tabs["0"].x() == -60


def test_tabs_are_not_clipped_at_200_per_cent_text_size(tabs, theme) -> None:
    theme.set_text_percent(200)
    tabs.resize(1400, tabs.sizeHint().height())
    for tab in tabs.tabs.values():
        assert tab.width() >= tab.sizeHint().width()
        assert tab.height() >= tab.fontMetrics().height()
        assert tabs.height() >= tab.geometry().bottom()


@pytest.mark.qt_log_ignore("does not support", extend=True)
def test_tab_menu_lists_the_available_commands(qtbot, tabs) -> None:
    asked = heard(tabs.intent_requested)
    place = tabs.tabs["b"].geometry().center()
    QApplication.sendEvent(
        tabs, QContextMenuEvent(QContextMenuEvent.Reason.Mouse, place, tabs.mapToGlobal(place))
    )
    (menu,) = tabs.findChildren(Menu)
    words = [action.text() for action in menu.actions() if not action.isSeparator()]
    assert words == [
        "Rename\tF2",
        "Duplicate",
        "Save",
        "Save as",
        "Show in folder",
        "Close",
        "Close other behaviours",
    ]
    by_words = {action.text(): action for action in menu.actions()}
    assert not by_words["Show in folder"].isEnabled(), "it has no file"
    for each in ("Duplicate", "Close"):
        by_words[each].trigger()
    menu.close()
    assert asked == [(DuplicateTab("b"),), (CloseBehaviour("b"),)]


# -- renaming -------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["double click", "F2", "menu"])
def test_tab_is_renamed_in_place(qtbot, tabs, way: str) -> None:
    renamed = heard(tabs.renamed)
    tab = tabs.tabs["a"]
    if way == "double click":
        QTest.mouseDClick(tab, Qt.MouseButton.LeftButton, pos=QPoint(14, 14))
    elif way == "F2":
        QTest.keyClick(tab, Qt.Key.Key_F2)
    else:
        tabs.menu_of("a").actions()[0].trigger()
    assert tabs.field.selectedText() == "Greeting"
    assert tabs.field.geometry().contains(tab.geometry().center())
    QTest.keyClicks(tabs.field, "Hello")
    QTest.keyClick(tabs.field, Qt.Key.Key_Return)
    assert renamed == [("a", "Hello")]
    assert tabs.field is None


def test_esc_cancels_renaming(tabs) -> None:
    renamed = heard(tabs.renamed)
    QTest.keyClick(tabs.tabs["a"], Qt.Key.Key_F2)
    assert not tabs.add.isVisible(), "nothing lies over the field"
    QTest.keyClicks(tabs.field, "Hello")
    QTest.keyClick(tabs.field, Qt.Key.Key_Escape)
    assert (renamed, tabs.field) == ([], None)
    assert tabs.add.isVisible()


def test_rejected_tab_name_shows_the_reason_and_stays_editable(tabs) -> None:
    renamed = heard(tabs.renamed)
    tabs.name_problem = lambda key, name: f"{key} can't be {name}" if name == "Taken" else ""
    QTest.keyClick(tabs.tabs["a"], Qt.Key.Key_F2)
    QTest.keyClicks(tabs.field, "Taken")
    QTest.keyClick(tabs.field, Qt.Key.Key_Return)
    assert QToolTip.text() != ""
    assert "a can't be Taken" in QToolTip.text().replace("&#39;", "'").replace("&#x27;", "'")
    assert tabs.field.property("wrong") == "true"
    assert renamed == []
    QTest.keyClicks(tabs.field, "2")
    assert tabs.field.property("wrong") == "false"
    QTest.keyClick(tabs.field, Qt.Key.Key_Return)
    assert renamed == [("a", "Taken2")]


def test_closing_a_tab_closes_its_rename_field(tabs) -> None:
    QTest.keyClick(tabs.tabs["a"], Qt.Key.Key_F2)
    tabs.show_tabs([B, C], "b")
    assert tabs.field is None


def test_folder_suffix_of_a_tab_is_not_editable(tabs) -> None:
    tabs.show_tabs([TabState("a", "Quiz — class 3", plain_name="Quiz", has_file=True), B], "a")
    QTest.keyClick(tabs.tabs["a"], Qt.Key.Key_F2)
    assert tabs.field.text() == "Quiz"


# -- blocks dragged from the page -----------------------------------------------------------------


def test_drop_target_is_the_tab_or_plus_button_at_the_position_if_any(qtbot, tabs) -> None:
    tab = tabs.tabs["b"]
    assert tabs.target_at(tab.mapToGlobal(tab.rect().center())) == "b"
    assert tabs.target_at(tabs.add.mapToGlobal(tabs.add.rect().center())) == NEW_TAB
    assert tabs.target_at(tab.mapToGlobal(QPoint(10, 90))) == ""
    beyond = tabs.mapToGlobal(QPoint(tabs.width() - 2, 10))
    assert tabs.target_at(beyond) == ""
    tabs.hide()
    assert tabs.target_at(tab.mapToGlobal(tab.rect().center())) == ""


def test_scrolled_out_tab_is_not_a_drop_target(qtbot, tabs) -> None:
    tabs.resize(150, 30)
    tabs.show_tabs([A, B, C], "a")
    hidden = tabs.tabs["c"]
    assert tabs.target_at(hidden.mapToGlobal(hidden.rect().center())) in {"", NEW_TAB}


def test_dragging_near_an_end_of_the_tab_bar_scrolls_to_hidden_tabs(qtbot, tabs) -> None:
    tabs.resize(180, 30)
    tabs.show_tabs([A, B, C], "a")
    last, first = tabs.tabs["c"], tabs.tabs["a"]
    left, right = tabs.mapToGlobal(QPoint(2, 15)), tabs.mapToGlobal(QPoint(tabs._clip_area.width() - 2, 15))
    middle = tabs.mapToGlobal(QPoint(tabs._clip_area.width() // 2, 15))
    assert not tabs.scroll_at(middle)
    assert not tabs.scroll_at(left), "nothing more is there"
    while tabs.scroll_at(right):
        pass
    assert tabs.target_at(right) == "c"
    assert last.geometry().right() <= tabs._clip_area.width()
    while tabs.scroll_at(left):
        pass
    assert first.geometry().left() == 0
    assert not tabs.scroll_at(tabs.mapToGlobal(QPoint(2, 90))), "below the row nothing is brought"


def test_only_one_drop_target_is_highlighted(tabs) -> None:
    def ringed() -> list[bool]:
        return [tabs.tabs["a"].is_drop_target, tabs.tabs["b"].is_drop_target, tabs.add.is_drop_target]

    tab = tabs.tabs["b"]
    before = tab.grab().toImage()
    for key, expected in (("b", [False, True, False]), (NEW_TAB, [False, False, True])):
        tabs.highlight_target(key)
        assert ringed() == expected
        assert (tab.grab().toImage() == before) == (key != "b")
    tabs.highlight_target("")
    assert ringed() == [False, False, False]
