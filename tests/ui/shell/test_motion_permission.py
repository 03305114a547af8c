"""Tests of the permission question before a real robot moves, which never covers Stop."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLineEdit, QVBoxLayout, QWidget

from app.core.robots.motion.permission import MotionPermission
from app.core.storage.settings import Settings
from app.robots.description.description import Robot, parse, thing_description
from app.robots.turtle import ROBOT
from app.ui.shell.dialogs.motion_permission import MotionPermissionCard
from app.ui.theme.theme import Theme
from tests.ui.clipping import clipped

ROVER: Robot = replace(parse(thing_description(ROBOT.thing_model, "Rover")), virtual=False)


class Window(QWidget):
    """Fake main window with a focused field and the permission question."""

    def __init__(self, folder) -> None:
        super().__init__()
        self.resize(1000, 700)
        self.field = QLineEdit()
        column = QVBoxLayout(self)
        column.addWidget(self.field)
        self.permission = MotionPermission(Settings(folder))
        self.complaints: list[str] = []
        self.question = MotionPermissionCard(Theme("light"), self, self.permission, self.complaints.append)
        self.done: list[str] = []

    def ask(self, *actions: str) -> None:
        self.permission.request_permission([(ROVER, actions)], lambda: self.done.append("moved"))
        self.question.refresh()


@pytest.fixture
def window(qtbot, tmp_path) -> Window:
    made = Window(tmp_path)
    qtbot.addWidget(made)
    made.show()
    made.field.setFocus()
    return made


def test_permission_question_is_hidden_without_a_request(window) -> None:
    window.question.refresh()
    assert not window.question.isVisible()


def test_permission_question_names_the_moving_actions_and_the_stop_key(window) -> None:
    window.ask("move", "turn")
    question = window.question
    assert question.isVisible()
    assert question.title.text() == "Allow Rover to move?"
    assert "“move” and “turn” move Rover." in question.message.text()
    assert "F12" in question.message.text()
    assert question.always_switch.text() == "Always for Rover"
    assert question.y() > 200  # covers neither the run bar's Stop nor the robot's
    assert window.focusWidget() is question.cancel_button
    assert question.accessibleName() == "Allow Rover to move?"


def test_allowing_motion_runs_the_requested_action(window) -> None:
    window.ask("move")
    QTest.mouseClick(window.question.allow_button, Qt.MouseButton.LeftButton)
    assert window.done == ["moved"]
    assert not window.question.isVisible()
    assert window.focusWidget() is window.field
    assert window.permission.is_allowed(ROVER)


@pytest.mark.parametrize("how", ["button", "escape", "enter"])
def test_not_now_denies_the_requested_motion(window, how) -> None:
    window.ask("move")
    if how == "button":
        QTest.mouseClick(window.question.cancel_button, Qt.MouseButton.LeftButton)
    elif how == "escape":
        QTest.keyClick(window.question.cancel_button, Qt.Key.Key_Escape)
    else:
        QTest.keyClick(window.question.cancel_button, Qt.Key.Key_Space)
    assert window.done == []
    assert not window.question.isVisible()
    assert not window.permission.is_allowed(ROVER)


def test_always_allow_choice_is_saved(window, tmp_path) -> None:
    window.ask("move")
    QTest.mouseClick(
        window.question.always_switch,
        Qt.MouseButton.LeftButton,
        pos=window.question.always_switch.rect().center(),
    )
    assert window.question.always_switch.isChecked()
    QTest.mouseClick(window.question.allow_button, Qt.MouseButton.LeftButton)
    assert MotionPermission(Settings(tmp_path)).is_allowed(ROVER)


def test_always_allow_that_cannot_be_saved_is_reported_and_motion_is_allowed(window, tmp_path) -> None:
    (tmp_path / "settings.json").mkdir()
    window.ask("move")
    window.question.always_switch.setChecked(True)
    QTest.mouseClick(window.question.allow_button, Qt.MouseButton.LeftButton)
    assert "can't save settings" in window.complaints[0]
    assert window.done == ["moved"]


def test_withdrawn_permission_request_closes_the_question(window) -> None:
    window.ask("move")
    window.permission.withdraw()
    window.question.refresh()
    assert not window.question.isVisible()
    assert window.done == []


def test_permission_question_stays_inside_a_small_window(window, qtbot) -> None:
    window.ask("move")
    window.resize(420, 380)
    qtbot.waitUntil(lambda: window.question.width() <= 400)
    inside = window.rect()
    assert inside.contains(window.question.geometry())


def test_permission_answer_works_after_the_previously_focused_widget_was_deleted(window) -> None:
    window.ask("move")
    window.field.deleteLater()
    QCoreApplication.sendPostedEvents(window.field, QEvent.Type.DeferredDelete.value)
    QTest.mouseClick(window.question.allow_button, Qt.MouseButton.LeftButton)
    assert window.done == ["moved"]
    assert not window.question.isVisible()


LONG = [
    "Roboterarm im Labor für Mechatronik und Regelungstechnik",
    "Donaudampfschifffahrtsgesellschaftskapitänsroboter",
    "R" * 100,
]


@pytest.mark.parametrize("name", LONG, ids=lambda each: each[:10])
@pytest.mark.parametrize("size", [(1440, 900), (640, 480)])
@pytest.mark.parametrize("percent", [100, 150])
def test_long_robot_name_is_shown_in_full(qtbot, tmp_path, name, size, percent) -> None:
    """Names of two robots may differ only in their last letter."""
    window = Window(tmp_path)
    qtbot.addWidget(window)
    window.question._theme.set_text_percent(percent)
    window.question._theme.apply()
    window.resize(*size)
    window.show()
    rover = replace(ROVER, name=name)
    window.permission.request_permission([(rover, ("move",))], lambda: None)
    window.question.refresh()
    assert clipped(window.question) == []
    for words in (window.question.title, window.question.message):
        widest = max(
            words.fontMetrics().horizontalAdvance(each) for each in re.split("[ \u200b]", words.text())
        )
        assert widest <= words.width()
        assert name in words.text().replace("\u200b", "")
    assert window.question.always_switch.accessibleName() == f"Always for {name}"
    assert name in window.question.accessibleName()


def test_permission_question_has_its_final_size_when_first_shown(qtbot, tmp_path) -> None:
    window = Window(tmp_path)
    qtbot.addWidget(window)
    window.question._theme.apply()  # polishing the question enlarges its text
    window.show()
    window.ask("move", "turn")
    first = window.question.height()
    for words in (window.question.title, window.question.message):
        assert words.height() >= words.heightForWidth(words.width())
    window.resize(1001, 700)
    assert window.question.height() == first
