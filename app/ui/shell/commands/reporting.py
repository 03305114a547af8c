"""Commands of the Help menu: problem report, and the web page of releases."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QLocale, QUrl, qVersion
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QWidget

from app.core.projects.file_format import encode_file
from app.core.reports.crash_reports import ALERT_ID
from app.core.session import Session
from app.ui.other_programs import open_externally
from app.ui.shell.commands.shell import Shell
from app.ui.widgets.file_dialogs import FileDialogs
from nep.i18n import _
from nep.system.lazy_import import lazy_module
from nep.version import RELEASES_PAGE, __version__

if TYPE_CHECKING:
    from app.core.reports import problem_report
    from app.ui.shell.dialogs import report as report_sheet
else:
    problem_report = lazy_module("app.core.reports.problem_report")
    report_sheet = lazy_module("app.ui.shell.dialogs.report")

DOCTOR_TIMEOUT_S = 15.0
"""Time limit in s for the connection doctor while a report is being created."""
DOCTOR_MAX_AGE_S = 60.0
"""Maximum age in s at which results of the connection doctor are reused for a report."""


class ReportCommands:
    """Handlers of the commands for problem reports and releases."""

    def __init__(
        self,
        shell: Shell,
        session: Session,
        dialogs: FileDialogs,
        clock: Callable[[], float] = time.time,
    ) -> None:
        # `clock` returns seconds since 1970.
        self._shell, self._session, self._dialogs = shell, session, dialogs
        self._clock = clock
        self._sheet: report_sheet.ReportSheet | None = None

    def report(self) -> None:
        """Open the sheet for a problem report, after the newest edit of the block editor was applied.

        The doctor is started unless its last result is at most `DOCTOR_MAX_AGE_S` old.
        """
        self._session.alerts.resolve(ALERT_ID)
        doctor = self._session.doctor
        if doctor.finished_s is None or self._clock() - doctor.finished_s > DOCTOR_MAX_AGE_S:
            doctor.start()
        self._shell.flush(self._open)

    def _open(self) -> None:
        shell, session = self._shell, self._session
        if self._sheet is None:
            self._sheet = report_sheet.ReportSheet(
                shell.theme, shell.surface, self._dialogs, shell.show_toast, self._clock
            )
        parts = problem_report.ReportParts(
            qt_info(shell.surface),
            session.settings.stored_values(),
            lambda: session.doctor.report(DOCTOR_TIMEOUT_S),
        )
        projects = session.documents
        names = [projects.title(each) for each in projects if not each.is_blank]
        self._sheet.show_for(parts, names, self._reported_work)

    def _reported_work(self) -> list[problem_report.ReportedWork]:
        projects = self._session.documents
        return [
            problem_report.ReportedWork(
                projects.title(each),
                encode_file(each.project),
            )
            for each in projects
            if not each.is_blank
        ]

    def open_releases_page(self, page: str = RELEASES_PAGE) -> None:
        """Open the web page of releases in the browser, and show the installed version in a toast.

        Studio itself sends no request.
        """
        is_opened = open_externally(QUrl(page))
        message = (
            _("This is NEP Studio {version}. The newest version is shown in your browser.")
            if is_opened
            else _("This is NEP Studio {version}. You'll find newer versions at {page}")
        )
        self._shell.show_toast(message.format(version=__version__, page=page))


def qt_info(window: QWidget) -> tuple[tuple[str, str], ...]:
    """Return information that only Qt has, about its version, the screens and the window.

    Returns:
        Pairs of name and value, in English, because developers read the reports.
    """
    screens = [
        (f"screen {index}", f"{size.width()} x {size.height()} at {each.devicePixelRatio():g}, {rate:.0f} Hz")
        for index, each in enumerate(QGuiApplication.screens(), start=1)
        for size, rate in ((each.size(), each.refreshRate()),)
    ]
    return (
        ("Qt", qVersion() or ""),
        ("Qt platform", QGuiApplication.platformName()),
        *screens,
        ("window", f"{window.width()} x {window.height()}"),
        ("language of the system", QLocale.system().name()),
    )
