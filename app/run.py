"""Command ``python -m app run FILE``: run a behaviour without a window.

Exit codes: 0 success, 1 a block failed or a robot did not stop, 2 the file can't be run, 3 a robot is
missing, 4 a real robot would move without permission, 130 stopped by Ctrl+C.
"""

from __future__ import annotations

import re
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TextIO

import nep
from app.blocks.compiler.compiler import ProjectCompiler
from app.blocks.interrupts import without_interrupts
from app.blocks.model.program import Program
from app.blocks.model.project import Project
from app.blocks.model.workspace import Workspace, parse_workspace
from app.blocks.runtime.events import (
    LinePrinted,
    ProgramEnded,
    ProgramFailed,
    ProgramRunning,
    RunnerEvent,
)
from app.core.projects.file_format import read_file
from app.core.robots.launcher import VirtualProcesses
from app.core.robots.motion.permission import actions_by_robot, risky_action_titles
from app.core.robots.stop.stopper import RobotStopper
from app.core.run.runner import Runner
from app.errors import AppError, DescriptionError
from app.robots.client.discovery import FoundRobots, find_robots
from app.robots.client.limits import DISCOVERY_TIMEOUT_S, LATE_DISCOVERY_INTERVAL_S, ROBOT_WAIT_S
from app.robots.client.stop import StopTarget
from app.robots.client.stop_report import StopReport
from app.robots.description.description import Robot, parse
from app.robots.identity import controls_of
from nep.errors import NepError
from nep.i18n import _, format_list, number
from nep.programs.robots.moving import description_topics, moving_topics
from nep.system.streams import print_error
from nep.text import escaped

OK, FAILED, UNUSABLE, ROBOT_MISSING, MAY_NOT_MOVE, INTERRUPTED = 0, 1, 2, 3, 4, 130
POLL_INTERVAL_S = 0.1
_START_BLOCK_TYPE = re.compile(r"events_|robot_.*_when_")


def run_file(
    path: Path | str,
    *,
    robot_wait_s: float = ROBOT_WAIT_S,
    master: str | None = None,
    out: TextIO | None = None,
    interrupted: threading.Event | None = None,
    allow_moving: bool = False,
    keep_position: bool = False,
) -> int:
    """Run a behaviour file to its end and return the exit code (see the module docstring).

    Ctrl+C stops the behaviour and waits until its robots have confirmed the stop. If ``out`` can't be written
    (its reader has closed it, the disk is full), the behaviour is stopped in the same way and the exit code
    is 1.

    Args:
        path: Behaviour file.
        robot_wait_s: Maximum wait in seconds for the robots that the blocks use.
        master: Master address; default as for `nep.node`.
        out: Stream for the output, one event per line; default stdout.
        interrupted: Event that another thread can set to stop the behaviour like Ctrl+C.
        allow_moving: True to let the behaviour move real robots; otherwise a behaviour that would move one is
            rejected.
        keep_position: True to leave virtual robots where they are; otherwise they are moved to their start
            position.
    """
    stop_requested = interrupted or threading.Event()
    write_line = _LineWriter(out or sys.stdout, stop_requested)
    try:
        project, compiler = read_file(Path(path)), ProjectCompiler()
        known_robots = _parse_descriptions(project.robots)
        robot_names = used_robot_names(project)
        with nep.node("behaviour runner", master=master) as node:
            found_robots = _find_used_robots(project, compiler, node, robot_wait_s, known_robots)
            discovered = _with_trusted_virtual(found_robots)
            for claim in discovered.rejected_claims:
                write_line(_("warning: {sentence}").format(sentence=claim))
            program = compiler.compile(
                project.pages, discovered.robots, absent=known_robots, name=project.name
            )
            code = _rejection_exit_code(program, robot_names, discovered.robots, write_line)
            if code is not None:
                return code
            used_robots = [robot for robot in discovered.robots if robot.name in program.robots]
            if not allow_moving and _would_move(program, used_robots, write_line):
                return MAY_NOT_MOVE
            if not keep_position:
                _reset_positions(node, [robot for robot in used_robots if robot.virtual])
            with closing(RobotStopper(node)) as stopper:
                stopper.set_robots(
                    StopTarget(robot, discovered.owners.get(robot.name)) for robot in used_robots
                )
                return _run(
                    program, discovered, _Connection(master, node, stopper), write_line, stop_requested
                )
    except KeyboardInterrupt:
        return INTERRUPTED
    except (AppError, NepError) as error:
        write_line(f"{error}.")
        return UNUSABLE
    finally:
        write_line.report_problem()


def _find_used_robots(
    project: Project,
    compiler: ProjectCompiler,
    node: nep.Node,
    wait_s: float,
    known_robots: Sequence[Robot],
) -> FoundRobots:
    robot_names = used_robot_names(project)
    discovered = (
        find_robots(node, wait_s, expected=robot_names, previous=known_robots)
        if robot_names
        else FoundRobots()
    )
    if compiler.compile(project.pages, discovered.robots, absent=known_robots).publishes:
        discovered = find_robots(
            node, DISCOVERY_TIMEOUT_S, expected=(), previous=known_robots
        )  # publish blocks may move any of them
    return discovered


def _with_trusted_virtual(discovered: FoundRobots) -> FoundRobots:
    # Only robots whose programs are known to be Studio's own count as virtual (docs/trust.md).
    processes = VirtualProcesses()
    robots = (
        replace(
            robot, virtual=robot.virtual and processes.is_started_by_studio(discovered.owners[robot.name])
        )
        if robot.name in discovered.owners
        else robot
        for robot in discovered.robots
    )
    return replace(discovered, robots=tuple(robots))


def used_robot_names(project: Project) -> tuple[str, ...]:
    """Return the sorted names of the robots used in scripts that have a start block.

    The result includes robots that the file does not describe.
    """
    parsed_pages = (parse_workspace(page.workspace.blocks) for page in project.pages)
    scripts = (script for parsed in parsed_pages for script in parsed.scripts)
    started = tuple(script for script in scripts if _START_BLOCK_TYPE.match(script[0].type))
    blocks = Workspace(started, {}).all_blocks()
    return tuple(sorted({block.field_text("ROBOT") for block in blocks if block.is_enabled} - {""}))


class _LineWriter:
    """Writer of lines to a stream. Thread-safe.

    Args:
        stream: Stream for the output.
        stop_requested: Event that is set if the stream can't be written any more.
    """

    def __init__(self, stream: TextIO, stop_requested: threading.Event) -> None:
        self._stream = stream
        self._stop_requested = stop_requested
        self._lock = threading.Lock()
        self._problem: str | None = None

    @property
    def has_failed(self) -> bool:
        return self._problem is not None

    def __call__(self, text: str) -> None:
        # Control characters are escaped: the text may come from other programs.
        line = escaped(text, lines=True)
        with self._lock:
            if self._problem is not None:
                return
            try:
                self._stream.write(line + "\n")
                self._stream.flush()
            except (OSError, ValueError) as error:
                is_closed = isinstance(error, (BrokenPipeError, ValueError))
                reason = getattr(error, "strerror", None) or str(error)
                self._problem = "" if is_closed else reason.lower()
                self._stop_requested.set()

    def report_problem(self) -> None:
        # Silent when the reader closed the stream: that is a normal end.
        if self._problem:
            print_error(
                _("the output can't be written: {reason}; the behaviour was stopped.").format(
                    reason=self._problem
                )
            )


def _parse_descriptions(descriptions: Mapping[str, Mapping[str, object]]) -> list[Robot]:
    robots = []
    for description in descriptions.values():
        try:
            robots.append(parse(description))
        except DescriptionError:
            continue
    return robots


def _rejection_exit_code(
    program: Program, robot_names: Sequence[str], robots: Sequence[Robot], write_line: Callable[[str], None]
) -> int | None:
    for problem in program.problems:
        template = _("error: {sentence}") if problem.severity == "error" else _("warning: {sentence}")
        write_line(template.format(sentence=problem.message))
    missing = sorted(set(robot_names) - {robot.name for robot in robots})
    if missing:
        write_line(
            _("Not found: {robots}. Switch on the robots or start virtual ones.").format(
                robots=format_list(missing)
            )
        )
        return ROBOT_MISSING
    if program.errors or not program.starts:
        write_line(_("“{name}” can't run.").format(name=program.name))
        return UNUSABLE
    return None


def _would_move(program: Program, robots: Sequence[Robot], write_line: Callable[[str], None]) -> bool:
    real_robots = [robot for robot in robots if not robot.virtual]
    used_actions = actions_by_robot(program, real_robots)
    risky_titles_by_robot = {
        robot.name: risky_action_titles(robot, actions) for robot, actions in used_actions
    }
    for name, titles in risky_titles_by_robot.items():
        if titles:
            write_line(
                _("{robot} would move ({actions}). To allow this, add --allow-moving.").format(
                    robot=name, actions=", ".join(titles)
                )
            )
    return any(risky_titles_by_robot.values())


def _reset_positions(node: nep.Node, robots: Sequence[Robot]) -> None:
    names = [robot.name for robot in robots]
    for topic in filter(None, (robot.topics.world for robot in robots)):
        with node.new_pub(topic, "json") as world:
            world.publish({"start": names})


@dataclass(frozen=True)
class _Connection:
    """Connection to the network.

    Attributes:
        master: Address of the master; None for the default.
        node: Node of the runner.
        stopper: Stopper of the behaviour's robots.
    """

    master: str | None
    node: nep.Node
    stopper: RobotStopper


def _run(
    program: Program,
    discovered: FoundRobots,
    connection: _Connection,
    write_line: _LineWriter,
    interrupted: threading.Event,
) -> int:
    stopper = connection.stopper
    events = _RunEvents(write_line)
    runner = Runner(events)
    write_line(_("Running “{name}”").format(name=program.name))
    if interrupted.is_set():
        return FAILED if write_line.has_failed else INTERRUPTED
    owners = {name: owner.node_id for name, owner in discovered.owners.items()}
    late_robots = _LateRobotMonitor(connection.node, runner) if program.publishes else None
    try:
        runner.start(program, [robot.source for robot in discovered.robots], connection.master, owners=owners)
        while not runner.wait(POLL_INTERVAL_S) and not interrupted.is_set():
            if late_robots is not None:
                late_robots.poll()
        was_interrupted = interrupted.is_set()
    except KeyboardInterrupt:
        was_interrupted = True
    with without_interrupts():
        # Immediately, and again when the program has ended and can't move the robots any more.
        stopper.send_stop(program_key=runner.program_key)
        runner.close()
        names = [
            *(robot.name for robot in discovered.robots if robot.name in program.robots),
            *events.unresponsive_robots,
        ]
        report = stopper.stop_all(names, program_key=runner.program_key)
        for line in stop_lines(report):
            write_line(line)
    if was_interrupted:
        return INTERRUPTED if not report.unconfirmed_robots and not write_line.has_failed else FAILED
    return OK if events.is_ok and not report.unconfirmed_robots else FAILED


class _LateRobotMonitor:
    """Monitor that informs a program about new robots, which it must not move by publishing."""

    def __init__(self, node: nep.Node, runner: Runner) -> None:
        self._node, self._runner = node, runner
        self._next_poll_s = time.monotonic() + LATE_DISCOVERY_INTERVAL_S
        self._known_topics: tuple[str, ...] = ()

    def poll(self) -> None:
        if time.monotonic() < self._next_poll_s:
            return
        with suppress(NepError):
            view = self._node.graph()
            topics = tuple(sorted(description_topics(view)))
            if topics != self._known_topics:
                discovered = find_robots(self._node, LATE_DISCOVERY_INTERVAL_S)
                unread = set(topics) - {robot.topics.description for robot in discovered.robots}
                moving = moving_topics(view, map(controls_of, discovered.robots), unread)
                self._runner.set_robots({}, moving.topics)
                self._known_topics = topics if not unread else ()
        self._next_poll_s = time.monotonic() + LATE_DISCOVERY_INTERVAL_S


class _RunEvents:
    """Handler of the runner's events: writes them as lines and stores the result of the run."""

    def __init__(self, write_line: Callable[[str], None]) -> None:
        self._write_line = write_line
        self._last_description = ""
        self.is_ok = True
        self.unresponsive_robots: tuple[str, ...] = ()

    def __call__(self, event: RunnerEvent) -> None:
        if isinstance(event, ProgramRunning) and event.description != self._last_description:
            self._last_description = event.description
            if event.description:
                self._write_line(event.description)
        elif isinstance(event, LinePrinted | ProgramFailed | ProgramEnded) and (
            event.text or not isinstance(event, ProgramEnded)
        ):
            self._write_line(event.text)
        if isinstance(event, ProgramEnded):
            self.is_ok, self.unresponsive_robots = event.is_ok, event.unresponsive_robots
            if event.elapsed_s is not None:
                self._write_line(_("ended after {seconds} s").format(seconds=number(event.elapsed_s, ".1f")))


def stop_lines(report: StopReport) -> list[str]:
    """Format the result of a stop as lines; empty if there was nothing to stop.

    There is one line if all robots have stopped and no other program replied on their behalf,
    otherwise one for each robot and each such program.
    """
    impostor_lines = [
        _("“{program}” replied to Stop on behalf of {robot}; the reply was ignored.").format(
            program=program, robot=name
        )
        for name, program in report.impostors
    ]
    if not report.robots:
        return impostor_lines
    unconfirmed_lines = [robot.message for robot in report.robots if not robot.is_confirmed]
    if unconfirmed_lines or impostor_lines:
        return [
            *(robot.message for robot in report.robots if robot.is_confirmed),
            *unconfirmed_lines,
            *impostor_lines,
        ]
    if len(report.robots) == 1:
        return [
            _("{robot} stopped ({elapsed} ms)").format(
                robot=report.robots[0].name, elapsed=f"{report.elapsed_ms:.0f}"
            )
        ]
    return [
        _("all {count} robots stopped ({elapsed} ms)").format(
            count=len(report.robots), elapsed=f"{report.elapsed_ms:.0f}"
        )
    ]
