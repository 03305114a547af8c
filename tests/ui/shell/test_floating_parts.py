"""Tests of overlays of the window: toast, banner, focus ring and sheet."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QScrollArea, QVBoxLayout, QWidget

from app.intents import Intent
from app.ui.shell.bars.banner import AlertBanner
from app.ui.shell.bars.toast import Toast
from app.ui.shell.dialogs.about import AboutSheet
from app.ui.shell.focus_ring import FocusRing
from app.ui.text.numbers import shortcut_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Button

pytest_plugins = ["tests.ui.shell_fixtures"]


@dataclass(frozen=True)
class Said:
    id: str
    severity: str = "error"
    title: str = "It is silent."
    detail: str = ""
    button: str | None = None
    intent: Intent | None = None


@pytest.fixture
def place(qtbot) -> QWidget:
    made = QWidget()
    made.resize(800, 500)
    QVBoxLayout(made)
    qtbot.addWidget(made)
    made.show()
    made.activateWindow()
    qtbot.waitUntil(made.isActiveWindow)
    return made


def test_toast_is_placed_in_the_corner_and_follows_window_resizes(place: QWidget, theme: Theme) -> None:
    toast = Toast(theme, place)
    toast.show_toast("Copied robots.Pepper.pose.y")
    assert toast.isVisible()
    assert not toast.button.isVisible()
    right = place.width() - toast.geometry().right()
    place.resize(600, 400)
    assert place.width() - toast.geometry().right() == right


def test_undo_button_of_a_toast_runs_the_undo_function(place: QWidget, theme: Theme) -> None:
    done: list[str] = []
    toast = Toast(theme, place)
    toast.show_toast("Deleted 4 blocks", "Undo", lambda: done.append("undone"))
    QTest.mouseClick(toast.button, Qt.MouseButton.LeftButton)
    assert done == ["undone"]
    assert not toast.isVisible()


def test_toast_does_not_time_out_while_focused(qtbot, place: QWidget, theme: Theme) -> None:
    toast = Toast(theme, place)
    toast.show_toast("Deleted 4 blocks", "Undo", lambda: None)
    toast.button.setFocus()
    qtbot.waitUntil(toast.button.hasFocus)
    toast._on_timeout()
    assert toast.isVisible()
    toast.button.clearFocus()
    toast.setAttribute(Qt.WidgetAttribute.WA_UnderMouse, False)
    toast._on_timeout()
    assert not toast.isVisible()


def test_offer_stays_until_answered_and_later_alerts_are_queued(place: QWidget, theme: Theme) -> None:
    banner = AlertBanner(theme)
    place.layout().addWidget(banner)
    done: list[str] = []
    banner.offer(
        "Put it back?",
        "It was not saved.",
        ("Yes", lambda: done.append("yes")),
        ("No", lambda: done.append("no")),
    )
    banner.show_alerts([Said("a", title="Alert.")])
    assert "Put it back?" in banner.banner.accessibleName()
    QTest.mouseClick(banner.banner.second_button, Qt.MouseButton.LeftButton)
    assert done == ["no"]
    assert banner.isVisible()
    assert banner.banner.accessibleName() == "Alert."
    assert not banner.banner.second_button.isVisible()


def test_closing_an_offer_or_alert_shows_the_next_alert(place: QWidget, theme: Theme) -> None:
    banner = AlertBanner(theme)
    place.layout().addWidget(banner)
    dismissed: list[str] = []
    banner.on_dismiss = dismissed.append
    banner.offer("Put it back?", "", ("Yes", lambda: None), ("No", lambda: None))
    banner.show_alerts([Said("a", title="First."), Said("b", title="Second.")])
    for shown in ("First.", "Second."):
        QTest.mouseClick(banner.banner.close_button, Qt.MouseButton.LeftButton)
        assert banner.banner.accessibleName() == shown
    QTest.mouseClick(banner.banner.close_button, Qt.MouseButton.LeftButton)
    assert not banner.isVisible()
    assert dismissed == ["a", "b"]


def test_alert_text_is_not_interpreted_as_markup(place: QWidget, theme: Theme) -> None:
    banner = AlertBanner(theme)
    place.layout().addWidget(banner)
    banner.show_alerts([Said("a", title="<b>/faces</b> & co.")])
    (line,), _is_whole = banner.banner.text_label.lines("body")
    assert next(text for text, _font, _role in line) == "<b>/faces</b> & co."
    assert "&lt;b&gt;" in banner.banner.text_label.toolTip()


def test_long_alert_text_wraps_to_the_lines_that_fit(place: QWidget, theme: Theme) -> None:
    banner = AlertBanner(theme)
    place.layout().addWidget(banner)
    banner.show_alerts([Said("a", detail="It means a lot. " * 30)])
    words = banner.banner.text_label
    words.resize(300, 48)
    for kind, most in (("bodyLarge", 2), ("small", 3)):
        lines, is_whole = words.lines(kind)
        assert (len(lines), is_whole) == (most, False)
    words.resize(3000, 48)
    assert words.lines("bodyLarge")[1]


def test_focus_ring_surrounds_the_focused_widget_and_follows_its_geometry(
    qtbot, place: QWidget, theme: Theme
) -> None:
    ring = FocusRing(theme, place)
    first, second = Button(theme, "One"), Button(theme, "Two")
    place.layout().addWidget(first)
    place.layout().addWidget(second)
    QTest.qWait(1)
    QTest.keyClick(place.windowHandle(), Qt.Key.Key_Tab)
    second.setFocus(Qt.FocusReason.TabFocusReason)
    qtbot.waitUntil(lambda: ring.target is second)
    assert ring.isVisible()
    assert ring.geometry() == second.geometry().adjusted(-4, -4, 4, 4)
    place.resize(900, 300)
    QTest.qWait(1)
    qtbot.waitUntil(lambda: ring.geometry() == second.geometry().adjusted(-4, -4, 4, 4))
    second.hide()
    qtbot.waitUntil(lambda: ring.target is first)
    place.setFocus()
    assert not ring.isVisible()


def test_mouse_click_shows_no_focus_ring_and_the_next_tab_key_does(
    qtbot, place: QWidget, theme: Theme
) -> None:
    ring = FocusRing(theme, place)
    field, other = QLineEdit(), QLineEdit()
    place.layout().addWidget(other)
    place.layout().addWidget(field)
    QTest.qWait(1)
    QTest.mousePress(field, Qt.MouseButton.LeftButton, pos=QPoint(5, 5))
    assert field.hasFocus()
    assert not ring.isVisible()
    QTest.mouseRelease(field, Qt.MouseButton.LeftButton, pos=QPoint(5, 5))
    QTest.keyClick(place.windowHandle(), Qt.Key.Key_Tab)
    qtbot.waitUntil(lambda: ring.target is other)


@pytest.mark.parametrize("key", ["Tab", "Backtab", "Right", "Down", "F6", "Home"])
def test_first_key_that_moves_the_focus_shows_the_ring(qtbot, place: QWidget, theme: Theme, key: str) -> None:
    ring = FocusRing(theme, place)
    buttons = [Button(theme, word) for word in ("One", "Two")]
    for button in buttons:
        place.layout().addWidget(button)
    QTest.qWait(1)
    buttons[0].setFocus()  # like a new page or a closed dialog
    assert not ring.isVisible()
    for other in (Qt.Key.Key_A, Qt.Key.Key_Shift, Qt.Key.Key_Escape, Qt.Key.Key_F12):
        QTest.keyClick(place.windowHandle(), other)
        QTest.qWait(1)
        assert not ring.isVisible()
    QTest.keyClick(place.windowHandle(), Qt.Key[f"Key_{key}"])
    qtbot.waitUntil(ring.isVisible)
    assert ring.target in buttons
    at = buttons[1].mapTo(place, buttons[1].rect().center())
    QTest.mouseClick(place.windowHandle(), Qt.MouseButton.LeftButton, pos=at)
    assert not ring.isVisible()


def test_hiding_a_clicked_widget_shows_no_focus_ring_on_the_next_widget(
    qtbot, place: QWidget, theme: Theme
) -> None:
    ring = FocusRing(theme, place)
    first, second = Button(theme, "One"), Button(theme, "Two")
    place.layout().addWidget(first)
    place.layout().addWidget(second)
    QTest.qWait(1)
    at = second.mapTo(place, second.rect().center())
    QTest.mouseClick(place.windowHandle(), Qt.MouseButton.LeftButton, pos=at)
    second.hide()  # Qt moves the focus with the reason Tab
    qtbot.waitUntil(first.hasFocus)
    assert ring.target is None
    QTest.keyClick(place.windowHandle(), Qt.Key.Key_Home)
    first.clearFocus()
    first.setFocus()
    assert ring.target is first


def test_first_mouse_press_in_a_window_shows_no_focus_ring(qtbot, theme: Theme) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    column = QVBoxLayout(window)
    ring = FocusRing(theme, window)
    run, pause = Button(theme, "Run"), Button(theme, "Pause")
    run.clicked.connect(lambda: run.setEnabled(False))
    column.addWidget(run)
    column.addWidget(pause)
    window.show()
    QTest.qWait(1)
    at = run.mapTo(window, run.rect().center())
    QTest.mouseClick(window.windowHandle(), Qt.MouseButton.LeftButton, pos=at)
    assert not run.isEnabled()
    assert ring.target is None


def test_focus_ring_is_hidden_while_its_widget_is_scrolled_out_of_view(
    qtbot, place: QWidget, theme: Theme
) -> None:
    ring = FocusRing(theme, place)
    inside = QWidget()
    inside.setFixedSize(300, 2000)
    button = Button(theme, "Far down")
    button.setParent(inside)
    button.move(10, 1500)
    area = QScrollArea()
    area.setWidget(inside)
    place.layout().addWidget(area)
    QTest.qWait(1)
    QTest.keyClick(place.windowHandle(), Qt.Key.Key_Tab)
    button.setFocus(Qt.FocusReason.TabFocusReason)
    qtbot.waitUntil(lambda: ring.target is button)
    area.verticalScrollBar().setValue(0)
    qtbot.waitUntil(lambda: not ring.isVisible())


def test_focus_ring_survives_deletion_of_its_widget(qtbot, place: QWidget, theme: Theme) -> None:
    ring = FocusRing(theme, place)
    button = Button(theme, "Brief")
    place.layout().addWidget(button)
    QTest.qWait(1)
    QTest.keyClick(place.windowHandle(), Qt.Key.Key_Tab)
    button.setFocus(Qt.FocusReason.TabFocusReason)
    qtbot.waitUntil(lambda: ring.target is button)
    button.deleteLater()
    qtbot.waitUntil(lambda: ring.target is not button)
    assert not ring.isVisible()


@pytest.mark.parametrize(
    ("keys", "said"), [("Ctrl+Shift+S", "Ctrl+Shift+S"), ("Ctrl++", "Ctrl++"), ("F12", "F12")]
)
def test_shortcuts_are_formatted_with_key_names(keys: str, said: str) -> None:
    assert shortcut_text(keys) == said


def test_sheet_closes_on_esc_and_on_focus_loss(qtbot, place: QWidget, theme: Theme) -> None:
    field = QLineEdit()
    place.layout().addWidget(field)
    for leave in (lambda: QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Escape), field.setFocus):
        sheet = AboutSheet(theme, place, print)
        sheet.open()
        assert sheet.isVisible()
        assert place.rect().contains(sheet.geometry())
        with qtbot.waitSignal(sheet.destroyed):
            leave()
