"""Tests that the window does not report a missing robot while a virtual robot is starting."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QLabel

from app.ui.panels.robots import camera, health, robot, robots, sensors
from app.ui.shell.bars.app_bar import robots_chip
from app.ui.shell.bars.status_bar import StatusFormatter
from app.ui.shell.bars.toast import Toast
from app.ui.theme.theme import Theme
from app.ui.widgets import Button
from tests.ui import fakes
from tests.ui.panel_case import Window

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.mark.parametrize("panel", [health.PANEL, robot.PANEL, robots.PANEL, sensors.PANEL])
def test_panel_shows_that_the_virtual_robot_is_starting(qapp, panel) -> None:
    session = fakes.Session()
    made = Window(session).make(panel, (384, 300))

    def words() -> str:
        made.refresh()
        return "\n".join(each.text() for each in made.empty.findChildren(QLabel))

    before = words()
    assert "No robot" in before
    session.launcher.start_virtual_robot()
    assert "Pepper is starting" in words()
    assert "No robot" not in words()
    session.launcher.stop_virtual_robot("Pepper")
    assert words() == before, "it is not wanted any more"
    made.dispose()
    made.close()


def test_camera_does_not_offer_a_robot_that_is_already_starting(qtbot) -> None:
    session = fakes.Session()
    made = Window(session).make(camera.PANEL, (384, 300))

    def words() -> list[str]:
        made.refresh()
        said = [*made.empty.findChildren(QLabel), *made.empty.findChildren(Button)]
        return [each.text() for each in said if each.text() and not each.isHidden()]

    before = words()
    assert "Use the virtual robot" in before
    session.launcher.start_virtual_robot()
    qtbot.waitUntil(
        lambda: words() == ["Pepper is starting", "A virtual robot takes a few seconds to start."]
    )
    session.launcher.stop_virtual_robot("Pepper")
    qtbot.waitUntil(lambda: words() == before)
    made.dispose()
    made.close()


def test_robots_chip_health_item_and_run_bar_show_that_the_virtual_robot_is_starting() -> None:
    session = fakes.Session()
    facts = StatusFormatter(session)
    said = (robots_chip(session)[0], facts.health()[1], session.runs.view().detail)
    assert said == ("No robot", "No robot", "No robot is connected")
    session.launcher.start_virtual_robot()
    session.tick()
    said = (robots_chip(session)[0], facts.health()[1], session.runs.view().detail)
    assert said == ("Pepper is starting",) * 3


def test_toast_closes_once_its_condition_is_met(qtbot, theme: Theme) -> None:
    window = QLabel()
    qtbot.addWidget(window)
    window.resize(600, 300)
    window.show()
    toast, came = Toast(theme, window), list[bool]()
    toast.show_toast("Starting the virtual Turtle", until=lambda: bool(came))
    toast.refresh()
    assert toast.isVisible()
    came.append(True)
    toast.refresh()
    assert not toast.isVisible()
    toast.show_toast("Copied")
    toast.refresh()
    assert toast.isVisible()


@pytest.mark.parametrize("panel", [camera.PANEL, health.PANEL, robot.PANEL, robots.PANEL, sensors.PANEL])
def test_newly_opened_panel_shows_the_robot_immediately(qtbot, panel) -> None:
    made = panel.make(Window(fakes.Session.full()).context())
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        widget.setParent(made)
    made.show()  # without waiting for the next tick
    assert not made.empty.isVisible(), "for a moment it would say that no robot is connected"
    made.dispose()
