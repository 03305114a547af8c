"""The master beside the window: is one there, does it know everybody yet; and starting one when none is."""

from __future__ import annotations

import logging
import os
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.core.own_process import module_command
from app.core.reports.crash import crash_extra, end_words, is_crash
from nep.errors import NepError
from nep.masters.master import is_running, start_process
from nep.protocol.graph_view import GraphView
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.programs import doctor
else:
    doctor = lazy_module("nep.programs.doctor")

LEARNING_S = 1.5
"""How long a master that has just started may not know everybody yet (it learns for one second)."""
AGAIN_S, AGAIN_AT_MOST_S = 2.0, 30.0
"""After how long a master that could not be started is tried again: twice as long each time."""
START_S = 50.0
"""How long a master may take to answer while its process lives: the first start after an installation, from a
slow disk and past a virus scanner, takes longer than the ten seconds that a program usually waits."""
END_WAIT_S = 2.0

_log = logging.getLogger("studio.master")


@dataclass(frozen=True, slots=True)
class MasterState:
    """Whether a master is there: ``searching``, ``connected`` or ``none``, its address, and a sentence."""

    kind: str
    address: str
    sentence: str = ""


class MasterChange:
    """Notices that another master has come. One thread uses it (the window's)."""

    def __init__(self) -> None:
        """Have seen no other master yet."""
        self._new_epoch = (0, 0.0)

    def still(self, known: GraphView | None, view: GraphView, now: float) -> bool:
        """Whether ``view`` is of another master than ``known`` and may lack people: they have not gone."""
        if known is None or view.epoch == known.epoch:
            return False
        if self._new_epoch[0] != view.epoch:
            self._new_epoch = (view.epoch, now)
        return now - self._new_epoch[1] < LEARNING_S


class MasterStart:
    """Joins the master that runs, or starts one. Each reason why it can't is told once."""

    def __init__(
        self,
        address: str,
        failed: Callable[[str], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``failed`` is given the reason, in the starting thread; ``clock`` gives monotonic seconds."""
        self._address, self._failed, self._clock = address, failed, clock
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._wait_s, self._again_at, self._told = AGAIN_S, 0.0, ""
        self.first = False
        """Whether there was no master before the one that is started here, so nobody can be there yet."""

    @property
    def runs(self) -> bool:
        """Whether the master that runs was started here."""
        return self._process is not None and self._process.poll() is None

    def ensure(self) -> None:
        """Start one now if there is none; returns at once."""
        if self._thread is not None and self._thread.is_alive():
            return
        self._thread = threading.Thread(target=self._start, name="studio-launcher", daemon=True)
        self._thread.start()

    def keep(self) -> None:
        """The same, to be said again and again while there is none: after a failure it takes its time."""
        if self._clock() >= self._again_at:
            self.ensure()

    def close(self) -> None:
        """Wait for a start that goes on."""
        if self._thread is not None:
            self._thread.join(timeout=END_WAIT_S)

    def _start(self) -> None:
        why = self._why_not()
        if not why:
            self._wait_s, self._again_at, self._told = AGAIN_S, 0.0, ""
            return
        self._again_at = self._clock() + self._wait_s
        self._wait_s = min(2 * self._wait_s, AGAIN_AT_MOST_S)
        if why != self._told:
            self._told = why
            self._failed(why)

    def _why_not(self) -> str:
        """Start it; "" when there is one now."""
        if is_running(self._address, timeout_s=0.5):
            return ""
        hindered = doctor.start_obstacle(self._address)
        if hindered is not None:
            return f"{hindered.sentence} {hindered.mend}"
        self.first = True
        self._look_back()
        try:
            self._process = start_process(
                self._address, owner_pid=os.getpid(), command=module_command("nep"), timeout_s=START_S
            )
        except (NepError, OSError) as error:
            return str(error)
        return ""

    def _look_back(self) -> None:
        """The master that was started here has gone: say so, if it crashed."""
        code = self._process.poll() if self._process is not None else None
        if code is None:
            return
        self._process = None
        if is_crash(code):
            how = f"the master's process {end_words(code)}"
            _log.error("%s", how, extra=crash_extra("master", how))
