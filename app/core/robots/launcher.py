"""Child processes of Studio: the master, if none is running, and virtual robots."""

from __future__ import annotations

import logging
import os
import platform
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import IO, Protocol

from app.core.faults import CONSOLE_EXTRA
from app.core.network.master import MasterStarter
from app.core.reports.crash import crash_extra, exit_text, is_crash, split_trace
from app.core.reports.own_process import module_command
from app.robots.identity import Identity
from app.robots.virtual_models import virtual_models
from nep.i18n import _
from nep.masters.process import NO_CONSOLE
from nep.system.addresses import is_loopback

EXIT_TIMEOUT_S = 2.0
TAIL_BYTES, TAIL_CHARS = 100_000, 2000
FIRST_GRAPH_TIMEOUT_S = 3.0
"""Time in seconds that a start request waits for the first graph, which may already contain the robot."""
STARTUP_TIMEOUT_S = 30.0
"""Time in seconds during which a started robot counts as starting; slow computers need that long."""
REQUEST_LIFETIME_S = 4.0
"""Lifetime in seconds of a start request while a robot with the same name is listed.

The exit of that robot may be detected as late as 3.3 s afterwards.
"""

MODULE_FLAGS = ("-m", "--module")
MAX_CACHED_PROCESSES = 1000

_log = logging.getLogger("studio.launcher")


@dataclass(frozen=True, slots=True)
class _StartRequest:
    """Request to start a virtual robot, with its model and its deadlines (monotonic seconds)."""

    model: str
    known_deadline_s: float
    deadline_s: float


@dataclass(frozen=True, slots=True)
class LaunchFailed:
    """Event: a process could not be started, or exited unexpectedly.

    Attributes:
        name: Name of the virtual robot, or "master".
        message: Problem in one sentence.
        detail: Last lines of the output, or the reason why the process could not be started.
        is_robot: False for the master.
    """

    name: str
    message: str
    detail: str
    is_robot: bool = True


class Process(Protocol):
    """Part of the interface of `subprocess.Popen` that `Launcher` uses."""

    pid: int

    def poll(self) -> int | None:
        """Return the exit code; None while the process is running."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the process to exit and return its exit code. Raises `subprocess.TimeoutExpired`."""

    def terminate(self) -> None:
        """Request the process to exit."""

    def kill(self) -> None:
        """Kill the process."""


StartProcess = Callable[[Sequence[str], Mapping[str, str], IO[bytes]], Process]
"""Function that starts a process, given the command, the environment, and the file for its output.

Raises OSError.
"""


def start_process(command: Sequence[str], environment: Mapping[str, str], log: IO[bytes]) -> Process:
    """Start a process of the operating system. The default `StartProcess`.

    Args:
        command: Program and arguments.
        environment: Environment variables.
        log: File for the output.
    """
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        env=environment,
        creationflags=NO_CONSOLE,
    )


class Launcher:
    """Starter of child processes, which detects when they exit and stops them when the window closes."""

    def __init__(
        self,
        address: str,
        post_event: Callable[[object], None],
        is_listed: Callable[[str], bool | None] = lambda _name: False,
        clock: Callable[[], float] = time.monotonic,
        start: StartProcess = start_process,
    ) -> None:
        # `is_listed` returns whether a robot is listed, from any instance, or None while unknown.
        self._address = address
        self._is_listed = is_listed
        self._clock = clock
        self._start = start
        self._requests: dict[str, _StartRequest] = {}
        self._starting_deadlines_s: dict[str, float] = {}  # end of the starting state, by the robot's name
        self._post_event = post_event
        self._lock = threading.Lock()
        self._robots: dict[str, tuple[Process, IO[bytes]]] = {}
        self.models_by_name: dict[str, str] = {}
        """Virtual robots that the user started here and did not stop, with their models."""
        self.ended_robots: frozenset[str] = frozenset()
        """Virtual robots started here whose processes ended unexpectedly."""
        title = (
            _("The master can't be started.") if is_loopback(address) else _("The master doesn't respond.")
        )
        self._master = MasterStarter(
            address, lambda reason: post_event(LaunchFailed("master", title, reason, False))
        )

    @property
    def virtual_robots(self) -> tuple[str, ...]:
        """Names of the running virtual robots that this Studio started."""
        with self._lock:
            return tuple(name for name, (process, _log) in self._robots.items() if process.poll() is None)

    @property
    def starting_robots(self) -> tuple[str, ...]:
        """Names of the virtual robots that are starting."""
        now = self._clock()
        return tuple(name for name, deadline_s in self._starting_deadlines_s.items() if now < deadline_s)

    def on_started(self, name: str) -> None:
        """Record that a robot has finished starting."""
        self._starting_deadlines_s.pop(name, None)

    @property
    def process_ids(self) -> tuple[int, ...]:
        """Process ids of running virtual robots that this Studio started."""
        with self._lock:
            return tuple(process.pid for process, _log in self._robots.values() if process.poll() is None)

    @property
    def has_started_master(self) -> bool:
        """True if this Studio started the running master."""
        return self._master.has_started

    def ensure_master(self) -> None:
        """Start a master if none is running. Returns immediately; a failure is posted as `LaunchFailed`."""
        self._master.ensure_running()

    def ensure_master_with_backoff(self) -> None:
        """Call `ensure_master`, unless a failed start was too recent. Call this method repeatedly."""
        self._master.ensure_running_with_backoff()

    def start_virtual_robot(self, name: str = "Pepper", model: str = "pepper") -> None:
        """Request the start of a virtual robot, unless a robot with this name is listed.

        Robots started by other Studios count as well. The request is valid for some seconds.
        `start_requested_robots` starts the robot as soon as the graph shows that no such robot is
        listed, or immediately if this Studio started the master.
        """
        now = self._clock()
        self.models_by_name[name] = model
        self._starting_deadlines_s[name] = now + STARTUP_TIMEOUT_S
        self._requests[name] = _StartRequest(model, now + FIRST_GRAPH_TIMEOUT_S, now + REQUEST_LIFETIME_S)
        self.start_requested_robots()

    def start_requested_robots(self) -> None:
        """Start the requested robots that are not listed; discard expired requests. Called at each tick."""
        if not self._requests:
            return
        now = self._clock()
        for name, request in list(self._requests.items()):
            is_listed = self._is_listed(name)
            if is_listed is None and (self._master.is_first_master or now >= request.known_deadline_s):
                is_listed = False
            if is_listed is False:
                del self._requests[name]
                self._start_robot(name, request.model)
            elif now >= request.deadline_s:
                del self._requests[name]

    def _start_robot(self, name: str, model: str) -> None:
        with self._lock:
            process_and_log = self._robots.get(name)
            if process_and_log is not None and process_and_log[0].poll() is None:
                return
            log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  open while the process writes
            command = [
                *module_command(virtual_models()[model].module),
                "--name",
                name,
                "--owner-pid",
                str(os.getpid()),
            ]
            environment = {**os.environ, "NEP_MASTER": self._address}
            try:
                process = self._start(command, environment, log)
            except OSError as error:
                log.close()
                self._starting_deadlines_s.pop(name, None)
                self._post_event(
                    LaunchFailed(
                        name, _("The virtual robot {robot} can't be started.").format(robot=name), str(error)
                    )
                )
                return
            self._robots[name] = (process, log)
            self.ended_robots -= {name}

    def restart_virtual_robot(self, name: str, model: str = "pepper") -> None:
        """Restart a virtual robot. The process that this Studio started, if any, is killed."""
        self.models_by_name[name] = model
        self._requests.pop(name, None)
        with self._lock:
            process_and_log = self._robots.pop(name, None)
        if process_and_log is not None:
            process_and_log[0].kill()
            process_and_log[0].wait()
            process_and_log[1].close()
        self._starting_deadlines_s[name] = self._clock() + STARTUP_TIMEOUT_S
        self._start_robot(name, model)

    def stop_virtual_robot(self, name: str) -> None:
        """Stop a virtual robot that this Studio started, and discard a pending request to start it."""
        self.models_by_name.pop(name, None)
        self._stop_robot(name)

    def _stop_robot(self, name: str) -> None:
        self._requests.pop(name, None)
        self._starting_deadlines_s.pop(name, None)
        with self._lock:
            process_and_log = self._robots.pop(name, None)
        if process_and_log is not None:
            _terminate(process_and_log[0])
            process_and_log[1].close()

    def check(self) -> None:
        """Detect processes that exited unexpectedly. Called at each tick of the session."""
        with self._lock:
            codes = {name: process.poll() for name, (process, _log) in self._robots.items()}
            for name, code in codes.items():
                if code is None:
                    continue
                _process, log = self._robots.pop(name)
                self.ended_robots |= {name}
                self._starting_deadlines_s.pop(name, None)
                output, trace = split_trace(_read_tail(log))
                if is_crash(code):
                    cause = f"the process of a virtual robot {exit_text(code)}"
                    _log.error(
                        "%s",
                        cause,
                        extra={**CONSOLE_EXTRA, **crash_extra("robot", cause, f"{output}{trace}")},
                    )
                self._post_event(
                    LaunchFailed(
                        name,
                        _("The virtual robot {robot} stopped unexpectedly.").format(robot=name),
                        output.strip()[-TAIL_CHARS:] or _exit_reason(code),
                    )
                )
                log.close()

    def close(self) -> None:
        """Stop the virtual robots.

        The master keeps running while programs other than Studio are registered.
        """
        self._requests.clear()
        for name in list(self._robots):
            self._stop_robot(name)
        self._master.close()


def _terminate(process: Process) -> None:
    process.terminate()
    try:
        process.wait(timeout=EXIT_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _exit_reason(code: int) -> str:
    # A negative exit code is the number of a signal.
    if code < 0:
        return _("Another program on this computer stopped it.")
    return _("No reason was reported (exit code {code}).").format(code=code)


def _read_tail(log: IO[bytes]) -> str:
    log.seek(0, os.SEEK_END)
    log.seek(max(0, log.tell() - TAIL_BYTES))
    return log.read().decode("utf-8", "replace").strip()


class VirtualProcesses:
    """Detection of the processes of virtual robots on this computer, with cached results. Not thread-safe."""

    def __init__(self, started_pids: Callable[[], Collection[int]] = tuple) -> None:
        self._started_pids = started_pids
        self._result_cache: dict[Identity, bool] = {}

    def is_started_by_studio(self, identity: Identity) -> bool:
        """Return True if a program is a virtual robot started by a Studio of this user.

        This applies to Studio's own process, to its child processes (or a child of one, as in a frozen
        build), and to processes of the same user on this computer that run the module of a
        virtual robot (`virtual_models`).
        """
        if identity.pid is None or identity.host != platform.node():
            return False
        if identity.pid == os.getpid():
            return True
        if identity not in self._result_cache:
            if len(self._result_cache) >= MAX_CACHED_PROCESSES:
                self._result_cache.clear()
            self._result_cache[identity] = self._is_own_process(identity.pid)
        return self._result_cache[identity]

    def has_ended(self, identity: Identity) -> bool:
        """Return True if a program has certainly exited.

        Always False for programs on other computers or with an unknown process id.
        """
        if identity.pid is None or identity.host != platform.node():
            return False
        import psutil  # noqa: PLC0415 (slow import, not needed to show the window)

        with suppress(psutil.Error):
            return psutil.Process(identity.pid).status() == psutil.STATUS_ZOMBIE
        return not psutil.pid_exists(identity.pid)

    def _is_own_process(self, pid: int) -> bool:
        import psutil  # noqa: PLC0415 (slow import)

        started_pids = set(self._started_pids())
        try:
            process = psutil.Process(pid)
            if pid in started_pids or any(parent.pid in started_pids for parent in process.parents()):
                return True
            return process.username() == psutil.Process().username() and self._is_virtual(process.cmdline())
        except psutil.Error:
            return False

    def _is_virtual(self, command: list[str]) -> bool:
        # Only the module option counts; later words of the command may be anything.
        modules = (each.module for each in virtual_models().values())
        return len(command) > 2 and command[1] in MODULE_FLAGS and command[2] in modules
