"""Tests of starting the virtual robots of the last session at the next start."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.core.robots.last_robots import MAX_ROBOTS, LastRobots
from app.core.storage.settings import Settings


class Launcher:
    """Fake launcher that records requested robots and starts none."""

    def __init__(self) -> None:
        self.models_by_name: dict[str, str] = {}

    def start_virtual_robot(self, name: str = "Pepper", model: str = "pepper") -> None:
        self.models_by_name[name] = model


def next_start(folder: Path) -> dict[str, str]:
    """Return the robots that a start of Studio requests, as models by name."""
    launcher = Launcher()
    LastRobots(Settings(folder)).start(launcher)
    return launcher.models_by_name


def test_running_virtual_robots_are_restored_and_stopped_ones_are_not(tmp_path: Path) -> None:
    robots, launcher = LastRobots(Settings(tmp_path)), Launcher()
    assert next_start(tmp_path) == {}
    launcher.start_virtual_robot()
    launcher.start_virtual_robot("Turtle", "diffdrive")
    robots.save(launcher)
    assert next_start(tmp_path) == {"Pepper": "pepper", "Turtle": "diffdrive"}
    del launcher.models_by_name["Pepper"]
    robots.save(launcher)
    assert next_start(tmp_path) == {"Turtle": "diffdrive"}
    launcher.models_by_name.clear()
    robots.save(launcher)
    assert next_start(tmp_path) == {}


def test_start_without_restoring_robots_keeps_the_saved_list(tmp_path: Path) -> None:
    Settings(tmp_path).virtual_robots = {"Pepper": "pepper"}
    LastRobots(Settings(tmp_path)).save(Launcher())
    assert next_start(tmp_path) == {"Pepper": "pepper"}


def test_robots_are_not_restored_when_disabled(tmp_path: Path) -> None:
    Settings(tmp_path).virtual_robots = {"Pepper": "pepper"}
    settings = Settings(tmp_path)
    assert settings.restarts_robots
    settings.restarts_robots = False
    assert next_start(tmp_path) == {}
    settings.restarts_robots = True
    assert next_start(tmp_path) == {"Pepper": "pepper"}


@pytest.mark.parametrize(
    "kept", [None, [], {"": "pepper"}, {"Pepper": "toaster"}, {"Pepper": 3}, {"Pepper": ["pepper"]}]
)
def test_damaged_list_of_last_robots_starts_no_robot(tmp_path: Path, kept: object) -> None:
    (tmp_path / "settings.json").write_text(json.dumps({Settings.virtual_robots.key: kept}))
    assert next_start(tmp_path) == {}


def test_number_of_restored_robots_is_limited(tmp_path: Path) -> None:
    Settings(tmp_path).virtual_robots = {f"Pepper {number}": "pepper" for number in range(500)}
    assert len(next_start(tmp_path)) == MAX_ROBOTS
