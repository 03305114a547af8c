"""Thread that runs a robot's stop function. The thread is started in advance and runs nothing else."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from app.clock import ThreadClock
from app.robots.driver.call import Failed
from app.robots.identity import MAX_ERROR_LENGTH, MAY_MOVE_MESSAGE
from nep.i18n import _
from nep.system.log_rarely import SuppressedErrors
from nep.text import bounded_str

_JOIN_TIMEOUT_S = 0.5
_log = logging.getLogger(__name__)


class StopThread:
    """Thread that runs the stop function of one robot. Thread-safe.

    Runs are numbered from 1. Stops requested while the function is running share that run.

    Args:
        name: Name of the robot.
        stop: Stop function of the robot.
        on_end: Called in this thread after each run, with its number and its error message, or None.
        clock: Clock of the thread.
    """

    def __init__(
        self,
        name: str,
        stop: Callable[[], object],
        on_end: Callable[[int, str | None], object],
        clock: ThreadClock,
    ) -> None:
        self._name, self._stop, self._on_end, self._clock = name, stop, on_end, clock
        self._errors = SuppressedErrors(_log, f"{name} stop")
        self._lock = threading.Lock()
        self._wake = clock.event()
        self._is_closing = False
        self._requested_run = self._started_run = self._finished_run = 0
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread = self._clock.start_thread(self._supervise, f"{self._name} stop")

    @property
    def requested_run(self) -> int:
        """Number of the newest run that was reserved; 0 before the first."""
        return self._requested_run

    def reserve(self) -> int:
        """Reserve a run for a stop requested now and return its number; `wake` starts the run.

        If a run is reserved or running, its number is returned.
        """
        with self._lock:
            if self._requested_run == self._finished_run:
                self._requested_run += 1
            return self._requested_run

    def reserve_next(self) -> int:
        """Reserve a run that has not begun yet and return its number; `wake` starts the run."""
        with self._lock:
            if self._requested_run == self._started_run:
                self._requested_run += 1
            return self._requested_run

    def wake(self) -> None:
        """Start the reserved run immediately, in the stop thread."""
        self._wake.set()

    def close(self) -> None:
        """Stop the thread. A stop function that doesn't return within 0.5 s is abandoned."""
        self._is_closing = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join(_JOIN_TIMEOUT_S)

    def _supervise(self) -> None:
        try:
            while not self._is_closing:
                with self._errors:
                    if self._requested_run == self._finished_run:
                        self._clock.wait(self._wake, None)
                    self._wake.clear()
                    if self._requested_run > self._finished_run:
                        self._run()
        finally:
            if not self._is_closing:  # an exception was injected outside of the try block
                self._wake.set()
                self.start()

    def _run(self) -> None:
        with self._lock:
            run = self._started_run = self._requested_run
        error: str | None = _(MAY_MOVE_MESSAGE).format(robot=self._name, why=_("the stop command failed"))
        try:
            error = self._call_stop()
        finally:
            with self._lock:
                self._finished_run = run
            self._on_end(run, error)

    def _call_stop(self) -> str | None:
        try:
            self._stop()
        except Failed as error:
            reason = bounded_str(error, MAX_ERROR_LENGTH)
        except BaseException as error:  # noqa: BLE001 - also SystemExit: a stop must always get a reply
            _log.warning("%s: stop() raised an exception", self._name, exc_info=True)
            reason = _("the stop command failed: {error}").format(error=bounded_str(error, MAX_ERROR_LENGTH))
        else:
            return None
        return _(MAY_MOVE_MESSAGE).format(robot=self._name, why=reason)
