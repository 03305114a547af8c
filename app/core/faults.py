"""Unexpected errors of Studio: logged once, shown as an alert, and isolated from the following steps.

All errors go through `logging`: uncaught exceptions of any thread (`install_hooks`), exceptions caught
by a guard (`log_errors`), and messages of Qt. Handlers whose output is read by people have a
`RepeatFilter`.
"""

from __future__ import annotations

import io
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from logging.handlers import RotatingFileHandler
from pathlib import Path
from types import TracebackType

import platformdirs

from app.core.alerts.alerts import Alerts
from app.intents import ShowLog
from nep.i18n import _
from nep.version import __version__

FILE_BYTES, BACKUP_COUNT = 1_000_000, 3
MAX_COUNTED_FAULTS = 500
CONSOLE_EXTRA: dict[str, object] = {"in_console": True}
"""``extra`` of a record for the log file only, because the Console already shows the event in other words."""
VERSION_MESSAGE = "NEP Studio %s writes from here on"
LOG_FORMAT = "%(asctime)s %(levelname)s %(threadName)s %(name)s: %(message)s"

ALERT_ID = "studio"
RECOVERY_S = 5.0
"""Time in seconds without a failure after which a fault is resolved.

Prevents the banner from flickering when errors are intermittent.
"""
EXPIRY_S = 60.0
"""Time in seconds after which the fault of a one-time step, such as an event, is resolved."""
MAX_FAULTS = 100

_log = logging.getLogger("studio")


def log_folder() -> Path:
    """Return the folder of the log files: the system's log folder, or ``log`` below ``$NEP_STUDIO_HOME``."""
    studio_home = os.environ.get("NEP_STUDIO_HOME")
    return (
        Path(studio_home) / "log"
        if studio_home
        else Path(platformdirs.user_log_dir("nep-studio", appauthor=False))
    )


@contextmanager
def log_errors(operation: str) -> Iterator[None]:
    """Return a context manager that logs exceptions as "can't ``operation``" and suppresses them."""
    try:
        yield
    except Exception:  # noqa: BLE001  the caller must continue after any error
        _log.exception("can't %s", operation)


class RepeatFilter:
    """Logging filter that passes a record at its 1st, 10th, 100th, 1000th ... occurrence.

    A record is a repetition if logger, level, and either the line of the exception or the text are the
    same. The newest 500 faults are remembered; an older fault counts as new. Thread-safe only under the
    handler's lock, which `logging` holds.
    """

    def __init__(self) -> None:
        self._counts: dict[tuple[object, ...], int] = {}

    def filter(self, record: logging.LogRecord) -> logging.LogRecord | None:
        """Return the record to write, or None to suppress it. Never raises.

        Of equal records, the first, 10th, 100th and so on are written. The number of occurrences is
        appended to the text of a repetition, which has no traceback.
        """
        record = _make_formattable(record)
        key = (record.name, record.levelno, _raise_location(record) or record.getMessage())
        count = self._counts.pop(key, 0) + 1
        while len(self._counts) >= MAX_COUNTED_FAULTS:
            del self._counts[next(iter(self._counts))]
        self._counts[key] = count
        if count == 1:
            return record
        if count < 10 or str(count).strip("0") != "1":
            return None
        summary_record = logging.makeLogRecord(record.__dict__)
        summary_record.msg, summary_record.args = f"{record.getMessage()} ({count} times)", ()
        summary_record.exc_info, summary_record.exc_text = None, None  # the first record has the traceback
        return summary_record


def _make_formattable(record: logging.LogRecord) -> logging.LogRecord:
    try:
        record.getMessage()
    except Exception as error:  # noqa: BLE001  arguments may have any class
        text = record.msg if isinstance(record.msg, str) else type(record.msg).__name__
        replacement = logging.makeLogRecord(record.__dict__)
        replacement.msg, replacement.args = (
            f"{text} (its arguments can't be formatted: {type(error).__name__})",
            (),
        )
        return replacement
    else:
        return record


def _raise_location(record: logging.LogRecord) -> tuple[object, ...] | None:
    if not record.exc_info or record.exc_info[0] is None:
        return None
    kind, _error, trace = record.exc_info
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    location = (trace.tb_frame.f_code.co_filename, trace.tb_lineno) if trace is not None else ()
    return (kind, *location)


class LogFile(RotatingFileHandler):
    """Log file of warnings and errors: ``studio.log`` and three older files of 1 MB each.

    Each run starts with a line that contains Studio's version, because an updated Studio appends to the
    same file. Only the user can read the files. Records that can't be written (disk full or read-only)
    are dropped.
    """

    def __init__(self, folder: Path) -> None:
        # `delay`: the folder is created with the first line.
        super().__init__(
            folder / "studio.log", maxBytes=FILE_BYTES, backupCount=BACKUP_COUNT, encoding="utf-8", delay=True
        )
        self.setLevel(logging.WARNING)
        self.setFormatter(logging.Formatter(LOG_FORMAT))
        self._repeat_filter = RepeatFilter()

    def emit(self, record: logging.LogRecord) -> None:
        """Write the record unless it is a repetition."""
        filtered = self._repeat_filter.filter(record)
        if filtered is not None:
            super().emit(filtered)

    def _open(self) -> io.TextIOWrapper:
        path = Path(self.baseFilename)
        path.parent.mkdir(0o700, parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        stream = os.fdopen(descriptor, "a", encoding="utf-8", errors="backslashreplace")
        first_record = logging.LogRecord("studio", logging.INFO, "", 0, VERSION_MESSAGE, (__version__,), None)
        stream.write(f"{self.format(first_record)}{self.terminator}")
        return stream

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  logging's name
        """Ignore write errors, which can't be reported elsewhere; the Console still shows the record."""


def install_hooks() -> None:
    """Install hooks that log uncaught exceptions of all threads and of finalizers."""
    sys.excepthook = _log_uncaught
    threading.excepthook = _log_uncaught_in_thread
    sys.unraisablehook = _log_unraisable


def _log_uncaught(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    _log.error("uncaught exception: %s", error_text(error), exc_info=(kind, error, trace))


def _log_uncaught_in_thread(hook_args: threading.ExceptHookArgs) -> None:
    error = hook_args.exc_value
    if error is None or isinstance(error, SystemExit):
        return
    name = hook_args.thread.name if hook_args.thread is not None else "a thread"
    _log.error(
        "uncaught exception in thread '%s': %s",
        name,
        error_text(error),
        exc_info=(type(error), error, hook_args.exc_traceback),
    )


def _log_unraisable(hook_args: sys.UnraisableHookArgs) -> None:
    error = hook_args.exc_value
    if error is not None:
        trace = hook_args.exc_traceback
        _log.error(
            "exception ignored in a finalizer: %s", error_text(error), exc_info=(type(error), error, trace)
        )


def error_text(error: BaseException) -> str:
    """Format an exception as one line: type and message."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


@dataclass(slots=True)
class _Fault:
    """Failed step.

    Attributes:
        message: Error message for the user.
        last_failure_s: Time of the last failure.
        has_recovered: True if the step has succeeded since the last failure.
    """

    message: str
    last_failure_s: float
    has_recovered: bool = False


class FaultAlerts:
    """Alert about failed steps of Studio. Not thread-safe; use it from the main thread."""

    def __init__(self, alerts: Alerts, clock: Callable[[], float]) -> None:
        self._alerts, self._clock = alerts, clock
        self._faults: dict[str, _Fault] = {}

    @contextmanager
    def guarded(self, operation: str, **placeholder_values: object) -> Iterator[None]:
        """Return a context manager that logs exceptions of one step, raises an alert and suppresses them.

        Args:
            operation: Translatable phrase that completes "can't ..."; mark it with `lazy`.
            placeholder_values: Values for the placeholders in ``operation``.
        """
        try:
            yield
        except Exception as error:  # noqa: BLE001  the following steps must run after any error
            self._on_failed(operation, placeholder_values, error)
        else:
            self._on_succeeded(operation)

    def run(self, operation: str, step: Callable[[], object]) -> None:
        """Run one step as with `guarded`, but without a context manager, which is slower.

        Args:
            operation: Translatable phrase that completes "can't ..."; mark it with `lazy`.
            step: Function to call.
        """
        try:
            step()
        except Exception as error:  # noqa: BLE001  the following steps must run after any error
            self._on_failed(operation, {}, error)
        else:
            self._on_succeeded(operation)

    def _on_failed(self, operation: str, placeholder_values: Mapping[str, object], error: Exception) -> None:
        english = operation.format(**placeholder_values)
        translated = _(operation).format(**placeholder_values)
        _log.exception("can't %s", english)
        message = _("Studio can't {what}: {error}").format(what=translated, error=error_text(error))
        self._record_failure(english, message)

    def _on_succeeded(self, operation: str) -> None:
        if self._faults and operation in self._faults:
            self._faults[operation].has_recovered = True

    def check(self) -> None:
        """Remove resolved faults, and resolve the alert if none is left. Called once a second."""
        now = self._clock()
        expired = [
            operation
            for operation, fault in self._faults.items()
            if now - fault.last_failure_s >= (RECOVERY_S if fault.has_recovered else EXPIRY_S)
        ]
        for operation in expired:
            del self._faults[operation]
        if expired and not self._faults:
            self._alerts.resolve(ALERT_ID)
        elif expired:
            self._update_alert(next(iter(self._faults.values())), count=0)

    def _record_failure(self, operation: str, message: str) -> None:
        is_new = operation not in self._faults
        while is_new and len(self._faults) >= MAX_FAULTS:
            del self._faults[next(iter(self._faults))]
        self._faults[operation] = _Fault(message, self._clock())
        if not self._alerts.has(ALERT_ID):
            self._update_alert(
                self._faults[operation], count=1
            )  # further faults and repetitions are in the log

    def _update_alert(self, fault: _Fault, *, count: int) -> None:
        title = _("Something went wrong in Studio. It may show outdated values.")
        self._alerts.raise_alert(
            ALERT_ID, "error", title, fault.message, button=_("Show the log"), intent=ShowLog(), count=count
        )
