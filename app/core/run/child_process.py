"""Process of a program and its child processes, with limited memory. All are killed together."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from app.errors import RunnerError
from nep.i18n import _
from nep.masters.process import NO_CONSOLE
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")

MAX_MEMORY_BYTES = 1_000_000_000
"""Maximum memory of a program and its child processes in bytes."""
CHILD_CHECK_INTERVAL_S = 1.0
"""Interval in seconds between searches for new child processes. Memory is checked more often."""


class ChildProcess:
    """Process of a program, with pipes for input, output and errors. Thread-safe."""

    def __init__(
        self,
        command: Sequence[str],
        cwd: Path | None,
        *,
        max_bytes: int = MAX_MEMORY_BYTES,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        # Raises RunnerError if the process can't be started.
        self._max_bytes, self._clock = max_bytes, clock
        self._child_processes: list[psutil.Process] = []
        self._next_search_s = clock() + CHILD_CHECK_INTERVAL_S
        self.exceeds_memory_limit = False
        """True if the process was killed because of its memory use."""
        try:
            self.popen = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, "PYTHONIOENCODING": "utf-8", "PYTHONUNBUFFERED": "1"},
                cwd=cwd,
                creationflags=NO_CONSOLE,
                # a separate process group, which can be killed as a whole
                start_new_session=os.name == "posix",
            )
        except OSError as error:
            raise RunnerError(_("can't start the program's process: {error}").format(error=error)) from error
        self._process = _process(self.popen.pid)

    @property
    def has_ended(self) -> bool:
        """True if the process has ended."""
        return self.popen.poll() is not None

    def check(self) -> None:
        """Search for new child processes, and kill all processes if together they use too much memory."""
        if self._process is None:
            return
        if self._clock() >= self._next_search_s:
            self._next_search_s = self._clock() + CHILD_CHECK_INTERVAL_S
            self._child_processes = _descendants(self._process)
        if sum(map(_memory_bytes, (self._process, *self._child_processes))) > self._max_bytes:
            self.exceeds_memory_limit = True
            self.kill()

    def wait(self, timeout_s: float) -> bool:
        """Wait until the process has exited; return False on timeout (in seconds)."""
        try:
            self.popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def kill(self) -> None:
        """Kill the process and its child processes."""
        if self._process is not None and not self.has_ended:
            self._child_processes = [*self._child_processes, *_descendants(self._process)]
        self.popen.kill()
        self.kill_descendants()

    def kill_descendants(self) -> None:
        """Kill the remaining child processes, including processes that left the process group."""
        if os.name == "posix":
            with contextlib.suppress(ProcessLookupError, PermissionError):  # the group is empty
                os.killpg(self.popen.pid, signal.SIGKILL)
        for process in self._child_processes:
            try:
                process.kill()  # psutil checks that the id was not reused
            except psutil.Error:
                continue


def child_command() -> tuple[str, ...]:
    """Return the command that runs a program: the current Python, or the executable of a frozen build."""
    if getattr(sys, "frozen", False):
        return (sys.executable, "--child")
    return (sys.executable, "-m", "app.blocks.runtime.child")


def source_root() -> Path | None:
    """Return the folder that contains the package ``app``; None in a frozen build."""
    return None if getattr(sys, "frozen", False) else Path(__file__).resolve().parents[3]


def _process(pid: int) -> psutil.Process | None:
    try:
        return psutil.Process(pid)
    except psutil.Error:
        return None


def _descendants(process: psutil.Process) -> list[psutil.Process]:
    try:
        return process.children(recursive=True)
    except psutil.Error:
        return []


def _memory_bytes(process: psutil.Process) -> int:
    try:
        return int(process.memory_info().rss)
    except psutil.Error:
        return 0
