"""`Computer`: properties of the computer on which dev.py runs. Uses only the standard library."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from platform import machine

ROOT = Path(__file__).resolve().parents[1]
STOP_TIMEOUT_S = 10.0


class CommandError(Exception):
    """Error that ends a development command; the message says how to fix it."""


def _ask(command: Sequence[str]) -> str:
    # Returns the output in English, or "" if the command can't run.
    try:
        completed = subprocess.run(
            command, capture_output=True, text=True, check=False, env={**os.environ, "LC_ALL": "C"}
        )
    except OSError:
        return ""
    return completed.stdout


def watch(command: Sequence[str], environ: Mapping[str, str], log: Path | None = None) -> int:
    """Run a command and return its exit code; its output goes to the terminal or to `log`.

    Ctrl+C also reaches the command, which is in the same process group. The command then has some
    seconds to stop (`stop_process`).
    """
    with open(log, "ab") if log else contextlib.nullcontext() as output:  # noqa: PTH123 (a path or nothing)
        process = subprocess.Popen(command, cwd=ROOT, env=dict(environ), stdout=output, stderr=output)
        try:
            return process.wait()
        except BaseException:
            stop_process(process)
            raise


def stop_process(process: subprocess.Popen[bytes]) -> None:
    """Wait for a process to exit; terminate it after half of `STOP_TIMEOUT_S` seconds, and then kill it."""
    for stop in (process.terminate, process.kill):
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(STOP_TIMEOUT_S / 2)
            return
        stop()


@dataclass(frozen=True)
class Computer:
    """Computer on which dev.py runs. Tests replace the properties and the functions that run commands.

    Attributes:
        platform: `sys.platform`.
        machine: Processor architecture.
        environ: Environment variables.
        root: True if the process runs as root.
        version: Python version: (major, minor).
        has_ensurepip: True if virtual environments can be created with pip.
        which: Returns the path of a command, or None.
        ask: Runs a command and returns its output.
        do: Runs a command and returns its exit code. See `watch`.
    """

    platform: str = sys.platform
    machine: str = machine()
    environ: Mapping[str, str] = field(default_factory=lambda: dict(os.environ))
    root: bool = hasattr(os, "geteuid") and os.geteuid() == 0
    version: tuple[int, int] = sys.version_info[:2]
    has_ensurepip: bool = importlib.util.find_spec("ensurepip") is not None
    which: Callable[[str], str | None] = shutil.which
    ask: Callable[[Sequence[str]], str] = _ask
    do: Callable[[Sequence[str], Mapping[str, str], Path | None], int] = watch

    @property
    def has_apt(self) -> bool:
        """True if apt is available: Debian, Ubuntu and derivatives."""
        return self.platform == "linux" and bool(self.which("apt-get") and self.which("dpkg-query"))

    @property
    def has_screen(self) -> bool:
        """True if windows can be displayed; always true on Windows and macOS."""
        return self.platform != "linux" or bool(
            self.environ.get("DISPLAY") or self.environ.get("WAYLAND_DISPLAY")
        )


def venv_python(folder: Path, platform: str) -> Path:
    """Return the path of the Python interpreter of a virtual environment."""
    return folder / ("Scripts/python.exe" if platform == "win32" else "bin/python")


@contextlib.contextmanager
def timed(description: str) -> Iterator[None]:
    """Print a description when entering the context, and the elapsed time when leaving it."""
    print(f"· {description} …", flush=True)
    begin = time.monotonic()
    yield
    print(f"  done in {time.monotonic() - begin:.1f} s", flush=True)
