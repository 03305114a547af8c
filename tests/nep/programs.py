"""Small programs that tests run, suspend and kill as processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from time import monotonic

import psutil

ROOT = Path(__file__).parents[2]
LETTERS = {"PYTHONIOENCODING": "utf-8"} if sys.platform == "win32" else {}
"""Environment for UTF-8 output; on Windows a pipe has the country's code page by default."""
GREETINGS_S = 40.0
"""Seconds that nodes wait for handshakes in a `Program`, and in tests with the fixture `patient`."""
_PATIENT = f"import nep.backends.base; nep.backends.base.HANDSHAKE_TIMEOUT_S = {GREETINGS_S}\n"
"""Code before that of a program. Back ends, which are imported when they are used, copy the value."""


class Program:
    """Running Python program whose input and output are read and written by lines.

    If it `is_patient`, its nodes wait long for handshakes, so that a busy computer doesn't lose their first
    messages.
    """

    def __init__(
        self, code: str, *args: str, before: Sequence[str] = (), is_patient: bool = True, **environment: str
    ) -> None:
        code = textwrap.dedent(code)
        self.process = subprocess.Popen(
            [*before, sys.executable, "-u", "-c", _patient(code) if is_patient else code, *args],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8" if LETTERS else None,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), **LETTERS, **environment},
        )

    def line(self) -> str:
        """Return the next line of output; raise AssertionError with the error output if the program exits."""
        assert self.process.stdout is not None
        said = self.process.stdout.readline()
        if not said:
            assert self.process.stderr is not None
            raise AssertionError(self.process.stderr.read())
        return said.strip()

    def say(self, text: str) -> None:
        """Write a line to the program's input."""
        assert self.process.stdin is not None
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def stop(self) -> None:
        """Suspend the process, as a debugger does; on return none of its threads runs."""
        self.signal(signal.SIGSTOP)
        process = psutil.Process(self.process.pid)
        eventually(lambda: process.status() == psutil.STATUS_STOPPED)

    def end(self, timeout_s: float = 50.0) -> tuple[str, str]:
        """Wait until the program exits; return the rest of its output and error streams."""
        return self.process.communicate(timeout=timeout_s)

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()


def _patient(code: str) -> str:
    """Return the code of a program with a long time limit for handshakes if it creates nodes.

    In ROS, killed subscribers stay registered, and a new publisher waits for them.
    """
    return _PATIENT + code if "nep.node(" in code and '"ros' not in code else code


@contextmanager
def running(
    code: str, *args: str, before: Sequence[str] = (), is_patient: bool = True, **environment: str
) -> Iterator[Program]:
    """Start a program; kill it at the end. `before` is a command prefix that starts it."""
    program = Program(code, *args, before=before, is_patient=is_patient, **environment)
    try:
        yield program
    finally:
        program.kill()


def eventually(is_met: Callable[[], bool], timeout_s: float = 30.0) -> float:
    """Poll `is_met` 100 times a second; return the seconds until it was true, else raise AssertionError."""
    started, never = monotonic(), Event()
    while not is_met():
        assert monotonic() - started < timeout_s, f"not met within {timeout_s} s"
        never.wait(0.01)
    return monotonic() - started


MASTER = """
import sys, nep
with nep.master(sys.argv[1]) as master:
    print(master.address)
    master.wait()
"""
