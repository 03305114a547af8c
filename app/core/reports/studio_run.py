"""Detection of crashes of Studio by marker files that remain after a crash.

Each run (each window) has a marker file that its process locks, and a trace file for crashes in native
code. Both are deleted when the run ends normally.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import logging
import os
import time
import traceback
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING

from app.core.faults import CONSOLE_EXTRA, error_text, log_folder
from app.core.reports.crash import Crash, fatal_line
from app.core.reports.crash_reports import CrashReports
from app.core.reports.studio_versions import parse_version
from app.core.storage.atomic_file import create_private_folder, read_regular_file, write_atomically
from app.core.storage.file_lock import FileLock
from app.core.storage.folders import state_home
from nep.system.lazy_import import lazy_module
from nep.version import __version__

if TYPE_CHECKING:
    import psutil
    from typing_extensions import Self
else:
    psutil = lazy_module("psutil")

MAX_LOG_LINES = 80
MAX_TRACE_BYTES = 1_000_000
CLOCK_TOLERANCE_S = 2.0
"""Tolerance in seconds when the start time of a process is compared with the clock."""
NO_TRACE_CAUSE = (
    "the process ended without leaving a trace: it was killed by the system (for example for lack of "
    "memory) or by a user, or the session of the computer ended"
)

_log = logging.getLogger("studio.run")


class StudioRun:
    """One run of Studio, from `start` to `finish`. Usable as a context manager.

    If an exception leaves the context, a crash report is stored.
    """

    def __init__(
        self,
        folder: Path | None = None,
        log: Path | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        # Markers are in `folder` (default: `runs` in the state folder), traces in the log folder.
        self._folder = folder if folder is not None else state_home() / "runs"
        self._log = log if log is not None else log_folder()
        self._clock = clock
        self._marker = self._folder / f"{uuid.uuid4().hex}.json"
        self._lock = FileLock(self._marker)
        self._trace: IO[str] | None = None
        self._began_s = 0.0

    @property
    def is_recorded(self) -> bool:
        """True if the marker file exists; otherwise a crash of this run can't be detected."""
        return self._marker.exists()

    def start(self) -> None:
        """Create and lock the marker file, and enable faulthandler. A failure is logged."""
        self._began_s = self._clock()
        try:
            self._write(is_exit_requested=False)
            self._lock.acquire()
            self._enable_faulthandler()
        except OSError as error:
            self._delete_files()
            _log.warning("a crash of this run will not be detected: %s", error, extra=CONSOLE_EXTRA)

    def expect_exit(self) -> None:
        """Record that Studio was asked to exit, so that ending now is not detected as a crash."""
        if self.is_recorded:
            with contextlib.suppress(OSError):
                self._write(is_exit_requested=True)

    def finish(self) -> None:
        """Delete the marker file when Studio exits normally."""
        self._delete_files()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # An uncaught exception is stored and propagates.
        if isinstance(error, Exception):
            text = "".join(traceback.format_exception(kind, error, trace))
            CrashReports(self._log / "crashes", self._clock).add(Crash("studio", error_text(error), text))
        self.finish()

    def pop_crashes(self) -> list[Crash]:
        """Return the crashes of earlier runs, and delete the files of these runs.

        If several instances call this, each crash is returned only once. Runs that ended because the
        computer restarted or because Studio was asked to exit are not crashes.
        """
        try:
            markers = [marker for marker in self._folder.glob("*.json") if marker != self._marker]
        except OSError:
            return []
        crashes = [self._check_marker(marker) for marker in markers]
        return [crash for crash in crashes if crash is not None]

    # -- this run -------------------------------------------------------------------------------------------

    def _write(self, *, is_exit_requested: bool) -> None:
        entry = {
            "pid": os.getpid(),
            "began_s": self._began_s,
            "version": __version__,
            "trace": _trace_name(self._marker),
            "asked": is_exit_requested,
        }
        write_atomically(self._marker, json.dumps(entry).encode(), durable=False, private=True)

    def _enable_faulthandler(self) -> None:
        create_private_folder(self._log)
        path = self._log / _trace_name(self._marker)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o600)
        self._trace = os.fdopen(descriptor, "a", encoding="utf-8")
        faulthandler.enable(self._trace)

    def _delete_files(self) -> None:
        if self._trace is not None:
            faulthandler.disable()
            self._trace.close()
            self._trace = None
        self._lock.release()
        _remove_files(self._marker, self._log)

    # -- earlier runs ------------------------------------------------------------------------------

    def _check_marker(self, marker: Path) -> Crash | None:
        lock = FileLock(marker)
        if not lock.acquire():
            return None  # its process is running
        content: tuple[Mapping[str, object], float] | None = None
        try:
            entry = json.loads(read_regular_file(marker))
            began_s, pid = float(entry["began_s"]), int(entry["pid"])
            if _is_running(pid, began_s):  # on a file system without locks
                return None
            marker.unlink()  # only one instance succeeds, which then reports it
            content = entry, began_s
        except OSError:
            return None
        except (ValueError, TypeError, KeyError, RecursionError):
            pass  # damaged, so nothing is known
        finally:
            lock.release()  # before it is deleted: Windows can't delete an open file
        trace = self._read_trace(marker)
        _remove_files(marker, self._log)
        return self._detect_crash(*content, trace) if content is not None else None

    def _detect_crash(self, entry: Mapping[str, object], began_s: float, trace: str) -> Crash | None:
        cause = fatal_line(trace)
        if not cause:
            if entry.get("asked") is True or psutil.boot_time() > began_s + CLOCK_TOLERANCE_S:
                return None
            cause = NO_TRACE_CAUSE
        start_time = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(began_s))
        version = parse_version(entry.get("version"))
        text = f"Version {version or 'unknown'}, started {start_time}.\n\n{trace}\n{self._log_tail()}"
        return Crash("studio", cause, text, version)

    def _read_trace(self, marker: Path) -> str:
        try:
            return read_regular_file(self._log / _trace_name(marker), MAX_TRACE_BYTES).decode(
                "utf-8", "replace"
            )
        except OSError:
            return ""

    def _log_tail(self) -> str:
        try:
            lines = read_regular_file(self._log / "studio.log").decode("utf-8", "replace").splitlines()
        except OSError:
            return ""
        return "\n".join(["The end of the log:", *lines[-MAX_LOG_LINES:]]) + "\n"


def _trace_name(marker: Path) -> str:
    return f"crash-{marker.stem}.trace"


def _remove_files(marker: Path, log: Path) -> None:
    for path in (marker, marker.with_name(f"{marker.name}.lock"), log / _trace_name(marker)):
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def _is_running(pid: int, began_s: float) -> bool:
    # Checks the start time too, because process ids are reused.
    try:
        process = psutil.Process(pid)
        is_same_process = process.create_time() <= began_s + CLOCK_TOLERANCE_S
        return is_same_process and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False
