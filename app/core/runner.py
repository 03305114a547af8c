"""Runner: a program in a process of its own, which can be paused, stepped, and always ended."""

from __future__ import annotations

import itertools
import json
import os
import queue
import subprocess
import sys
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Literal

from app.blocks.program import Program
from app.core.runner_event import RunnerEvent as RunnerEvent
from app.errors import RunnerError

State = Literal["ready", "running", "paused", "stopping", "ended"]

ASK_S = 0.04
"""How long a stopped program may take to end by itself; then it is killed. Together well below 100 ms."""
END_S = 2.0
"""How long a process whose program has ended may take to end."""
LONGEST_LINE = 1_000_000
ERRORS_KEPT = 40

_runs = itertools.count(1)


class Runner:
    """Runs one program. `on_event` is called in its reader's thread; "ended" comes exactly once, and last."""

    def __init__(
        self,
        on_event: Callable[[RunnerEvent], object],
        *,
        command: Sequence[str] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`command` starts the child, by default this Python or this frozen Studio."""
        self.run = next(_runs)
        self.program_id = f"program-{uuid.uuid4().hex[:8]}"
        """Who the robots' commands are from; a stop names it, so that nothing it sent moves a robot later."""
        self.state: State = "ready"
        self._on_event = on_event
        self._command = tuple(command) if command is not None else child_command()
        self._clock = clock
        self._process: subprocess.Popen[bytes] | None = None
        self._threads: list[threading.Thread] = []
        self._errors: deque[str] = deque(maxlen=ERRORS_KEPT)
        self._orders: queue.SimpleQueue[Mapping[str, object] | None] = queue.SimpleQueue()
        self._began_s = 0.0
        self._ended = threading.Event()
        self._last: RunnerEvent | None = None

    @property
    def pid(self) -> int | None:
        """The child's process id, None before `start`."""
        return None if self._process is None else self._process.pid

    def start(
        self,
        program: Program,
        robots: Sequence[Mapping[str, object]],
        master: str | None,
        *,
        name: str | None = None,
        paused: bool = False,
        pace_s: float = 0.0,
    ) -> None:
        """Start the program; `robots` are the descriptions of those that are connected.

        `pace_s` is slow motion (`set_pace`). RunnerError if its process can't be started.
        """
        if self._process is not None:
            raise RunnerError("this runner has run its program; make another one")
        try:
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, "PYTHONIOENCODING": "utf-8", "PYTHONUNBUFFERED": "1"},
                cwd=_home(),
            )
        except OSError as error:
            raise RunnerError(f"the program's process can't be started: {error}") from error
        self._began_s = self._clock()
        self.state = "paused" if paused else "running"
        kept = program.to_json() | ({} if name is None else {"name": name})
        self._orders.put(
            {
                "do": "start",
                "id": self.program_id,
                "program": kept,
                "robots": list(robots),
                "master": master,
                "paused": paused,
                "pace_s": pace_s,
            }
        )
        self._thread(self._write, "input")
        errors = self._thread(self._read_errors, "errors")
        self._thread(lambda: self._read(errors), "output")  # last: it waits for the errors' end

    def _thread(self, work: Callable[[], None], label: str) -> threading.Thread:
        thread = threading.Thread(target=work, name=f"runner {label}", daemon=True)
        self._threads.append(thread)
        thread.start()
        return thread

    def set_pace(self, seconds: float) -> None:
        """Slow motion: how long each script stays at a block before it is done; 0 for none."""
        self._orders.put({"do": "pace", "pace_s": seconds})

    def pause(self) -> None:
        """Hold the program, and what its robots do; the event "paused" says when all stand still."""
        self._orders.put({"do": "pause"})

    def go_on(self) -> None:
        """Let a paused program go on."""
        if self.state == "paused":
            self.state = "running"
        self._orders.put({"do": "go"})

    def step(self) -> None:
        """Run one block of a paused program."""
        self._orders.put({"do": "step"})

    def stop(self) -> None:
        """End the program: it is asked, and killed if it has not ended at once. It is gone within 100 ms.

        Works in every state and from any thread. Its robots are another matter: `app.core.stopping`.
        """
        process = self._process
        if process is None:
            return
        if self.state != "ended":
            self.state = "stopping"
        self._orders.put({"do": "stop"})
        self._orders.put(None)
        try:
            process.wait(ASK_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(END_S)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the program has ended and its last event was told; whether it has."""
        return self._ended.wait(timeout_s)

    def close(self) -> None:
        """End the program and the threads."""
        self.stop()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout=END_S)

    # ---- inside

    def _write(self) -> None:
        """Send orders; a thread of its own, because a child that hangs does not read."""
        process = self._process
        if process is None or process.stdin is None:
            return
        try:
            with process.stdin as stream:
                while (order := self._orders.get()) is not None:
                    stream.write(json.dumps(order).encode() + b"\n")
                    stream.flush()
        except (OSError, ValueError):
            return  # it has ended; the reader tells

    def _read(self, errors: threading.Thread) -> None:
        process = self._process
        if process is None or process.stdout is None:
            return
        for line in _lines(process.stdout):
            event = self._event(line)
            if event is None:
                continue
            if event.kind == "ended":
                self._last = event
                break
            if event.kind in ("running", "paused") and self.state in ("running", "paused"):
                self.state = "paused" if event.kind == "paused" else "running"
            self._on_event(event)
        self._finish(process, errors)

    def _finish(self, process: subprocess.Popen[bytes], errors: threading.Thread) -> None:
        self._orders.put(None)  # its input ends, and with it a child that still waits for orders
        try:
            code = process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
        if process.stdout is not None:
            process.stdout.close()
        errors.join(timeout=END_S)  # its last words
        was_stopped = self.state == "stopping"
        self.state = "ended"
        last = self._last
        if last is None:
            text = "" if was_stopped else self._why(code)
            last = RunnerEvent("ended", self.run, text=text, ok=was_stopped, elapsed_s=self._elapsed())
        self._on_event(last)
        self._ended.set()

    def _elapsed(self) -> float:
        return round(self._clock() - self._began_s, 3)

    def _why(self, code: int) -> str:
        """Why a process ended that did not say so."""
        words = next((line for line in reversed(self._errors) if line.strip()), "")
        how = f"was killed (signal {-code})" if code < 0 else f"ended with code {code}"
        return f"The program's process {how}{': ' + words.strip() if words else ''}."

    def _read_errors(self) -> None:
        process = self._process
        if process is None or process.stderr is None:
            return
        for line in _lines(process.stderr):
            self._errors.append(line.decode("utf-8", "replace")[:500].rstrip())
        process.stderr.close()

    def _event(self, line: bytes) -> RunnerEvent | None:
        """The event of a line; None for what the child's protocol does not know."""
        try:
            said = json.loads(line)
        except ValueError:
            return None
        if not isinstance(said, Mapping):
            return None
        kind = said.get("is")
        block = said.get("block")
        first = (block,) if isinstance(block, str) else ()
        blocks = (*first, *(each for each in _texts(said.get("blocks")) if each not in first))
        if kind == "ready":
            return RunnerEvent("ready", self.run)
        if kind in ("running", "paused"):
            return RunnerEvent(kind, self.run, blocks=blocks, says=str(said.get("says", "")))
        if kind == "error":
            return RunnerEvent("error", self.run, blocks=first, text=str(said.get("sentence", "")), ok=False)
        if kind == "print":
            return RunnerEvent("print", self.run, text=str(said.get("text", "")))
        if kind == "ended":
            elapsed_s = said.get("elapsed_s")
            return RunnerEvent(
                "ended",
                self.run,
                ok=said.get("ok") is True,
                elapsed_s=float(elapsed_s) if isinstance(elapsed_s, (int, float)) else self._elapsed(),
                silent=_texts(said.get("silent")),
            )
        return None


def child_command() -> tuple[str, ...]:
    """How to start a program's process: this Python, or the frozen Studio as its own child."""
    if getattr(sys, "frozen", False):
        return (sys.executable, "--child")
    return (sys.executable, "-m", "app.blocks.child")


def _home() -> Path | None:
    """Where ``app`` is found when it is not installed."""
    return None if getattr(sys, "frozen", False) else Path(__file__).resolve().parents[2]


def _lines(stream: IO[bytes]) -> Iterator[bytes]:
    """The lines of a pipe until its end; a line that is too long comes in pieces, which are no JSON."""
    return iter(lambda: stream.readline(LONGEST_LINE), b"")


def _texts(said: object) -> tuple[str, ...]:
    return tuple(str(each) for each in said) if isinstance(said, (list, tuple)) else ()
