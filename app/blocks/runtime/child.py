"""Process of a program: ``python -m app.blocks.runtime.child``. Exchanges JSON lines with the runner.

Input, one object per line: ``{"do": "start", "program": …, "robots": [descriptions], "owners": {robot: node
id}, "master": …, "name": …, "paused": bool, "pace_s": seconds}``, then ``{"do": "pause" | "go" | "step" |
"stop"}``, ``{"do": "pace", "pace_s": seconds}`` (delay before each block), ``{"do": "variable", "python":
name, "value": …}`` (set a variable), ``{"do": "breakpoints", "blocks": [ids]}``, ``{"do": "answer",
"question": number, "text": …}``, or ``{"do": "robots", "owners": …, "guarded": {topic: [robots]}}`` when
robots connect or restart.

Output: the events of `app.blocks.runtime.events`. When the input is closed, the program stops its robots and
exits.
"""

from __future__ import annotations

import io
import itertools
import json
import os
import queue
import signal
import sys
import threading
import uuid
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TextIO

import msgspec

import nep
from app.blocks.model.program import Program
from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.events import (
    BlocksTraced,
    CommandReplaced,
    LinePrinted,
    ProgramEnded,
    ProgramFailed,
    ProgramPaused,
    ProgramReady,
    ProgramRunning,
    QuestionChanged,
    RunnerEvent,
    VariablesChanged,
    limited,
)
from app.blocks.runtime.network import Network
from app.blocks.runtime.publishing import PublishGuard, guarded_topics
from app.blocks.runtime.questions import ProgramQuestion
from app.blocks.runtime.runtime import Runtime
from app.blocks.runtime.variables import VariableWatch
from app.errors import AppError
from app.robots.client.limits import STOP_TIMEOUT_S
from app.robots.description.description import Robot, parse
from nep.errors import NepError
from nep.i18n import _
from nep.system.crash_trace import enable_crash_trace

_encode = msgspec.json.Encoder().encode

SAMPLE_INTERVAL_S = 1 / 30
VARIABLES_PERIOD_SAMPLES = 3
"""Number of samples (one per `SAMPLE_INTERVAL_S`) per check of the variables, which takes place at 10 Hz."""
FLUSH_TIMEOUT_S = 0.03
MAX_LINE_LENGTH = 2000
MAX_LINES = 10_000
LINES_PER_SAMPLE = 50


class RunnerOutput:
    """Writer of JSON lines to the runner. Thread-safe.

    Printed text is limited: long lines are truncated, excess lines dropped.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._lock = threading.Lock()
        self._printed: queue.Queue[str] = queue.Queue(LINES_PER_SAMPLE)
        self._remaining_lines = MAX_LINES
        self.on_print: Callable[[str], object] = lambda _line: None
        """Called with each line that the program prints."""
        self._dropped_count = 0

    def send(self, event: RunnerEvent) -> None:
        """Write an event as a line; do nothing if the pipe is closed."""
        line = _encode(event).decode()
        with self._lock:
            try:
                self._stream.write(line + "\n")
                self._stream.flush()
            except (OSError, ValueError):
                return

    def print(self, text: str) -> None:
        """Queue the lines of a printed text for `send_printed`; lines are dropped while the queue is full.

        Only the first ``4 * MAX_LINE_LENGTH`` characters of the text are printed.
        """
        for line in text[: MAX_LINE_LENGTH * 4].splitlines() or [""]:
            try:
                self._printed.put_nowait(line[:MAX_LINE_LENGTH])
            except queue.Full:
                self._dropped_count += 1
            self.on_print(line[:MAX_LINE_LENGTH])

    def send_printed(self) -> None:
        """Send the queued lines, at most `MAX_LINES` in total."""
        while self._remaining_lines > 0:
            try:
                self.send(LinePrinted(text=self._printed.get_nowait()))
            except queue.Empty:
                break
            self._remaining_lines -= 1
            if self._remaining_lines == 0:
                text = _("no more lines are shown: the limit of {count} lines has been reached")
                self.send(LinePrinted(text=text.format(count=MAX_LINES)))
        if self._dropped_count:
            text = _("{count} lines were dropped: too many at once")
            self.send(LinePrinted(text=text.format(count=self._dropped_count)))
            self._dropped_count = 0


class PrintStream(io.TextIOBase):
    """Replacement for ``sys.stdout`` that sends printed lines to the runner."""

    def __init__(self, out: RunnerOutput) -> None:
        self._out = out

    def write(self, text: str) -> int:
        """Queue a text without the line breaks at its ends; a text of line breaks only is ignored."""
        if text.strip("\n"):
            self._out.print(text.strip("\n"))
        return len(text)


class Run:
    """Execution of one program.

    Args:
        command: Command "start" of the runner.
        out: Writer to the runner.
    """

    def __init__(self, command: Mapping[str, object], out: RunnerOutput) -> None:
        program = command["program"]
        robots = command["robots"]
        if not isinstance(program, Mapping) or not isinstance(robots, list):
            raise TypeError("a start needs a program and robots")
        self._program = Program.from_json(program)
        self._breakpoints = frozenset(self._program.breakpoints)
        all_robots = tuple(map(parse, robots))
        self._robots: tuple[Robot, ...] = tuple(
            robot for robot in all_robots if robot.name in self._program.robots
        )
        self._owners = _parse_string_map(command.get("owners"))
        self._guard = PublishGuard(guarded_topics(all_robots), self._program.moves)
        self._id = str(command.get("id") or f"program-{uuid.uuid4().hex[:8]}")
        self._master = None if command.get("master") is None else str(command["master"])
        self._out = out
        self._runtime = Runtime(
            out.print,
            labels=self._program.labels,
            readings=self._program.readings,
            on_question=self._send_question,
        )
        self._network: Network | None = None
        self._variables = VariableWatch({}, ())
        self._started_at = self._runtime.scheduler.clock.now()
        self._stop_timeout_s: float | None = None
        self.set_pace(command)
        self._starts_paused = command.get("paused") is True
        if self._starts_paused:
            self._runtime.scheduler.pause()

    def command_handlers(self) -> dict[str, Callable[[], None]]:
        """Return the handlers of commands without arguments, by name of the command."""
        scheduler = self._runtime.scheduler
        return {
            "pause": self.pause,
            "go": self.resume,
            "step": scheduler.step_once,
            "stop": self.stop,
        }

    def pause(self) -> None:
        """Pause the scripts, their waits, and the motions of robots."""
        self._runtime.scheduler.pause()
        if self._network is not None:
            self._network.pause_robots()

    def resume(self) -> None:
        """Resume scripts, waits and motions."""
        if self._network is not None:
            self._network.resume_robots()
        self._runtime.scheduler.resume()

    def _send_question(self, question: ProgramQuestion | None) -> None:
        if question is None:
            self._out.send(QuestionChanged())
        else:
            self._out.send(
                QuestionChanged(question=question.id, text=question.text, choices=question.choices)
            )

    def answer(self, command: Mapping[str, object]) -> None:
        """Pass the user's answer to the open question; command "answer"."""
        question, reply_text = command.get("question"), command.get("text")
        if isinstance(question, int) and isinstance(reply_text, str):
            self._runtime.questions.set_answer(question, reply_text)

    def set_pace(self, command: Mapping[str, object]) -> None:
        """Set the delay before each block; command "pace"."""
        pace_s = command.get("pace_s")
        if isinstance(pace_s, (int, float)):
            self._runtime.scheduler.set_pace(pace_s)

    def update_robots(self, command: Mapping[str, object]) -> None:
        """Update the connected robots and the topics that move them; command "robots"."""
        topics = command.get("guarded")
        if isinstance(topics, Mapping):
            self._guard.set_topics({str(topic): tuple(map(str, names)) for topic, names in topics.items()})
        if self._network is not None:
            self._network.update_owners(_parse_string_map(command.get("owners")))

    def stop(self) -> None:
        """Stop the scripts and make `run` return without waiting for the robots' replies.

        The runner waits for these replies.
        """
        self._stop_timeout_s = 0.0
        self._runtime.scheduler.stop()
        self._runtime.finished.set()

    def run(self) -> bool:
        """Run the program until it ends, then stop the robots; return True if no block failed."""
        with nep.node(f"program {self._program.name}"[:100], master=self._master) as node:
            self._out.on_print = partial(node.log.info, "%s")
            silent_robots = self._run_scripts(self._connect(node))
            error = self._runtime.error
            self._runtime.scheduler.record_stop()
            self._send_trace()
            if error is not None:
                node.log.error("%s", error.sentence)
                self._out.send(ProgramFailed(block=error.block, text=limited(error.sentence)))
            self._send_replacements()
            self._out.send_printed()
            self._send_variables()
            elapsed_s = round(self._runtime.scheduler.clock.now() - self._started_at, 3)
            self._out.send(
                ProgramEnded(is_ok=error is None, elapsed_s=elapsed_s, unresponsive_robots=silent_robots)
            )
            node.close(FLUSH_TIMEOUT_S if self._stop_timeout_s == 0.0 else 2 * STOP_TIMEOUT_S)
        return error is None

    def _connect(self, node: nep.Node) -> Network:
        network = Network(
            node,
            self._id,
            self._robots,
            parts=(*self._program.sensors, *self._program.events),
            publishes=self._program.publishes,
            listens=self._program.listens,
            owners=self._owners,
            clock=self._runtime.scheduler.clock,
        )
        network.guard = self._guard
        self._network = network
        if self._starts_paused:
            network.pause_robots()
        return network

    def _run_scripts(self, network: Network) -> tuple[str, ...]:
        # Returns the robots that haven't confirmed their stop; none if the program was stopped by the user.
        try:
            names = self._runtime.namespace() | {"step": partial(self._step, network)}
            if self._program.shows_value:
                names["write"] = self._runtime.show
            self._variables = VariableWatch(names, self._program.variables)
            code = compile(self._program.runnable, "<behaviour>", "exec")
            exec(code, names)  # noqa: S102 (the compiler's own tree: texts of files are literals only)
            self._started_at = self._runtime.scheduler.clock.now()
            self._runtime.start(network, self._robots)
            self._report_until_finished()
        finally:
            self._runtime.scheduler.stop()
            silent_robots = network.stop_robots(self._stop_timeout_s)
            network.close()
        return silent_robots if self._stop_timeout_s is None else ()

    def _step(self, network: Network, block: str) -> None:
        # With a pace, robots must not keep driving while the block waits. Before a breakpoint
        # everything is paused.
        scheduler = self._runtime.scheduler
        if block in self._breakpoints and not scheduler.is_paused:
            self.pause()
        if scheduler.pace_s:
            with network.suspend_motions():
                scheduler.step(block)
        else:
            scheduler.step(block)

    def set_breakpoints(self, command: Mapping[str, object]) -> None:
        """Replace the breakpoints; command "breakpoints"."""
        blocks = command.get("blocks")
        if isinstance(blocks, list):
            self._breakpoints = frozenset(map(str, blocks))

    def set_variable(self, command: Mapping[str, object]) -> None:
        """Set a variable to a value entered by the user; command "variable"."""
        value = command.get("value")
        if isinstance(value, (str, int, float)):
            self._variables.set_value(str(command.get("python")), value)

    def _send_variables(self) -> None:
        changes = self._variables.changes()
        if changes:
            self._out.send(VariablesChanged(values=tuple(changes)))

    def _send_trace(self) -> None:
        records = self._runtime.scheduler.take_trace()
        if records:
            self._out.send(BlocksTraced(records=records))

    def _report_until_finished(self) -> None:
        runtime, status_text = self._runtime, self._runtime.status_text
        last_report: object = None
        sample_counter = itertools.count()
        while not runtime.finished.wait(SAMPLE_INTERVAL_S):
            if next(sample_counter) % VARIABLES_PERIOD_SAMPLES == 0:
                self._send_variables()
            snapshot = runtime.scheduler.snapshot()
            self._send_trace()
            self._out.send_printed()
            self._send_replacements()
            event: ProgramPaused | ProgramRunning
            if snapshot.is_paused:
                event = ProgramPaused(
                    block=snapshot.next_block,
                    description=limited(status_text.block_text(snapshot.next_block)),
                    warning=limited(status_text.warning(snapshot.blocks)),
                )
            else:
                event = ProgramRunning(description=limited(status_text.text(snapshot.blocks)))
            report = (event, snapshot.blocks if snapshot.is_paused else ())
            if report != last_report:
                last_report = report
                self._out.send(event)

    def _send_replacements(self) -> None:
        for replacement in self._runtime.replacements.take_new():
            event = CommandReplaced(
                block=replacement.block, text=limited(replacement.message), count=replacement.count
            )
            self._out.send(event)


def _parse_string_map(decoded: object) -> dict[str, str]:
    return {str(key): str(value) for key, value in decoded.items()} if isinstance(decoded, Mapping) else {}


def read_commands(stream: TextIO) -> Iterator[Mapping[str, object]]:
    """Yield the runner's commands until the pipe is closed; invalid lines are ignored."""
    for line in stream:
        try:
            command = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(command, Mapping):
            yield command


def main(stdin: TextIO | None = None, stdout: TextIO | None = None) -> int:
    """Run one program and return the exit code.

    Args:
        stdin: Commands of the runner (default: ``sys.stdin``).
        stdout: Output to the runner (default: ``sys.stdout``).

    Returns:
        0 if no block failed, or if the input ended before a program was started; 1 if a block failed or
        the program can't be started.
    """
    out = RunnerOutput(stdout or sys.stdout)
    commands = read_commands(stdin or sys.stdin)
    sys.stdout = PrintStream(out)
    out.send(ProgramReady())
    command = next((command for command in commands if command.get("do") == "start"), None)
    if command is None:
        return 0
    try:
        run = Run(command, out)
        threading.Thread(target=_run_commands, args=(run, commands), name="orders", daemon=True).start()
        return 0 if run.run() else 1
    except BehaviourError as error:
        out.send(ProgramFailed(block=error.block, text=limited(error.sentence)))
    except (AppError, NepError) as error:
        text = _("The program can't start: {error}.").format(error=error)
        out.send(ProgramFailed(text=limited(text)))
    except (KeyError, TypeError, ValueError, SyntaxError) as error:
        text = _("The program can't be loaded: {error}.").format(error=error)
        out.send(ProgramFailed(text=limited(text)))
    out.send(ProgramEnded(is_ok=False, elapsed_s=0.0))
    return 1


def _run_commands(run: Run, commands: Iterator[Mapping[str, object]]) -> None:
    handlers = run.command_handlers()
    argument_handlers: dict[str, Callable[[Mapping[str, object]], None]] = {
        "pace": run.set_pace,
        "robots": run.update_robots,
        "variable": run.set_variable,
        "breakpoints": run.set_breakpoints,
        "answer": run.answer,
    }
    for command in commands:
        argument_handler = argument_handlers.get(str(command.get("do")))
        if argument_handler is not None:
            argument_handler(command)
        handler = handlers.get(str(command.get("do")))
        if handler is not None:
            handler()
    run.stop()  # the runner has exited or closed the pipe


if __name__ == "__main__":
    # Ctrl+C in a terminal also reaches this process; the runner decides what happens.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    enable_crash_trace()
    exit_code = main()
    # Scripts may hang in blocking calls; don't wait for them.
    sys.stderr.flush()
    os._exit(exit_code)
