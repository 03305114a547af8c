"""Connection doctor: what keeps programs from finding each other, each finding with its next step."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtGui import QAction, QGuiApplication

from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.widgets import Chip, EmptyState, IconButton
from app.ui.widgets.cards import AlertRow
from app.ui.widgets.lists.scroll_areas import PanelRows
from nep.i18n import _, lazy
from nep.programs.doctor import report

if TYPE_CHECKING:
    from nep.programs.doctor import Finding

STATUS = {"error": "error", "warning": "warn", "info": "info", "ok": "ok"}
BAD = frozenset({"error", "warning"})
STARTABLE = frozenset({"master:none"})


class DoctorPanel(PanelWidget):
    """Everything that was looked at, the worst first."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Connection doctor"))
        self._seen: tuple[object, ...] = ()
        self._master = ""
        self.rows: list[AlertRow] = []
        self.shown: list[Finding] = []  # each in the row of its place
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        self.again = IconButton(self.theme, "refresh-cw", _("Look again"), size=26)
        self.again.clicked.connect(self.session.doctor.look)
        self.header = [self.again]
        self._copy = QAction(_("Copy the report"), self)
        self._copy.triggered.connect(self.copy_report)
        self.empty = EmptyState(
            self.theme, "stethoscope", _("Looking at the connections"), _("This takes a second or two.")
        )
        self.pages = PanelRows(self.empty, _("Connection doctor"))
        self.pages.fill(self)

    def refresh(self) -> None:
        doctor = self.session.doctor
        if self.session.master.kind != self._master:
            # a master came or went while the panel is looked at: what was found is not true any more
            self._master = self.session.master.kind
            doctor.look()
        now = (doctor.revision, doctor.looking)
        if now == self._seen:
            return
        self._seen = now
        self.again.setEnabled(not doctor.looking)
        if doctor.looked_s is None:
            return
        if list(doctor.findings) != self.shown:
            self._show(doctor.findings)
        self.set_title(self.title(), time.strftime("%H:%M:%S", time.localtime(doctor.looked_s)))
        self.pages.show_rows(bool(self.rows))

    def _show(self, found: Sequence[Finding]) -> None:
        for row in self.rows:
            self.pages.drop(row)
        self.shown = list(found)
        self.rows = [self._row(finding) for finding in found]
        for place, row in enumerate(self.rows):
            self.pages.put(place, row)
        bad = [each.severity for each in found if each.severity in BAD]
        if bad:
            self.chip.set(str(len(bad)), STATUS[bad[0]])
        else:
            self.chip.set(_("all is well"), "ok")

    def _row(self, finding: Finding) -> AlertRow:
        row = AlertRow(self.theme, framed=finding.severity in BAD)
        does = _("Copy the command") if finding.command else ""
        row.say(
            STATUS[finding.severity],
            finding.sentence,
            finding.mend,
            command=finding.command,
            button=_("Start the master") if finding.id in STARTABLE else does,
        )
        row.button.clicked.connect(lambda: self._mend(finding))
        return row

    def _mend(self, finding: Finding) -> None:
        if finding.id in STARTABLE:
            self.session.launcher.ensure_master()
            self.context.toast(_("Starting the master"))
            return
        QGuiApplication.clipboard().setText(finding.command)
        self.context.toast(_("Copied “{command}”").format(command=finding.command))

    def copy_report(self) -> None:
        """Put everything that was found on the clipboard, to be sent to somebody."""
        QGuiApplication.clipboard().setText(report(self.session.doctor.findings))
        self.context.toast(_("Copied the report"))

    def more_actions(self) -> Sequence[QAction]:
        return (self._copy,)


PANEL = Panel("doctor", lazy("Connection doctor"), "stethoscope", (), DoctorPanel)
