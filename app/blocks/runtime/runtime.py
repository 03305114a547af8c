"""Runtime of a program: its commands, and the start and end of its scripts.

Each `Runtime` runs one program. `Runtime.namespace` returns the names available to the compiled program.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from types import ModuleType

from app.blocks.runtime import values
from app.blocks.runtime.broadcasts import Broadcasts, Receiver
from app.blocks.runtime.errors import BehaviourError, explain
from app.blocks.runtime.link import ProgramLink
from app.blocks.runtime.pure import calculation, clock, lists, texts
from app.blocks.runtime.questions import QuestionCallback, Questions
from app.blocks.runtime.robot_handle import Replacements, RobotHandle, StatusText
from app.blocks.runtime.scheduler import EndScript, Scheduler, ScriptGroup, StopProgram
from app.blocks.runtime.triggers import ScriptTrigger, ThresholdTrigger, change_detector, event_matches
from app.blocks.runtime.variables import short_text
from app.clock import ThreadClock
from app.robots.description.description import Robot
from nep.i18n import _, lazy, translate

_METHOD_NAMES = (
    "answer", "ask", "ask_with_choices", "broadcast", "broadcast_and_wait", "called", "fail", "newest",
    "number", "on_broadcast", "on_message", "on_start", "on_true", "publish", "reset_timer", "robot",
    "stop_others", "stop_program", "timer", "value", "wait", "wait_until", "write",
)  # fmt: skip
_VALUE_NAMES = (
    "is_known", "join", "length", "part", "random_number", "repeat", "rounded", "rounded_down", "rounded_up",
)  # fmt: skip
_FUNCTION_MODULES: tuple[ModuleType, ...] = (calculation, clock, lists, texts)
"""Modules whose names in ``__all__`` are available to programs."""

Script = Callable[..., None]
Decorator = Callable[[Script], Script]

MAX_QUEUED_MESSAGES = 16
MAX_QUEUED_EVENTS = 1
MAX_CALL_DEPTH = 200
"""Maximum nesting depth of function calls."""
_RECURSION_LIMIT = 6000  # recursion limit: one function call takes up to a dozen Python frames


def stop_script() -> None:
    """End the current run of the calling script, even from within a function."""
    raise EndScript


class CallStack:
    """Call stack of user-defined functions: limits the depth, and restores the current block after a call."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._local = threading.local()

    def raise_recursion_limit(self) -> None:
        """Raise Python's recursion limit in this process, to allow `MAX_CALL_DEPTH` nested calls."""
        sys.setrecursionlimit(max(sys.getrecursionlimit(), _RECURSION_LIMIT))

    def run(self, block: str, name: str, call: Callable[[], object]) -> object:
        """Call a function and return its result.

        Args:
            block: Id of the calling block.
            name: Name of the function, for messages.
            call: Function.

        Raises:
            BehaviourError: Calls are nested too deeply.
        """
        depth = int(getattr(self._local, "depth", 0))
        if depth >= MAX_CALL_DEPTH:
            raise BehaviourError(
                _("“{name}” calls itself more than {count} times.").format(name=name, count=MAX_CALL_DEPTH),
                block,
            )
        self._local.depth = depth + 1
        previous_block = self._scheduler.block()
        try:
            result = call()
        finally:
            self._local.depth = depth
        self._scheduler.restore_block(previous_block)
        return result


class Runtime:
    """Running program.

    Attributes:
        finished: Set when all scripts have ended, a script has failed or stopped the program, or
            another program has stopped a robot.
        error: Error of the script that failed, or of the robot that another program stopped; else None.

    Args:
        write_line: Called with each line that the program writes.
        labels: Labels of blocks by id.
        readings: Blocks as text by id.
        on_question: Called with the question to show, or None; without this callback, questions raise
            BehaviourError.
        clock: Clock of all waits (default: that of the computer).
    """

    def __init__(
        self,
        write_line: Callable[[str], None],
        *,
        labels: Mapping[str, str] | None = None,
        readings: Mapping[str, str] | None = None,
        on_question: QuestionCallback | None = None,
        clock: ThreadClock | None = None,
    ) -> None:
        self._write_line = write_line
        self._labels = labels or {}
        self._link: ProgramLink | None = None
        self._robots: Mapping[str, Robot] = {}
        self._starts: list[Script] = []
        self._triggers: list[tuple[ScriptTrigger, Script]] = []
        self._subscriptions: list[Callable[[ProgramLink], None]] = []
        self._count_lock = threading.Lock()
        self._running = 0
        self._timer_start_s = 0.0
        self.scheduler = Scheduler(clock)
        self.status_text = StatusText(self.scheduler.block, readings or {})
        self.replacements = Replacements()
        self._calls = CallStack(self.scheduler)
        self.questions = Questions(self.scheduler, on_question)
        self._broadcasts = Broadcasts(self.scheduler, self._add_running, self._remove_running)
        self.finished = threading.Event()
        self.error: BehaviourError | None = None

    def namespace(self) -> dict[str, object]:
        """Return the functions available to the program by name: methods of the runtime, pure functions."""
        return (
            {name: getattr(self, name) for name in _METHOD_NAMES}
            | {name: getattr(values, name) for name in _VALUE_NAMES}
            | {name: getattr(part, name) for part in _FUNCTION_MODULES for name in part.__all__}
            | {"step": self.scheduler.step, "stop_script": stop_script}
        )

    # ---- start and end

    def start(self, link: ProgramLink, robots: Sequence[Robot]) -> None:
        """Start all scripts, after the program's code has registered them.

        Args:
            link: Connection to the network.
            robots: Descriptions of the program's robots.
        """
        self._link = link
        self.reset_timer()
        self.scheduler.trace.restart()
        self._robots = {robot.name: robot for robot in robots}
        self._calls.raise_recursion_limit()
        link.set_callbacks(self.scheduler.wake_scripts, self._on_external_stop)
        for subscribe in self._subscriptions:
            subscribe(link)
        self._running = len(self._starts) + len(self._triggers)
        if not self._running:
            self.finished.set()
        with self.scheduler.defer_turns():
            for receiver in self._broadcasts.receivers:
                # Not counted: without other running scripts, it can't receive a broadcast any more.
                self.scheduler.start(
                    receiver.name, self._with_error_reporting(partial(receiver.serve, self.scheduler))
                )
            for script in self._starts:
                body = self._with_error_reporting(
                    partial(self._run_once, script), on_end=self._remove_running
                )
                self.scheduler.start(script.__name__, body, idle=False)
            for trigger, script in self._triggers:
                body = self._with_error_reporting(
                    partial(self._run_for_events, trigger, script), on_end=self._remove_running
                )
                self.scheduler.start(script.__name__, body)

    def _run_once(self, script: Script, *arguments: object) -> None:
        with suppress(EndScript):
            self.scheduler.start_run()
            script(*arguments)
        self.scheduler.finish_run()

    def _run_for_events(self, trigger: ScriptTrigger, script: Script) -> None:
        while True:
            self._run_once(script, *trigger.next(self.scheduler))
            if trigger.dropped_count:
                self.write(
                    _("“{title}” couldn't keep up: {dropped} of its events were skipped").format(
                        title=trigger.title, dropped=trigger.dropped_count
                    )
                )
                trigger.dropped_count = 0

    def _with_error_reporting(
        self, body: Callable[[], None], on_end: Callable[[], None] = lambda: None
    ) -> Callable[[], None]:
        def run() -> None:
            try:
                body()
            except Exception as error:  # noqa: BLE001 (every error is reported at its block)
                block = self.scheduler.block()
                self._on_script_error(explain(error, self._labels.get(block or "", ""), block))
            finally:
                on_end()

        return run

    def _add_running(self) -> None:
        with self._count_lock:
            self._running += 1

    def _remove_running(self) -> None:
        with self._count_lock:
            self._running -= 1
            is_last = self._running == 0
        if is_last:
            self.scheduler.stop()  # ends scripts that only wait for broadcasts
            self.finished.set()

    def _on_script_error(self, error: BehaviourError) -> None:
        group = self.scheduler.current_script().group
        self.scheduler.record_failure(error.sentence, error.block)
        if group.ends_program:
            self._fail(error)
        else:
            self.end_group(group, error)

    # ---- groups of scripts

    def hold_group(self, group: ScriptGroup, *, restarts_blocks: bool = False) -> None:
        """Suspend the scripts of a group and the motions of robots that they started.

        Args:
            group: Group of scripts.
            restarts_blocks: True to run an interrupted wait or action from its beginning after
                `resume_group`, False to continue it.
        """
        group.hold(restarts_blocks=restarts_blocks)
        self._require_link().hold_motions(group)

    def resume_group(self, group: ScriptGroup) -> None:
        """Resume the scripts and motions of a group after `hold_group`.

        Args:
            group: Group of scripts.
        """
        self._require_link().resume_motions(group)
        group.resume()

    def end_group(self, group: ScriptGroup, error: BehaviourError | None = None) -> None:
        """End the scripts of a group and the motions of robots that they started.

        Args:
            group: Group of scripts.
            error: Error that ended the group, or None.
        """
        if error is None:
            group.end()
        else:
            group.fail(error)
        self._require_link().end_motions(group)

    def _fail(self, error: BehaviourError) -> None:
        if self.error is None and not self.scheduler.is_stopping:
            self.error = error
        self.scheduler.stop()
        self.finished.set()

    def _on_external_stop(self, robot: str) -> None:
        self._fail(
            BehaviourError(
                _("{robot} was stopped by another program, so the behaviour ended.").format(robot=robot)
            )
        )

    def stop_program(self) -> None:
        """End all scripts, including the calling one."""
        self.scheduler.stop()
        self.finished.set()
        raise StopProgram

    def stop_others(self) -> None:
        """End the current runs of all other scripts, which events can start again."""
        self.scheduler.end_other_runs()

    # ---- blocks

    def value(self, block: str, compute: Callable[[], object]) -> object:
        """Compute and return the result of a value block; exceptions are converted to errors of the block.

        Args:
            block: Id of the block.
            compute: Computes the result.

        Raises:
            BehaviourError: The computation failed.
        """
        try:
            return compute()
        except Exception as error:
            raise explain(error, self._labels.get(block, ""), block) from error

    def number(self, block: str, compute: Callable[[], object]) -> object:
        """Compute and return the result of a block that must return a number; see `value`.

        An unknown result (None) is returned as well.

        Raises:
            BehaviourError: The computation failed, or the result is not a number, such as a text joined
                by "+".
        """
        result = self.value(block, compute)
        if result is None or isinstance(result, (int, float)):
            return result
        name = f"“{self._labels.get(block, '')}”"
        if isinstance(result, complex):
            raise BehaviourError(_("{name} has no result for these numbers.").format(name=name), block)
        raise BehaviourError(_("{name} needs numbers, not text.").format(name=name), block)

    def called(self, block: str, call: Callable[[], object]) -> object:
        """Call a user-defined function and return its result.

        Args:
            block: Id of the calling block.
            call: Function.

        Raises:
            BehaviourError: The function failed, or calls are nested too deeply.
        """
        name = self._labels.get(block, "")
        return self.value(block, lambda: self._calls.run(block, name, call))

    def fail(self, message: str) -> object:
        """Raise BehaviourError with this message, for a block that can't run."""
        raise BehaviourError(message)

    def wait(self, seconds: object) -> None:
        """Wait for a number of seconds, not counting pauses of the program."""
        self.scheduler.wait(float(values.number(seconds, lazy("“wait”"))))

    def wait_until(self, condition: Callable[[], object], at_most_s: object = None) -> None:
        """Wait until a condition is true; a condition with unknown values counts as false.

        Args:
            condition: Evaluated 50 times a second.
            at_most_s: Maximum wait in seconds, not counting pauses; None for no limit.
        """
        timeout_s = None if at_most_s is None else float(values.number(at_most_s, lazy("“wait until”")))
        self.scheduler.wait_until(lambda: _is_true(condition), timeout_s)

    def write(self, value: object) -> None:
        """Write a value as a line to the Console."""
        self._write_line(values.text(value))

    def show(self, value: object) -> None:
        """Write the value of a tried block as a short line; an empty line if the value is unknown."""
        self._write_line("" if value is None else short_text(value))

    # ---- questions

    def ask(self, question: object) -> None:
        """Ask the user a question and wait for the answer, which `answer` returns."""
        self.questions.ask(question)

    def ask_with_choices(self, question: object, choices: object) -> None:
        """Ask the user to select an item of a list and wait for the selection, which `answer` returns."""
        self.questions.ask_with_choices(question, choices)

    def answer(self) -> object:
        """Return the last answer, as a number if possible; "" before the first answer."""
        return self.questions.answer

    # ---- time

    def timer(self) -> float:
        """Return the seconds since the start or the last reset, not counting pauses of the program."""
        return round(self.scheduler.running_time_s() - self._timer_start_s, 3)

    def reset_timer(self) -> None:
        """Restart the timer at 0."""
        self._timer_start_s = self.scheduler.running_time_s()

    # ---- topics

    def publish(self, topic: str, payload: object) -> None:
        """Publish a message on a topic.

        Raises:
            BehaviourError: The message would move a robot that the program may not move.
        """
        self._require_link().publish(topic, payload)

    def newest(self, topic: str, path: str) -> object:
        """Return a field of the newest message of a topic; None if there is no message yet or no such field.

        Args:
            topic: Name of the topic.
            path: Field path; "" for the whole message.
        """
        message = self._require_link().newest(topic)
        return None if message is None else values.part(message, path)

    def broadcast(self, name: str) -> None:
        """Start the scripts that receive a broadcast, and continue without waiting for them."""
        self._broadcasts.send(name)

    def broadcast_and_wait(self, name: str) -> None:
        """Start the scripts that receive a broadcast, and wait until they have ended."""
        deliveries = self._broadcasts.send(name)
        self.scheduler.wait_until(lambda: all(each.done for each in deliveries), None, cause="broadcast")

    # ---- event blocks

    def on_start(self, script: Script) -> Script:
        """Register a script that runs when the program starts."""
        self._starts.append(script)
        return script

    def on_message(self, topic: str) -> Decorator:
        """Return a decorator for scripts that run for each message on a topic and take its payload."""

        def prepare(trigger: ScriptTrigger, link: ProgramLink) -> None:
            link.on_message(topic, lambda payload: trigger.enqueue((payload,)))

        return self._trigger_decorator(
            _("when a message arrives on {topic}").format(topic=topic), prepare, MAX_QUEUED_MESSAGES
        )

    def on_broadcast(self, name: str) -> Decorator:
        """Return a decorator for scripts that run at each broadcast with this name.

        A script that is still running at the next broadcast is restarted.
        """

        def decorate(script: Script) -> Script:
            self._broadcasts.receivers.append(Receiver(name, script))
            return script

        return decorate

    def on_true(self, condition: Callable[[], object]) -> Decorator:
        """Return a decorator for scripts that run each time the condition becomes true."""

        def decorate(script: Script) -> Script:
            self._triggers.append(
                (ScriptTrigger(_("when … becomes true"), condition=lambda: _is_true(condition)), script)
            )
            return script

        return decorate

    def on_event(self, robot: str, event: str, filters: Mapping[str, object]) -> Decorator:
        """Return a decorator for scripts that run at each event of a robot with this name.

        Args:
            robot: Name of the robot.
            event: Name of the event.
            filters: Required values of fields, by name.
        """

        def prepare(trigger: ScriptTrigger, link: ProgramLink) -> None:
            description = self._robots[robot].event(event)
            source = self._robots[robot].source

            def on_data(data: object) -> None:
                if event_matches(data, filters, description, source):
                    trigger.enqueue(())

            link.on_event(robot, event, on_data)

        return self._trigger_decorator(
            _("when {robot} {event}").format(robot=robot, event=event), prepare, MAX_QUEUED_EVENTS
        )

    def on_change(self, robot: str, sensor: str) -> Decorator:
        """Return a decorator for scripts that run each time the value of a sensor changes."""

        def prepare(trigger: ScriptTrigger, link: ProgramLink) -> None:
            link.on_sensor(robot, sensor, change_detector(lambda: trigger.enqueue(())))

        return self._trigger_decorator(
            _("when {robot} {sensor} changes").format(robot=robot, sensor=sensor), prepare, MAX_QUEUED_EVENTS
        )

    def on_pass(self, robot: str, sensor: str, side: str, limit: float) -> Decorator:
        """Return a decorator for scripts that run each time a sensor passes a limit.

        See `RobotHandle.on_pass` for the arguments.
        """

        def prepare(trigger: ScriptTrigger, link: ProgramLink) -> None:
            link.on_sensor(robot, sensor, ThresholdTrigger(side, limit, lambda: trigger.enqueue(())))

        return self._trigger_decorator(
            _("when {robot} {sensor} goes {side} {limit}").format(
                robot=robot, sensor=sensor, side=translate("choice", side), limit=f"{limit:g}"
            ),
            prepare,
            MAX_QUEUED_EVENTS,
        )

    def _trigger_decorator(
        self, title: str, prepare: Callable[[ScriptTrigger, ProgramLink], None], max_queued: int
    ) -> Decorator:
        def decorate(script: Script) -> Script:
            trigger = ScriptTrigger(title, max_queued=max_queued)
            self._triggers.append((trigger, script))
            self._subscriptions.append(lambda link: prepare(trigger, link))
            return script

        return decorate

    # ---- robots

    def robot(self, name: str) -> RobotHandle:
        """Return the interface to a robot; the robot need not be connected."""
        return RobotHandle(name, self)

    def robot_description(self, name: str) -> Robot:
        """Return the description of a robot. Raises BehaviourError if the robot is not connected."""
        if name not in self._robots:
            raise BehaviourError(_("{name} isn't connected.").format(name=name))
        return self._robots[name]

    @property
    def robot_count(self) -> int:
        """Number of robots that the program uses."""
        return len(self._robots)

    def link(self) -> ProgramLink:
        """Return the connection to the network. Raises BehaviourError before `start`."""
        return self._require_link()

    def _require_link(self) -> ProgramLink:
        if self._link is None:
            raise BehaviourError(_("The program hasn't started yet."))
        return self._link


def _is_true(condition: Callable[[], object]) -> bool:
    try:
        return bool(condition())
    except BehaviourError as error:
        if error.is_value_unknown:
            return False
        raise
