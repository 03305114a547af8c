"""Self-test of this process: steps in order, and a watchdog that ends the process in any case."""

from __future__ import annotations

import faulthandler
import logging
import os
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import PureWindowsPath
from typing import TextIO

import psutil

from app.core.self_test import timeouts
from app.core.self_test.environment import CRASH, REPORT, TestEnvironment, remove_home
from app.core.self_test.report import Report
from nep.i18n import _, format_list

FAILED_EXIT_CODE = 1
WEB_PROCESS_NAME = "qtwebengineprocess"
KILL_TIMEOUT_S = 5.0


class SelfTest:
    """Execution of the steps, and the watchdog. Thread-safe."""

    def __init__(self, environment: TestEnvironment, info: dict[str, object]) -> None:
        # Starts the watchdog: from now on the process ends in time, whatever its threads do.
        self.environment = environment
        self.report = Report(environment.path(REPORT), {**info, "bound_s": timeouts.TOTAL_TIMEOUT_S})
        self._changed = threading.Condition()
        self._total_deadline_s = time.monotonic() + timeouts.TOTAL_TIMEOUT_S
        self._step_deadline_s = self._total_deadline_s
        self._awaited_result = ""
        self._crash: TextIO = environment.path(CRASH).open("w", encoding="utf-8")
        faulthandler.enable(self._crash)
        # This second watchdog needs neither Python code nor the GIL; it writes the stack of all threads.
        last_s = timeouts.TOTAL_TIMEOUT_S + 2 * timeouts.GRACE_S
        faulthandler.dump_traceback_later(last_s, exit=True, file=self._crash)
        threading.Thread(target=self._watch, name="self-test watch", daemon=True).start()

    # -- steps --------------------------------------------------------------------------------------------

    def start_step(self, name: str, description: str) -> None:
        """Start a step.

        Args:
            name: Name of the step, a key of `timeouts.STEP_TIMEOUTS_S`.
            description: Expected result, as a sentence for the report.
        """
        timeout_s = timeouts.STEP_TIMEOUTS_S[name]
        self.report.start_step(name, description, timeout_s)
        self._wait_until(time.monotonic() + timeout_s + timeouts.GRACE_S, description)

    def record_success(self, details: str = "") -> None:
        """Record that the current step has succeeded.

        Args:
            details: Details of the result.
        """
        self.report.record_success(details)

    def fail(self, reason: str) -> None:
        """Record that the test has failed. Only the first reason is stored."""
        self.report.fail(reason)

    def run(self, run_steps: Callable[[], int]) -> int:
        """Run the test and clean up; return the exit code.

        Args:
            run_steps: Opens the window and runs the steps until the window is closed; returns its exit code.

        Returns:
            0 on success, 1 on failure. An exception or a non-zero result of ``run_steps`` is a failure.
        """
        try:
            code = run_steps()
        except Exception as error:  # noqa: BLE001  written to the report
            traceback.print_exc(file=self._crash)
            self._crash.flush()
            self.fail(
                _("{kind}: {error}; see {file}").format(kind=type(error).__name__, error=error, file=CRASH)
            )
        else:
            if code != 0:
                self.fail(_("Studio exited with exit code {code}").format(code=code))
        if not self.report.failure:
            self.record_success()  # it has closed
        self._end_processes()
        is_ok = self.report.finish()
        self._finish()
        return 0 if is_ok else FAILED_EXIT_CODE

    def _finish(self) -> None:
        # The watchdog continues until the process ends.
        faulthandler.cancel_dump_traceback_later()
        faulthandler.disable()
        self._crash.close()
        crash = self.environment.path(CRASH)
        with suppress(OSError):
            if crash.stat().st_size == 0:
                crash.unlink()
        if not self.report.failure:
            logging.shutdown()  # the log file is in the folder too, and Windows can't delete an open file
            remove_home(self.environment)
        self._wait_until(time.monotonic() + timeouts.EXIT_TIMEOUT_S, _("the end of the process"))

    # -- processes ----------------------------------------------------------------------------------------

    def _end_processes(self) -> None:
        # Only the master may remain, which waits for this process; it is ended here.
        if self.report.failure:
            kill_children()
            return
        self.start_step("processes", _("every process of the test exits"))
        processes = [
            process
            for process in children()
            if not is_web_process(process) and not is_windows_program(process)
        ]
        masters = [process for process in processes if is_master_process(process)]
        for process in masters:
            with suppress(psutil.Error):
                process.terminate()
        _exited, running = psutil.wait_procs(processes, timeout=timeouts.STEP_TIMEOUTS_S["processes"])
        if running:
            names = format_list([f"{process.pid} ({' '.join(command(process)[:4])})" for process in running])
            self.fail(_("These processes didn't exit: {names}").format(names=names))
            kill_children()
        else:
            self.record_success()

    # -- watchdog -----------------------------------------------------------------------------------------

    def _wait_until(self, deadline_s: float, description: str) -> None:
        with self._changed:
            self._step_deadline_s, self._awaited_result = deadline_s, description
            self._changed.notify_all()

    def _watch(self) -> None:
        with self._changed:
            while (
                remaining_s := min(self._step_deadline_s, self._total_deadline_s + timeouts.GRACE_S)
                - time.monotonic()
            ) > 0:
                self._changed.wait(remaining_s)
            awaited_result = self._awaited_result
        self.fail(
            _("Studio didn't respond in time and was stopped. It was waiting for: {what}").format(
                what=awaited_result
            )
        )
        self.report.finish()
        with suppress(OSError, ValueError):  # closed at the very end
            faulthandler.dump_traceback(self._crash, all_threads=True)
        kill_children()
        os._exit(FAILED_EXIT_CODE)


def children() -> list[psutil.Process]:
    """Return all descendants of this process."""
    try:
        return psutil.Process().children(recursive=True)
    except psutil.Error:
        return []


def command(process: psutil.Process) -> list[str]:
    """Return the command line of a process; empty if the process has exited or can't be read."""
    try:
        return process.cmdline()
    except (psutil.Error, OSError):  # see `is_web_process`
        return []


def is_master_process(process: psutil.Process) -> bool:
    """Return True if a process is a master with an owner process, after whose exit it exits as well."""
    arguments = command(process)
    return "master" in arguments and "--owner-pid" in arguments


def is_web_process(process: psutil.Process) -> bool:
    """Return True if a process belongs to the web view. Such processes exit with their parent."""
    try:
        return process.name().lower().startswith(WEB_PROCESS_NAME[:15])
    except (psutil.Error, OSError):  # raised on Windows, where psutil has no own exception
        return False


def is_windows_program(process: psutil.Process, root: str = os.environ.get("SYSTEMROOT", "")) -> bool:
    """Return True if a process is part of Windows, such as a console host.

    Windows starts such programs as child processes and ends them at any time.

    Args:
        process: Process to check.
        root: Folder of Windows.
    """
    try:
        program = process.exe()
    except (psutil.Error, OSError):  # not available on every Windows for every process; see `is_web_process`
        program = next(iter(command(process)), "")
    return bool(root) and PureWindowsPath(program).is_relative_to(PureWindowsPath(root))


def kill_children() -> None:
    """Kill all descendants of this process."""
    processes = children()
    for process in processes:
        with suppress(psutil.Error):
            process.kill()
    psutil.wait_procs(processes, timeout=KILL_TIMEOUT_S)
