"""Tests that the commands and programs of README.md and docs/first-programs.md run and don't busy-wait."""

from __future__ import annotations

import os
import re
import shlex
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import psutil
import pytest

import dev
from nep.masters.master import Master
from tests.e2e.programs import ROOT, Program
from tests.e2e.waiting import until

PAGES = ("README.md", "docs/first-programs.md")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
RUNS_UNTIL = "Ctrl+C ends it"
"""Comment after a command that runs until it is interrupted."""
MAX_CPU_SHARE = 0.2

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(
        os.name != "posix", reason="the commands are those of a POSIX shell, and Ctrl+C is a signal"
    ),
]


class Reader:
    """Runner for the commands and programs of a page; programs run until the end of the test."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self.programs: list[Program] = []
        """Those of the library; they don't end by themselves."""
        self.behaviours: list[Program] = []

    def start(self, arguments: Sequence[str], environment: dict[str, str] | None = None) -> Program:
        """Start a Python program, wait for its first line and return it."""
        program = self._stack.enter_context(Program(*arguments, environment=environment))
        until(lambda: program.lines or program.process.poll() is not None, f"{arguments} prints", 40)
        assert program.process.poll() in (None, 0), (arguments, program.lines)
        assert program.lines, f"{arguments} printed nothing"
        return program

    def type(self, line: str) -> None:
        """Run a shell command; check a command that can't run here with `is_known` instead."""
        words, is_endless = shlex.split(line, comments=True), RUNS_UNTIL in line
        match words:
            case ["nep", "master"]:
                nobody_else = {"NEP_MASTER": "127.0.0.1:0", "NEP_GATEWAY": "0"}
                program = self.start(["-m", *words], nobody_else)
                os.environ["NEP_MASTER"] = program.lines[0].split()[-1]
                return
            case ["nep", *_]:
                program = self.start(["-m", *words])
            case ["python", *arguments]:
                self.behaviours.append(self.start(arguments))
                return
            case _:
                assert is_known(words), f"nothing here tells whether this works: {line}"
                return
        if is_endless:
            program.interrupt()
        assert program.wait(60) == (130 if is_endless else 0), (line, program.lines)

    def run(self, source: str) -> None:
        """Start a program listed on a page."""
        self.programs.append(self.start(["-c", source]))


def is_known(words: Sequence[str]) -> bool:
    """Return whether what a command names exists, for commands that would change this computer."""
    match words:
        case ["python3", "dev.py", command]:
            return command in {"demo", *dev.SCRIPTS}
        case ["source", activate]:
            return os.name != "posix" or Path(sys.prefix, *Path(activate).parts[1:]).exists()
        case ["pip", "install", what]:
            extra = what.removeprefix(".").strip("[]")
            return not extra or f"\n{extra} = [" in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return False


def measured(programs: Sequence[Program]) -> tuple[list[float], float]:
    """Return the CPU seconds of each program and the elapsed seconds for two lines of the last program."""

    def cpu_s() -> list[float]:
        return [sum(psutil.Process(each.process.pid).cpu_times()[:2]) for each in programs]

    begin, before, newest = time.monotonic(), cpu_s(), programs[-1]
    printed = len(newest.lines)
    until(lambda: len(newest.lines) > printed + 1, "the last program prints again", 40)
    return [after - used for after, used in zip(cpu_s(), before, strict=True)], time.monotonic() - begin


@pytest.fixture
def virtual_pepper(master: Master) -> Iterator[Program]:
    with Program("-m", "app.robots.simulated", "--name", "Pepper") as program:
        yield program


def test_readme_blocks_run_in_order_print_their_output_and_do_not_busy_wait(
    virtual_pepper: Program, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(
        "NEP_MASTER", os.environ["NEP_MASTER"]
    )  # restored after the test, because pages start masters that change it
    with ExitStack() as stack:
        reader = Reader(stack)
        pages = "\n".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)
        for language, text in BLOCK.findall(pages):
            if language == "python":
                reader.run(text)
            else:
                for line in text.splitlines():
                    reader.type(line)
        used_s, elapsed_s = measured(reader.programs)
        assert all(used < MAX_CPU_SHARE * elapsed_s for used in used_s), (used_s, elapsed_s)
        for program in reader.programs:
            assert program.process.poll() is None, program.lines
        for program in reader.behaviours:
            assert program.wait(60) == 0, program.lines
