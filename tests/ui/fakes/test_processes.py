"""Tests that the launcher of virtual robots handles fake processes like real ones."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO

import pytest

from app.core.robots.launcher import Launcher, LaunchFailed, Process, start_process
from tests.ui.fakes.processes import Process as MadeUpProcess

WAITS = """
import os, sys, time
while not os.path.exists(sys.argv[1]):
    time.sleep(0.002)
print("no room left")
sys.exit(3)
"""
"""Program that waits for a file, prints the reason and exits with code 3."""


class RealProcesses:
    """Processes of the operating system that exit when a test creates a file."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.made: list[Process] = []

    def start(self, _command: Sequence[str], environment: Mapping[str, str], log: IO[bytes]) -> Process:
        file = self.folder / f"{len(self.made)}"
        self.made.append(start_process([sys.executable, "-S", "-c", WAITS, str(file)], environment, log))
        return self.made[-1]

    def die(self, place: int) -> None:
        (self.folder / f"{place}").touch()
        self.made[place].wait(60)


class MadeUpProcesses:
    """Fake processes."""

    def __init__(self) -> None:
        self.made: list[MadeUpProcess] = []

    def start(self, _command: Sequence[str], _environment: Mapping[str, str], log: IO[bytes]) -> Process:
        self.made.append(MadeUpProcess(log))
        return self.made[-1]

    def die(self, place: int) -> None:
        self.made[place].die(b"no room left\n", 3)


@pytest.fixture(params=["real", "made up"])
def started_here(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[RealProcesses | MadeUpProcesses]:
    made = RealProcesses(tmp_path) if request.param == "real" else MadeUpProcesses()
    yield made
    for process in made.made:
        process.kill()
        process.wait(60)


@pytest.fixture
def told() -> list[object]:
    return []


@pytest.fixture
def launcher(started_here: RealProcesses | MadeUpProcesses, told: list[object]) -> Iterator[Launcher]:
    made = Launcher("127.0.0.1:1", told.append, start=started_here.start)
    yield made
    made.close()


def test_robots_appear_and_disappear_with_their_processes(launcher: Launcher, started_here, told) -> None:
    assert (launcher.virtual_robots, launcher.process_ids) == ((), ())
    launcher.start_virtual_robot("Pepper")
    launcher.start_virtual_robot("Turtle", "diffdrive")
    launcher.start_virtual_robot("Pepper")  # already running
    assert launcher.virtual_robots == ("Pepper", "Turtle")
    pepper, turtle = started_here.made
    assert launcher.process_ids == (pepper.pid, turtle.pid)
    assert pepper.pid != turtle.pid
    assert (pepper.poll(), turtle.poll()) == (None, None)
    launcher.stop_virtual_robot("Pepper")
    assert (launcher.virtual_robots, pepper.poll()) == (("Turtle",), -15 if os.name == "posix" else 1)
    launcher.check()
    assert told == [], "it was told to go"
    launcher.close()
    assert (launcher.virtual_robots, turtle.poll() is None) == ((), False)


def test_robot_process_that_exits_reports_its_last_output_once(
    launcher: Launcher, started_here, told
) -> None:
    launcher.start_virtual_robot("Pepper")
    launcher.check()
    assert told == []
    started_here.die(0)
    assert (launcher.virtual_robots, launcher.process_ids) == ((), ())
    assert started_here.made[0].poll() == 3
    for _ in range(2):
        launcher.check()
    assert told == [LaunchFailed("Pepper", "The virtual robot Pepper stopped unexpectedly.", "no room left")]
    assert launcher.ended_robots == {"Pepper"}
    launcher.start_virtual_robot("Pepper")
    assert (launcher.virtual_robots, launcher.ended_robots) == (("Pepper",), frozenset())


def test_process_killed_by_another_program_is_reported_as_killed(
    launcher: Launcher, started_here, told
) -> None:
    launcher.start_virtual_robot("Pepper")
    killed = started_here.made[0]
    killed.kill()
    killed.wait(60)
    launcher.check()
    (failed,) = told
    ended = "Another program on this computer stopped it."
    assert failed.detail == (ended if os.name == "posix" else "No reason was reported (exit code 1).")


def test_restarted_process_is_a_new_process(launcher: Launcher, started_here, told) -> None:
    launcher.start_virtual_robot("Pepper")
    launcher.restart_virtual_robot("Pepper")
    before, now = started_here.made
    assert (before.poll(), now.poll()) == (-9 if os.name == "posix" else 1, None)
    assert launcher.process_ids == (now.pid,)
    for process in (before, now):
        process.terminate()
        process.wait(60)
        process.kill()  # an ended process keeps its exit code
    assert [before.poll(), now.poll()] == ([-9, -15] if os.name == "posix" else [1, 1])
    assert told == []


def test_waiting_for_a_running_process_respects_the_timeout(launcher: Launcher, started_here) -> None:
    launcher.start_virtual_robot("Pepper")
    with pytest.raises(subprocess.TimeoutExpired):
        started_here.made[0].wait(0.01)
