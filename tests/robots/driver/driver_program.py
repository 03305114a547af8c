"""Driver program in any language, for the contract test over the wire.

The program takes ``--name``, ``--master`` and ``--test-clock``. With the latter its clock does not
advance by itself; each line on its stdin is a number of seconds to advance it, and the program replies
with a line of JSON that has the member ``clock``.
"""

from __future__ import annotations

import json
import shlex
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from app.robots.description.description import Robot, parse
from tests.robots.conftest import Ears, eventually

END_S = 30.0


@dataclass(frozen=True)
class ProgramKind:
    """Kind of a robot with a driver program."""

    command: tuple[str, ...]

    @property
    def model(self) -> str:
        """Model name in the test ids, from the command."""
        return "".join(sign if sign.isalnum() else "_" for sign in self.command[-1].rpartition("/")[2])


def program_kind(command_line: str) -> ProgramKind:
    """Return the kind of a command line, split as by a shell."""
    return ProgramKind(tuple(shlex.split(command_line)))


class ProgramClock:
    """Simulated clock of a driver program."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def advance(self, seconds: float) -> None:
        """Advance the clock and wait for the program's confirmation."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        stdin.write(f"{seconds}\n")
        stdin.flush()
        for line in stdout:
            if line.startswith("{") and "clock" in json.loads(line):
                return
        raise AssertionError(f"{self._process.args} ended")


class ProgramDriver:
    """Running driver program, with the interface of `Driver` that the tests use."""

    body: object = None

    def __init__(self, process: subprocess.Popen[str], description: Mapping[str, Any]) -> None:
        self._process = process
        self.description = description
        self.robot: Robot = parse(description)

    def close(self) -> None:
        """Terminate the program, and check that it exits with code 0."""
        self._process.terminate()
        assert self._process.wait(END_S) == 0


@contextmanager
def running_driver(
    kind: ProgramKind, name: str, master: str, ears: Ears, *, real_clock: bool = False
) -> Iterator[tuple[ProgramDriver, ProgramClock]]:
    """Start the program and wait until its robot is announced."""
    announced = ears.listen("description", "robot/description")
    command = [*kind.command, "--name", name, "--master", master]
    if not real_clock:
        command.append("--test-clock")
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8")
    try:
        eventually(lambda: announced or process.poll() is not None)
        assert announced, f"{command} ended before it announced its robot"
        description = announced[0]
        assert isinstance(description, Mapping)
        yield ProgramDriver(process, description), ProgramClock(process)
    finally:
        process.kill()
        process.communicate()
