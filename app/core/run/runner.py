"""Execution of a program in a separate process, which can be paused, stepped and stopped at any time."""

from __future__ import annotations

import itertools
import json
import logging
import queue
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import msgspec
from msgspec.structs import replace

from app.blocks.model.program import Program
from app.blocks.runtime.events import (
    AnyEvent,
    BlocksTraced,
    LinePrinted,
    ProgramEnded,
    ProgramPaused,
    ProgramReady,
    ProgramRunning,
    QuestionChanged,
    VariablesChanged,
)
from app.blocks.runtime.events import RunnerEvent as RunnerEvent
from app.core.faults import CONSOLE_EXTRA
from app.core.reports.crash import crash_extra, exit_text, is_crash, split_trace
from app.core.run.child_output import OutputReader, RateLimiter
from app.core.run.child_process import MAX_MEMORY_BYTES, ChildProcess, source_root
from app.core.run.child_process import child_command as child_command
from app.core.run.spare_child import SpareChild
from app.errors import RunnerError
from app.robots.identity import program_of
from nep.i18n import _, ngettext, number

State = Literal["ready", "running", "paused", "stopping", "ended"]

STOP_GRACE_S = 0.04
"""Time in seconds after which a process is killed if its program doesn't stop.

Stopping normally takes well below 100 ms in total.
"""
EXIT_TIMEOUT_S = 2.0
"""Time in seconds after which a process is killed if it doesn't exit after its program has ended."""
MEMORY_CHECK_INTERVAL_S = 0.1
"""Interval between memory checks in seconds."""
PIPE_TIMEOUT_S = 0.5
"""Time in seconds that pipes may stay open after the process has exited, held by child processes."""
MAX_EVENTS_PER_S = 300
_UNLIMITED_EVENTS = (ProgramReady, BlocksTraced, VariablesChanged, QuestionChanged)
"""Events that `MAX_EVENTS_PER_S` doesn't limit, because later ones can't be understood without them."""
MIN_REPORTED_BYTES = 10_000
MAX_ERROR_LENGTH = 100_000
MAX_ERROR_LINES = 200
"""Number of stored lines of error output. A crash in native code writes the stack of each thread."""

_run_numbers = itertools.count(1)
_log = logging.getLogger("studio.runner")
_decode = msgspec.json.Decoder(AnyEvent).decode


class Runner:
    """Process that runs one program.

    ``on_event`` is called in background threads; the last event is always "ended". A program that
    floods Studio with output, uses too much memory or leaves processes behind is limited and reported.
    """

    def __init__(
        self,
        on_event: Callable[[RunnerEvent], object],
        *,
        command: Sequence[str] | None = None,
        max_bytes: int = MAX_MEMORY_BYTES,
        clock: Callable[[], float] = time.monotonic,
        spare: SpareChild | None = None,
    ) -> None:
        # `command` starts the child; the default is this Python or this frozen Studio. A spare is used first.
        self.run = next(_run_numbers)
        self.program_key = uuid.uuid4().hex
        """Key of the program. A Stop that contains the key invalidates the program's commands; until then it
        is secret.
        """
        self.program_id = program_of(self.program_key)
        """Id of the program as a sender of commands."""
        self.state: State = "ready"
        self._on_event = on_event
        self._command = tuple(command) if command is not None else child_command()
        self._clock, self._max_bytes, self._spare = clock, max_bytes, spare
        self._child: ChildProcess | None = None
        self._threads: list[threading.Thread] = []
        self._error_lines: deque[str] = deque(maxlen=MAX_ERROR_LINES)
        self._commands: queue.SimpleQueue[Mapping[str, object] | None] = queue.SimpleQueue()
        self._start_s = 0.0
        self._ended, self._output_ended = threading.Event(), threading.Event()
        self._end_event: ProgramEnded | None = None

    @property
    def pid(self) -> int | None:
        """Process id of the child; None before `start`."""
        return None if self._child is None else self._child.popen.pid

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
        """Start the program.

        Args:
            program: Compiled program.
            robots: Descriptions of the connected robots.
            master: Address of the master, or None.
            name: Name of the behaviour.
            paused: True to pause before the first block.
            pace_s: Delay before each block in seconds.
            owners: Node ids of the robots' programs, by the robot's name. Messages of other nodes are
                ignored.

        Raises:
            RunnerError: The process can't be started, or this runner has already started a program.
        """
        if self._child is not None:
            raise RunnerError(_("this runner has already run its program; create a new one"))
        child = self._spare.take() if self._spare is not None else None
        if child is None:
            child = ChildProcess(self._command, source_root(), max_bytes=self._max_bytes)
        self._child = child
        self._start_s = self._clock()
        self.state = "paused" if paused else "running"
        encoded_program = program.to_json() | ({} if name is None else {"name": name})
        self._commands.put(
            {
                "do": "start",
                "id": self.program_id,
                "program": encoded_program,
                "robots": list(robots),
                "owners": dict(owners or {}),
                "master": master,
                "paused": paused,
                "pace_s": pace_s,
            }
        )
        self._start_thread(self._write, "input")
        errors = self._start_thread(lambda: self._read_errors(child), "errors")
        reader = self._start_thread(lambda: self._read(child), "output")
        # last, because it waits for the others
        self._start_thread(lambda: self._watch(child, reader, errors), "watch")

    def _start_thread(self, target: Callable[[], None], label: str) -> threading.Thread:
        thread = threading.Thread(target=target, name=f"runner {label}", daemon=True)
        self._threads.append(thread)
        thread.start()
        return thread

    def set_pace(self, seconds: float) -> None:
        """Set the delay before each block in seconds; 0 for full speed."""
        self._commands.put({"do": "pace", "pace_s": seconds})

    def set_robots(self, owners: Mapping[str, str], guarded: Mapping[str, Sequence[str]]) -> None:
        """Report new or restarted robots to the program.

        Args:
            owners: Node ids of the robots' programs, by the robot's name.
            guarded: Names of the robots that messages on a topic move, by topic.
        """
        topics = {topic: list(names) for topic, names in guarded.items()}
        self._commands.put({"do": "robots", "owners": dict(owners), "guarded": topics})

    def set_variable(self, python: str, value: str | float | bool) -> None:
        """Set a variable of the running program.

        Args:
            python: Name of the variable in the Python code.
            value: New value.
        """
        self._commands.put({"do": "variable", "python": python, "value": value})

    def set_breakpoints(self, blocks: Sequence[str]) -> None:
        """Set the blocks before which the program pauses."""
        self._commands.put({"do": "breakpoints", "blocks": list(blocks)})

    def pause(self) -> None:
        """Pause the program and its robots. The event "paused" is posted when all have paused."""
        self._commands.put({"do": "pause"})

    def resume(self) -> None:
        """Resume a paused program."""
        if self.state == "paused":
            self.state = "running"
        self._commands.put({"do": "go"})

    def step(self) -> None:
        """Run one block of a paused program."""
        self._commands.put({"do": "step"})

    def answer(self, question: int, text: str) -> None:
        """Answer a question of the program."""
        self._commands.put({"do": "answer", "question": question, "text": text})

    def stop(self) -> None:
        """Stop the program within 100 ms: request it to end, and kill the process if it doesn't.

        Works in every state. Thread-safe. The robots are stopped by `app.core.robots.stop.stopper`.
        """
        child = self._child
        if child is None:
            return
        if self.state != "ended":
            self.state = "stopping"
        self._commands.put({"do": "stop"})
        self._commands.put(None)
        if not child.wait(STOP_GRACE_S):
            child.kill()
            child.wait(EXIT_TIMEOUT_S)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the program has ended and its last event was delivered; return False on timeout.

        Args:
            timeout_s: Timeout in seconds; None to wait without limit.
        """
        return self._ended.wait(timeout_s)

    def close(self) -> None:
        """Stop the program and the threads."""
        self.stop()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout=EXIT_TIMEOUT_S)

    # ---- private

    def _write(self) -> None:
        # In a separate thread, because a child that doesn't respond does not read.
        child = self._child
        if child is None or child.popen.stdin is None:
            return
        try:
            with child.popen.stdin as stream:
                while (command := self._commands.get()) is not None:
                    stream.write(json.dumps(command).encode() + b"\n")
                    stream.flush()
        except (OSError, ValueError):
            return  # the child has ended; the reader reports it

    def _read(self, child: ChildProcess) -> None:
        if child.popen.stdout is None:
            return
        output, limiter = (
            OutputReader(child.popen.stdout, self._ended, self._clock),
            RateLimiter(MAX_EVENTS_PER_S, self._clock),
        )
        for line in output:
            event = self._parse_event(line)
            if event is None:
                output.unexpected_bytes += len(line)
            elif isinstance(event, ProgramEnded):
                self._end_event = event
                break
            elif isinstance(event, _UNLIMITED_EVENTS) or limiter.try_acquire():
                self._deliver(event, limiter)
        self._report_dropped(limiter.rejected_count, output.unexpected_bytes)
        child.popen.stdout.close()
        self._output_ended.set()

    def _deliver(self, event: RunnerEvent, limiter: RateLimiter) -> None:
        if isinstance(event, ProgramRunning | ProgramPaused) and self.state in ("running", "paused"):
            self.state = "paused" if isinstance(event, ProgramPaused) else "running"
        rejected_count = limiter.take_rejected_count()
        if rejected_count:
            self._report_dropped(rejected_count, 0)
        self._on_event(event)

    def _report_dropped(self, event_count: int, unexpected_bytes: int) -> None:
        if event_count:
            text = ngettext(
                "{count} line was dropped: too many at once",
                "{count} lines were dropped: too many at once",
                event_count,
            ).format(count=event_count)
            self._on_event(LinePrinted(run=self.run, text=text))
        if unexpected_bytes >= MIN_REPORTED_BYTES:
            text = _("{size} MB of unexpected output were discarded").format(
                size=number(unexpected_bytes / 1e6, ".1f")
            )
            self._on_event(LinePrinted(run=self.run, text=text))

    def _watch(self, child: ChildProcess, reader: threading.Thread, errors: threading.Thread) -> None:
        while not child.has_ended and not self._output_ended.wait(MEMORY_CHECK_INTERVAL_S):
            child.check()
        self._commands.put(None)  # closes its input, which ends a child that still waits for commands
        is_hung = not child.wait(EXIT_TIMEOUT_S)
        if is_hung:
            child.kill()
            child.wait(EXIT_TIMEOUT_S)
        child.kill_descendants()  # remaining children would hold its pipes open
        reader.join(timeout=PIPE_TIMEOUT_S)
        errors.join(timeout=PIPE_TIMEOUT_S)  # its last output
        was_stopped = self.state == "stopping"
        self.state = "ended"
        end_event = self._end_event
        if end_event is None:
            text = "" if was_stopped else self._failure_reason(child, is_hung=is_hung)
            end_event = ProgramEnded(run=self.run, text=text, is_ok=was_stopped, elapsed_s=self._elapsed())
        self._on_event(end_event)
        self._ended.set()

    def _elapsed(self) -> float:
        return round(self._clock() - self._start_s, 3)

    def _failure_reason(self, child: ChildProcess, *, is_hung: bool) -> str:
        if child.exceeds_memory_limit:
            return _("The program used more than {size} GB of memory and was stopped.").format(
                size=number(self._max_bytes / 1e9)
            )
        if is_hung:
            return _("The program lost its connection to Studio and was stopped.")
        code = child.popen.returncode
        output, trace = split_trace("".join(f"{line}\n" for line in self._error_lines))
        if is_crash(code):
            cause = f"the program's process {exit_text(code)}"
            extra = {**CONSOLE_EXTRA, **crash_extra("behaviour", cause, f"{output}{trace}")}
            _log.error("%s", cause, extra=extra)
        last_line = next((line for line in reversed(output.splitlines()) if line.strip()), "")
        if code < 0:
            cause = _("The program's process was killed (signal {signal})").format(signal=-code)
        else:
            cause = _("The program's process ended with exit code {code}").format(code=code)
        return f"{cause}: {last_line.strip()}." if last_line else f"{cause}."

    def _read_errors(self, child: ChildProcess) -> None:
        # Keeps the last lines; a line without an end is cut.
        stream = child.popen.stderr
        if stream is None:
            return
        try:
            for line in iter(lambda: stream.readline(MAX_ERROR_LENGTH), b""):
                self._error_lines.append(line.decode("utf-8", "replace")[:500].rstrip())
        finally:
            stream.close()

    def _parse_event(self, line: bytes) -> RunnerEvent | None:
        try:
            event = _decode(line)
        except (msgspec.DecodeError, RecursionError):
            return None
        if isinstance(event, ProgramEnded) and event.elapsed_s is None:
            event = replace(event, elapsed_s=self._elapsed())
        return replace(event, run=self.run)
