"""Compile and run the C# client's programs with mono."""

from __future__ import annotations

import os
import queue
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from tests.clients.build_lock import locked

ROOT = Path(__file__).parents[2]
CSHARP = ROOT / "clients" / "csharp"
BUILD = CSHARP / "build"
JSON = Path("/usr/lib/cli/Newtonsoft.Json-5.0/Newtonsoft.Json.dll")
COMPILE = ("mcs", "-langversion:7", "-warnaserror", "-nowarn:0649,0169", "-debug-")
HAS_MONO = sys.platform != "win32" and bool(shutil.which("mcs") and shutil.which("mono") and JSON.exists())
WITHOUT = "mono-mcs, mono-runtime or libnewtonsoft-json5.0-cil is missing: the C# client is not tested"
_LINE_S = 60.0


def sources(folder: str) -> list[Path]:
    """Return all C# sources below a folder of the client."""
    return sorted((CSHARP / folder).rglob("*.cs"))


def library() -> Path:
    """Return ``Nep.dll``, compiled when a source is newer."""
    return _compiled("Nep.dll", sources("src"), ("-target:library", f"-r:{JSON}"))


def program(name: str, *files: Path) -> Path:
    """Return a program that uses the library, compiled when a source is newer."""
    return _compiled(name, [*files], ("-target:exe", f"-r:{library()}", f"-r:{JSON}"))


def _compiled(name: str, files: list[Path], options: tuple[str, ...]) -> Path:
    BUILD.mkdir(exist_ok=True)
    target = BUILD / name
    needed = [*files, *(Path(each[3:]) for each in options if each.startswith("-r:"))]
    with locked(BUILD / "lock"):
        if not target.exists() or any(each.stat().st_mtime > target.stat().st_mtime for each in needed):
            made = BUILD / "new" / name  # mcs names the assembly after its file
            made.parent.mkdir(exist_ok=True)
            done = subprocess.run(
                [*COMPILE, *options, f"-out:{made}", *map(str, files)],
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stdout + done.stderr
            made.replace(target)
    return target


class MonoProgram:
    """Running C# program that reads and writes lines."""

    def __init__(self, path: Path, *args: str, stderr: IO[str] | None = None, **environment: str) -> None:
        self.process = subprocess.Popen(
            ["mono", str(path), *args],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stderr,
            encoding="utf-8",
            env={**os.environ, "MONO_PATH": str(BUILD), **environment},
        )
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line.rstrip("\n"))
        self._lines.put("(exited)")

    def line(self, timeout_s: float = _LINE_S) -> str:
        """Return the next line of its output."""
        return self._lines.get(timeout=timeout_s)

    def is_silent(self) -> bool:
        """Return whether no line waits to be read."""
        return self._lines.empty()

    def say(self, text: str) -> None:
        """Write a line to its input."""
        assert self.process.stdin is not None
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def ask(self, text: str) -> str:
        """Write a line to its input, and return the next line of its output."""
        self.say(text)
        return self.line()

    def end(self, timeout_s: float = _LINE_S) -> int:
        """Close its input and return its exit code."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        return self.process.wait(timeout_s)

    def close(self) -> None:
        """Kill it if it still runs."""
        self.process.kill()
        self.process.wait()
        self._reader.join()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


@contextmanager
def running(
    path: Path, *args: str, stderr: IO[str] | None = None, **environment: str
) -> Iterator[MonoProgram]:
    """Run a program, and kill it at the end."""
    started = MonoProgram(path, *args, stderr=stderr, **environment)
    try:
        yield started
    finally:
        started.close()
