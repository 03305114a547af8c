"""Tests of themed menus, including the context menus of text fields."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import ComboBox
from app.ui.widgets.menus import FieldContextMenu, Menu, round_region

# on the offscreen platform, popups can't grab the keyboard
pytestmark = pytest.mark.qt_log_ignore("does not support grabbing the keyboard", extend=True)
pytest_plugins = ["tests.ui.shell_fixtures"]


def shown(qtbot, theme: Theme, place: QWidget, *actions: QAction) -> Menu:
    theme.apply()
    qtbot.addWidget(place)
    place.show()
    menu = Menu(theme, place)
    menu.addActions(list(actions))
    menu.popup(QPoint(20, 20))
    qtbot.waitUntil(menu.isVisible)
    return menu


def test_menu_has_round_corners_and_straight_edges() -> None:
    region = round_region(QSize(200, 100), 8)
    for corner in (QPoint(0, 0), QPoint(199, 0), QPoint(1, 98), QPoint(199, 99)):
        assert not region.contains(corner)
    for edge in (QPoint(100, 0), QPoint(0, 50), QPoint(199, 50), QPoint(100, 99), QPoint(3, 3)):
        assert region.contains(edge)


def test_text_check_marks_and_shortcuts_are_painted(qtbot, theme: Theme) -> None:
    place = QWidget()
    plain, marked = QAction("&Copy", place), QAction("&Copy", place)
    marked.setCheckable(True)
    marked.setChecked(True)
    marked.setShortcut("Ctrl+C")
    off = QAction("&Copy", place)
    off.setEnabled(False)
    menu = shown(qtbot, theme, place, plain, marked, off)
    image = menu.grab().toImage()
    looks = []
    for action in (plain, marked, off):
        rect = menu.actionGeometry(action).adjusted(4, 4, -4, -4)
        left = image.copy(rect.left(), rect.top(), 24, rect.height())
        middle = image.copy(rect.left() + 24, rect.top(), 60, rect.height())
        right = image.copy(rect.right() - 60, rect.top(), 56, rect.height())
        looks.append((left, middle, right))
    assert looks[0][0] != looks[1][0]  # the check mark
    assert looks[0][1] == looks[1][1]  # texts are aligned in one column
    assert looks[0][2] != looks[1][2]  # the shortcut
    assert looks[0][1] != looks[2][1]  # disabled items are paler
    menu.close()


def test_every_enabled_menu_entry_is_triggered_by_its_mnemonic(qtbot, theme: Theme) -> None:
    place, done = QWidget(), []
    made = [QAction(words, place) for words in ("Cortar", "Copiar", "Última", "No")]
    for action in made:
        action.triggered.connect(lambda _on=False, action=action: done.append(action.text()))
    made[3].setEnabled(False)
    for key in ("C", "O", "U", "N"):
        menu = shown(qtbot, theme, place, *made)
        QTest.keyClick(menu, key)
        menu.close()
    assert done == ["Cortar", "Copiar", "Última"]  # disabled items can't be chosen


def test_mnemonic_opens_a_submenu(qtbot, theme: Theme) -> None:
    place = QWidget()
    menu = Menu(theme, place)
    inner = Menu(theme, menu, "Look")
    menu.addMenu(inner)
    inner.addAction("Dark")
    theme.apply()
    qtbot.addWidget(place)
    place.show()
    menu.popup(QPoint(20, 20))
    QTest.keyClick(menu, "L")
    qtbot.waitUntil(inner.isVisible)
    menu.close()


def test_mnemonics_are_underlined_during_keyboard_navigation(qtbot, theme: Theme) -> None:
    place = QWidget()
    menu = shown(qtbot, theme, place, QAction("Copy", place), QAction("Paste", place))
    before = menu.grab().toImage()
    QTest.keyClick(menu, Qt.Key.Key_Down)
    menu.setActiveAction(None)
    assert menu.grab().toImage() != before
    menu.close()


def test_text_field_uses_the_themed_context_menu(qtbot, theme: Theme) -> None:
    field = QLineEdit("hello")
    FieldContextMenu(theme, field)
    theme.apply()
    qtbot.addWidget(field)
    field.show()
    field.selectAll()
    field.customContextMenuRequested.emit(QPoint(5, 5))
    menu = QApplication.activePopupWidget()
    assert isinstance(menu, Menu)
    cut = next(action for action in menu.actions() if action.text().replace("&", "").startswith("Cut"))
    cut.trigger()
    assert field.text() == ""
    with qtbot.waitSignal(menu.destroyed):
        menu.close()


def test_combo_box_popup_is_frameless(qtbot, theme: Theme) -> None:
    theme.apply()
    choice = ComboBox(theme, [(name, name) for name in ("one", "two", "three", "four", "five")])
    qtbot.addWidget(choice)
    choice.show()
    choice.showPopup()
    popup = choice.view().window()
    qtbot.waitUntil(popup.isVisible)
    assert popup.windowFlags() & Qt.WindowType.FramelessWindowHint
    QTest.keyClick(choice.view(), Qt.Key.Key_Down)
    QTest.keyClick(choice.view(), Qt.Key.Key_Return)
    assert choice.value == "two"
