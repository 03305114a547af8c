"""Programs that behave badly: memory, floods, no ends of lines, closed pipes, processes left behind."""

from __future__ import annotations

import os
import sys
import threading
import time

import psutil
import pytest

from app.core.child_output import LONGEST_LINE, Gate, Output
from app.core.runner import EVENTS_PER_S, Runner
from tests.core.test_runner import LONG_S, Heard, heard, program, stop_within_s, timed_stop

__all__ = ["heard"]
ENDED = 'print(\'{"is": "ended", "ok": true, "elapsed_s": 1.0}\', flush=True)'
GIGABYTE = "import os\nfor _ in range(1000):\n    os.write(1, b'y\\n' * 500_000)\n"
PRINTS = 'import sys\nwhile True:\n    sys.stdout.write(\'{"is": "print", "text": "x"}\\n\')\n'
NO_END = f"import os\nfor _ in range(20):\n    os.write(1, b'{{\"is\"' + b'x' * 500_000)\nprint()\n{ENDED}"
CLOSES = "import os, threading\nos.close(1)\nthreading.Event().wait(60)"
EATS = (
    "held = [bytearray(b'x' * 20_000_000) for _ in range(40)]\nimport threading\nthreading.Event().wait(60)"
)
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
    return [event.text for event in heard.events if event.kind == "print"]


# ---- memory ----------------------------------------------------------------------------------------


def test_a_program_that_eats_memory_is_ended_and_says_so(started, heard) -> None:
    started(EATS, most_bytes=200_000_000)
    ended = heard.until("ended")
    assert not ended.ok
    assert ended.text == "The program used more than 0.2 GB of memory and was ended."


# ---- floods ----------------------------------------------------------------------------------------


def test_a_gigabyte_of_output_is_counted_and_stop_works_at_once(started, heard) -> None:
    me = psutil.Process()
    before = me.memory_info().rss
    runner = started(GIGABYTE)
    pause, late = threading.Event(), 0.0
    for _ in range(100):  # what a window's timer would feel
        began = time.monotonic()
        pause.wait(0.01)
        late = max(late, time.monotonic() - began - 0.01)
    assert runner.state == "running"  # it is not through: its pipe makes it wait
    assert timed_stop(runner) < stop_within_s()
    assert heard.until("ended").ok
    assert late < 0.25
    assert me.memory_info().rss - before < 60_000_000
    (told,) = printed(heard)
    assert told.endswith(" MB that no block wrote were left out")
    assert float(told.split()[0]) > 1


def test_a_flood_of_lines_is_thinned_out_and_counted(started, heard) -> None:
    runner = started(PRINTS)
    began = time.monotonic()
    heard.until("print", text="x")
    pause = threading.Event()
    while time.monotonic() - began < 2.2:
        pause.wait(0.05)
    assert timed_stop(runner) < stop_within_s()
    assert runner.wait(LONG_S)
    seconds = time.monotonic() - began + 1
    assert printed(heard).count("x") <= EVENTS_PER_S * (seconds + 1)
    left_out = [text for text in printed(heard) if text.endswith("lines were left out: too many at once")]
    assert left_out
    assert len(left_out) < 10


def test_a_line_without_end_is_left_out_and_what_follows_is_read(started, heard) -> None:
    started(NO_END)
    assert heard.until("ended").elapsed_s == 1.0
    assert printed(heard) == ["10.0 MB that no block wrote were left out"]


def test_errors_without_end_are_bounded(started, heard) -> None:
    started(
        "import os\nfor _ in range(50):\n    os.write(2, b'e' * 1_000_000)\nraise SystemExit('last words')"
    )
    assert "last words" in heard.until("ended").text


# ---- pipes and processes ---------------------------------------------------------------------------


def test_a_program_that_closes_its_output_is_ended(started, heard) -> None:
    started(CLOSES)
    assert heard.until("ended").text == "The program closed its line to Studio and was ended."


def child_of(heard: Heard, runner: Runner) -> psutil.Process:
    deadline = time.monotonic() + LONG_S
    while not runner._errors:
        assert time.monotonic() < deadline
        threading.Event().wait(0.01)
    return psutil.Process(int(runner._errors[0].split()[1]))


def gone(process: psutil.Process) -> bool:
    try:
        process.wait(5)
    except psutil.TimeoutExpired:
        return False
    return True


@pytest.mark.parametrize("end", ["stop", "by itself"])
def test_processes_that_it_started_end_with_it(started, heard, end) -> None:
    runner = started(FORKS.format(new=False, wait=60 if end == "stop" else 0.3))
    left = child_of(heard, runner)
    if end == "stop":
        assert timed_stop(runner) < stop_within_s()
    heard.until("ended")  # although its child holds the pipe
    assert gone(left)


@pytest.mark.skipif(os.name != "posix", reason="sessions are of POSIX")
def test_a_process_that_has_left_its_group_ends_too(started, heard) -> None:
    runner = started(FORKS.format(new=True, wait=60))
    left = child_of(heard, runner)
    assert timed_stop(runner) < stop_within_s() + 0.1  # they are looked for first
    heard.until("ended")
    assert gone(left)


# ---- the parts -------------------------------------------------------------------------------------


class Pipe:
    """A pipe whose chunks a test chooses."""

    def __init__(self, *chunks: bytes) -> None:
        self.chunks = list(chunks)

    def read1(self, _size: int) -> bytes:
        return self.chunks.pop(0) if self.chunks else b""


def test_lines_are_put_together_and_the_rest_is_counted() -> None:
    pipe = Pipe(b'{"is": "re', b'ady"}\nnoise\n\n{"is": 1}', b"\n", b"tail")
    output = Output(pipe, threading.Event())  # type: ignore[arg-type]
    assert list(output) == [b'{"is": "ready"}', b'{"is": 1}']
    assert output.strange_bytes == len("noise\n") + len("tail")


def test_what_follows_a_line_that_was_too_long_is_none_of_ours_until_its_end() -> None:
    long = b'{"is"' + b"x" * LONGEST_LINE
    output = Output(Pipe(long, b"x", b'{"is": 2}\n{"is": 3}\n'), threading.Event())  # type: ignore[arg-type]
    assert list(output) == [b'{"is": 3}']


def test_the_gate_lets_through_again_after_a_second() -> None:
    now = [0.0]
    gate = Gate(3, lambda: now[0])
    assert [gate.passes() for _ in range(5)] == [True, True, True, False, False]
    assert gate.take_kept_back() == 0  # not while it is shut
    now[0] = 1.1
    assert gate.passes()
    assert gate.take_kept_back() == 2
    assert gate.take_kept_back() == 0
