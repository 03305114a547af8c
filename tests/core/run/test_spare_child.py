"""Tests of the spare child process: Run takes it, and it is discarded when it is stale or not needed."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from app.blocks.runtime.events import ProgramEnded, ProgramRunning
from app.core.parts.programs import SPARE_CHILD_DELAY_S, SpareProgram
from app.core.run.child_process import ChildProcess, child_command, source_root
from app.core.run.runner import Runner
from app.core.run.spare_child import SpareChild
from tests.blocks.fakes import until
from tests.core.reports.test_children import waits
from tests.core.run.test_runner import Heard

IDLE = (sys.executable, "-c", "import sys; sys.stdin.read()")
Make = Callable[..., SpareChild]


@pytest.fixture
def spare() -> Iterator[Make]:
    made: list[SpareChild] = []

    def make(command: tuple[str, ...] = IDLE, source: Path | None = None) -> SpareChild:
        made.append(SpareChild(lambda: ChildProcess(command, source_root()), source))
        return made[-1]

    yield make
    for each in made:
        each.close()


def close(child: ChildProcess | None) -> None:
    assert child is not None
    child.kill()
    child.wait(10)
    for stream in (child.popen.stdin, child.popen.stdout, child.popen.stderr):
        assert stream is not None
        stream.close()


def test_spare_is_started_once_and_taken_once(spare: Make) -> None:
    made = spare()
    threads = [threading.Thread(target=made.prepare) for _ in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    pid = made.pid
    child = made.take()
    assert child is not None
    assert child.popen.pid == pid
    assert made.take() is None
    close(child)


def test_killed_spare_is_not_taken(spare: Make) -> None:
    made = spare()
    made.prepare()
    assert made.pid is not None
    process = psutil.Process(made.pid)
    process.kill()
    until(lambda: process.status() == psutil.STATUS_ZOMBIE)
    assert made.take() is None
    made.prepare()
    close(made.take())


def test_spare_with_older_code_or_environment_is_killed(
    spare: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = tmp_path / "nep" / "a.py"
    module.parent.mkdir()
    module.touch()
    made = spare(source=tmp_path)
    for change in (lambda: os.utime(module, (4e9, 4e9)), lambda: monkeypatch.setenv("LANGUAGE", "xx")):
        made.prepare()
        pid = made.pid
        assert pid is not None
        change()
        assert made.take() is None
        assert not psutil.pid_exists(pid)


def test_no_spare_after_close(spare: Make) -> None:
    closed = spare()
    closed.prepare()
    pid = closed.pid
    assert pid is not None
    closed.close()
    closed.prepare()
    assert closed.pid is None
    assert not psutil.pid_exists(pid)


def test_spare_ends_when_its_input_closes_as_after_the_death_of_studio(spare: Make) -> None:
    made = spare(child_command())
    made.prepare()
    child = made.take()
    assert child is not None
    assert child.popen.stdin is not None
    child.popen.stdin.close()
    assert child.wait(60)
    close(child)


def test_two_runs_in_quick_succession_use_the_spare_and_a_new_process(spare: Make, master) -> None:
    made = spare(child_command())
    made.prepare()
    pid, heard = made.pid, Heard()
    runners = [Runner(heard, spare=made), Runner(heard, spare=made)]
    try:
        for runner in runners:
            runner.start(waits(), [], master.address)
        assert runners[0].pid == pid != runners[1].pid
        for runner in runners:
            heard.until(ProgramRunning, run=runner.run)
            runner.stop()
            heard.until(ProgramEnded, run=runner.run)
    finally:
        for runner in runners:
            runner.close()


def test_stop_ends_a_run_whose_spare_is_still_importing(spare: Make) -> None:
    made, heard = spare(child_command()), Heard()
    made.prepare()
    runner = Runner(heard, spare=made)
    runner.start(waits(), [], None)
    runner.stop()
    assert heard.until(ProgramEnded).is_ok
    runner.close()


class CountedSpare:
    """Spare child that counts the requests to start one."""

    requests = 0

    def prepare_in_background(self) -> None:
        self.requests += 1


class OneProject:
    """Open projects whose current one has blocks, or none."""

    def __init__(self, *, has_blocks: bool) -> None:
        self.current = SimpleNamespace(has_blocks=has_blocks)


@pytest.mark.parametrize(
    ("elapsed_s", "has_blocks", "is_enabled", "requests"),
    [
        (SPARE_CHILD_DELAY_S, True, True, 1),
        (SPARE_CHILD_DELAY_S - 0.1, True, True, 0),
        (SPARE_CHILD_DELAY_S, False, True, 0),
        (SPARE_CHILD_DELAY_S, True, False, 0),
    ],
)
def test_session_requests_a_spare_after_a_delay_if_the_behaviour_has_blocks(
    elapsed_s: float, has_blocks: bool, is_enabled: bool, requests: int
) -> None:
    spare, now_s = CountedSpare(), [100.0]
    part = SpareProgram(spare, OneProject(has_blocks=has_blocks), lambda: now_s[0], is_enabled=is_enabled)
    part.check()  # before the start of the session
    part.start()
    now_s[0] += elapsed_s
    part.check()
    assert spare.requests == requests
