"""Errors of Studio itself: heard wherever they are, said once, and never the end of what comes after.

Everything goes through `logging`: what is raised and caught nowhere (`install_hooks`, in any thread), what a
guard caught (`log_errors`), and what Qt says. Handlers that a person reads have a `RepeatFilter`.
"""

from __future__ import annotations

import io
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from logging.handlers import RotatingFileHandler
from pathlib import Path
from types import TracebackType

import platformdirs

from app.core.alerts import Alerts
from nep.i18n import _
from nep.version import __version__

FILE_BYTES, FILES_KEPT = 1_000_000, 3
FAULTS_KEPT = 500
IN_CONSOLE: dict[str, object] = {"in_console": True}
"""The `extra` of a record that the Console has in words of its own: it is for the log file."""
WRITER = "NEP Studio %s writes from here on"
FORMAT = "%(asctime)s %(levelname)s %(threadName)s %(name)s: %(message)s"

ALERT = "studio"
WELL_S = 5.0
"""So long must what failed have gone well: what fails now and then must not make the banner flicker."""
OVER_S = 60.0
"""What is not tried again (an event that came once) is over after so long; the log has it."""
MOST = 100

_log = logging.getLogger("studio")


def log_folder() -> Path:
    """Where the log files are: the system's place for them, or below ``$NEP_STUDIO_HOME``."""
    chosen = os.environ.get("NEP_STUDIO_HOME")
    return Path(chosen) / "log" if chosen else Path(platformdirs.user_log_dir("nep-studio", appauthor=False))


@contextmanager
def log_errors(what: str) -> Iterator[None]:
    """Log what goes wrong inside as "can't ``what``", with its traceback, and go on behind it."""
    try:
        yield
    except Exception:  # noqa: BLE001  whatever it is: what comes after still has its turn
        _log.exception("can't %s", what)


class RepeatFilter:
    """Says a fault when it is new, and when it has happened 10, 100, 1000 ... times, with the count.

    The same are records of one logger and level, raised at one place or with one text. The newest 500 faults
    are known; an older one that happens again is new. Handlers call it under their own lock.
    """

    def __init__(self) -> None:
        self._counts: dict[tuple[object, ...], int] = {}

    def filter(self, record: logging.LogRecord) -> logging.LogRecord | None:
        """The record as it is to be written, or None; one that was written before says how often it came.

        It never raises: whoever logs must not end because of the words.
        """
        record = _sayable(record)
        key = (record.name, record.levelno, _place(record) or record.getMessage())
        count = self._counts.pop(key, 0) + 1
        while len(self._counts) >= FAULTS_KEPT:
            del self._counts[next(iter(self._counts))]
        self._counts[key] = count
        if count == 1:
            return record
        if count < 10 or str(count).strip("0") != "1":
            return None
        again = logging.makeLogRecord(record.__dict__)
        again.msg, again.args = f"{record.getMessage()} ({count} times)", ()
        again.exc_info, again.exc_text = None, None  # the first one told where
        return again


def _sayable(record: logging.LogRecord) -> logging.LogRecord:
    """The record; where its values do not fit its text, or can't be said, one with the text only."""
    try:
        record.getMessage()
    except Exception as error:  # noqa: BLE001  values are of any class
        text = record.msg if isinstance(record.msg, str) else type(record.msg).__name__
        made = logging.makeLogRecord(record.__dict__)
        made.msg, made.args = f"{text} (its values can't be said: {type(error).__name__})", ()
        return made
    else:
        return record


def _place(record: logging.LogRecord) -> tuple[object, ...] | None:
    """The type of an exception and the line that raised it; None when a record has none."""
    if not record.exc_info or record.exc_info[0] is None:
        return None
    kind, _error, trace = record.exc_info
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = (trace.tb_frame.f_code.co_filename, trace.tb_lineno) if trace is not None else ()
    return (kind, *where)


class LogFile(RotatingFileHandler):
    """Warnings and errors with their tracebacks: ``studio.log`` and three older ones of a megabyte each.

    The first line that a run writes, in each file, says its version: an update goes on in the same file.
    Only the user may read them. A disk that is full or read-only ends nothing: the line is lost.
    """

    def __init__(self, folder: Path) -> None:
        """The folder is made with the first line."""
        super().__init__(
            folder / "studio.log", maxBytes=FILE_BYTES, backupCount=FILES_KEPT, encoding="utf-8", delay=True
        )
        self.setLevel(logging.WARNING)
        self.setFormatter(logging.Formatter(FORMAT))
        self._once = RepeatFilter()

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line, once."""
        told = self._once.filter(record)
        if told is not None:
            super().emit(told)

    def _open(self) -> io.TextIOWrapper:
        path = Path(self.baseFilename)
        path.parent.mkdir(0o700, parents=True, exist_ok=True)
        number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        stream = os.fdopen(number, "a", encoding="utf-8", errors="backslashreplace")
        begins = logging.LogRecord("studio", logging.INFO, "", 0, WRITER, (__version__,), None)
        stream.write(f"{self.format(begins)}{self.terminator}")
        return stream

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  logging's name
        """Nothing: there is no better place to say it, and the Console has the line."""


def install_hooks() -> None:
    """From now on log what is raised and caught nowhere: in this thread, in others, and while things end."""
    sys.excepthook = _raised
    threading.excepthook = _raised_in_thread
    sys.unraisablehook = _raised_at_end


def _raised(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    _log.error("a fault of Studio: %s", error_words(error), exc_info=(kind, error, trace))


def _raised_in_thread(raised: threading.ExceptHookArgs) -> None:
    error = raised.exc_value
    if error is None or isinstance(error, SystemExit):
        return
    name = raised.thread.name if raised.thread is not None else "a thread"
    _log.error(
        "'%s' ended: %s", name, error_words(error), exc_info=(type(error), error, raised.exc_traceback)
    )


def _raised_at_end(raised: sys.UnraisableHookArgs) -> None:
    error = raised.exc_value
    if error is not None:
        trace = raised.exc_traceback
        _log.error("while something ended: %s", error_words(error), exc_info=(type(error), error, trace))


def error_words(error: BaseException) -> str:
    """An exception in one line: its type and what it says."""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


@dataclass(slots=True)
class _Fault:
    """One thing that failed: what was said, when it last failed, whether it has gone well since."""

    said: str
    last_s: float
    is_well: bool = False


class FaultAlerts:
    """What Studio could not do. One thread uses it (the window's)."""

    def __init__(self, alerts: Alerts, clock: Callable[[], float]) -> None:
        """``clock`` gives monotonic seconds."""
        self._alerts, self._clock = alerts, clock
        self._faults: dict[str, _Fault] = {}

    @contextmanager
    def guarded(self, what: str, **holes: object) -> Iterator[None]:
        """One thing: when it raises, the log and an alert say so, and the next has its turn.

        ``what`` completes the sentence "can't ..."; it is marked with `lazy`, its ``holes`` are filled here.
        """
        try:
            yield
        except Exception as error:  # noqa: BLE001  whatever it is: what comes after must still arrive
            english, told = what.format(**holes), _(what).format(**holes)
            _log.exception("can't %s", english)
            self._failed(
                english, _("Studio can't {what}: {error}").format(what=told, error=error_words(error))
            )
        else:
            if self._faults and what in self._faults:
                self._faults[what].is_well = True

    def check(self) -> None:
        """Once a second: forget what is over; without any fault the alert is cured."""
        now = self._clock()
        over = [
            what
            for what, fault in self._faults.items()
            if now - fault.last_s >= (WELL_S if fault.is_well else OVER_S)
        ]
        for what in over:
            del self._faults[what]
        if over and not self._faults:
            self._alerts.resolve(ALERT)
        elif over:
            self._tell(next(iter(self._faults.values())), count=0)

    def _failed(self, what: str, said: str) -> None:
        is_new = what not in self._faults
        while is_new and len(self._faults) >= MOST:
            del self._faults[next(iter(self._faults))]
        self._faults[what] = _Fault(said, self._clock())
        if not self._alerts.has(ALERT):
            self._tell(self._faults[what], count=1)  # of others and of how often the log tells

    def _tell(self, fault: _Fault, *, count: int) -> None:
        title = _("Something went wrong in Studio. It may show outdated values.")
        self._alerts.put(
            ALERT, "error", title, fault.said, button=_("Show the log"), action="help.log", count=count
        )
