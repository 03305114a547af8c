"""Processes that run next to Studio, with their output by lines and their exit."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.e2e.waiting import LONG_S, until

ROOT = Path(__file__).resolve().parents[2]
END_S = 60.0


class Program:
    """Python process of this repository. Usable as a context manager that ends it."""

    def __init__(self, *arguments: str, environment: Mapping[str, str] | None = None) -> None:
        self._lines: list[str] = []
        self._news = threading.Condition()
        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", **(environment or {})},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
        )
        self._reader = threading.Thread(target=self._read, name="program-reader", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self.process.stdout:
            with self._news:
                self._lines.append(line.rstrip("\n"))

    @property
    def lines(self) -> Sequence[str]:
        """Lines of output so far."""
        with self._news:
            return tuple(self._lines)

    def says(self, words: str, within_s: float = LONG_S) -> str:
        """Wait for a line of output with these words and return it."""
        return until(
            lambda: next((line for line in self.lines if words in line), ""),
            lambda: f"{self.process.args} says {words!r}: {self.lines[-5:]}",
            within_s,
        )

    def end_input(self) -> None:
        """Close the program's standard input, which lets it end."""
        self.process.stdin.close()

    def kill(self) -> None:
        """Kill the process with SIGKILL."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(END_S)

    def interrupt(self) -> None:
        """Send SIGINT, as Ctrl+C does."""
        self.process.send_signal(signal.SIGINT)

    def wait(self, within_s: float) -> int:
        """Wait until the process has ended and its output is read; return its exit code."""
        code = self.process.wait(within_s)
        self._reader.join(END_S)
        return code

    def __enter__(self):
        return self

    def __exit__(self, *_exc: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(END_S)
        self._reader.join(END_S)
        for pipe in (self.process.stdin, self.process.stdout):
            with contextlib.suppress(OSError):
                pipe.close()
