"""Tests of the buffer for key events that arrive before the page is ready."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QFocusEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLineEdit

from app.ui.blockly.key_buffer import KeyBuffer


class Watch(QObject):
    """Event filter that passes key events to the buffer, as the host of the page does."""

    def __init__(self, keys: KeyBuffer) -> None:
        super().__init__()
        self._keys = keys

    def eventFilter(self, _watched, event) -> bool:
        return self._keys.buffer_event(event)


@pytest.fixture
def field(qtbot) -> QLineEdit:
    made = QLineEdit()
    qtbot.addWidget(made)
    return made


@pytest.fixture
def keys(field) -> KeyBuffer:
    keys = KeyBuffer(lambda: field)
    field.watch = Watch(keys)
    field.installEventFilter(field.watch)
    return keys


def test_queued_keys_are_delivered_in_order(field, keys):
    QTest.keyClicks(field, "a")
    keys.start()
    QTest.keyClicks(field, "bc")
    assert field.text() == "a"
    keys.release()
    QTest.keyClicks(field, "d")
    assert field.text() == "abcd"


@pytest.mark.parametrize("how", ["mouse", "focus"])
def test_click_or_focus_change_delivers_queued_keys(field, keys, how):
    keys.start()
    QTest.keyClicks(field, "ab")
    if how == "mouse":
        QTest.mouseClick(field, Qt.LeftButton)
    else:
        keys.buffer_event(QFocusEvent(QFocusEvent.Type.FocusOut))
    QTest.keyClicks(field, "c")
    assert field.text() == "abc"


def test_keys_queued_for_a_crashed_page_are_discarded(field, keys):
    keys.start()
    QTest.keyClicks(field, "ab")
    keys.discard_all()
    keys.release()
    QTest.keyClicks(field, "c")
    assert field.text() == "c"
