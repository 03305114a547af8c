"""Tests of slow motion, selected in the run bar or the Run menu, also during a run."""

from __future__ import annotations

from app.ui.shell.bars.run_bar import SPEED_COMMANDS
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]


class Runner:
    """Fake runner that records the pace in seconds."""

    def __init__(self) -> None:
        self.paces: list[float] = []

    def set_pace(self, seconds: float) -> None:
        self.paces.append(seconds)

    def stop(self) -> None: ...


def test_run_bar_offers_the_same_speeds_as_the_menu(window: MainWindow, commands: Commands) -> None:
    offered = [action.text() for action in window.run_bar._speed_menu.actions()]
    assert offered == ["Full speed", "Slow motion: 0.5 s per block", "Very slow: 1.5 s per block"]
    assert commands.actions["run.full_speed"].isChecked()
    assert window.run_bar.pace.accessibleName() == "Speed"


def test_speed_applies_to_the_running_program_and_to_later_programs(
    window: MainWindow, commands: Commands
) -> None:
    runs, runner = window.session.runs, Runner()
    runs._runner = runner  # type: ignore[assignment]
    for name in SPEED_COMMANDS:
        commands.run(name)
    assert runner.paces == [0.0, 0.5, 1.5]
    assert runs.pace_s == 1.5
    window.show_layout("behaviour")
    window.tick()
    assert window.run_bar.pace.isChecked()
    commands.run("run.full_speed")
    window.tick()
    assert not window.run_bar.pace.isChecked()
    runs._runner = None


def test_reset_of_virtual_robots_to_their_start_position_can_be_disabled(
    window: MainWindow, commands: Commands
) -> None:
    fleet, action = window.session.fleet, commands.actions["run.from_start"]
    assert (fleet.resets_at_start, action.isChecked()) == (True, True)
    commands.run("run.from_start")
    assert (fleet.resets_at_start, action.isChecked()) == (False, False)
    commands.run("run.from_start")
    assert (fleet.resets_at_start, action.isChecked()) == (True, True)
