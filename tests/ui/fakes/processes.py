"""Fake processes of virtual robots and programs."""

from __future__ import annotations

import itertools
import subprocess
from collections.abc import Callable, Mapping, Sequence
from typing import IO

from app.blocks.model.program import Program
from app.blocks.runtime.events import (
    BlocksTraced,
    CommandReplaced,
    ProgramEnded,
    ProgramFailed,
    ProgramPaused,
    ProgramReady,
    ProgramRunning,
    RunnerEvent,
)
from app.blocks.runtime.trace import BlockBegan, BlockEnded
from app.core.robots import launcher as processes_module
from app.errors import RunnerError


class Process:
    """Fake process that runs until it is terminated or until a test calls `die`."""

    _ids = itertools.count(1_000_000_000)
    """Process ids higher than those of any operating system."""

    def __init__(self, log: IO[bytes]) -> None:
        self.pid = next(self._ids)
        self._log = log
        self._code: int | None = None

    def die(self, said: bytes, code: int) -> None:
        """Write output to the log and exit with this code."""
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
    """Fake runner of a program whose steps a test reports; it executes commands immediately."""

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
        self._on_event(ProgramReady(run=self.run))
        if paused:
            block, says = next(iter(program.readings.items()), ("", ""))
            self.does(block, says=says)
            self.pause()

    def does(self, *blocks: str, says: str = "") -> None:
        """Report that the program executes these blocks."""
        ended = [BlockEnded(0.0, script, block) for script, block in enumerate(self._blocks)]
        self._blocks, self._says = blocks, says
        began = [BlockBegan(0.0, script, block) for script, block in enumerate(blocks)]
        self._on_event(BlocksTraced(run=self.run, records=(*ended, *began)))
        self._on_event(ProgramRunning(run=self.run, description=says))

    def warns(self, block: str, sentence: str, count: int = 1) -> None:
        """Report that a block lost its robot to another script `count` times."""
        self._on_event(CommandReplaced(run=self.run, block=block, text=sentence, count=count))

    def fails(self, block: str, sentence: str) -> None:
        """Report that a block failed, and end the program."""
        failed = BlockEnded(0.0, 0, block, "failed", sentence)
        self._on_event(BlocksTraced(run=self.run, records=(failed,)))
        self._on_event(ProgramFailed(run=self.run, block=block, text=sentence))
        self.ends(ok=False)

    def ends(self, *, ok: bool = True, why: str = "") -> None:
        """Report the end of the program; ``why`` is the reason if it failed."""
        if self.state != "ended":
            self.state = "ended"
            self._on_event(ProgramEnded(run=self.run, is_ok=ok, text=why))

    def set_pace(self, seconds: float) -> None:
        self.pace_s = seconds

    def set_breakpoints(self, blocks: Sequence[str]) -> None:
        self.breakpoints = tuple(blocks)

    def set_robots(self, owners: Mapping[str, str], guarded: Mapping[str, Sequence[str]]) -> None:
        """Do nothing; the fake program uses no robots."""

    def pause(self) -> None:
        self.state = "paused"
        block = next(iter(self._blocks), None)
        self._on_event(ProgramPaused(run=self.run, block=block, description=self._says))

    def resume(self) -> None:
        self.state = "running"
        self._on_event(ProgramRunning(run=self.run, description=self._says))

    def step(self) -> None:
        self.pause()

    def stop(self) -> None:
        self.ends()


class Launcher(processes_module.Launcher):
    """Real launcher with fake processes that starts no master."""

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
