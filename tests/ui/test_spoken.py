"""Painted widgets tell screen readers what they are."""

from __future__ import annotations

import gc

from PySide6.QtGui import QAccessible
from PySide6.QtWidgets import QLabel, QPushButton, QWidget

from app.ui import spoken


def test_a_painted_widget_has_a_role_and_its_newest_name(qtbot) -> None:
    picture = QWidget()
    qtbot.addWidget(picture)
    spoken.speak_as(picture, "Graphic", "The room of Pepper")
    told = QAccessible.queryAccessibleInterface(picture)
    assert told.role() == QAccessible.Role.Graphic
    picture.setAccessibleName("The room of Turtle")
    assert told.text(QAccessible.Text.Name) == "The room of Turtle"


def test_widgets_of_qt_stay_as_they_are(qtbot) -> None:
    for widget, role in (
        (QPushButton("Run"), QAccessible.Role.Button),
        (QLabel("x"), QAccessible.Role.StaticText),
    ):
        qtbot.addWidget(widget)
        assert QAccessible.queryAccessibleInterface(widget).role() == role


def test_nothing_is_kept_of_widgets_that_are_gone(qtbot) -> None:
    before = len(spoken._kept)
    for _ in range(10):
        widget = QWidget()
        spoken.speak_as(widget, "Pane", "x")
        assert QAccessible.queryAccessibleInterface(widget).role() == QAccessible.Role.Pane
        widget.deleteLater()
        del widget
    gc.collect()
    qtbot.waitUntil(lambda: len(spoken._kept) <= before + 1)
