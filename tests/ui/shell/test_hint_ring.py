"""Tests of the hint ring, which surrounds a button until it is pressed and ignores mouse events."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.ui.shell.hint_ring import HintRing
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, assign_command

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def place(qtbot: QtBot, theme: Theme) -> QWidget:
    made = QWidget()
    made.resize(500, 300)
    button = Button(theme, "Run")
    button.setParent(made)
    button.setGeometry(100, 50, 90, 30)
    assign_command(button, "run.run")
    qtbot.addWidget(made)
    made.show()
    return made


@pytest.fixture
def ring(place: QWidget, theme: Theme) -> HintRing:
    return HintRing(theme, place)


def test_hint_ring_surrounds_the_button_and_follows_its_geometry(
    qtbot: QtBot, place: QWidget, ring: HintRing
) -> None:
    assert ring.point_at("run.run")
    (button,) = place.findChildren(Button)
    assert ring.geometry().contains(QRect(button.pos(), button.size()))
    button.move(200, 120)
    qtbot.waitUntil(lambda: ring.geometry().contains(QRect(QPoint(200, 120), button.size())))


def test_click_passes_through_the_hint_ring_and_hides_the_ring(place: QWidget, ring: HintRing) -> None:
    ring.point_at("run.run")
    (button,) = place.findChildren(Button)
    pressed: list[bool] = []
    button.clicked.connect(lambda: pressed.append(True))
    assert place.childAt(button.geometry().center()) is button
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)
    assert pressed == [True]
    assert ring.isHidden()
    assert ring.target is None


def test_hint_ring_is_hidden_by_escape_and_when_its_button_is_hidden(
    qtbot: QtBot, place: QWidget, ring: HintRing
) -> None:
    ring.point_at("run.run")
    QTest.keyClick(place.windowHandle(), Qt.Key.Key_Escape)
    assert ring.isHidden()
    ring.point_at("run.run")
    (button,) = place.findChildren(Button)
    button.hide()
    qtbot.waitUntil(ring.isHidden)


def test_hint_ring_is_not_shown_for_a_hidden_button(place: QWidget, ring: HintRing) -> None:
    assert not ring.point_at("run.stop")
    assert ring.isHidden()
