"""Report of a self-test: a JSON file that is valid at any time, even if the process is killed."""

from __future__ import annotations

import json
import platform
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import psutil

from app.core.storage.atomic_file import write_atomically
from nep.i18n import _
from nep.version import __version__

FORMAT, FORMAT_VERSION = "nep-studio-selftest", 1
MAX_AGE_S = 24 * 3600.0
"""Maximum plausible age of the process in seconds at the start of the self-test.

A greater age means that the clock was changed.
"""


@dataclass
class StepReport:
    """Report of one step. Times are in milliseconds since the start of the process.

    Attributes:
        description: Expected result, as a sentence.
        timeout_s: Time limit in seconds.
        start_ms: Start of the step.
        end_ms: End of the step; None while it is in progress.
        is_ok: True if the step succeeded.
        details: Details of the result, or the reason for the failure.
    """

    name: str
    description: str
    timeout_s: float
    start_ms: int
    end_ms: int | None = None
    is_ok: bool = False
    details: str = ""

    def to_json(self) -> dict[str, object]:
        """Return the step as a JSON object for the report."""
        return {
            "name": self.name,
            "ok": self.is_ok,
            "ms": self.end_ms,
            "began_ms": self.start_ms,
            "bound_s": self.timeout_s,
            "words": self.description,
            "said": self.details,
        }


def seconds_since_start() -> float:
    """Return the age of this process in seconds according to the system; 0 if unknown."""
    try:
        age_s = time.time() - psutil.Process().create_time()
    except psutil.Error:
        return 0.0
    return age_s if 0.0 <= age_s < MAX_AGE_S else 0.0


class Report:
    """Report of one self-test, written to disk at each change. Thread-safe."""

    def __init__(self, path: Path, info: dict[str, object]) -> None:
        self._path = path
        self._lock = threading.RLock()
        self._offset_s = seconds_since_start() - time.monotonic()
        self._steps: list[StepReport] = []
        self._recorded_times_ms: dict[str, int] = {}
        self._system_info: dict[str, object] = {
            "version": __version__,
            "system": platform.platform(),
            "machine": platform.machine(),
            "python": platform.python_version(),
            "frozen": bool(getattr(sys, "frozen", False)),
            "program": sys.executable,
            "began": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
            **info,
        }
        self._failure = ""
        self._is_complete = False

    def now_ms(self) -> int:
        """Return the time in milliseconds since the start of the process."""
        return round((time.monotonic() + self._offset_s) * 1000)

    @property
    def failure(self) -> str:
        """Reason why the test failed, or ""."""
        return self._failure

    @property
    def current_step(self) -> StepReport | None:
        """Step in progress, or None."""
        with self._lock:
            last_step = self._steps[-1] if self._steps else None
            return last_step if last_step is not None and last_step.end_ms is None else None

    def add_computer_info(self, **info: object) -> None:
        """Add information about this computer."""
        with self._lock:
            self._system_info.update(info)

    def record_time(self, name: str) -> None:
        """Record the current time under the key ``NAME_ms``.

        Only the first call for each name has an effect.
        """
        with self._lock:
            self._recorded_times_ms.setdefault(f"{name}_ms", self.now_ms())

    def start_step(self, name: str, description: str, timeout_s: float) -> None:
        """Start a step.

        Args:
            name: Name of the step.
            description: Expected result, as a sentence for the report.
            timeout_s: Time limit in seconds.
        """
        with self._lock:
            self._steps.append(StepReport(name, description, timeout_s, self.now_ms()))
            self._write()

    def record_success(self, details: str = "") -> None:
        """Record that the current step has succeeded.

        Args:
            details: Details of the result.
        """
        with self._lock:
            step = self.current_step
            if step is not None:
                step.end_ms, step.is_ok, step.details = self.now_ms(), True, details
                self._write()

    def fail(self, reason: str) -> None:
        """Record that the test has failed. Only the first reason is stored."""
        with self._lock:
            step = self.current_step
            if step is not None:
                step.end_ms, step.details = self.now_ms(), reason
            self._failure = self._failure or reason
            self._write()

    def finish(self) -> bool:
        """Complete the report; return True if the test has succeeded."""
        with self._lock:
            self._is_complete = True
            self.record_time("total")
            self._write()
            return not self._failure

    def _write(self) -> None:
        step, failure = self.current_step, self._failure
        if not failure and not self._is_complete:
            name = step.name if step is not None else (self._steps[-1].name if self._steps else "")
            failure = _("Studio exited during the self-test; its last step was “{step}”.").format(step=name)
        content = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "ok": self._is_complete and not self._failure,
            "why": failure,
            **self._system_info,
            **{
                name: self._recorded_times_ms.get(name)
                for name in ("first_paint_ms", "editor_ready_ms", "total_ms")
            },
            "steps": [each.to_json() for each in self._steps],
        }
        text = json.dumps(content, indent=1, ensure_ascii=False)
        try:
            write_atomically(self._path, text.encode("utf-8", "backslashreplace") + b"\n", durable=False)
        except OSError as error:  # disk full, or folder deleted: the exit code still reports the failure
            reason = (error.strerror or str(error)).lower()
            self._failure = self._failure or _("The report can't be written ({reason})").format(reason=reason)
