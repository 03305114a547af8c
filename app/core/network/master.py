"""State of the connection to the master, and start of a master if none is running."""

from __future__ import annotations

import logging
import os
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.core.reports.crash import crash_extra, exit_text, is_crash
from app.core.reports.own_process import module_command
from nep.errors import NepError
from nep.masters.process import is_running, start_process
from nep.protocol.graph_view import GraphView
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.programs import doctor
else:
    doctor = lazy_module("nep.programs.doctor")

DISCOVERY_TIMEOUT_S = 1.5
"""Time in seconds after a master's start during which it may not know all nodes yet.

A master waits one second for nodes to register again.
"""
RETRY_S, MAX_RETRY_S = 2.0, 30.0
"""Initial and maximum pause before another attempt to start a master; the pause doubles with each failure."""
START_TIMEOUT_S = 50.0
"""Time limit in seconds for a started master to reply while its process is alive.

The first start after an installation, from a slow disk and with a virus scanner, takes longer than the
usual ten seconds.
"""
JOIN_TIMEOUT_S = 2.0

_log = logging.getLogger("studio.master")


@dataclass(frozen=True, slots=True)
class MasterState:
    """State of the connection to the master.

    Attributes:
        kind: ``searching``, ``connected`` or ``none``.
        message: Explanation for the user; may be empty.
    """

    kind: str
    address: str
    message: str = ""


class MasterChangeDetector:
    """Detector of a change to another master, such as after a restart.

    Not thread-safe; use it from the main thread.
    """

    def __init__(self) -> None:
        self._new_epoch = (0, 0.0)

    def is_incomplete(self, previous: GraphView | None, view: GraphView, now: float) -> bool:
        """Return True if another master has just replaced the known one and may not know all nodes yet.

        Args:
            previous: Last applied graph, or None.
            view: New graph.
            now: Monotonic seconds.
        """
        if previous is None or view.epoch == previous.epoch:
            return False
        if self._new_epoch[0] != view.epoch:
            self._new_epoch = (view.epoch, now)
        return now - self._new_epoch[1] < DISCOVERY_TIMEOUT_S


class MasterStarter:
    """Starter of the master process; does nothing if a master is already running.

    Consecutive failures with the same reason are reported once, by the callback `on_failed`.
    """

    def __init__(
        self,
        address: str,
        on_failed: Callable[[str], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        # `on_failed` is called with the reason in the starting thread; `clock` is monotonic seconds.
        self._address, self._on_failed, self._clock = address, on_failed, clock
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._wait_s, self._retry_at_s, self._last_reason = RETRY_S, 0.0, ""
        self.is_first_master = False
        """True if no master was running before this one was started, so that no other node can be registered
        yet.
        """

    @property
    def has_started(self) -> bool:
        """True if the running master was started by this object."""
        return self._process is not None and self._process.poll() is None

    def ensure_running(self) -> None:
        """Start a master if none is running. Returns immediately."""
        if self._thread is not None and self._thread.is_alive():
            return
        self._thread = threading.Thread(target=self._start, name="studio-launcher", daemon=True)
        self._thread.start()

    def ensure_running_with_backoff(self) -> None:
        """Call `ensure_running`, unless a failed start was too recent. Call this method repeatedly."""
        if self._clock() >= self._retry_at_s:
            self.ensure_running()

    def close(self) -> None:
        """Wait at most `JOIN_TIMEOUT_S` for a start in progress."""
        if self._thread is not None:
            self._thread.join(timeout=JOIN_TIMEOUT_S)

    def _start(self) -> None:
        error_text = self._try_start()
        if not error_text:
            self._wait_s, self._retry_at_s, self._last_reason = RETRY_S, 0.0, ""
            return
        self._retry_at_s = self._clock() + self._wait_s
        self._wait_s = min(2 * self._wait_s, MAX_RETRY_S)
        if error_text != self._last_reason:
            self._last_reason = error_text
            self._on_failed(error_text)

    def _try_start(self) -> str:
        if is_running(self._address, timeout_s=0.5):
            return ""
        blocker = doctor.start_blocker(self._address)
        if blocker is not None:
            return f"{blocker.sentence} {blocker.fix}"
        self.is_first_master = True
        self._log_crash()
        try:
            self._process = start_process(
                self._address, owner_pid=os.getpid(), command=module_command("nep"), timeout_s=START_TIMEOUT_S
            )
        except (NepError, OSError) as error:
            return str(error)
        return ""

    def _log_crash(self) -> None:
        code = self._process.poll() if self._process is not None else None
        if code is None:
            return
        self._process = None
        if is_crash(code):
            cause = f"the master's process {exit_text(code)}"
            _log.error("%s", cause, extra=crash_extra("master", cause))
