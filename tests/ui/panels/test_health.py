"""Tests of the Health panel: rows, number of problems and suggested next steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from app.intents import ConnectRobot, OpenDoctor
from app.ui.panels.robots.health import PANEL, HealthPanel
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press
from tests.ui.sample_data import pepper

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def asked(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(asked: Window) -> Iterator[HealthPanel]:
    made = asked.make(PANEL, (384, 300))
    assert isinstance(made, HealthPanel)
    yield made
    made.dispose()
    made.close()


def said(panel: HealthPanel) -> dict[str, str]:
    return {row.title.text(): row.text_label.text() for row in panel.rows}


def test_healthy_robot_shows_a_row_per_fact_and_no_problems(panel, asked) -> None:
    assert said(panel)["Battery"] == "84 %"
    assert said(panel)["Stop"] == "confirmed in 41 ms, at 8:40"
    assert panel.chip.text == ""
    assert not panel.step_button.isVisible()
    assert panel.rows[0].accessibleName() == "Connection"
    assert panel.rows[0].accessibleDescription() == panel.rows[0].text_label.text()
    asked.session.fleet.links[0].last_stop, asked.session.fleet.links[0].last_stop_status = (
        "not confirmed, at 8:41",
        "error",
    )
    panel.refresh()
    assert said(panel)["Stop"] == "not confirmed, at 8:41"


def test_problems_are_counted_and_listed_first(panel, asked) -> None:
    asked.session.fleet.links[0].values["battery"] = 7
    panel.refresh()
    assert (panel.chip.text, panel.chip.status) == ("1 problem", "warn")
    assert panel.rows[0].title.text() == "Battery"
    asked.session.fleet.links[0].is_unresponsive = True
    panel.refresh()
    assert (panel.chip.text, panel.chip.status) == ("2 problems", "error")


@pytest.mark.parametrize(("virtual", "does"), [(True, ConnectRobot("Pepper")), (False, OpenDoctor())])
def test_unresponsive_robot_shows_a_next_step(panel, asked, virtual: bool, does: str) -> None:
    link = asked.session.fleet.links[0]
    link.robot, link.is_unresponsive = replace(link.robot, virtual=virtual), True
    panel.refresh()
    assert panel.step_button.isVisible()
    assert panel.rows[0].y() < panel.step_button.parentWidget().y() < panel.rows[1].y()
    press(panel.step_button)
    assert asked.commands == [does]


def test_health_panel_without_a_robot_suggests_next_steps(qapp) -> None:
    asked = Window(Session())
    panel = asked.make(PANEL, (384, 300))
    assert panel.pages.currentWidget() is panel.empty
    for button in panel.empty._buttons:
        press(button)
    assert asked.commands == ["robots.virtual", "help.doctor"]
    asked.session.join(pepper())
    panel.refresh()
    assert panel.pages.currentWidget() is not panel.empty
    panel.dispose()


def test_panel_follows_the_selected_robot_and_names_the_robot_if_several_are_connected(panel, asked) -> None:
    assert asked.session.looked_at == ["Pepper"]
    assert panel.subtitle() == ""
    asked.session.join(pepper("Turtle"))
    asked.session.fleet.select("Turtle")
    panel.refresh()
    assert asked.session.looked_at == ["Turtle"]
    assert panel.subtitle() == "Turtle"
    panel.dispose()
    assert asked.session.looked_at == []


def test_health_rows_are_rebuilt_when_the_theme_changes(panel) -> None:
    old = panel.rows[0]
    panel.theme_changed()
    panel.refresh()
    assert panel.rows[0] is not old
    assert len(panel.rows) == len(said(panel))


# -- panel position ---------------------------------------------------------------------------------------


def test_health_panel_opens_with_robots_below_the_sensors(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    window.show()
    commands.run("layout.behaviour")
    bench = window.bench
    assert bench is not None
    assert "health" not in bench.open_names()
    commands.run("robots.show")
    health, sensors, robots = (bench.docks[name] for name in ("health", "sensors", "robots"))
    qtbot.waitUntil(lambda: abs(health.height() - 190) <= 1)
    assert abs(sensors.height() - 140) <= 1
    assert health.x() == sensors.x()
    assert health.y() > sensors.y()
    assert robots.isVisible()
    assert not bench.tabifiedDockWidgets(health)


def test_health_panel_opened_in_the_smallest_window_stays_open_in_a_wider_window(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    window.show()
    window.resize(1100, 700)
    commands.run("layout.behaviour")
    bench = window.bench
    assert bench is not None
    commands.run("robots.show")
    docks = bench.docks
    for size in ((1100, 700), (1440, 900)):
        window.resize(*size)
        qtbot.waitUntil(lambda: abs(docks["health"].height() - 190) <= 1)
        qtbot.waitUntil(lambda: abs(docks["sensors"].height() - 140) <= 1)
        assert docks["health"].isVisible()
        assert docks["robot"].height() >= 100
        assert docks["health"].geometry().bottom() <= bench.height()


def test_closed_health_panel_stays_closed_after_the_layout_is_restored(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    window.show()
    commands.run("layout.behaviour")
    bench = window.bench
    assert bench is not None
    commands.run("robots.show")
    bench.docks["health"].close()
    bench.docks["robots"].close()
    commands.run("robots.show")
    assert "health" not in bench.open_names()
    saved = bench.save()
    for name in ("health", "robots"):
        bench.removeDockWidget(bench.docks.pop(name))
    assert bench.restore(saved)
    assert "robots" in bench.open_names()
    assert "health" not in bench.open_names()


def test_health_panel_is_a_tab_when_sensors_share_their_dock(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    window.show()
    commands.run("layout.behaviour")
    bench = window.bench
    assert bench is not None
    bench.tabifyDockWidget(bench.docks["camera"], bench.docks["sensors"])
    commands.run("robots.show")
    assert bench.docks["health"] in bench.tabifiedDockWidgets(bench.docks["sensors"])
