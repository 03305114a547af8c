"""Connection doctor of the window: runs the checks in a thread and stores the findings."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from app.core.network.topics import split_key
from nep.i18n import _
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.programs import doctor
else:
    doctor = lazy_module("nep.programs.doctor")

JOIN_TIMEOUT_S = 4.0


class Doctor:
    """Connection checks that run in a background thread. Not thread-safe; use it from the main thread."""

    def __init__(
        self,
        diagnose: Callable[[str, doctor.ProgressCallback], Sequence[doctor.Finding]],
        clock: Callable[[], float] = time.time,
    ) -> None:
        # `diagnose` gets the expected topic and a progress callback (findings so far, checks done, checks in
        # all).
        self._diagnose, self._clock = diagnose, clock
        self._thread: threading.Thread | None = None
        self._expected_topic = self._checked_topic = ""
        self._findings: tuple[doctor.Finding, ...] = ()
        self._partial_findings: tuple[doctor.Finding, ...] | None = None
        self.check_count = self.total_checks = 0
        """Number of checks done in the current or last run; `total_checks` is the total number of checks."""
        self._finished_s: float | None = None
        self.revision = 0

    @property
    def is_running(self) -> bool:
        """True if the checks are running."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def findings(self) -> Sequence[doctor.Finding]:
        """Findings of the last completed run, worst first."""
        return self._findings

    @property
    def partial_findings(self) -> Sequence[doctor.Finding] | None:
        """Findings of the current run up to now, worst first; None if no run is in progress."""
        return self._partial_findings

    @property
    def finished_s(self) -> float | None:
        """Time of the last completed run in seconds since 1970; None before the first run."""
        return self._finished_s

    @property
    def expected_topic(self) -> str:
        """Topic on which the user expects messages that don't arrive; "" if none is selected."""
        return self._expected_topic

    @property
    def checked_topic(self) -> str:
        """Value of `expected_topic` in the run that produced `findings`; "" if none was selected."""
        return self._checked_topic

    def expect_topic(self, topic: str) -> None:
        """Set the topic on which the user expects messages ("" for none), and run the checks."""
        self._expected_topic = topic
        self.start()

    def start(self) -> None:
        """Start the checks, unless they are running."""
        if self.is_running:
            return
        self._thread = threading.Thread(target=self._run_checks, name="studio-doctor", daemon=True)
        self._thread.start()
        self.revision += 1

    def report(self, within_s: float) -> str:
        """Return the findings of the last completed run as text for a report. Thread-safe.

        Args:
            within_s: Maximum time in seconds to wait for a run in progress.
        """
        thread = self._thread
        if thread is not None:
            thread.join(within_s)
        return doctor.report_text(self._findings)

    def close(self) -> None:
        """Wait at most `JOIN_TIMEOUT_S` for a run in progress."""
        if self._thread is not None:
            self._thread.join(JOIN_TIMEOUT_S)

    def _run_checks(self) -> None:
        while True:  # repeats when another topic was set meanwhile
            expected_topic, self._partial_findings = self._expected_topic, None
            findings = self._find(expected_topic)
            if expected_topic == self._expected_topic:
                break
        self._findings, self._finished_s, self._checked_topic = findings, self._clock(), expected_topic
        self._partial_findings = None
        self.revision += 1

    def _report_progress(
        self, findings: tuple[doctor.Finding, ...], check_count: int, total_checks: int
    ) -> None:
        self._partial_findings, self.check_count, self.total_checks = findings, check_count, total_checks
        self.revision += 1

    def _find(self, expected_topic: str) -> tuple[doctor.Finding, ...]:
        try:
            return tuple(self._diagnose(expected_topic, self._report_progress))
        except Exception as error:  # noqa: BLE001  reported as a finding
            message = _("The doctor couldn't finish ({kind}: {error}).").format(
                kind=type(error).__name__, error=error
            )
            return (
                doctor.Finding(
                    "doctor", "error", message, _("Report this error to the developers of NEP Studio.")
                ),
            )


def create_doctor(address: str, folder: Path) -> Doctor:
    """Return a doctor for a master, which also checks Studio's folder.

    Topics of other networks are not checked, because the doctor supports only the native network.

    Args:
        address: Address of the master.
        folder: Studio's folder.
    """
    folders = [(_("Settings and unsaved work"), folder)]
    return Doctor(
        lambda key, report_progress: doctor.diagnose(
            address, "" if split_key(key)[0] else key, folders, report_progress
        )
    )
