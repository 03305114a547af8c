"""Run, Pause, Step and Stop.

The program's process, the robots' answers, and what the run bar says of them.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from app.core.alerts import Alerts
from app.core.console import Console
from app.core.document import Document
from app.core.fleet import Fleet
from app.core.run_view import RunView, connected_words, listed, result_words, seconds, unanswered_words
from app.core.runner import Runner, RunnerEvent
from app.core.stopping import RobotStop, RobotStopper, StopReport
from app.errors import AppError

STOPPING_SHOWN_AFTER_S = 0.1
STOP_TIMEOUT_S = 1.0


@dataclass(frozen=True, slots=True)
class StopDone:
    """Every robot was told to stop, and answered or not."""

    number: int
    report: StopReport


@dataclass(frozen=True, slots=True)
class RobotAnswered:
    """One robot answered while others are waited for."""

    number: int
    robot: RobotStop


class Network(Protocol):
    """What a run needs of the network."""

    address: str
    stopper: RobotStopper | None


class Runs:
    """The behaviour's runs. One thread uses it (the window's); the stop itself happens beside it."""

    def __init__(
        self,
        document: Document,
        fleet: Fleet,
        network: Network,
        *,
        alerts: Alerts,
        console: Console,
        post_event: Callable[[object], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Nothing runs yet."""
        self._document, self._fleet, self._network = document, fleet, network
        self._alerts, self._console, self._post_event, self._clock = alerts, console, post_event, clock
        self._runner: Runner | None = None
        self._state = "ready"
        self._name = ""
        self._says = ""
        self._paused_at = ""
        self._started_s = 0.0
        self._elapsed_s: float | None = None
        self._held_s = 0.0
        self._pause_began: float | None = None
        self._stop_pressed_s = 0.0
        self._stop_number = 0
        self._stop_thread: threading.Thread | None = None
        self._answered: list[RobotStop] = []
        self._asked: tuple[str, ...] = ()
        self._report: StopReport | None = None
        self._ended_by_itself = False
        self._last_words = ""
        self.running_blocks: tuple[str, ...] = ()
        self.stopped_blocks: tuple[str, ...] = ()
        self.block_errors: Mapping[str, str] = {}
        self.blocks_revision = 0

    # -- what a person does ----------------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        """Whether a program runs or is paused."""
        return self._state in {"running", "paused"}

    def run(self) -> None:
        """Run the behaviour as it is now; while paused, go on. Problems are told on their blocks."""
        if self._state == "paused":
            self.go_on()
        elif self._state in {"ready", "proven"}:
            self._begin(paused=False)

    def step(self) -> None:
        """Run one block: of a paused program the next, of none the first."""
        if self._state in {"ready", "proven"}:
            self._begin(paused=True)
        elif self._runner is not None:
            if self._state == "running":
                self._runner.pause()
            else:
                self._runner.step()

    def pause(self) -> None:
        """Hold the program at its next block; its robots keep still, its clock stands."""
        if self._state == "running" and self._runner is not None:
            self._runner.pause()

    def go_on(self) -> None:
        """Let a paused program go on."""
        if self._state == "paused" and self._runner is not None:
            self._runner.go_on()
            self._resume()

    def stop(self) -> None:
        """End the program and tell every robot to stop; what they answer is the run bar's result."""
        self._stop_pressed_s = self._clock()
        self._stop_number += 1
        if self.active:
            self._elapsed_s = self._elapsed()
        self._state, self._report, self._answered = "stopping", None, []
        self._asked = tuple(link.name for link in self._fleet.connected)
        self._mark(running=(), stopped=self.running_blocks or self.stopped_blocks)
        number, runner, stopper = self._stop_number, self._runner, self._network.stopper
        self._stop_thread = threading.Thread(
            target=self._stop_all, args=(number, runner, stopper), name="studio-stop", daemon=True
        )
        self._stop_thread.start()

    def confirm_still(self) -> None:
        """A person says that the robot that did not answer stands still."""
        if self._state == "unanswered":
            self._state, self._report = "ready", None
            self._alerts.cure("stop")

    def close(self) -> None:
        """The window closes: end the program; its robots are told by its end."""
        if self._runner is not None:
            self._runner.close()
        if self._stop_thread is not None:
            self._stop_thread.join(timeout=STOP_TIMEOUT_S + 1)

    # -- what it says ----------------------------------------------------------------------------------------

    def view(self) -> RunView:
        """The state of the run bar now."""
        view = self._view()
        if self._last_words and view.state in {"running", "paused"}:
            return replace(view, last_stop=self._last_words)
        return view

    def _view(self) -> RunView:
        names = [link.name for link in self._fleet.connected]
        ready = RunView(
            "ready",
            "Ready",
            connected_words(names),
            "Ready",
            can_run=True,
            can_step=True,
            stop_filled=bool(names),
        )
        if self._state == "stopping" and self._clock() - self._stop_pressed_s < STOPPING_SHOWN_AFTER_S:
            return replace(
                ready, can_run=False, can_step=False, title="Stopping", detail="", compact="Stopping"
            )
        views: dict[str, Callable[[], RunView]] = {
            "running": self._running_view,
            "paused": self._paused_view,
            "stopping": self._stopping_view,
            "proven": self._proven_view,
            "unanswered": self._unanswered_view,
        }
        return views[self._state]() if self._state in views else ready

    def _running_view(self) -> RunView:
        time_words = seconds(self._elapsed())
        return RunView(
            "running",
            f"Running, {time_words}",
            self._says,
            f"{self._name} runs, {time_words}",
            can_pause=True,
            can_step=True,
        )

    def _paused_view(self) -> RunView:
        title = f"Paused at “{self._paused_at}”" if self._paused_at else "Paused"
        return RunView(
            "paused",
            title,
            "Robots hold still; the clock stands",
            f"{self._name} is paused",
            can_run=True,
            can_step=True,
            run_word="Go on",
        )

    def _stopping_view(self) -> RunView:
        done = {robot.name for robot in self._answered if robot.answered}
        waiting = [name for name in self._asked if name not in done]
        waited = self._clock() - self._stop_pressed_s
        detail = f"Waiting for {listed(waiting)}, {waited:.1f} s" if waiting else ""
        result = f"{len(done)} of {len(self._asked)} robots stopped" if self._asked else None
        return RunView("stopping", "Stopping", detail, "Stopping", stop_word="Stopping", result=result)

    def _proven_view(self) -> RunView:
        words, good = result_words(self._report) if self._report is not None else ("", True)
        detail = "The dashed outline shows where" if self.stopped_blocks else ""
        title = f"Stopped after {seconds(self._elapsed_s)}" if self._elapsed_s is not None else "Stopped"
        if self._ended_by_itself:
            title, detail = f"Finished after {seconds(self._elapsed_s or 0)}", "Every script came to its end"
        if self.block_errors:
            title = f"Stopped by a problem after {seconds(self._elapsed_s or 0)}"
            detail = next(iter(self.block_errors.values()))
        return RunView(
            "proven",
            title,
            detail,
            words or "Stopped",
            can_run=True,
            can_step=True,
            result=words or None,
            result_ok=good,
        )

    def _unanswered_view(self) -> RunView:
        if self._report is None:
            return self._proven_view()
        title, detail, compact, confirm = unanswered_words(self._report)
        words, _ = result_words(self._report)
        return RunView(
            "unanswered",
            title,
            detail,
            compact,
            stop_word="Stop again",
            result=words,
            result_ok=False,
            confirm=confirm,
        )

    # -- what the session tells ------------------------------------------------------------------------------

    def on_runner(self, event: RunnerEvent) -> None:
        """Take over what the program's process said."""
        if event.run != (self._runner.run if self._runner is not None else None):
            return  # of a run before this one
        match event.kind:
            case "running":
                self._mark(running=event.blocks, stopped=())
                self._says = event.says or self._says
            case "paused":
                self._state, self._paused_at = "paused", event.says
                self._pause_began = self._pause_began or self._clock()
                self._mark(running=(), stopped=event.blocks)
            case "error":
                self.block_errors = {event.block: event.text} if event.block else {}
                self._mark(running=(), stopped=())
                self._console.add("error", self._name, event.text)
                if not event.block:
                    self._alerts.put("program", "error", event.text, "The behaviour was stopped.")
            case "print":
                self._console.add("info", self._name, event.text)
            case "ended":
                self._ended(event)

    def on_stop(self, event: StopDone | RobotAnswered) -> None:
        """Take over what robots answered to the newest stop."""
        if event.number != self._stop_number:
            return
        if isinstance(event, RobotAnswered):
            self._answered.append(event.robot)
            return
        self._report = event.report
        words, good = result_words(event.report)
        self._last_words = words
        self._state = "proven" if good else "unanswered"
        self._tell_fleet(event.report)
        self._console.add("info" if good else "error", self._name or "stop", words)
        if good:
            self._alerts.cure("stop")
        else:
            title, detail, _, _ = unanswered_words(event.report)
            self._alerts.put("stop", "error", f"{title}.", detail, button="Stop again", action="run.stop")

    # -- inside ----------------------------------------------------------------------------------------------

    def _begin(self, *, paused: bool) -> None:
        self._alerts.cure("program")
        self.block_errors, self._report, self._ended_by_itself = {}, None, False
        self._mark(running=(), stopped=())
        try:
            program = self._document.program()
            wrong = {p.block_id: p.sentence for p in program.problems if p.severity == "error" and p.block_id}
            if wrong:
                self.block_errors = wrong
                self._mark(running=(), stopped=())
                return
            robots = [link.robot.source for link in self._fleet.connected]
            runner = Runner(self._post_event)
            runner.start(program, robots, self._network.address, name=self._document.name, paused=paused)
        except AppError as error:
            self._alerts.put("program", "error", "The behaviour can't be started.", str(error))
            self._state = "ready"
            return
        self._runner, self._name = runner, self._document.name
        self._state, self._says, self._paused_at = "running", "", ""
        self._started_s, self._held_s, self._pause_began, self._elapsed_s = self._clock(), 0.0, None, None
        self._console.add("info", self._name, "started")

    def _ended(self, event: RunnerEvent) -> None:
        if self._runner is not None:
            self._runner = None
        if self._state == "stopping":
            return
        self._ended_by_itself = event.ok and not self.block_errors
        if event.text and not event.ok and not self.block_errors:
            self._alerts.put("program", "error", "The behaviour ended by itself.", event.text)
        stopped = self.running_blocks if not event.ok else ()
        ended_by_itself, errors = self._ended_by_itself, self.block_errors
        self.stop()  # the end of a program is a stop like any other: every robot is told and must answer
        self._ended_by_itself, self.block_errors = ended_by_itself, errors
        self._mark(running=(), stopped=stopped)

    def _resume(self) -> None:
        if self._pause_began is not None:
            self._held_s += self._clock() - self._pause_began
            self._pause_began = None
        self._state = "running"
        self._mark(running=self.running_blocks, stopped=())

    def _elapsed(self) -> float:
        held = self._held_s
        if self._pause_began is not None:
            held += self._clock() - self._pause_began
        return max(0.0, self._clock() - self._started_s - held)

    def _mark(self, *, running: tuple[str, ...], stopped: tuple[str, ...]) -> None:
        self.running_blocks, self.stopped_blocks = running, stopped
        self.blocks_revision += 1

    def _stop_all(self, number: int, runner: Runner | None, stopper: RobotStopper | None) -> None:
        # robots first: their answer takes a round trip, the process ends meanwhile
        ended = (
            threading.Thread(target=runner.stop, name="studio-stop-program", daemon=True) if runner else None
        )
        if ended is not None:
            ended.start()
        report = StopReport((), 0.0)
        if stopper is not None:
            report = stopper.stop_all(
                timeout_s=STOP_TIMEOUT_S,
                on_answer=lambda robot: self._post_event(RobotAnswered(number, robot)),
            )
        if ended is not None:
            ended.join(timeout=STOP_TIMEOUT_S)
        self._post_event(StopDone(number, report))

    def _tell_fleet(self, report: StopReport) -> None:
        now = time.localtime()
        clock = f"{now.tm_hour}:{now.tm_min:02d}"
        words = {}
        for robot in report.robots:
            if not robot.can_confirm:
                words[robot.name] = f"sent at {clock}; this robot cannot confirm"
            elif robot.answered:
                words[robot.name] = f"answered in {max(1, round(robot.elapsed_ms or 0))} ms, at {clock}"
            else:
                words[robot.name] = f"not answered, at {clock}"
        self._fleet.stopped(words.keys(), words)
