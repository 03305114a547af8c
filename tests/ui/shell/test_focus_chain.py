"""Tests that querying the focus chain has no side effects, even if the queried widget is deleted."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import shiboken6
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QLabel, QLineEdit, QScrollArea, QVBoxLayout, QWidget

import app.ui
from app.ui.widgets.keyboard import focus_proxy, next_in_focus_chain, tab_stops

ASKS = re.compile(r"\.(nextInFocusChain|previousInFocusChain|focusProxy|buddy)\(\)")


def delete(widget: QWidget) -> None:
    widget.deleteLater()
    QCoreApplication.sendPostedEvents(widget, QEvent.Type.DeferredDelete.value)


@pytest.fixture
def window(qtbot) -> QWidget:
    window = QWidget()
    qtbot.addWidget(window)
    column = QVBoxLayout(window)
    for widget in (QLineEdit(), QLabel("not a stop"), QScrollArea(), QLineEdit()):
        column.addWidget(widget)
    window.show()
    return window


def test_deleting_a_queried_widget_keeps_other_widgets_of_the_focus_chain_valid(window: QWidget) -> None:
    first, second = window.findChildren(QLineEdit)
    area = window.findChildren(QScrollArea)[0]
    header = area.viewport()  # created by Qt: PySide would mark its wrapper as deleted
    assert list(tab_stops(window, first)) == [area, second]
    assert list(tab_stops(window, first, forward=False)) == [second, area]
    step = next_in_focus_chain(first)
    while step is not first:
        step = next_in_focus_chain(step)
    delete(first)
    delete(second)
    for widget in (window, area, header):
        assert shiboken6.isValid(widget)
    assert area.parentWidget() is window


def test_focus_proxy_keeps_its_parent_when_queried(window: QWidget) -> None:
    first, second = window.findChildren(QLineEdit)
    assert focus_proxy(first) is None
    first.setFocusProxy(second)
    assert focus_proxy(first) is second
    assert second.parentWidget() is window


def test_window_stays_top_level_after_a_focus_chain_query(window: QWidget) -> None:
    last = window.findChildren(QLineEdit)[-1]
    assert any(next_in_focus_chain(each) is window for each in window.findChildren(QWidget))
    delete(last)
    assert shiboken6.isValid(window)
    assert window.isVisible()
    assert window.isWindow()


def test_only_the_keyboard_module_queries_the_qt_focus_chain() -> None:
    root = Path(app.ui.__file__).parent
    asking = {path.name for path in root.rglob("*.py") if ASKS.search(path.read_text("utf-8"))}
    assert asking == {"keyboard.py"}
