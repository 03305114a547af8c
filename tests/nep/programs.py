"""Small programs that tests run as processes of their own, and kill."""

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
"""On Windows a program writes into a pipe with the letters of the country's code page alone."""
GREETINGS_S = 40.0
"""For how long the nodes of a test that uses the fixture `patient` wait for greetings."""


class Program:
    """A Python program that is running. It says things line by line."""

    def __init__(self, code: str, *args: str, before: Sequence[str] = (), **environment: str) -> None:
        self.process = subprocess.Popen(
            [*before, sys.executable, "-u", "-c", textwrap.dedent(code), *args],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8" if LETTERS else None,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), **LETTERS, **environment},
        )

    def line(self) -> str:
        """The next line it prints; an AssertionError when it ends instead."""
        assert self.process.stdout is not None
        said = self.process.stdout.readline()
        if not said:
            assert self.process.stderr is not None
            raise AssertionError(self.process.stderr.read())
        return said.strip()

    def say(self, text: str) -> None:
        """Give it a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def stop(self) -> None:
        """Halt it as a debugger does; when this returns none of its threads runs."""
        self.signal(signal.SIGSTOP)
        process = psutil.Process(self.process.pid)
        eventually(lambda: process.status() == psutil.STATUS_STOPPED)

    def end(self, timeout_s: float = 50.0) -> tuple[str, str]:
        """Wait for its end; what else it printed."""
        return self.process.communicate(timeout=timeout_s)

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()


@contextmanager
def running(code: str, *args: str, before: Sequence[str] = (), **environment: str) -> Iterator[Program]:
    """A program, killed at the end. `before` are the words of a command that starts it."""
    program = Program(code, *args, before=before, **environment)
    try:
        yield program
    finally:
        program.kill()


def eventually(is_met: Callable[[], bool], timeout_s: float = 30.0) -> float:
    """Seconds until `is_met()`; an AssertionError when it takes too long. Looks 100 times a second."""
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
