"""Helpers that run JavaScript programs with nep-js: the conformance adapter, and complete scripts."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.clients.build_lock import locked

PACKAGE = Path(__file__).resolve().parents[2] / "clients" / "javascript"
ADAPTER = PACKAGE / "conformance" / "adapter.mjs"
LONG_S = 60.0

node, npm = shutil.which("node"), shutil.which("npm")


NEEDS_NODE = [
    pytest.mark.skipif(
        node is None or npm is None, reason="needs node and npm, which this computer does not have"
    ),
    pytest.mark.timeout(300),  # the first test installs and builds the package
]


def build_package() -> None:
    """Install the dependencies of nep-js and build it; skip the test if npm can't reach its registry."""
    with locked(Path(tempfile.gettempdir()) / "nep-js-build.lock"):
        if not (PACKAGE / "node_modules" / "zeromq").is_dir():
            run_npm("ci", "--no-audit", "--no-fund", "--silent")
        sources = [*(PACKAGE / "src").rglob("*.ts"), PACKAGE / "tsconfig.json", PACKAGE / "build.mjs"]
        entry = PACKAGE / "dist" / "index.d.mts"
        if not entry.exists() or entry.stat().st_mtime < max(each.stat().st_mtime for each in sources):
            done = subprocess.run(
                [str(npm), "run", "--silent", "build"],
                cwd=PACKAGE,
                capture_output=True,
                text=True,
                timeout=240,
                check=False,
            )
            assert done.returncode == 0, done.stdout + done.stderr


def run_npm(*arguments: str, folder: Path = PACKAGE) -> None:
    """Run npm in the package, or another folder; skip the test when it fails."""
    command = [str(npm), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=240, check=False)
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines() or ["no reason given"]
        pytest.skip(f"npm could not install what nep-js needs: {lines[-1]}")


def run_script(script: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a CommonJS program with nep-js as an installed package until it exits."""
    return subprocess.run(
        prepared(script, folder),
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=LONG_S,
        check=False,
    )


@contextmanager
def running_script(script: str, folder: Path, *arguments: str, **environment: str) -> Iterator[None]:
    """Run a CommonJS program in the background, and kill it at the end."""
    command = [*prepared(script, folder), *arguments]
    process = subprocess.Popen(command, cwd=folder, env={**os.environ, **environment})
    try:
        yield
    finally:
        process.kill()
        process.wait(LONG_S)


def prepared(script: str, folder: Path, name: str = "program.cjs") -> list[str]:
    """Write a program into a folder where it can import nep-js and zeromq; return its command."""
    modules = folder / "node_modules"
    modules.mkdir(exist_ok=True)
    for package, target in (("nep-js", PACKAGE), ("zeromq", PACKAGE / "node_modules" / "zeromq")):
        if not (modules / package).exists():
            (modules / package).symlink_to(target, target_is_directory=True)
    (folder / name).write_text(script, encoding="utf-8")
    return [str(node), name]


class Adapter:
    """The conformance adapter of nep-js as a running process: see clients/javascript/conformance."""

    def __init__(self, master: str) -> None:
        self.messages: list[Mapping[str, Any]] = []
        self._replies: dict[int, Mapping[str, Any]] = {}
        self._news = threading.Condition()
        self._last = 0
        self.process = subprocess.Popen(
            [str(node), str(ADAPTER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "NEP_MASTER": master},
            encoding="utf-8",
        )
        self._reader = threading.Thread(target=self._read, name="test-adapter-reader", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            said = json.loads(line)
            with self._news:
                if "re" in said:
                    self._replies[said["re"]] = said
                else:
                    self.messages.append(said)
                self._news.notify_all()

    def begin(self, do: str, **members: object) -> int:
        """Send a command and return its number."""
        self._last += 1
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"id": self._last, "do": do, **members}) + "\n")
        self.process.stdin.flush()
        return self._last

    def reply(self, number: int) -> Mapping[str, Any]:
        """Wait for the reply to a command."""
        with self._news:
            assert self._news.wait_for(lambda: number in self._replies, LONG_S), f"no reply to {number}"
            return self._replies[number]

    def do(self, do: str, **members: object) -> Mapping[str, Any]:
        """Send a command and return its reply; fails on an error."""
        reply = self.reply(self.begin(do, **members))
        assert "error" not in reply, reply
        return reply

    def wait(self, is_met: Callable[[list[Mapping[str, Any]]], bool], timeout_s: float = LONG_S) -> bool:
        """Wait until the reported messages meet a condition."""
        with self._news:
            return self._news.wait_for(lambda: is_met(self.messages), timeout_s)

    def end(self) -> None:
        """Kill the process if it runs, and close its streams."""
        self.process.kill()
        self.process.wait(LONG_S)
        self._reader.join(LONG_S)
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
