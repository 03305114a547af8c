"""Tests that runs of fake programs behave like runs of programs in processes."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.stack import Stack
from app.blocks.runtime.events import (
    BlocksTraced,
    ProgramEnded,
    ProgramFailed,
    ProgramPaused,
    ProgramRunning,
    RunnerEvent,
)
from app.blocks.runtime.trace import BlockBegan
from app.blocks.runtime.variables import VariableValue
from app.core.run.runner import Runner
from app.core.session import Session
from app.core.storage.settings import Settings
from app.errors import RunnerError
from nep.masters.master import Master
from tests.blocks.fakes import until
from tests.blocks.samples import block, number, started, text, workspace, write
from tests.core.waiting import tick_until
from tests.ui import fakes


class Run(Protocol):
    """Session with a program. Each method returns after the window has processed the event."""

    session: Session

    def make_runner(self, on_event: Callable[[RunnerEvent], object]) -> Runner:
        """Return a runner for one program."""

    def works(self, block: str) -> None:
        """Let the running program reach this block."""

    def fails(self, block: str) -> None:
        """Let the program fail at this block."""

    def ends(self) -> None:
        """Let the program reach its end."""

    def pauses_at(self, block: str) -> None:
        """Let the program reach the breakpoint of this block and pause."""

    def is_killed(self) -> None:
        """Kill the process of the program."""


class RealRun:
    """Programs in processes."""

    def __init__(self, master: Master, folder: Path) -> None:
        self.session = Session(
            Settings(folder), address=master.address, journal_folder=folder, start_processes=False
        )

    def make_runner(self, on_event: Callable[[RunnerEvent], object]) -> Runner:
        return Runner(on_event)

    def pauses_at(self, block: str) -> None:
        tick_until(self.session, lambda: self.session.runs.view().state == "paused")
        assert self.session.runs.stopped_blocks == (block,)

    def works(self, block: str) -> None:
        tick_until(self.session, lambda: block in self.session.runs.running_blocks)

    def fails(self, block: str) -> None:
        tick_until(self.session, lambda: block in self.session.runs.block_errors)

    def ends(self) -> None:
        tick_until(self.session, lambda: not self.session.runs.active)

    def is_killed(self) -> None:
        runner = self.session.runs._runner
        assert runner is not None
        assert runner.pid is not None
        os.kill(runner.pid, signal.SIGTERM if os.name == "nt" else signal.SIGKILL)
        self.ends()

    def close(self) -> None:
        self.session.close()


class MadeUpRun:
    """Programs whose events a test defines."""

    def __init__(self) -> None:
        self.session = fakes.Session()

    def make_runner(self, on_event: Callable[[RunnerEvent], object]) -> fakes.Runner:
        return fakes.Runner(on_event)

    @property
    def _runner(self) -> fakes.Runner:
        runner = self.session.runner
        assert runner is not None
        return runner

    def pauses_at(self, block: str) -> None:
        tick_until(self.session, lambda: block in self._runner.breakpoints)
        self._runner.does(block)
        self._runner.pause()
        self.session.tick()

    def works(self, block: str) -> None:
        self._runner.does(block)
        self.session.tick()

    def fails(self, block: str) -> None:
        self._runner.fails(block, "a number can't be divided by 0")
        self.session.tick()

    def ends(self) -> None:
        self._runner.ends()
        self.session.tick()

    def is_killed(self) -> None:
        self._runner.ends(ok=False, why="The program's process was killed (signal 9).")
        self.session.tick()

    def close(self) -> None:
        self.session.close()


@pytest.fixture(params=["real", "made up"])
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Run]:
    if request.param == "made up":
        made: RealRun | MadeUpRun = MadeUpRun()
    else:
        made = RealRun(request.getfixturevalue("master"), tmp_path)
    yield made
    made.close()


def endless() -> Mapping[str, object]:
    """Return a behaviour that increments a variable in an infinite loop."""
    change = block("variables_change", "c", VAR={"id": "n"}, BY=number(1))
    return workspace(started(block("control_forever", "loop", BODY=[change])), variables=("n",))


def shown(run: Run) -> tuple[object, ...]:
    """Return the state of the run, its enabled buttons and their labels."""
    view = run.session.runs.view()
    return view.state, view.can_run, view.can_pause, view.can_step, view.run_label, view.stop_label


READY = ("ready", True, False, True, "Run", "Stop")
RUNNING = ("running", False, True, True, "Restart", "Stop")
PAUSED = ("paused", True, False, True, "Resume", "Stop")


def test_program_runs_pauses_steps_resumes_and_stops(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    assert (shown(run), runs.active) == (READY, False)
    runs.run()
    assert (shown(run), runs.active) == (RUNNING, True)
    assert runs.view().title == "Starting", "nothing of its program was heard yet"
    assert runs.document is run.session.document
    run.works("c")
    assert runs.view().title.startswith("Running, ")
    runs.pause()
    tick_until(run.session, lambda: runs.view().state == "paused")
    assert (shown(run), runs.active) == (PAUSED, True)
    assert (bool(runs.stopped_blocks), runs.running_blocks) == (True, ())
    seen = runs.blocks_revision
    runs.step()
    tick_until(
        run.session,
        lambda: runs.blocks_revision > seen and not runs.running_blocks and shown(run) == PAUSED,
    )
    runs.run()
    assert (shown(run), runs.stopped_blocks) == (RUNNING, ())
    run.works("c")
    runs.set_pace(0.5)
    assert runs.view().is_slow
    runs.stop()
    assert not runs.active
    tick_until(run.session, lambda: runs.view().state == "ready")
    assert shown(run) == READY
    assert runs.view().title.startswith("Stopped after ")
    assert runs.view().detail == "It stopped at the dashed block"
    assert (runs.running_blocks, runs.stopped_blocks) == ((), ("c",))


def test_breakpoint_applies_immediately_and_is_not_a_pending_edit(run: Run) -> None:
    runs, blocks = run.session.runs, endless()
    run.session.document.apply_edit(blocks)
    runs.run()
    run.works("c")
    marked = block("variables_change", "c", VAR={"id": "n"}, BY=number(1)) | {"data": '{"pause":true}'}
    loop = block("control_forever", "loop", BODY=[marked])
    run.session.document.apply_edit(workspace(started(loop), variables=("n",)))
    run.pauses_at("c")
    assert not runs.view().is_edited
    run.session.document.apply_edit(blocks)
    tick_until(run.session, lambda: runs._breakpoints == ())
    runs.resume()
    run.works("c")
    assert runs.view().state == "running"


def pressed(run: Run, ago_s: float) -> None:
    """Set the time since the start of the run, which decides whether another press of Run is a double click.

    With a negative time it is one, however slow the computer is.
    """
    runs = run.session.runs
    runs._run = replace(runs._run, started_s=runs._clock() - ago_s)


def test_run_again_restarts_the_running_program(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    runs.run()
    run.works("c")
    first = runs._runner
    assert first is not None
    pressed(run, -60.0)
    runs.run()
    assert runs._runner is first, "two presses within half a second are one"
    assert shown(run) == RUNNING
    pressed(run, 10.0)
    runs.run()
    assert (runs.active, shown(run)) == (False, RUNNING), "nothing flashes while the robots answer"
    runs.run()  # still stopping: starts no third program
    tick_until(run.session, lambda: runs.active)
    assert runs._runner is not first
    assert first.state in {"stopping", "ended"}
    assert shown(run) == RUNNING
    second = runs._runner
    run.works("c")
    assert runs._runner is second
    runs.stop()
    tick_until(run.session, lambda: runs.view().state == "ready")
    assert runs.view().title.startswith("Stopped after ")


def test_stop_cancels_a_restart(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    runs.run()
    run.works("c")
    runs.restart()
    runs.stop()
    tick_until(run.session, lambda: runs.view().state == "ready")
    run.session.tick()
    assert not runs.active


def test_paused_program_is_restarted_from_its_beginning(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    runs.step()
    tick_until(run.session, lambda: runs.view().state == "paused")
    assert runs.view().can_restart
    runs.restart()
    tick_until(run.session, lambda: runs.view().state == "running" and runs.active)
    runs.stop()
    tick_until(run.session, lambda: runs.view().state == "ready")


def test_edits_during_a_run_are_reported_as_pending_until_undone(run: Run) -> None:
    runs, document = run.session.runs, run.session.document

    def says() -> bool:
        """Return whether the run bar reports pending edits, after the newest edit was compiled."""
        tick_until(run.session, lambda: document.newest_program() is document.program())
        runs.tick()
        view = runs.view()
        assert view.is_edited == (view.detail == "Your changes take effect at the next run")
        return view.is_edited

    document.apply_edit(endless())
    runs.run()
    run.works("c")
    assert not says()
    more = workspace(started(block("control_forever", "loop", BODY=[]), write(text("Hi"))))
    document.apply_edit(more)
    assert says()
    document.apply_edit(endless())
    assert not says(), "undone: it is what runs"
    document.apply_edit(more)
    assert says()
    run.session.documents.new()
    run.session.document.apply_edit(more)
    runs.tick()
    assert (runs.view().is_edited, runs.view().run_label) == (False, "Run"), "another tab shows"
    run.session.documents.show(document)
    assert says()
    runs.restart()
    tick_until(run.session, lambda: runs.active)
    assert not says()
    runs.stop()
    tick_until(run.session, lambda: runs.view().state == "ready")


def test_tried_stack_runs_only_after_the_running_program_has_stopped(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    runs.run()
    run.works("c")
    first = runs._runner
    runs.try_stack(Stack("c"))
    assert runs._runner is first, "what runs is stopped first"
    tick_until(run.session, lambda: runs.active)
    assert runs._runner is not first
    view = runs.view()
    assert (view.title, view.run_label, view.can_restart) == ("Trying “change by”", "Run", True)
    run.session.document.apply_edit(workspace())
    runs.tick()
    assert not runs.view().is_edited, "edits are no matter of a try"
    run.ends()
    tick_until(run.session, lambda: runs.view().state == "ready")
    view = runs.view()
    assert (view.title, view.detail) == ("Tried “change by”", "Finished")


def test_trying_a_variable_shows_its_value_in_the_run_without_stopping_the_program(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    tried = Stack("toolbox", "value", block("variables_get", VAR={"id": "n"}))

    def words() -> str:
        runs.try_stack(tried)
        assert runs.tried_value is not None
        return runs.tried_value.text

    assert words() == "no value yet"
    assert not runs.active
    runs.run()
    run.works("c")
    first = runs._runner
    runs._show_values({"n": VariableValue("n", "boolean", "yes")})
    assert words() == "yes"
    assert runs._runner is first
    assert runs.active


def test_stop_ends_a_tried_stack(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    runs.try_stack(Stack("loop"))
    run.works("c")
    runs.stop()
    tick_until(run.session, lambda: runs.view().state == "ready")
    assert runs.view().title == "“repeat forever” was stopped"
    assert runs.stopped_blocks == ("c",)


def test_empty_slot_of_a_tried_stack_is_reported_on_its_block(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(workspace(started(block("control_wait_until", "gap"))))
    runs.try_stack(Stack("gap"))
    assert not runs.active
    assert "needs a condition" in runs.block_errors["gap"]


def test_runner_reports_program_events_and_state(run: Run) -> None:
    told: list[RunnerEvent] = []
    runner = run.make_runner(told.append)

    def come(kind: type[RunnerEvent]) -> None:
        """Wait until an event is of this kind, check all events and clear them."""
        until(lambda: any(isinstance(event, kind) for event in told))
        assert {event.run for event in told} == {runner.run}
        assert not any(isinstance(event, ProgramFailed) for event in told)
        told.clear()

    program = compile_behaviour(endless(), [])
    assert runner.state == "ready"
    runner.start(program, [], run.session.address, paused=True)
    come(ProgramPaused)
    for _ in range(2):
        runner.step()
        come(ProgramPaused)
        assert runner.state == "paused"
    with pytest.raises(RunnerError, match="create a new one"):
        runner.start(program, [], run.session.address)
    runner.resume()
    assert runner.state == "running"
    come(ProgramRunning)
    runner.stop()
    until(lambda: bool(told) and isinstance(told[-1], ProgramEnded))
    ended = told[-1]
    assert isinstance(ended, ProgramEnded)
    assert (ended.is_ok, ended.text, runner.state) == (True, "", "ended")
    seen = len(told)
    runner.stop()  # already ended
    assert len(told) == seen
    assert runner.program_key != run.make_runner(told.append).program_key


def test_step_starts_a_program_at_its_first_block(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(workspace(started(write(text("Hi")) | {"id": "w"})))
    runs.step()
    assert runs.active
    tick_until(run.session, lambda: runs.view().state == "paused")
    assert runs.stopped_blocks == ("w",)
    assert runs.view().title == "Paused at “write”"
    runs.stop()
    tick_until(run.session, lambda: runs.view().state == "ready")


def test_finished_program_is_reported_and_can_run_again(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(workspace(started(write(text("Hi")))))
    for _ in range(2):
        runs.run()
        run.ends()
        tick_until(run.session, lambda: runs.view().state == "ready")
        assert shown(run) == READY
        assert runs.view().title.startswith("Finished after ")
        assert (runs.running_blocks, runs.stopped_blocks, runs.block_errors) == ((), (), {})
    assert not run.session.alerts.active


def test_failing_block_ends_the_program_and_is_marked(run: Run) -> None:
    runs = run.session.runs
    half = block("values_arithmetic", "v", A=number(1), SIGN="/", B=number(0))
    run.session.document.apply_edit(workspace(started(write(half))))
    runs.run()
    run.fails("v")
    tick_until(run.session, lambda: runs.view().state == "ready")
    assert runs.view().title.endswith("because of an error")
    assert list(runs.block_errors) == ["v"]
    assert runs.view().detail == runs.block_errors["v"]
    assert not run.session.alerts.active, "it stands on its block"


def test_killed_program_process_is_reported(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    runs.run()
    run.works("c")
    run.is_killed()
    tick_until(run.session, lambda: runs.view().state == "ready")
    (alert,) = run.session.alerts.active
    assert (alert.id, alert.title) == ("program", "The behaviour stopped unexpectedly.")
    assert alert.detail.startswith("The program's process was killed")
    assert runs.view().title.startswith("Stopped after ")


def test_late_events_of_an_earlier_run_are_ignored(run: Run) -> None:
    runs = run.session.runs
    run.session.document.apply_edit(endless())
    runs.run()
    earlier = runs._runner
    assert earlier is not None
    runs.stop()
    tick_until(run.session, lambda: runs.view().state == "ready")
    runs.run()
    run.works("c")
    assert runs._runner is not None
    assert runs._runner.run != earlier.run
    runs.on_runner_event(BlocksTraced(run=earlier.run, records=(BlockBegan(0.0, 9, "other"),)))
    assert runs.running_blocks != ("other",)
    runs.stop()
    tick_until(run.session, lambda: runs.view().state == "ready")
