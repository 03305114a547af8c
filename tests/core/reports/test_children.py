"""Tests that a crashed child process is logged and reported, but not one that ends as expected."""

from __future__ import annotations

import os
import signal
import socket
import sys

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.program import Program
from app.blocks.runtime.events import ProgramEnded, ProgramRunning
from app.core.network.master import MasterStarter
from app.core.reports.crash import Crash
from app.core.robots.launcher import TAIL_CHARS, LaunchFailed
from app.core.run.runner import Runner
from tests.blocks.samples import block, number, started, workspace
from tests.core.robots.test_launcher import World
from tests.core.run.test_runner import Heard

WAIT_S = 60.0
TRACE = (
    b'Fatal Python error: Segmentation fault\n\nCurrent thread 0x1 (most recent call first):\n  File "a.py"\n'
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals")


@pytest.fixture
def crashes(caplog: pytest.LogCaptureFixture):
    def found() -> list[Crash]:
        return [each.crash for each in caplog.records if isinstance(getattr(each, "crash", None), Crash)]

    return found


def waits() -> Program:
    return compile_behaviour(workspace(started(block("control_wait", SECONDS=number(600)))), [])


# ---- the program of a behaviour


def test_crashed_program_process_is_reported_with_its_location(crashes, master) -> None:
    heard = Heard()
    runner = Runner(heard)
    try:
        runner.start(waits(), [], master.address)
        heard.until(ProgramRunning)
        assert runner.pid is not None
        os.kill(runner.pid, signal.SIGSEGV)
        told = heard.until(ProgramEnded).text
    finally:
        runner.close()
    assert told == "The program's process was killed (signal 11).", "nothing of the trace is for the person"
    (crash,) = crashes()
    assert (crash.part, crash.cause) == ("behaviour", "the program's process ended by signal 11 (SIGSEGV)")
    assert "Fatal Python error: Segmentation fault" in crash.text
    assert "scheduler.py" in crash.text


@pytest.mark.parametrize(
    "code", ["raise SystemExit('no room left')", "import os, signal; os.kill(os.getpid(), 15)"]
)
def test_program_exit_by_system_exit_or_sigterm_is_not_a_crash(crashes, code: str) -> None:
    heard = Heard()
    runner = Runner(heard, command=(sys.executable, "-c", code))
    runner.start(waits(), [], None)
    heard.until(ProgramEnded)
    runner.close()
    assert crashes() == []


def test_program_stopped_by_studio_is_not_a_crash(crashes, master) -> None:
    heard = Heard()
    runner = Runner(heard)
    runner.start(waits(), [], master.address)
    heard.until(ProgramRunning)
    runner.stop()
    heard.until(ProgramEnded)
    runner.close()
    assert crashes() == []


# ---- a virtual robot


@pytest.fixture
def world():
    made = World()
    yield made
    made.launcher.close()


def died(world: World, said: bytes, code: int) -> LaunchFailed:
    world.launcher.start_virtual_robot("Turtle", "diffdrive")
    world.processes[0].die(said, code)
    world.launcher.check()
    (told,) = [each for each in world.events if isinstance(each, LaunchFailed)]
    return told


def test_crashed_robot_process_is_reported_with_its_output(crashes, world: World) -> None:
    told = died(world, b"it was hot\n" + TRACE, -11)
    assert told.detail == "it was hot"
    (crash,) = crashes()
    assert (crash.part, crash.cause) == (
        "robot",
        "the process of a virtual robot ended by signal 11 (SIGSEGV)",
    )
    assert "it was hot" in crash.text
    assert TRACE.decode().strip() in crash.text


def test_crashed_robot_process_without_output_has_default_message(crashes, world: World) -> None:
    assert died(world, TRACE, -11).detail == "Another program on this computer stopped it."
    assert len(crashes()) == 1


@pytest.mark.parametrize("code", [1, -signal.SIGTERM])
def test_robot_process_that_ends_with_code_1_or_sigterm_is_not_a_crash(
    crashes, world: World, code: int
) -> None:
    assert died(world, b"x" * 5000, code).detail == "x" * TAIL_CHARS
    assert crashes() == []


def test_robot_stopped_by_user_is_not_a_crash(crashes, world: World) -> None:
    world.launcher.start_virtual_robot("Turtle", "diffdrive")
    world.launcher.stop_virtual_robot("Turtle")
    world.launcher.check()
    assert crashes() == []


# ---- the master


def test_crashed_master_is_reported_at_next_master_start(crashes) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    told: list[str] = []
    start = MasterStarter(address, told.append)
    for number_of_crashes in (0, 1):
        start.ensure_running()
        assert start._thread is not None
        start._thread.join(WAIT_S)
        assert (told, len(crashes())) == ([], number_of_crashes)
        process = start._process
        assert process is not None
        process.send_signal(signal.SIGSEGV if number_of_crashes == 0 else signal.SIGTERM)
        process.wait(WAIT_S)
    start._log_crash()
    (crash,) = crashes()
    assert (crash.part, crash.cause) == ("master", "the master's process ended by signal 11 (SIGSEGV)")
