"""Self-test of the real window with a virtual robot.

The test starts the robot, runs a greeting, presses Stop, takes a screenshot and closes the window. Each
step checks the visible result: the painted window, the rendered blocks, and the robot's own reports
that it moves and has stopped. Without the web view, the Developer layout is used.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from functools import partial

import PySide6
from PySide6.QtCore import QEvent, QObject, QTimer, qVersion
from PySide6.QtGui import QGuiApplication, QImage

from app.core.robots.robot_link import RobotLink
from app.core.self_test import SelfTest, timeouts
from app.core.self_test.environment import PICTURE
from app.core.session import Session
from app.ui.application import Options, run, startup_problem
from app.ui.panels.build.behaviour.panel import BehaviourPanel
from app.ui.self_drive import SelfDrive, Step
from app.ui.shell.main_window import MainWindow
from nep.i18n import _

ROBOT = "Pepper"
STATE_TOPIC = f"/{ROBOT}/state"
JOINT_PREFIXES = ("theta_deg", "head_", "arm_", "elbow_")
"""Prefixes of the robot's joint names in its state messages."""
SETTLE_S = 1.0
"""Pause in s before the screenshot, so that pending repaints are completed."""
REPORTED_LEVELS, MAX_REPORTED_RECORDS = ("warn", "error"), 40
"""Levels of the log records in the report, and their maximum number."""
MIN_COLOURS = 24
"""Minimum number of colours in a screenshot; an empty or incomplete window has fewer."""


class FirstPaint(QObject):
    """Event filter that calls a function once, after the first paint of a window."""

    def __init__(self, window: MainWindow, callback: Callable[[], object]) -> None:
        # `callback` is called in the event loop iteration after the paint event.
        super().__init__(window)
        self._window, self._callback = window, callback
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Paint and watched is self._window:
            self._window.removeEventFilter(self)
            QTimer.singleShot(0, self, self._callback)
        return False


class WindowSteps:
    """Steps of the self-test, with their actions and checks."""

    def __init__(self, window: MainWindow, test: SelfTest, *, loads_web_view: bool) -> None:
        # `loads_web_view`: the page of the block editor is loaded.
        self._window, self._session, self._test, self._loads_web_view = (
            window,
            window.session,
            test,
            loads_web_view,
        )
        self._is_painted = False
        self._drawing = b""
        self._is_drawing_requested = False
        self._is_watching_state = False
        self._initial_state: Mapping[str, object] = {}
        self._speech = self._movement = ""
        self._message_before_stop: object = None
        FirstPaint(window, self._on_painted)

    def all(self) -> list[Step]:
        """Return all steps in the order of execution."""
        steps = [
            self._step("window", _("the window"), lambda: None, lambda: self._is_painted),
            self._step("master", _("the master"), lambda: None, self._has_master, self._master_problem),
            self._step(
                "robot", _("the virtual robot"), self._start_robot, self._has_robot, self._robot_problem
            ),
            self._step("behaviour", _("the program of the greeting"), lambda: None, self._has_program),
        ]
        if self._loads_web_view:
            steps.append(
                self._step(
                    "editor",
                    _("the blocks of the greeting in the block editor"),
                    lambda: None,
                    self._has_blocks,
                )
            )
        return [
            *steps,
            self._step("run", _("the program runs"), self._run, self._is_running, self._run_problem),
            self._step(
                "moves", _("the robot speaks and moves"), lambda: None, self._has_moved, self._run_problem
            ),
            self._step("stop", _("the robot confirms that it has stopped"), self._stop, self._has_stopped),
            Step(
                _("a screenshot of the window"),
                lambda: None,
                lambda: True,
                timeouts.STEP_TIMEOUTS_S["picture"],
                PICTURE.removesuffix(".png"),
                SETTLE_S,
                name="picture",
            ),
        ]

    def _step(
        self,
        name: str,
        expected: str,
        action: Callable[[], object],
        is_visible: Callable[[], bool],
        failure_reason: Callable[[], str] = lambda: "",
    ) -> Step:
        return Step(
            expected,
            action,
            is_visible,
            timeouts.STEP_TIMEOUTS_S[name],
            settle_s=0.0,
            failure_reason=failure_reason,
            name=name,
            details=partial(self._details, name),
        )

    def _details(self, name: str) -> str:
        # Details for the report.
        session = self._session
        link = session.fleet.link(ROBOT)
        match name:
            case "master":
                return session.live.master.address
            case "robot":
                return link.state_label if link is not None else ""
            case "behaviour":
                return session.document.name
            case "editor":
                return _("{count} bytes of drawing").format(count=len(self._drawing))
            case "run":
                return session.runs.view().title
            case "moves":
                return f"“{self._speech}”, {self._movement}"
            case "stop":
                return session.runs.view().result or ""
        return ""

    def _on_painted(self) -> None:
        self._is_painted = True
        self._test.report.record_time("first_paint")

    def _has_master(self) -> bool:
        return self._session.live.master.kind == "connected" and self._session.launcher.has_started_master

    def _master_problem(self) -> str:
        return self._alert_text("companion:master")

    def _start_robot(self) -> None:
        if self._loads_web_view:
            self._window.commands.behaviours.start_demo()
            return
        self._session.launcher.start_virtual_robot(ROBOT)
        self._session.documents.open_example(self._window.examples[0].path)
        self._window.show_layout("developer")
        self._window.open_panel("robot")

    def _robot_link(self) -> RobotLink | None:
        link = self._session.fleet.link(ROBOT)
        return link if link is not None and link.state in {"ready", "busy"} else None

    def _has_robot(self) -> bool:
        if not self._is_watching_state and self._robot_link() is not None:
            self._is_watching_state = True
            self._session.live.watch(STATE_TOPIC)  # watched until the session ends
        return bool(self._state())

    def _robot_problem(self) -> str:
        return self._alert_text(f"companion:{ROBOT}")

    def _has_program(self) -> bool:
        program = self._session.document.newest_program()
        return program is not None and ROBOT in program.robots and program.starts > 0 and not program.errors

    def _has_blocks(self) -> bool:
        dock = self._window.find_dock("behaviour")
        if not self._is_drawing_requested and dock is not None and isinstance(dock.panel, BehaviourPanel):
            self._is_drawing_requested = True
            dock.panel.render_picture("svg", True, self._on_drawing)
        return bool(self._drawing)

    def _on_drawing(self, drawing: bytes) -> None:
        self._is_drawing_requested, self._drawing = False, drawing
        if drawing:
            self._test.report.record_time("editor_ready")

    def _run(self) -> None:
        self._initial_state = self._state()
        self._window.commands.run("run.run")

    def _is_running(self) -> bool:
        runs = self._session.runs
        return runs.view().state == "running" and bool(runs.running_blocks)

    def _run_problem(self) -> str:
        errors = self._session.runs.block_errors
        return next(iter(errors.values()), "") or self._alert_text("program")

    def _has_moved(self) -> bool:
        state = self._state()
        moved_joints = (
            name
            for name in state
            if name.startswith(JOINT_PREFIXES) and state[name] != self._initial_state.get(name)
        )
        self._speech = self._speech or str(state.get("speech") or "")
        self._movement = self._movement or next(
            (f"{name} {self._initial_state.get(name)} → {state[name]}" for name in moved_joints), ""
        )
        return bool(self._speech and self._movement)

    def _stop(self) -> None:
        self._message_before_stop = self._newest_message()
        self._window.commands.run("run.stop")

    def _has_stopped(self) -> bool:
        view, state = self._session.runs.view(), self._state()
        is_idle = state.get("moving") is False and not state.get("speech")
        is_confirmed = view.state == "proven" and bool(view.result) and view.result_status == "ok"
        return is_confirmed and is_idle and self._newest_message() is not self._message_before_stop

    def _newest_message(self) -> object:
        topic = self._session.shown.topics.get(STATE_TOPIC)
        return topic.newest if topic is not None else None

    def _state(self) -> Mapping[str, object]:
        # The last state published by the robot.
        topic = self._session.shown.topics.get(STATE_TOPIC)
        payload = topic.newest.payload if topic is not None and topic.newest is not None else None
        return payload if isinstance(payload, Mapping) else {}

    def _alert_text(self, id: str) -> str:
        alert = next((each for each in self._session.alerts.active if each.id == id), None)
        return f"{alert.title} {alert.detail}".strip() if alert is not None else ""


class SelfTestListener:
    """Listener that forwards the progress of the steps to the self-test."""

    def __init__(self, test: SelfTest, session: Session) -> None:
        self._test, self._session = test, session

    def step_started(self, step: Step) -> None:
        """Start a step in the self-test, and with it the step's time limit."""
        self._test.start_step(step.name, step.expected)

    def step_finished(self, step: Step) -> None:
        """Record the step as passed, or as failed if its screenshot has too few colours."""
        if not step.picture:
            self._test.record_success(step.details())
            return
        colours = colour_count(QImage(str(self._test.environment.path(PICTURE))))
        if colours < MIN_COLOURS:
            self._test.fail(_("the screenshot of the window has only {count} colours").format(count=colours))
        else:
            self._test.record_success(_("{count} colours").format(count=colours))

    def run_finished(self, has_succeeded: bool, message: str) -> None:
        """Add the console's warnings and errors to the report, record any failure, and start the last step.

        The last step is the closing of the window.
        """
        reported_records = [each for each in self._session.console.records if each.level in REPORTED_LEVELS]
        self._test.report.add_computer_info(
            console=[
                f"{each.level} {each.origin}: {each.text}"
                for each in reported_records[-MAX_REPORTED_RECORDS:]
            ]
        )
        if not has_succeeded:
            self._test.fail(message)
        self._test.start_step("close", _("the window closes; the robot and the program stop"))


def colour_count(picture: QImage) -> int:
    """Count the distinct colours in a sample of an image's pixels; 0 for an empty image."""
    return len(
        {picture.pixel(x, y) for x in range(0, picture.width(), 7) for y in range(0, picture.height(), 7)}
    )


def run_window_steps(test: SelfTest, *, loads_web_view: bool) -> int:
    """Show the window and run the steps of the self-test in it.

    Args:
        test: Self-test that records the results.
        loads_web_view: True to load the page of the block editor.

    Returns:
        The exit code of the window; 0 if no window can be opened, which is recorded as a failure.
    """
    problem = startup_problem(os.environ, sys.platform, os.geteuid() if hasattr(os, "geteuid") else 1)
    if problem:
        test.fail(problem)
        return 0

    def make_driver(window: MainWindow) -> SelfDrive:
        test.record_success(f"Qt {qVersion()}")
        test.report.add_computer_info(
            qt=qVersion(), pyside=PySide6.__version__, screen=QGuiApplication.platformName()
        )
        steps = WindowSteps(window, test, loads_web_view=loads_web_view).all()
        listener, picture = SelfTestListener(test, window.session), PICTURE.removesuffix(".png")
        return SelfDrive(window, test.environment.folder, steps, listener, picture)

    return run(Options(make_driver=make_driver, loads_web_view=loads_web_view))
