"""Tests of programs that exceed the memory limit, flood or close their output or leave processes behind."""

from __future__ import annotations

import os
import sys
import threading
import time

import psutil
import pytest

from app.blocks.runtime.events import LinePrinted, ProgramEnded
from app.core.run.child_process import MAX_MEMORY_BYTES
from app.core.run.runner import MAX_EVENTS_PER_S, Runner
from tests.core.run.test_runner import LONG_S, STOP_WITHIN_S, Heard, heard, program, stopping_s

__all__ = ["heard"]
ENDED = 'print(\'{"is": "ended", "ok": true, "elapsed_s": 1.0}\', flush=True)'
GIGABYTE = "import os\nfor _ in range(1000):\n    os.write(1, b'y\\n' * 500_000)\n"
PRINTS = 'import sys\nwhile True:\n    sys.stdout.write(\'{"is": "print", "text": "x"}\\n\')\n'
NO_END = f"import os\nfor _ in range(20):\n    os.write(1, b'{{\"is\"' + b'x' * 500_000)\nprint()\n{ENDED}"
CLOSES = "import os, threading\nos.close(1)\nthreading.Event().wait(60)"
EATS = (
    "held = [bytearray(b'x' * 20_000_000) for _ in range(40)]\nimport threading\nthreading.Event().wait(60)"
)
LETS_EAT = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {EATS!r}])"
FORKS = """
import subprocess, sys, threading
sleeps = "import threading; threading.Event().wait(120)"
made = subprocess.Popen([sys.executable, "-c", sleeps], start_new_session={new})
sys.stderr.write(f"child {{made.pid}}\\n")
sys.stderr.flush()
threading.Event().wait({wait})
"""


def python(text: str) -> tuple[str, ...]:
    return (sys.executable, "-c", text)


@pytest.fixture
def started(heard: Heard):
    made: list[Runner] = []

    def start(text: str, **more: int) -> Runner:
        made.append(Runner(heard, command=python(text), **more))
        made[-1].start(program(), [], None)
        return made[-1]

    yield start
    for each in made:
        each.close()
        assert each.pid is None or not psutil.pid_exists(each.pid)
    assert [t.name for t in threading.enumerate() if t.name.startswith("runner ")] == []


def printed(heard: Heard) -> list[str]:
    return [event.text for event in heard.events if isinstance(event, LinePrinted)]


# ---- memory ----------------------------------------------------------------------------------------


def test_program_over_memory_limit_is_killed_and_reported(started, heard) -> None:
    started(EATS, max_bytes=200_000_000)
    ended = heard.until(ProgramEnded)
    assert not ended.is_ok
    assert ended.text == "The program used more than 0.2 GB of memory and was stopped."


def test_memory_of_child_processes_counts_towards_limit(started, heard) -> None:
    started(LETS_EAT, max_bytes=200_000_000)
    assert heard.until(ProgramEnded).text == "The program used more than 0.2 GB of memory and was stopped."


def test_default_memory_limit_is_one_gigabyte() -> None:
    assert Runner(lambda _event: None)._max_bytes == MAX_MEMORY_BYTES == 1_000_000_000


# ---- floods ----------------------------------------------------------------------------------------


def test_gigabyte_of_output_is_counted_and_stop_works_at_once(started, heard) -> None:
    me = psutil.Process()
    before = me.memory_info().rss
    shares: list[float] = []

    def begin() -> Runner:
        runner, pause = started(GIGABYTE), threading.Event()
        began, worked = time.monotonic(), time.process_time()
        for _ in range(100):  # stands for the timer of the window
            pause.wait(0.01)
        shares.append((time.process_time() - worked) / (time.monotonic() - began))
        assert runner.state == "running"  # not finished: the full pipe blocks the child
        return runner

    began = time.monotonic()
    assert stopping_s(begin) < STOP_WITHIN_S
    seconds = time.monotonic() - began
    assert heard.until(ProgramEnded).is_ok
    assert shares[0] < 0.5  # reading the flood takes less than half of a processor
    assert me.memory_info().rss - before < 60_000_000
    (told, *_) = printed(heard)
    assert told.endswith(" MB of unexpected output were discarded")
    assert 1 < float(told.split()[0]) < 40 * (seconds + 1)  # MB; reading is throttled to 20 MB/s


def test_line_flood_is_throttled_and_counted(started, heard) -> None:
    def begin() -> Runner:
        runner, pause = started(PRINTS), threading.Event()
        heard.until(LinePrinted, text="x", run=runner.run)
        flooded = time.monotonic()
        while time.monotonic() - flooded < 2.2:
            pause.wait(0.05)
        return runner

    began = time.monotonic()
    assert stopping_s(begin) < STOP_WITHIN_S
    heard.until(ProgramEnded)
    seconds = time.monotonic() - began
    assert printed(heard).count("x") <= MAX_EVENTS_PER_S * (seconds + 1)
    left_out = [text for text in printed(heard) if text.endswith("lines were dropped: too many at once")]
    assert left_out
    assert len(left_out) <= seconds + 2  # one per second, and one at the end


def test_endless_line_is_discarded_and_later_lines_are_read(started, heard) -> None:
    started(NO_END)
    assert heard.until(ProgramEnded).elapsed_s == 1.0
    assert printed(heard) == ["10.0 MB of unexpected output were discarded"]


def test_last_line_of_a_large_error_output_is_reported(started, heard) -> None:
    started(
        "import os\nfor _ in range(50):\n    os.write(2, b'e' * 1_000_000)\nraise SystemExit('last words')"
    )
    assert "last words" in heard.until(ProgramEnded).text


# ---- pipes and processes ---------------------------------------------------------------------------


def test_program_that_closes_its_output_is_stopped(started, heard) -> None:
    started(CLOSES)
    assert heard.until(ProgramEnded).text == "The program lost its connection to Studio and was stopped."


def child_of(heard: Heard, runner: Runner) -> int:
    """Wait until the program has started its child process and return the PID, even if it has ended since."""
    deadline = time.monotonic() + LONG_S
    while not runner._error_lines:
        assert time.monotonic() < deadline
        threading.Event().wait(0.01)
    return int(runner._error_lines[0].split()[1])


def gone(pid: int) -> bool:
    """Return whether a process ends in time.

    A zombie counts as ended, because a container without an init never reaps it.
    """

    def has_ended() -> bool:
        try:
            return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return True

    end = time.monotonic() + LONG_S
    while not has_ended() and time.monotonic() < end:
        threading.Event().wait(0.02)
    return has_ended()


@pytest.mark.parametrize("new", [False, True], ids=["in its group", "in a session of its own"])
def test_child_processes_end_with_stop(started, heard, new) -> None:
    left: list[int] = []

    def begin() -> Runner:
        runner = started(FORKS.format(new=new and os.name == "posix", wait=60))
        left.append(child_of(heard, runner))
        return runner

    assert stopping_s(begin) < STOP_WITHIN_S
    heard.until(ProgramEnded)  # although the child process holds the pipe open
    assert all(gone(each) for each in left)


def test_orphaned_child_processes_end_with_the_program(started, heard) -> None:
    left = child_of(heard, started(FORKS.format(new=False, wait=0.3)))
    heard.until(ProgramEnded)
    assert gone(left)
