"""A program's process and whatever it starts: bounded in memory, and ended as a whole."""

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

MOST_BYTES = 1_000_000_000
"""How much memory a program may use, together with what it starts."""
FAMILY_S = 1.0
"""How often it is looked what the process has started; its own memory is looked at each time."""


class ChildProcess:
    """The process with its three pipes. Methods may be called from any thread."""

    def __init__(
        self,
        command: Sequence[str],
        cwd: Path | None,
        *,
        most_bytes: int = MOST_BYTES,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Start it; RunnerError if that is impossible."""
        self._most_bytes, self._clock = most_bytes, clock
        self._family: list[psutil.Process] = []
        self._next_family_s = clock() + FAMILY_S
        self.too_large = False
        """Whether it was ended because of its memory."""
        try:
            self.popen = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, "PYTHONIOENCODING": "utf-8", "PYTHONUNBUFFERED": "1"},
                cwd=cwd,
                creationflags=NO_CONSOLE,
                start_new_session=os.name == "posix",  # a group of its own, which can be ended at once
            )
        except OSError as error:
            raise RunnerError(_("can't start the program's process: {error}").format(error=error)) from error
        self._process = _process(self.popen.pid)

    @property
    def ended(self) -> bool:
        """Whether it has gone."""
        return self.popen.poll() is not None

    def look(self) -> None:
        """Notice what it has started, and end it when it uses too much memory."""
        if self._process is None:
            return
        if self._clock() >= self._next_family_s:
            self._next_family_s = self._clock() + FAMILY_S
            self._family = _descendants(self._process)
        if sum(map(_used, (self._process, *self._family))) > self._most_bytes:
            self.too_large = True
            self.kill()

    def wait(self, timeout_s: float) -> bool:
        """Wait for its end; whether it has ended."""
        try:
            self.popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def kill(self) -> None:
        """End it and whatever it has started, without asking."""
        if self._process is not None and not self.ended:
            self._family = [*self._family, *_descendants(self._process)]
        self.popen.kill()
        self.end_family()

    def end_family(self) -> None:
        """End what it has left behind: its group, and those of its children that have left the group."""
        if os.name == "posix":
            with contextlib.suppress(ProcessLookupError, PermissionError):  # nobody is left in it
                os.killpg(self.popen.pid, signal.SIGKILL)
        for process in self._family:
            try:
                process.kill()  # psutil makes sure that it is still the same one
            except psutil.Error:
                continue


def child_command() -> tuple[str, ...]:
    """How to start a program's process: this Python, or the frozen Studio as its own child."""
    if getattr(sys, "frozen", False):
        return (sys.executable, "--child")
    return (sys.executable, "-m", "app.blocks.runtime.child")


def home() -> Path | None:
    """Where ``app`` is found when it is not installed."""
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


def _used(process: psutil.Process) -> int:
    try:
        return int(process.memory_info().rss)
    except psutil.Error:
        return 0
