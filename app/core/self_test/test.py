"""One self-test of this process: its steps one after the other, and a watch that ends it in any case."""

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

from app.core.self_test import bounds
from app.core.self_test.report import Report
from app.core.self_test.surroundings import CRASH, REPORT, Surroundings, remove_home
from nep.i18n import _, listed

FAILED = 1
WEB_PROCESS = "qtwebengineprocess"
KILL_S = 5.0


class SelfTest:
    """What the steps tell, and what happens when they tell nothing. Methods may be called in any thread."""

    def __init__(self, place: Surroundings, facts: dict[str, object]) -> None:
        """Begin: from now on the process ends in time, whatever its threads do."""
        self.place = place
        self.report = Report(place.path(REPORT), {**facts, "bound_s": bounds.ALL_S})
        self._news = threading.Condition()
        self._all_until = time.monotonic() + bounds.ALL_S
        self._step_until = self._all_until
        self._what = ""
        self._crash: TextIO = place.path(CRASH).open("w", encoding="utf-8")
        faulthandler.enable(self._crash)
        # Of the two watches this one needs neither Python nor its lock; what it writes is where all stood.
        last_s = bounds.ALL_S + 2 * bounds.GRACE_S
        faulthandler.dump_traceback_later(last_s, exit=True, file=self._crash)
        threading.Thread(target=self._watch, name="self-test watch", daemon=True).start()

    # -- steps --------------------------------------------------------------------------------------------

    def begin(self, name: str, words: str) -> None:
        """The step of that name (of `bounds.STEP_S`) begins; ``words`` say what is to be seen."""
        bound_s = bounds.STEP_S[name]
        self.report.begin(name, words, bound_s)
        self._wait_until(time.monotonic() + bound_s + bounds.GRACE_S, words)

    def seen(self, said: str = "") -> None:
        """What the step is to show was seen; ``said`` tells what exactly."""
        self.report.seen(said)

    def fail(self, why: str) -> None:
        """It has failed; the first sentence counts."""
        self.report.fail(why)

    def run(self, show: Callable[[], int]) -> int:
        """Let ``show`` do the steps until the window is closed, then end what is left; the exit code.

        0 when all was well; 1 when something was not, also when ``show`` raises or gives another code.
        """
        try:
            code = show()
        except Exception as error:  # noqa: BLE001  whatever it is: the report says it
            traceback.print_exc(file=self._crash)
            self._crash.flush()
            self.fail(
                _("{kind}: {error}; see {file}").format(kind=type(error).__name__, error=error, file=CRASH)
            )
        else:
            if code != 0:
                self.fail(_("Studio ended with exit code {code}").format(code=code))
        if not self.report.why:
            self.seen()  # it has closed
        self._end_processes()
        well = self.report.end()
        self._finish()
        return 0 if well else FAILED

    def _finish(self) -> None:
        """All is told. The process must still end: until then something watches."""
        faulthandler.cancel_dump_traceback_later()
        faulthandler.disable()
        self._crash.close()
        crash = self.place.path(CRASH)
        with suppress(OSError):
            if crash.stat().st_size == 0:
                crash.unlink()
        if not self.report.why:
            logging.shutdown()  # the log is there, too, and Windows removes no file that is open
            remove_home(self.place)
        self._wait_until(time.monotonic() + bounds.END_S, _("the end of the process"))

    # -- processes ----------------------------------------------------------------------------------------

    def _end_processes(self) -> None:
        """Nothing may be left of what was started but the master, which waits for us, and is ended here."""
        if self.report.why:
            end_family()
            return
        self.begin("processes", _("every process of the test exits"))
        family = [each for each in children() if not is_web(each) and not is_of_windows(each)]
        masters = [each for each in family if is_master(each)]
        for each in masters:
            with suppress(psutil.Error):
                each.terminate()
        _gone, left = psutil.wait_procs(family, timeout=bounds.STEP_S["processes"])
        if left:
            names = listed([f"{each.pid} ({' '.join(command(each)[:4])})" for each in left])
            self.fail(_("These processes did not exit: {names}").format(names=names))
            end_family()
        else:
            self.seen()

    # -- the watch ----------------------------------------------------------------------------------------

    def _wait_until(self, until: float, what: str) -> None:
        with self._news:
            self._step_until, self._what = until, what
            self._news.notify_all()

    def _watch(self) -> None:
        with self._news:
            while (left := min(self._step_until, self._all_until + bounds.GRACE_S) - time.monotonic()) > 0:
                self._news.wait(left)
            what = self._what
        self.fail(
            _("Studio did not respond in time and was stopped. It was waiting for: {what}").format(what=what)
        )
        self.report.end()
        with suppress(OSError, ValueError):  # it is closed at the very end
            faulthandler.dump_traceback(self._crash, all_threads=True)
        end_family()
        os._exit(FAILED)


def children() -> list[psutil.Process]:
    """Every process that this one has started, and those that they have."""
    try:
        return psutil.Process().children(recursive=True)
    except psutil.Error:
        return []


def command(process: psutil.Process) -> list[str]:
    """Its command line; nothing for one that has ended."""
    try:
        return process.cmdline()
    except (psutil.Error, OSError):  # see `is_web`
        return []


def is_master(process: psutil.Process) -> bool:
    """Whether it is a master that was started for its owner: it ends by itself, a moment after us."""
    words = command(process)
    return "master" in words and "--owner-pid" in words


def is_web(process: psutil.Process) -> bool:
    """Whether it belongs to the web view, whose processes end with the one that they belong to."""
    try:
        return process.name().lower().startswith(WEB_PROCESS[:15])
    except (psutil.Error, OSError):  # Windows' own word, where psutil has none for it
        return False


def is_of_windows(process: psutil.Process, root: str = os.environ.get("SYSTEMROOT", "")) -> bool:
    """Whether its program is one of Windows itself, in the folder ``root``; elsewhere there is none.

    Windows starts some in our name, such as the host of a console, and ends them when it likes.
    """
    try:
        program = process.exe()
    except (psutil.Error, OSError):  # not every Windows tells it of every process; see `is_web`
        program = next(iter(command(process)), "")
    return bool(root) and PureWindowsPath(program).is_relative_to(PureWindowsPath(root))


def end_family() -> None:
    """End all of them without asking."""
    family = children()
    for each in family:
        with suppress(psutil.Error):
            each.kill()
    psutil.wait_procs(family, timeout=KILL_S)
