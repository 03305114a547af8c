"""Run, Pause, Step and Stop: control of the program's process, and collection of the robots' replies."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Protocol

from app.blocks.model.program import Program, Variable
from app.blocks.model.stack import Stack
from app.blocks.runtime.events import (
    BlocksTraced,
    CommandReplaced,
    LinePrinted,
    ProgramEnded,
    ProgramFailed,
    ProgramPaused,
    ProgramRunning,
    RunnerEvent,
    VariablesChanged,
)
from app.blocks.runtime.variables import VariableValue
from app.core.alerts.alerts import Alerts
from app.core.projects.open_project import OpenProject
from app.core.robots.fleet import Fleet
from app.core.robots.motion.permission import actions_by_robot
from app.core.robots.stop.report import LateReply, RobotReplied, RobotStopped, StopCompleted
from app.core.robots.stop.stopper import RobotStopper
from app.core.run.asking import OpenQuestion
from app.core.run.block_errors import BlockErrors
from app.core.run.edits_since_run import EditsSinceRun
from app.core.run.program_robots import ProgramRobots, owners_of
from app.core.run.requests import OpenBehaviours, RequestedRun
from app.core.run.run_record import RunRecord
from app.core.run.run_warnings import RunWarnings
from app.core.run.runner import Runner
from app.core.run.stop_job import stop_program, stop_robot
from app.core.run.stop_reports import StopReporter
from app.core.run.trial import Trial, TriedValue
from app.core.run.view import (
    RunState,
    RunView,
    block_label,
    result_text,
    view_of,
)
from app.core.world.console import Console
from app.errors import AppError
from app.robots.client.limits import STOP_TIMEOUT_S as STOP_TIMEOUT_S
from app.robots.client.stop_report import StopReport
from nep.i18n import _

DOUBLE_CLICK_INTERVAL_S = 0.5
"""Maximum time in seconds between two clicks on Run that count as a double click."""
CLOSE_TIMEOUT_S = STOP_TIMEOUT_S + 1

_log = logging.getLogger("studio")


class RunNetwork(Protocol):
    """Parts of the session that `Runs` uses."""

    address: str
    stopper: RobotStopper | None


class Runs:
    """Control of the running behaviour. Not thread-safe; use it from the main thread.

    Waiting for the result of a Stop takes place in other threads.
    """

    pace_s = 0.0
    """Delay before each block, in seconds."""
    blocks_revision = 0
    values_revision = 0

    def __init__(
        self,
        projects: OpenBehaviours,
        fleet: Fleet,
        network: RunNetwork,
        *,
        alerts: Alerts,
        console: Console,
        post_event: Callable[[object], None],
        clock: Callable[[], float] = time.monotonic,
        create_runner: Callable[[Callable[[RunnerEvent], object]], Runner] = Runner,
    ) -> None:
        self._projects, self._fleet, self._network = projects, fleet, network
        self._alerts, self._console, self._post_event, self._clock = alerts, console, post_event, clock
        self._create_runner = create_runner
        self.starting_robots: Callable[[], Sequence[str]] = tuple  # names of robots that are starting
        self.before_stop: Callable[[], object] = tuple  # called by Stop before it stops robots
        self.document: OpenProject | None = None  # the run's behaviour
        self._runner: Runner | None = None
        self._current_request: RequestedRun | None = None  # the current run, else the last
        self._trial = Trial()
        self.open_question = OpenQuestion()
        self._pending_request: RequestedRun | None = (
            None  # begins once the current run is proven to be stopped
        )
        self._edits = EditsSinceRun()
        self._used_robots: tuple[str, ...] = ()
        self._breakpoints: tuple[str, ...] = ()  # of the running program
        self._program_key: str | None = None  # robots reject later commands of the last program by its key
        self._labels: Mapping[str, str] = {}
        self._robots = ProgramRobots(fleet)
        fleet.robots_in_use = lambda: self.used_robots
        self._stop_reporter = StopReporter(fleet, alerts, console)
        self._record = RunRecord(RunState())
        self._view: tuple[RunState, OpenProject, RunView] | None = None
        self._stop_number = self._stop_mark = 0
        self._stopped_again: set[str] = set()
        self._stop_thread: threading.Thread | None = None
        self.running_blocks: tuple[str, ...] = ()
        self.stopped_blocks: tuple[str, ...] = ()
        self._earlier_blocks: frozenset[str] = frozenset()  # that began in earlier runs
        self._errors = BlockErrors()
        self._warnings = RunWarnings(lambda text: self._console.add("warn", self._run.name, text))
        self.values: Mapping[str, VariableValue] = {}
        """Values of the run's variables by id; still available after the run."""
        self._variables: Mapping[str, Variable] = {}

    # -- commands of the user ----------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        """True if a program is running or paused."""
        return self._run.state in {"running", "paused"}

    @property
    def state(self) -> RunState:
        """Current state of the run."""
        return self._run

    @property
    def record(self) -> RunRecord:
        """Record of the current run, else of the last one."""
        return self._record

    @property
    def _run(self) -> RunState:
        return self._record.state

    @_run.setter
    def _run(self, state: RunState) -> None:
        self._record.state = state

    def _begin_record(self, state: RunState) -> None:
        self._earlier_blocks, self._record = self.ran_blocks, RunRecord(state)

    @property
    def used_robots(self) -> tuple[str, ...]:
        """Names of the robots that the running or paused program uses."""
        return self._used_robots if self.active else ()

    @property
    def ran_blocks(self) -> frozenset[str]:
        """Ids of all blocks that have begun since Studio was started."""
        return self._earlier_blocks | self._record.blocks.begun

    @property
    def tried_value(self) -> TriedValue | None:
        """Value of the block that was tried last, or None."""
        return self._trial.value

    @property
    def block_errors(self) -> Mapping[str, str]:
        """Error messages by block id, until the block is fixed or the next run starts."""
        return self._errors.by_block

    @property
    def block_warnings(self) -> Mapping[str, str]:
        """Warnings by block id. They remain available after the run."""
        return self._warnings.by_block

    def tick(self) -> None:
        """Check for edits, changed robots and breakpoints, and update `view`. Called at each tick."""
        self._view = None
        if (
            self._run.unrunnable_program is not None
            and self._run.unrunnable_program is not self._projects.current.newest_program()
        ):
            self._run = replace(self._run, unrunnable_program=None)  # another tab, or an edit
        self._settle()
        edit_count = 0 if self.document is None else self.document.edits
        if self._warnings.clear_if_edited(edit_count) | self._errors.discard_fixed():
            self.blocks_revision += 1
        if self.active:
            self._update_breakpoints()
        is_edited = self.active and self._edits.has_edits()
        if is_edited != self._run.is_edited:
            self._run = replace(self._run, is_edited=is_edited)

    def _update_breakpoints(self) -> None:
        # Sends changed breakpoints to the running program.
        newest = self.document.newest_program() if self.document is not None else None
        if newest is None or self._runner is None or newest.breakpoints == self._breakpoints:
            return
        self._breakpoints = newest.breakpoints
        self._runner.set_breakpoints(newest.breakpoints)

    def view(self) -> RunView:
        """Return the contents of the run bar, cached until the next tick or change."""
        run, current = self._run, self._projects.current
        if self._view is None or self._view[0] is not run or self._view[1] is not current:
            names = [link.name for link in self._fleet.connected]
            is_elsewhere = self.document not in {None, current}
            view = view_of(
                run,
                names,
                self._clock(),
                starting_robots=self.starting_robots(),
                is_elsewhere=is_elsewhere,
                is_slow=self.pace_s > 0,
            )
            self._view = (run, current, view)
        return self._view[2]

    def run(self) -> None:
        """Run the current behaviour. A paused program is resumed, a running program is restarted.

        Errors that prevent the start are shown on their blocks. The second click of a double-click is
        ignored.
        """
        run = self._run
        if run.state == "paused":
            self.resume()
        elif run.state != "running" or self._clock() - run.started_s >= DOUBLE_CLICK_INTERVAL_S:
            self._request_run(RequestedRun(self._projects.current))

    def restart(self) -> None:
        """Restart the running or paused behaviour with its current blocks."""
        if self.active and self._current_request is not None:
            self._request_run(replace(self._current_request, starts_paused=False))

    def try_stack(self, stack: Stack) -> None:
        """Stop a running program, and run one stack of the current behaviour.

        A stack that is only a variable isn't run: its value in the current or last run is shown.
        """
        variable = stack.variable_id(self._projects.current.workspace)
        if variable is not None:
            self._show_variable(stack, variable)
            return
        request, run = RequestedRun(self._projects.current, stack=stack), self._run
        is_repeated = self.active and self._current_request == request
        if not is_repeated or self._clock() - run.started_s >= DOUBLE_CLICK_INTERVAL_S:
            self._request_run(request)

    def _show_variable(self, stack: Stack, id: str) -> None:
        # A new program would lack the value of the current or last run.
        project = self._projects.current
        value = self.values.get(id) if self.document is project else None
        self._trial.set_value(project, stack, value.text if value is not None else _("no value yet"))

    def is_running_or_pending(self, project: OpenProject) -> bool:
        """Return True if this behaviour is running, or will be run when another program has stopped."""
        return (self.active and self.document is project) or (
            self._pending_request is not None and self._pending_request.document is project
        )

    def _request_run(self, request: RequestedRun) -> None:
        # Runs once the running program has stopped and its robots are proven to have stopped.
        if self._run.state in {"ready", "proven"}:
            self._start(request)
            return
        if self.active:
            self._stop(self._used_robots)
        if self._run.state == "stopping":
            self._pending_request = request
            self._run = replace(self._run, is_restarting=True)

    def step(self) -> None:
        """Run the next block of a paused program, or the first block of a new one.

        A running program is paused.
        """
        if self._run.state in {"ready", "proven"}:
            self._start(RequestedRun(self._projects.current, starts_paused=True))
        elif self._run.state == "running":
            self.pause()
        elif self._run.state == "paused" and self._runner is not None:
            self._runner.step()

    def set_pace(self, seconds: float) -> None:
        """Set the delay before each block in seconds, including for a running program."""
        self.pace_s, self._view = seconds, None
        if self._runner is not None:
            self._runner.set_pace(seconds)

    def set_variable(self, id: str, value: str | float | bool) -> bool:
        """Set a variable of the running program.

        Args:
            id: Id of the variable.
            value: New value.

        Returns:
            False if no program is running or paused, or if the program doesn't use the variable.
        """
        variable = self._variables.get(id)
        if self._runner is None or not self.active or variable is None or not variable.python:
            return False
        self._runner.set_variable(variable.python, value)
        return True

    def pause(self) -> None:
        """Pause the program, its clock and its robots (docs/adr/0006)."""
        if self._run.state == "running" and self._runner is not None:
            self._runner.pause()

    def resume(self) -> None:
        """Resume a paused program."""
        run = self._run
        if run.state == "paused" and self._runner is not None:
            self._runner.resume()
            pause_s = 0.0 if run.pause_start_s is None else self._clock() - run.pause_start_s
            self._run = replace(
                self._run, state="running", paused_s=run.paused_s + pause_s, pause_start_s=None
            )
            self._mark_blocks(stopped=())

    def stop(self) -> None:
        """Stop the program and all robots. The run bar shows the robots' replies."""
        self.before_stop()
        self._stopped_again.clear()
        self._pending_request = None
        self._stop(None)
        self._fleet.permission.withdraw()

    def stop_robot(self, name: str) -> None:
        """Stop one robot.

        If a program is running, stop everything, because the program would move the robot again.
        """
        if self.active:
            self.stop()
            return
        self.before_stop()
        self._stopped_again.discard(name)
        self._stop_in_thread(name)

    def _stop_in_thread(self, name: str) -> None:
        self._fleet.mark_stopping([name])
        mark = self._fleet.moved.mark
        target = partial(stop_robot, self._post_event, self._network.stopper, name, mark)
        threading.Thread(target=target, name="studio-stop-one", daemon=True).start()

    def stop_again(self, name: str) -> None:
        """Repeat the Stop of a robot that has now ended an action that the first Stop could not end.

        The Stop is repeated once at most, so that a robot whose Stops always time out is not stopped
        forever.
        """
        report, state = self._run.report, self._run.state
        if name in self._stopped_again:
            return
        if state == "unanswered" and report is not None and name in report.unconfirmed_names:
            self._stopped_again.add(name)
            self._stop(self._run.robots_to_stop)
        elif state in {"ready", "proven"}:
            self._stopped_again.add(name)
            self._stop_in_thread(name)

    def update_robots(self) -> None:
        """Report new and restarted robots to the running program, once the user has allowed them to move."""
        if self.active:
            self._robots.update()

    def confirm_stopped(self) -> None:
        """Record that the user has confirmed that the robots without a reply are not moving."""
        if self._run.state == "unanswered" and self._run.report is not None:
            unconfirmed_names = self._run.report.unconfirmed_names
            self._fleet.confirm_stopped(unconfirmed_names)
            if self._network.stopper is not None:
                self._network.stopper.discard_late(unconfirmed_names)
            self._settle()

    def _settle(self) -> None:
        # Enables Run once every robot of the last Stop is proven or confirmed to have stopped.
        report = self._run.report if self._run.state == "unanswered" else None
        if report is not None and not any(name in self._fleet.moved for name in report.unconfirmed_names):
            self._run = replace(self._run, state="ready", report=None)
            self._alerts.resolve("stop")

    def close(self) -> None:
        """Stop the program, which stops its robots before it exits."""
        if self._runner is not None:
            self._runner.stop()
        if self._stop_thread is not None:
            self._stop_thread.join(timeout=CLOSE_TIMEOUT_S)

    # -- input from the session --------------------------------------------------------------------------

    def on_runner_event(self, event: RunnerEvent) -> None:
        """Apply an event of the program's process. Events of earlier runs are ignored."""
        if self._runner is None or event.run != self._runner.run:
            return
        self.open_question.on_event(event)
        match event:
            case BlocksTraced() | ProgramRunning() | ProgramPaused() if self.active:
                self._on_progress(event)
            case ProgramFailed() if self.active:  # blocks interrupted by Stop fail; that is expected
                self._on_error(event)
            case CommandReplaced() if self.active and self.document is not None:
                self._warnings.add(event.block, event.text, event.count, self.document.edits)
                self.blocks_revision += 1
            case LinePrinted():
                self._on_print(event)
            case VariablesChanged():
                self._show_values({**self.values, **{value.id: value for value in event.values}})
            case ProgramEnded():
                self._on_end(event)

    def _on_progress(self, event: BlocksTraced | ProgramRunning | ProgramPaused) -> None:
        # The run's clock starts with the first event of its scripts.
        if not self._run.is_started:
            self._run = replace(self._run, is_started=True, started_s=self._clock())
        run, traced = self._run, self._record.blocks
        previous_blocks = traced.blocks
        match event:
            case BlocksTraced():
                traced.apply(event.records)
                if traced.blocks != previous_blocks:
                    self._mark_blocks(running=traced.blocks, stopped=self.stopped_blocks)
                if traced.failure is not None and not run.errors:
                    self._set_errors(
                        {traced.failure.value_block or traced.failure.block: traced.failure.text}
                    )
            case ProgramRunning():
                if event.description and event.description != run.description:
                    self._run = replace(run, description=event.description)
                    self._console.add("info", run.name, event.description)
                self._mark_blocks(running=previous_blocks, stopped=self.stopped_blocks)
            case ProgramPaused():
                next_block = () if event.block is None else (event.block,)
                blocks = tuple(dict.fromkeys((*next_block, *previous_blocks)))
                self._run = replace(
                    run,
                    state="paused",
                    paused_at=block_label(event.description, blocks, self._labels),
                    pause_start_s=run.pause_start_s or self._clock(),
                    warning=event.warning,
                )
                self._mark_blocks(stopped=blocks)

    def on_stop(self, event: StopCompleted | RobotReplied | RobotStopped | LateReply) -> None:
        """Handle an event of a Stop: a reply, a late reply or the result.

        Replies to earlier Stops are ignored.
        """
        if isinstance(event, RobotStopped):
            self._stop_reporter.update_fleet(event.report, event.mark)
            self._stop_reporter.notify_user(event.report, "stop")
        elif isinstance(event, LateReply):
            self._on_late_reply(event)
        elif event.number == self._stop_number:
            if isinstance(event, RobotReplied):
                replies = (*self._run.replies, event.robot)
                self._run = replace(self._run, replies=replies)
                if event.robot.problem or not event.robot.is_waiting:
                    robot_replies = [robot for robot in replies if robot.name == event.robot.name]
                    self._stop_reporter.update_fleet(StopReport(tuple(robot_replies), 0.0), self._stop_mark)
            else:
                self._run = replace(self._run, has_stopped_blocks=bool(self.stopped_blocks))
                self._apply_report(event.report)

    def _apply_report(self, report: StopReport) -> None:
        # State first, sentences later: an error in formatting must not leave it "stopping".
        state = "unanswered" if report.unconfirmed_robots else "proven" if report.is_confirmed else "ready"
        self._run = replace(self._run, state=state, report=report, last_stop_status=report.status)
        self._stop_reporter.update_fleet(report, self._stop_mark)
        self._run = replace(
            self._run,
            last_stop_text=result_text(report),
            is_restarting=False,
            motion_warnings=self._stop_reporter.motion_warnings(report),
        )
        self._stop_reporter.notify_user(report, self._run.name or "stop")
        request, self._pending_request = self._pending_request, None
        if request is not None and not report.unconfirmed_robots:
            self._start(request)

    def _on_late_reply(self, event: LateReply) -> None:
        # A late reply counts unless the state has changed since.
        run = self._run
        if event.number is None:
            self.on_stop(RobotStopped(event.report, event.mark))
        elif event.number == self._stop_number and run.state == "unanswered" and run.report is not None:
            self._apply_report(run.report.with_late_reply(event.report))

    # -- private -----------------------------------------------------------------------------------------

    def _start(self, request: RequestedRun) -> None:
        project, self._current_request = request.document, request
        is_same, self.document = self.document is project, project
        self._trial.prepare(request)
        self._alerts.resolve("program")
        self._warnings.reset()
        self._errors.start_run(request)
        self._set_errors({})
        self._mark_blocks()
        try:
            program = self._runnable_program(request)
            if program is None:
                return
            robots = [link.robot for link in self._fleet.connected if link.name in program.robots]
            requested_actions = actions_by_robot(program, robots)
            if not self._fleet.permission.request_permission(
                requested_actions, partial(self._start_if_ready, request)
            ):
                return  # the window asks the user first
            self._fleet.return_to_start(program.robots if request.stack is None else ())
            owners = owners_of(self._fleet)
            runner = self._create_runner(self._post_event)
            runner.start(
                program,
                [link.robot.source for link in self._fleet.connected],
                self._network.address,
                name=project.name,
                paused=request.starts_paused,
                pace_s=self.pace_s,
                owners=owners,
            )
        except AppError as error:
            self._alerts.raise_alert("program", "error", _("The behaviour can't be started."), str(error))
            return
        self.open_question.reset(runner)
        self._runner, self._used_robots, self._labels = runner, program.robots, program.labels
        self._robots.start(runner, requested_actions, owners)
        self._breakpoints, self._program_key = program.breakpoints, runner.program_key
        self._fleet.moved.record_command((robot.name for robot in robots), "behaviour")
        self._variables = {variable.id: variable for variable in program.variables}
        if request.stack is None or not is_same:
            self._show_values({})  # trying a block keeps the values of other variables
        self._console.ignore_process(runner.pid)
        self._edits.set_program(project if request.stack is None else None, program)
        self._show_start(self._projects.title(project), self._trial.start(program, robots))

    def _show_start(self, title: str, tried_label: str) -> None:
        run, previous = RunState("running", title, is_started=False, tried_label=tried_label), self._run
        self._begin_record(
            replace(
                run,
                started_s=self._clock(),
                last_stop_text=previous.last_stop_text,
                last_stop_status=previous.last_stop_status,
            )
        )
        text = _("trying “{block}”").format(block=tried_label) if tried_label else _("started")
        self._console.add("info", self._run.name, text)

    def _runnable_program(self, request: RequestedRun) -> Program | None:
        # None if it has no blocks to run or has problems; the run bar shows the reason.
        program = request.program()
        problems = {} if program is None else request.problems(program)
        if program is None or (program.starts and not problems):
            return program
        if request.stack is None or not problems:  # problems of a tried block are shown at the block
            previous = self._run
            self._begin_record(
                RunState(
                    unrunnable_program=program,
                    last_stop_text=previous.last_stop_text,
                    last_stop_status=previous.last_stop_status,
                )
            )
        self._set_errors(problems, prevents_start=True)
        return None

    def _start_if_ready(self, request: RequestedRun) -> None:
        # After the user's permission, unless another run has begun meanwhile.
        if self._run.state in {"ready", "proven"}:
            self._start(request)

    def _on_print(self, event: LinePrinted) -> None:
        # Shown in the Console, or as the value of a tried block.
        value = self._trial.parse_line(event.text)
        if value is None:
            self._console.add("info", self._run.name, event.text)
        else:
            self._run = replace(self._run, value=value)

    def _on_error(self, event: ProgramFailed) -> None:
        self._console.add("error", self._run.name, event.text)
        if event.block is not None and not self._run.errors:  # it failed before its first block
            self._set_errors({event.block: event.text})
        elif event.block is None:
            self._alerts.raise_alert("program", "error", _("The behaviour was stopped."), event.text)

    def _on_end(self, event: ProgramEnded) -> None:
        self._runner = None
        self._robots.stop()
        if not self.active:
            return  # Stop was first
        is_finished = event.is_ok and not self._run.errors
        if is_finished:
            self._mark_blocks()
        # the end of a program is a Stop like any other: every robot that it used must reply
        self._stop(tuple(dict.fromkeys((*self._used_robots, *event.unresponsive_robots))))
        self._run = replace(self._run, is_finished=is_finished)
        if not event.is_ok and not self._run.errors:
            self._alerts.raise_alert("program", "error", _("The behaviour stopped unexpectedly."), event.text)

    def _stop(self, names: tuple[str, ...] | None) -> None:
        self.open_question.clear()
        run = self._run
        now, elapsed_s = self._clock(), run.elapsed_s
        if self.active:
            elapsed_s = run.elapsed(now)
            self._warnings.log_final_counts()
        elif run.state not in {"stopping", "unanswered"}:
            elapsed_s = None
        # includes robots that have not replied to an earlier Stop, whose report is discarded
        requested = (
            self._fleet.stoppable_robots if names is None else (*names, *self._fleet.unresponsive_robots)
        )
        robots_to_stop = tuple(dict.fromkeys((*requested, *self._fleet.stopping_robots)))
        self._run = replace(
            self._run,
            state="stopping",
            stop_pressed_s=now,
            is_stop_repeated=run.state == "unanswered" or (run.state == "stopping" and run.is_stop_repeated),
            elapsed_s=elapsed_s,
            report=None,
            replies=(),
            is_finished=False,
            is_edited=False,
            is_restarting=False,
            robots_to_stop=robots_to_stop,
        )
        self._fleet.mark_stopping(robots_to_stop)
        self._stop_mark = self._fleet.moved.mark
        self._mark_blocks(stopped=self.running_blocks or self.stopped_blocks)
        self._stop_number += 1
        target = partial(
            stop_program,
            self._post_event,
            self._stop_number,
            self._runner,
            self._network.stopper,
            robots_to_stop,
            self._program_key,
            is_for_all=names is None,
        )
        self._stop_thread = threading.Thread(target=target, name="studio-stop", daemon=True)
        self._stop_thread.start()

    def _set_errors(self, errors: Mapping[str, str], *, prevents_start: bool = False) -> None:
        self._errors.set_errors(errors, prevents_start=prevents_start)
        self._run = replace(self._run, errors=errors)
        self.blocks_revision += 1

    def _show_values(self, values: Mapping[str, VariableValue]) -> None:
        self.values = values
        self.values_revision += 1

    def _mark_blocks(self, running: tuple[str, ...] = (), stopped: tuple[str, ...] = ()) -> None:
        self.running_blocks, self.stopped_blocks = running, stopped
        self.blocks_revision += 1
