"""Writes the report of a problem beside the window, which goes on meanwhile."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path

from app.core.faults import error_words
from app.core.reports.problem_report import write_report
from app.errors import ReportError
from nep.i18n import _

_log = logging.getLogger("studio.report")


class ReportWriter:
    """Makes and writes one report in a thread of its own, which ends with it."""

    def __init__(self, path: Path, make: Callable[[], bytes]) -> None:
        """Begin at once; ``make`` is called in the thread."""
        self.path = path
        self.problem = ""
        """Why it could not be written, in a sentence without a full stop; "" while nothing is wrong."""
        self._make = make
        self._thread = threading.Thread(target=self._work, name="studio-report")
        self._thread.start()

    @property
    def is_done(self) -> bool:
        """Whether it is written, or has failed."""
        return not self._thread.is_alive()

    def wait(self, timeout_s: float) -> bool:
        """Wait for it; whether it is done."""
        self._thread.join(timeout_s)
        return self.is_done

    def _work(self) -> None:
        try:
            write_report(self.path, self._make())
        except ReportError as error:
            self.problem = str(error)
        except Exception as error:  # noqa: BLE001  a report of problems must not have one that nobody hears of
            _log.exception("can't make a report")
            self.problem = _("the report can't be made: {error}").format(error=error_words(error))
