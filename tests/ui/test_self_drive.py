"""Tests of the scripted tour: it waits for conditions, takes screenshots and reports unmet conditions."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtGui import QImage

from app.ui.self_drive import SelfDrive, Step
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]


def drive(qtbot, window: MainWindow, commands: Commands, folder: Path, steps: list[Step]) -> SelfDrive:
    window.show()
    done: list[str] = []
    window.on_closed = lambda: done.append("shut")
    driver = SelfDrive(window, folder, steps)
    qtbot.waitUntil(lambda: bool(done))
    return driver


def test_every_tour_step_waits_for_its_condition_before_its_screenshot(
    qtbot, window: MainWindow, commands: Commands, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    looks: list[int] = []

    def after_three_looks() -> bool:
        looks.append(1)
        return len(looks) > 3

    steps = [
        Step("dark", lambda: commands.run("theme.dark"), after_three_looks, picture="dark", settle_s=0),
        Step(
            "developer",
            lambda: commands.run("layout.developer"),
            lambda: True,
            picture="developer",
            settle_s=0,
        ),
        Step("nothing to keep", lambda: None, lambda: True, settle_s=0),
    ]
    driver = drive(qtbot, window, commands, tmp_path / "tour", steps)
    assert driver.has_succeeded
    assert [path.name for path in driver.pictures] == ["dark.png", "developer.png"]
    assert len(looks) == 4
    shot = QImage(str(driver.pictures[1]))
    assert (shot.width(), shot.height()) == (1440, 900)
    assert shot.pixelColor(2, 500) == window.theme.colour("window")
    assert "2 pictures are in" in capsys.readouterr().out


def test_unmet_tour_condition_is_reported(
    qtbot, window: MainWindow, commands: Commands, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = [
        Step("a robot", lambda: None, lambda: False, timeout_s=0.2),
        Step("never", lambda: None, lambda: True),
    ]
    driver = drive(qtbot, window, commands, tmp_path, steps)
    assert not driver.has_succeeded
    assert (tmp_path / "failed.png").is_file()
    assert capsys.readouterr().err == "step not completed within 0.2 s: a robot\n"
