"""Tests of sending words and simulated events to a virtual robot from its panel."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QMenu

from app.robots.description.description import parse, thing_description
from app.robots.simulated import ROBOT
from app.ui.panels.robots.robot.panel import PANEL, RobotPanel
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press
from tests.ui.sample_data import drawing, pepper

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)


@pytest.fixture
def window(qapp) -> Window:
    made = Window(Session())
    made.session.join(parse(thing_description(ROBOT.thing_model, "Pepper")))
    made.session.fleet.links[0].drawing = drawing()
    return made


@pytest.fixture
def panel(qtbot, window) -> RobotPanel:
    made = window.make(PANEL, (384, 320))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, RobotPanel)
    return made


def menu(panel: RobotPanel) -> QMenu:
    """Return the open menu."""
    return next(each for each in panel.say_bar.findChildren(QMenu) if each.isVisible())


def choose(panel: RobotPanel, words: str) -> None:
    opened = menu(panel)
    (action,) = [each for each in opened.actions() if each.text() == words]
    place = opened.actionGeometry(action).center()
    QTest.mouseClick(opened, Qt.MouseButton.LeftButton, pos=place)


def test_typed_words_are_sent_to_the_robot_with_return(panel, window) -> None:
    assert panel.say_bar.field.placeholderText() == "Say something to Pepper"
    QTest.keyClicks(panel.say_bar.field, " good morning ")
    assert window.session.changes("Pepper") == []
    QTest.keyClick(panel.say_bar.field, Qt.Key.Key_Return)
    assert window.session.changes("Pepper") == [{"say": "good morning"}]
    assert panel.say_bar.field.text() == ""
    QTest.keyClick(panel.say_bar.field, Qt.Key.Key_Return)
    assert window.session.changes("Pepper") == []
    QTest.keyClick(panel.say_bar.field, Qt.Key.Key_Up)
    assert panel.say_bar.field.text() == "good morning"


def test_room_shows_the_words_heard_by_the_robot(panel, window) -> None:
    link = window.session.fleet.links[0]
    link.drawing = {**drawing(), "speech": "", "heard": "good morning"}
    panel.refresh()
    assert panel.view.caption == "Pepper heard “good morning”"
    link.drawing = {**drawing(), "speech": "", "heard": ""}
    panel.refresh()
    assert panel.view.caption == ""


def test_words_that_the_behaviour_waits_for_are_suggested(panel, window) -> None:
    hat = {"type": "robot_pepper_when_heard", "fields": {"ROBOT": "Pepper", "WORD": "quiz"}}
    window.session.document.set_blocks({"blocks": {"blocks": [hat]}})
    press(panel.say_bar.suggestions_button)
    assert [action.text() for action in menu(panel).actions()] == ["quiz", "hello"]
    choose(panel, "quiz")
    assert window.session.changes("Pepper") == [{"say": "quiz"}]
    QTest.keyClick(panel.say_bar.field, Qt.Key.Key_Down)
    assert [action.text() for action in menu(panel).actions()] == ["quiz", "hello"]


def test_events_except_heard_words_are_simulated_from_a_menu(panel, window) -> None:
    press(panel.say_bar.events_button)
    entries = [action.text() for action in menu(panel).actions()]
    assert {"Sees a face", "Bumps into something with its front", "Left hand is touched"} <= set(entries)
    assert not any("hears" in entry for entry in entries)
    choose(panel, "Bumps into something with its front")
    assert window.session.changes("Pepper") == [{"happen": "bumped", "side": "front"}]


def test_say_bar_is_unavailable_for_a_real_robot(qtbot) -> None:
    window = Window(Session())
    window.session.join(pepper("Table"), virtual=False)
    panel = window.make(PANEL, (384, 320))
    qtbot.addWidget(panel)
    assert isinstance(panel, RobotPanel)
    assert not panel.say_bar.isVisibleTo(panel)
