"""Tests that starting a behaviour in another tab stops the running one and reports it."""

from __future__ import annotations

import itertools

from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow
from tests.blocks.samples import number, started, workspace, write
from tests.ui.fakes.processes import Runner

pytest_plugins = ["tests.ui.shell_fixtures"]


def test_starting_a_second_behaviour_reports_the_stopped_behaviour(
    window: MainWindow, commands: Commands
) -> None:
    session = window.session
    runs, seconds = session.runs, itertools.count(0.0, 10.0)
    runs._create_runner, runs._clock = Runner, lambda: next(seconds)
    for name in ("Greeting", "Quiz"):
        if session.document.has_blocks:
            commands.run("file.new")
        session.document.apply_edit(workspace(started(write(number(1)))))
        session.document.name = name
        commands.run("run.run")
    assert "Greeting" in window.toast.text
    assert "Quiz" in window.toast.text


def test_restarting_the_same_behaviour_reports_no_stopped_behaviour(
    window: MainWindow, commands: Commands
) -> None:
    session = window.session
    runs, seconds = session.runs, itertools.count(0.0, 10.0)
    runs._create_runner, runs._clock = Runner, lambda: next(seconds)
    session.document.apply_edit(workspace(started(write(number(1)))))
    for _ in range(2):
        commands.run("run.run")
    assert window.toast.text == ""
