"""Tests of the Enter key on buttons: one click per key press, no effect on other widgets."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QVBoxLayout, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import Button


@pytest.fixture
def window(qtbot) -> QWidget:
    made = QWidget()
    column = QVBoxLayout(made)
    made.button, made.field = Button(Theme("light"), "Activate"), QLineEdit()
    column.addWidget(made.button)
    column.addWidget(made.field)
    made.pressed = []
    made.button.clicked.connect(lambda: made.pressed.append("button"))
    made.field.returnPressed.connect(lambda: made.pressed.append("field"))
    qtbot.addWidget(made)
    made.show()
    made.activateWindow()
    qtbot.waitUntil(made.isActiveWindow)
    return made


@pytest.mark.parametrize("key", [Qt.Key_Return, Qt.Key_Enter, Qt.Key_Space])
def test_enter_presses_the_focused_button(qtbot, window, key):
    window.button.setFocus()
    QTest.keyClick(window.windowHandle(), key)
    qtbot.waitUntil(lambda: window.pressed == ["button"])


def test_enter_handling_does_not_affect_text_fields_ctrl_enter_and_other_keys(qtbot, window):
    window.button.setFocus()
    QTest.keyClick(window.windowHandle(), Qt.Key_Return, Qt.ControlModifier)
    QTest.keyClick(window.windowHandle(), Qt.Key_A)
    window.button.setEnabled(False)
    window.field.setFocus()
    QTest.keyClick(window.windowHandle(), Qt.Key_Return)
    qtbot.waitUntil(lambda: bool(window.pressed))
    assert window.pressed == ["field"]


def test_holding_enter_presses_the_button_once(qtbot, window):
    window.button.setFocus()
    held = QKeyEvent(QEvent.Type.KeyPress, Qt.Key_Return, Qt.NoModifier, "\r", True)
    QTest.keyPress(window.windowHandle(), Qt.Key_Return)
    for _ in range(3):
        QApplication.sendEvent(window.button, held)
    QTest.keyRelease(window.windowHandle(), Qt.Key_Return)
    assert window.pressed == ["button"]
