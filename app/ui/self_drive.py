"""Unattended operation of the real window: a list of steps, each with an expected result to wait for.

Each step can save a screenshot. A step that fails or exceeds its time limit ends the run with an
explanation.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QApplication

from app.intents import Inspect
from app.ui.intents import OpenPanel
from app.ui.shell.main_window import DEFAULT_SIZE, MainWindow
from nep.i18n import _, number
from nep.messages.codecs import content_of

POLL_MS = 100
SETTLE_S = 0.6


@dataclass(frozen=True)
class Step:
    """Action on the window, with the condition to wait for.

    Attributes:
        expected: Description of the expected result.
        action: Performs the action.
        is_visible: Returns True once the result is visible.
        timeout_s: Time limit in s.
        picture: File name of the screenshot without extension, or "" for none.
        settle_s: Pause in s between the result and the screenshot.
        failure_reason: Returns the reason if the result can't occur any more, which fails the step, or
            "".
        details: Returns details for the report.
        name: Name of the step in the report.
    """

    expected: str
    action: Callable[[], object]
    is_visible: Callable[[], bool]
    timeout_s: float = 20.0
    picture: str = ""
    settle_s: float = SETTLE_S
    failure_reason: Callable[[], str] = lambda: ""
    details: Callable[[], str] = lambda: ""
    name: str = ""


class Listener(Protocol):
    """Observer of the progress of a `SelfDrive`."""

    def step_started(self, step: Step) -> None:
        """Called before the action of a step."""

    def step_finished(self, step: Step) -> None:
        """Called after the result of a step was visible and its screenshot was saved."""

    def run_finished(self, has_succeeded: bool, message: str) -> None:
        """Called at the end of the run, before the window closes.

        Args:
            has_succeeded: True if all steps succeeded.
            message: Summary of the run, or description of the failure.
        """


class ResultPrinter:
    """Listener that prints the result of the run to stdout, or a failure to stderr."""

    def step_started(self, step: Step) -> None:
        """Ignore the start of a step."""

    def step_finished(self, step: Step) -> None:
        """Ignore the result of a step."""

    def run_finished(self, has_succeeded: bool, message: str) -> None:
        """Print the result to stdout, or a failure to stderr."""
        (sys.stdout if has_succeeded else sys.stderr).write(message + "\n")


class SelfDrive(QObject):
    """Runner that performs the steps in order and then closes the window.

    Attributes:
        has_succeeded: True once all steps have succeeded.
        pictures: Paths of the saved screenshots.
    """

    def __init__(
        self,
        window: MainWindow,
        folder: Path,
        steps: Sequence[Step] | None = None,
        listener: Listener | None = None,
        failed_picture: str = "failed",
    ) -> None:
        # Starts immediately. `steps` replace the default ones; `failed_picture` is the name of the screenshot
        # of a failed step.
        super().__init__(window)
        self._window, self._commands, self._folder = window, window.commands, folder
        self._listener = listener if listener is not None else ResultPrinter()
        self._failed_picture = failed_picture
        self.has_succeeded = False
        self.pictures: list[Path] = []
        self._steps = iter(steps if steps is not None else self._plan())
        self._step: Step | None = None
        self._step_started_s = 0.0
        self._visible_since_s: float | None = None
        window.resize(DEFAULT_SIZE)
        folder.mkdir(parents=True, exist_ok=True)
        self._timer = QTimer(self)
        self._timer.setInterval(POLL_MS)
        self._timer.timeout.connect(self._check)
        self._start_next_step()
        self._timer.start()

    def _plan(self) -> list[Step]:
        window, session = self._window, self._window.session
        run, request = self._commands.run, self._commands.request

        def has_robot() -> bool:
            return any(link.state in {"ready", "busy"} for link in session.fleet.links)

        def has_run_state(*names: str) -> Callable[[], bool]:
            return lambda: session.runs.view().state in names

        def is_block_highlighted() -> bool:
            return session.runs.view().state == "running" and bool(session.runs.running_blocks)

        def has_inspected_topic() -> bool:
            return any(topic.is_watched and topic.newest is not None for topic in session.shown.topics)

        return [
            Step("the start page", self._show_start_page, window.isVisible, picture="start-light"),
            Step(
                "the start page in dark colours",
                lambda: run("theme.dark"),
                window.isVisible,
                picture="start-dark",
            ),
            Step("the virtual robot", self._start_demo, has_robot, 40, settle_s=2.5),
            Step(
                "the program runs", lambda: run("run.run"), is_block_highlighted, 30, "behaviour-light", 1.5
            ),
            Step(
                "the running program in dark colours",
                lambda: run("theme.dark"),
                lambda: True,
                5,
                "behaviour-dark",
            ),
            Step("every robot stopped", lambda: run("run.stop"), has_run_state("proven"), 5, "stopped-dark"),
            Step("the topics", lambda: run("layout.developer"), self._has_demo_topics, 20),
            Step("a message", self._inspect, has_inspected_topic, 20, "developer-dark", 2.5),
            Step(
                "the topics in light colours", lambda: run("theme.light"), lambda: True, 5, "developer-light"
            ),
            Step("the stopped program", lambda: run("layout.behaviour"), lambda: True, 5, "stopped-light"),
            Step(
                "the robot's actions",
                lambda: request(OpenPanel("robots")),
                lambda: True,
                5,
                "robots-light",
            ),
        ]

    def _show_start_page(self) -> None:
        self._commands.run("theme.light")
        self._window.show_start()

    def _start_demo(self) -> None:
        self._commands.run("theme.light")
        self._commands.behaviours.start_demo()

    def _has_demo_topics(self) -> bool:
        return len(self._window.session.shown.topics) > 3

    def _inspect(self) -> None:
        topics = self._window.session.shown.topics
        poses = [topic.name for topic in topics if topic.name.endswith(("/pose", "/state"))]
        cameras = [topic.name for topic in topics if content_of(topic.codec) == "image"]
        if cameras:
            self._window.open_topic(cameras[0])
        if poses:
            self._commands.request(Inspect(poses[0]))

    def _start_next_step(self) -> None:
        self._step = next(self._steps, None)
        self._visible_since_s = None
        self._step_started_s = time.monotonic()
        if self._step is None:
            self._finish(True, f"all steps succeeded; {len(self.pictures)} pictures are in {self._folder}")
            return
        self._listener.step_started(self._step)
        try:
            self._step.action()
        except Exception as error:
            self._fail(self._step, f"{type(error).__name__}: {error}")
            raise

    def _check(self) -> None:
        step = self._step
        if step is None:
            return
        try:
            self._check_step(step, time.monotonic())
        except Exception as error:
            self._fail(step, f"{type(error).__name__}: {error}")
            raise

    def _check_step(self, step: Step, now: float) -> None:
        if self._visible_since_s is None and step.is_visible():
            self._visible_since_s = now
        if self._visible_since_s is not None:
            if now - self._visible_since_s >= step.settle_s:
                self._save_screenshot(step.picture)
                self._listener.step_finished(step)
                self._start_next_step()
        elif reason := step.failure_reason():
            self._fail(step, reason)
        elif now - self._step_started_s > step.timeout_s:
            self._fail(step, "")

    def _fail(self, step: Step, reason: str) -> None:
        self._save_screenshot(self._failed_picture)
        if reason:
            message = _("step failed: {what}: {why}").format(what=step.expected, why=reason)
        else:
            seconds = number(step.timeout_s, "g")
            message = _("step not completed within {seconds} s: {what}").format(
                seconds=seconds, what=step.expected
            )
        self._finish(False, message)

    def _save_screenshot(self, name: str) -> None:
        if not name:
            return
        path = self._folder / f"{name}.png"
        if self._window.grab().save(str(path)):
            self.pictures.append(path)
        else:
            sys.stderr.write(f"the picture {path} can't be written\n")

    def _finish(self, has_succeeded: bool, message: str) -> None:
        self.has_succeeded = has_succeeded
        self._timer.stop()
        self._step = None
        try:
            self._listener.run_finished(has_succeeded, message)
        finally:  # the window must close even if the listener fails
            for widget in QApplication.topLevelWidgets():
                if widget is self._window:
                    widget.close()
