"""What the app bar's chip says of the robots."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from app.ui.shell.bars.app_bar import robots_chip


def chip(*states: str, run: str = "idle", silent: str | None = None) -> tuple[str, str]:
    links = [
        SimpleNamespace(name=f"Robot {number}", state=state, silent=silent)
        for number, state in enumerate(states, 1)
    ]
    runs = SimpleNamespace(
        active=run in {"starting", "running", "paused", "stopping"}, view=lambda: SimpleNamespace(state=run)
    )
    return robots_chip(SimpleNamespace(fleet=SimpleNamespace(links=links), runs=runs))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("state", "run", "words"),
    [
        ("ready", "idle", "Robot 1 ready"),
        ("busy", "idle", "Robot 1 moving"),
        ("ready", "running", "Robot 1 running"),
        ("ready", "paused", "Robot 1 holds still"),
        ("ready", "error", "Robot 1 ready"),
    ],
)
def test_one_robot_says_what_it_does(state: str, run: str, words: str) -> None:
    assert chip(state, run=run) == (words, "ok")


def test_robots_that_went_away_do_not_count() -> None:
    assert chip("away") == ("No robot", "off")
    assert chip("ready", "away") == ("Robot 1 ready", "ok")


def test_several_are_counted() -> None:
    assert chip("ready", "busy", run="running") == ("2 robots", "ok")


def test_one_that_is_silent_is_named() -> None:
    assert chip("silent") == ("Silent", "error")
    assert chip("silent", silent="camera silent") == ("Camera silent", "error")
    assert chip("silent", "ready") == ("Robot 1: silent", "error")
    assert chip("silent", "silent") == ("2 robots silent", "error")
