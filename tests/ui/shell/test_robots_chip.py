"""Tests of the robots chip in the app bar."""

from __future__ import annotations

import pytest

from app.ui.shell.bars.app_bar import robots_chip
from tests.ui.shell_parts import robots_in


def chip(*states: str, run: str = "ready", silent: str | None = None) -> tuple[str, str]:
    return robots_chip(robots_in(*states, run=run, silent=silent))


@pytest.mark.parametrize(
    ("state", "run", "words"),
    [
        ("ready", "ready", "Robot 1 ready"),
        ("busy", "ready", "Robot 1 moving"),
        ("ready", "running", "Robot 1 running"),
        ("ready", "paused", "Robot 1 is paused"),
    ],
)
def test_chip_shows_the_state_of_a_single_robot(state: str, run: str, words: str) -> None:
    assert chip(state, run=run) == (words, "ok")


def test_disconnected_robots_are_not_counted() -> None:
    assert chip("away") == ("No robot", "off")
    assert chip("ready", "away") == ("Robot 1 ready", "ok")


def test_several_robots_are_counted() -> None:
    assert chip("ready", "busy", run="running") == ("2 robots", "ok")


def test_unresponsive_robot_is_reported() -> None:
    assert chip("silent") == ("Not responding", "error")
    assert chip("silent", silent="camera silent") == ("Camera silent", "error")
    assert chip("silent", "ready") == ("Robot 1: not responding", "error")
    assert chip("silent", "silent") == ("2 robots not responding", "error")
