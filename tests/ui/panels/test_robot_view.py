from __future__ import annotations

import time
from dataclasses import replace

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QFocusEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel

from app.blocks.model.stack import Stack
from app.ui.intents import OpenPanel
from app.ui.panels.robots.robot.panel import PANEL, STALE_AFTER_S, RobotPanel
from tests.blocks.samples import block, number, started, workspace
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, press
from tests.ui.sample_data import drawing, pepper


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> RobotPanel:
    made = window.make(PANEL, (384, 288))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, RobotPanel)
    return made


def point(panel: RobotPanel, part: str):
    place = panel.view.position_of(part)
    assert place is not None
    return place.toPoint()


def test_robot_is_drawn_from_its_state_with_name_and_chip(panel, window) -> None:
    assert (panel.title(), panel.chip.text, panel.chip.status) == ("Pepper", "virtual, ready", "ok")
    before = panel.view.grab().toImage()
    link = window.session.fleet.links[0]
    link.drawing = drawing(theta_deg=90.0)
    link.silence_reason = "silent for 4 s"
    panel.refresh()
    assert panel.view.grab().toImage() != before
    assert panel.chip.status == "warn"
    assert window.session.looked_at == ["Pepper"]


def test_unchanged_state_is_not_repainted(panel, window, monkeypatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(panel.view, "update", lambda: asked.append(1))
    link = window.session.fleet.links[0]
    link.drawing = dict(link.drawing)  # another message with equal content
    panel.refresh()
    assert asked == []
    link.drawing = drawing(x=1.0)
    panel.refresh()
    assert asked == [1]


@pytest.mark.parametrize("how", ["away", "mute", "old"])
def test_robot_without_recent_state_is_grey_and_has_no_speech_bubble(panel, window, monkeypatch, how) -> None:
    link = window.session.fleet.links[0]
    link.drawing = drawing(speech="Hello!")
    panel.refresh()
    speaking = panel.view.grab().toImage()
    assert panel.view.accessibleDescription() == "Hello!"
    now = time.monotonic()
    if how == "old":
        monkeypatch.setattr(time, "monotonic", lambda: now + STALE_AFTER_S + 0.1)
    elif how == "mute":
        link.is_unresponsive = True
    else:
        link.is_connected = False
    panel.refresh()
    assert panel.view.is_stale
    assert panel.view.accessibleDescription() == ""
    grey = panel.view.grab().toImage()
    link.drawing = drawing()
    panel.view.show_state(link.drawing)
    assert panel.view.grab().toImage() == grey  # no speech bubble
    monkeypatch.undo()
    link.is_connected, link.is_unresponsive, link.drawing = True, False, drawing(speech="Hello!")
    panel.refresh()
    assert panel.view.grab().toImage() == speaking
    assert panel.view.accessibleDescription() == "Hello!"


@pytest.mark.parametrize("part", ["head", "left_hand", "right_hand"])
def test_pressing_a_body_part_touches_the_part_until_released(panel, window, part) -> None:
    QTest.mousePress(panel.view, Qt.MouseButton.LeftButton, pos=point(panel, part))
    assert window.session.changes("Pepper") == [{"touch": part, "down": True}]
    QTest.mouseRelease(panel.view, Qt.MouseButton.LeftButton, pos=point(panel, part))
    assert window.session.changes("Pepper") == [{"touch": part, "down": False}]


def test_robot_is_touched_with_the_keyboard(panel, window) -> None:
    QTest.keyPress(panel.view, Qt.Key.Key_H)
    QTest.keyRelease(panel.view, Qt.Key.Key_H)
    assert [change["down"] for change in window.session.changes("Pepper")] == [True, False]


def test_space_touches_the_head_while_pressed(panel, window) -> None:
    QTest.keyPress(panel.view, Qt.Key.Key_Space)
    assert window.session.changes("Pepper") == [{"touch": "head", "down": True}]
    QTest.keyRelease(panel.view, Qt.Key.Key_Space)
    assert window.session.changes("Pepper") == [{"touch": "head", "down": False}]
    QTest.keyPress(panel.view, Qt.Key.Key_L)
    QApplication.sendEvent(panel.view, QFocusEvent(QEvent.Type.FocusOut))
    assert window.session.changes("Pepper")[-1] == {"touch": "left_hand", "down": False}
    QTest.keyRelease(panel.view, Qt.Key.Key_L)
    assert window.session.changes("Pepper") == [], "it is let go once"


def test_ball_is_dragged_over_the_floor(panel, window) -> None:
    start = point(panel, "ball")
    QTest.mousePress(panel.view, Qt.MouseButton.LeftButton, pos=start)
    end = start + (point(panel, "head") - start) * 0.2
    end.setY(start.y() + 8)
    QTest.mouseMove(panel.view, end)
    QTest.mouseRelease(panel.view, Qt.MouseButton.LeftButton, pos=end)
    moves = window.session.changes("Pepper")
    assert moves
    assert moves[-1]["move"] == "ball"
    assert moves[-1]["y"] > -1.65  # to the right
    assert -3 <= moves[-1]["x"] <= 3


def test_press_outside_all_objects_has_no_effect(panel, window) -> None:
    QTest.mouseClick(panel.view, Qt.MouseButton.LeftButton, pos=panel.view.rect().topLeft())
    assert window.session.changes("Pepper") == []


def test_reset_button_sends_a_reset_to_the_robot(panel, window) -> None:
    panel.reset_button.show()
    press(panel.reset_button)
    assert window.session.changes("Pepper") == [{"reset": True}]


def test_panel_without_a_robot_offers_the_virtual_robot(qtbot, qapp) -> None:
    window = Window(Session())
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    press(button(panel, "Use the virtual robot"))
    assert window.commands == ["robots.virtual"]
    window.session.join(pepper("Ada"))
    panel.refresh()
    assert panel.title() == "Ada"


def test_real_robot_has_a_link_to_its_actions_instead_of_a_drawing(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.join(pepper("Turtle"), virtual=False)
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    assert isinstance(panel, RobotPanel)
    assert not panel.reset_button.isVisibleTo(panel)
    press(button(panel, "Show actions"))
    assert window.commands == [OpenPanel("robots")]
    panel.dispose()
    assert window.session.looked_at == []


@pytest.mark.parametrize(
    ("kept", "words"),
    [
        (lambda sensor: True, "Use its camera and sensors to see its state."),
        (lambda sensor: sensor.is_image, "Use its camera to see its state."),
        (lambda sensor: not sensor.is_image, "Use its sensors to see its state."),
        (lambda sensor: False, "This robot reports no state, but you can try its actions."),
    ],
)
def test_hint_for_a_robot_without_a_drawing_mentions_only_available_sensors(qtbot, kept, words) -> None:
    window = Window(Session())
    whole = pepper("Table")
    robot = replace(whole, virtual=False, sensors=tuple(sensor for sensor in whole.sensors if kept(sensor)))
    window.session.join(robot, virtual=False)
    panel = window.make(PANEL, (384, 288))
    qtbot.addWidget(panel)
    assert words in [shown.text() for shown in panel.empty.findChildren(QLabel)]


@pytest.mark.parametrize("is_tried", [False, True])
def test_run_resets_robots_to_the_start_position_and_a_tried_block_does_not(qapp, is_tried: bool) -> None:
    session = Session.full()
    turn = block("robot_virtual_pepper_do_turn", "t", ROBOT="Pepper", DIRECTION="left", ANGLE=number(90))
    session.document.apply_edit(workspace(started(turn)))
    if is_tried:
        session.runs.try_stack(Stack("t"))
    else:
        session.runs.run()
    assert session.runs.active
    assert session.changes("Pepper") == ([] if is_tried else [{"start": ["Pepper"]}])
