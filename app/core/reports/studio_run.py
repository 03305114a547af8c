"""Whether Studio ended in order: a run leaves a mark, and the next start reads those that are still there.

Each run has a mark of its own (so has each window), with the lock that its process holds; a file beside it in
which Python writes where native code crashed; and takes both away when it ends in order.
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

from app.core.faults import IN_CONSOLE, error_words, log_folder
from app.core.reports.crash import Crash, fatal_line
from app.core.reports.crash_reports import CrashReports
from app.core.reports.studio_versions import plain_version
from app.core.storage.atomic_file import private_folder, read_whole, write_atomically
from app.core.storage.file_lock import FileLock
from app.core.storage.settings import state_home
from nep.system.lazy_import import lazy_module
from nep.version import __version__

if TYPE_CHECKING:
    import psutil
    from typing_extensions import Self
else:
    psutil = lazy_module("psutil")

LOG_LINES = 80
MOST_TRACE = 1_000_000
CLOCK_S = 2.0
"""By so much what the system says of a process's begin may differ from the clock."""
WITHOUT_A_WORD = (
    "it ended without a word: the system ended it (for lack of memory, say), or a person did, or the "
    "computer's session ended"
)

_log = logging.getLogger("studio.run")


class StudioRun:
    """This run of Studio, from `begin` to `end`; as a context manager, an exception that ends it is kept."""

    def __init__(
        self,
        folder: Path | None = None,
        log: Path | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        """Marks are in ``folder`` (default: ``runs`` in the folder for state), traces in that of the log."""
        self._folder = folder if folder is not None else state_home() / "runs"
        self._log = log if log is not None else log_folder()
        self._clock = clock
        self._mark = self._folder / f"{uuid.uuid4().hex}.json"
        self._lock = FileLock(self._mark)
        self._trace: IO[str] | None = None
        self._began_s = 0.0

    @property
    def is_noted(self) -> bool:
        """Whether there is a mark: without, nobody will know how this run ended."""
        return self._mark.exists()

    def begin(self) -> None:
        """Leave the mark. Where nothing can be written there is none, and one line in the log says so."""
        self._began_s = self._clock()
        try:
            self._write(asked=False)
            self._lock.acquire()
            self._listen()
        except OSError as error:
            self._take_away()
            _log.warning("if Studio crashes, the next start will not know: %s", error, extra=IN_CONSOLE)

    def expect_end(self) -> None:
        """Somebody, or the end of the session, asks Studio to end: if it ends now, that is no crash."""
        if self.is_noted:
            with contextlib.suppress(OSError):
                self._write(asked=True)

    def end(self) -> None:
        """It ends in order."""
        self._take_away()

    def __enter__(self) -> Self:
        """Begin."""
        self.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End; an exception that nobody caught is reported before it goes on."""
        if isinstance(error, Exception):
            told = "".join(traceback.format_exception(kind, error, trace))
            CrashReports(self._log / "crashes", self._clock).add(Crash("studio", error_words(error), told))
        self.end()

    def left(self) -> list[Crash]:
        """The runs that did not end in order; each is told to one caller only.

        A run that the computer's own restart ended is none, nor one that was asked to end.
        """
        try:
            marks = [mark for mark in self._folder.glob("*.json") if mark != self._mark]
        except OSError:
            return []
        found = [self._look(mark) for mark in marks]
        return [crash for crash in found if crash is not None]

    # -- this run -------------------------------------------------------------------------------------------

    def _write(self, *, asked: bool) -> None:
        entry = {
            "pid": os.getpid(),
            "began_s": self._began_s,
            "version": __version__,
            "trace": _trace_name(self._mark),
            "asked": asked,
        }
        write_atomically(self._mark, json.dumps(entry).encode(), durable=False, private=True)

    def _listen(self) -> None:
        private_folder(self._log)
        path = self._log / _trace_name(self._mark)
        number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o600)
        self._trace = os.fdopen(number, "a", encoding="utf-8")
        faulthandler.enable(self._trace)

    def _take_away(self) -> None:
        if self._trace is not None:
            faulthandler.disable()
            self._trace.close()
            self._trace = None
        self._lock.release()
        _remove(self._mark, self._log)

    # -- those before ---------------------------------------------------------------------------------------

    def _look(self, mark: Path) -> Crash | None:
        lock = FileLock(mark)
        if not lock.acquire():
            return None  # its process lives
        judged: tuple[Mapping[str, object], float] | None = None
        try:
            entry = json.loads(read_whole(mark))
            began_s, pid = float(entry["began_s"]), int(entry["pid"])
            if _runs(pid, began_s):  # on a disk without locks
                return None
            mark.unlink()  # who can do so tells of it
            judged = entry, began_s
        except OSError:
            return None
        except (ValueError, TypeError, KeyError, RecursionError):
            pass  # it is damaged, and tells nothing
        finally:
            lock.release()  # before it is removed: Windows removes no file that is open
        trace = self._trace_of(mark)
        _remove(mark, self._log)
        return self._judged(*judged, trace) if judged is not None else None

    def _judged(self, entry: Mapping[str, object], began_s: float, trace: str) -> Crash | None:
        how = fatal_line(trace)
        if not how:
            if entry.get("asked") is True or psutil.boot_time() > began_s + CLOCK_S:
                return None
            how = WITHOUT_A_WORD
        began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(began_s))
        version = plain_version(entry.get("version"))
        text = f"It was version {version or 'not known'}, begun {began}.\n\n{trace}\n{self._end_of_log()}"
        return Crash("studio", how, text, version)

    def _trace_of(self, mark: Path) -> str:
        try:
            return read_whole(self._log / _trace_name(mark), MOST_TRACE).decode("utf-8", "replace")
        except OSError:
            return ""

    def _end_of_log(self) -> str:
        try:
            lines = read_whole(self._log / "studio.log").decode("utf-8", "replace").splitlines()
        except OSError:
            return ""
        return "\n".join(["The end of the log:", *lines[-LOG_LINES:]]) + "\n"


def _trace_name(mark: Path) -> str:
    return f"crash-{mark.stem}.trace"


def _remove(mark: Path, log: Path) -> None:
    for path in (mark, mark.with_name(f"{mark.name}.lock"), log / _trace_name(mark)):
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def _runs(pid: int, began_s: float) -> bool:
    """Whether the process of that number lives and is as old as the mark: numbers are given out again."""
    try:
        process = psutil.Process(pid)
        is_old = process.create_time() <= began_s + CLOCK_S
        return is_old and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False
