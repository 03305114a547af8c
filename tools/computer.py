"""The computer that dev.py runs on, and the only way that it touches it. Standard library only."""

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
END_S = 10.0


class Trouble(Exception):  # noqa: N818 (not a fault of this program, but of the computer it runs on)
    """Something is missing that a person must bring; its text says what to do."""


def _ask(command: Sequence[str]) -> str:
    """What a command prints in English; nothing when it cannot run."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env={**os.environ, "LC_ALL": "C"}
        )
    except OSError:
        return ""
    return done.stdout


def watch(command: Sequence[str], environ: Mapping[str, str], log: Path | None = None) -> int:
    """Run a command to its end and return its exit code; what it says goes to the person, or into `log`.

    Ctrl+C reaches the command too (it is in our terminal's group): it may end in its own order, but must end.
    """
    with open(log, "ab") if log else contextlib.nullcontext() as output:  # noqa: PTH123 (a path or nothing)
        process = subprocess.Popen(command, cwd=ROOT, env=dict(environ), stdout=output, stderr=output)
        try:
            return process.wait()
        except BaseException:
            end(process)
            raise


def end(process: subprocess.Popen[bytes]) -> None:
    """See a process end: by itself, else asked, else killed; END_S in all."""
    for harder in (process.terminate, process.kill):
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(END_S / 2)
            return
        harder()


@dataclass(frozen=True)
class Computer:
    """What we run on, and the only way that we touch it."""

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
        """Whether this is Debian, Ubuntu or a relative."""
        return self.platform == "linux" and bool(self.which("apt-get") and self.which("dpkg-query"))

    @property
    def has_screen(self) -> bool:
        """Whether windows can be shown to a person (Windows and macOS: always)."""
        return self.platform != "linux" or bool(
            self.environ.get("DISPLAY") or self.environ.get("WAYLAND_DISPLAY")
        )


def venv_python(folder: Path, platform: str) -> Path:
    """The interpreter in a virtual environment."""
    return folder / ("Scripts/python.exe" if platform == "win32" else "bin/python")


@contextlib.contextmanager
def timed(what: str) -> Iterator[None]:
    """Say what is being done, and how long it took."""
    print(f"· {what} …", flush=True)
    begin = time.monotonic()
    yield
    print(f"  done in {time.monotonic() - begin:.1f} s", flush=True)
