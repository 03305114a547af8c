"""Processes without the computer: of virtual robots, and of the program that runs."""

from __future__ import annotations

import itertools
import subprocess
from collections.abc import Callable, Mapping, Sequence
from typing import IO

from app.blocks import Program
from app.core.robots import launcher as processes_module
from app.core.run.runner import EventKind, RunnerEvent
from app.errors import RunnerError


class Process:
    """Lives until it is told to end, or until a test says that it has ended by itself."""

    _ids = itertools.count(1_000_000_000)
    """No process of any computer has such a number."""

    def __init__(self, log: IO[bytes]) -> None:
        self.pid = next(self._ids)
        self._log = log
        self._code: int | None = None

    def die(self, said: bytes, code: int) -> None:
        """It says something and ends by itself."""
        self._log.write(said)
        self._log.flush()
        self._code = code

    def poll(self) -> int | None:
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        if self._code is None:
            raise subprocess.TimeoutExpired("process", timeout or 0.0)
        return self._code

    def terminate(self) -> None:
        self._code = -15 if self._code is None else self._code

    def kill(self) -> None:
        self._code = -9 if self._code is None else self._code


class Runner:
    """Runs nothing: a test says what the program does. The program itself does what it is told, at once."""

    _runs = itertools.count(1_000_000)
    pid = None

    def __init__(self, on_event: Callable[[RunnerEvent], object]) -> None:
        self.run = next(self._runs)
        self.program_key = f"key of run {self.run}"
        self.state = "ready"
        self.pace_s = 0.0
        self.breakpoints: tuple[str, ...] = ()
        self._on_event = on_event
        self._blocks: tuple[str, ...] = ()
        self._says = ""

    def start(
        self,
        program: Program,
        robots: Sequence[Mapping[str, object]],
        master: str | None,
        *,
        name: str | None = None,
        paused: bool = False,
        pace_s: float = 0.0,
        owners: Mapping[str, str] | None = None,
    ) -> None:
        if self.state != "ready":
            raise RunnerError("this runner has already run its program; create a new one")
        self.state, self.pace_s, self.breakpoints = "running", pace_s, program.breakpoints
        self._tell("ready")
        if paused:
            block, says = next(iter(program.readings.items()), ("", ""))
            self._blocks, self._says = (block,), says
            self.pause()

    def does(self, *blocks: str, says: str = "") -> None:
        """The program is at these blocks now."""
        self._blocks, self._says = blocks, says
        self._tell("running", blocks=blocks, description=says)

    def warns(self, block: str, sentence: str, count: int = 1) -> None:
        """A block lost its robot to another script, so often."""
        self._tell("warning", blocks=(block,), text=sentence, count=count)

    def fails(self, block: str, sentence: str) -> None:
        """A block fails, and with it the program."""
        self._tell("error", blocks=(block,), text=sentence, is_ok=False)
        self.ends(ok=False)

    def ends(self, *, ok: bool = True, why: str = "") -> None:
        """The program comes to its end; ``why`` it did not end well."""
        if self.state != "ended":
            self.state = "ended"
            self._tell("ended", is_ok=ok, text=why)

    def set_pace(self, seconds: float) -> None:
        self.pace_s = seconds

    def set_breakpoints(self, blocks: Sequence[str]) -> None:
        self.breakpoints = tuple(blocks)

    def set_robots(self, owners: Mapping[str, str], guarded: Mapping[str, Sequence[str]]) -> None:
        """The program asks nobody."""

    def pause(self) -> None:
        self.state = "paused"
        self._tell("paused", blocks=self._blocks, description=self._says)

    def resume(self) -> None:
        self.state = "running"
        self._tell("running", blocks=self._blocks, description=self._says)

    def step(self) -> None:
        self.pause()

    def stop(self) -> None:
        self.ends()

    def _tell(self, kind: EventKind, **more: object) -> None:
        self._on_event(RunnerEvent(kind, self.run, **more))  # type: ignore[arg-type]


class Launcher(processes_module.Launcher):
    """The real ones, with processes of a test, and no master of the computer."""

    def __init__(
        self,
        address: str,
        post_event: Callable[[object], None],
        is_there: Callable[[str], bool | None],
        clock: Callable[[], float],
    ) -> None:
        super().__init__(address, post_event, is_there, clock, lambda _command, _more, log: Process(log))
        self.masters_asked_for = 0

    def ensure_master(self) -> None:
        self.masters_asked_for += 1
