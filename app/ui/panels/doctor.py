"""Connection doctor: what keeps programs from finding each other, each finding with its next step."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QAction, QGuiApplication, QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Chip, EmptyState, IconButton, label, paint
from app.ui.widgets.lists.scroll_areas import PanelRows
from nep.doctor import report

if TYPE_CHECKING:
    from nep.doctor import Finding

STATUS = {"error": "error", "warning": "warn", "info": "info", "ok": "ok"}
BORDERS = {"error": "errorBorder", "warning": "warnBorder"}
STARTABLE = frozenset({"master:none"})


class FindingRow(QWidget):
    """One finding: what it is, what to do next, and a button where Studio can do it or help with it."""

    def __init__(self, theme: Theme, finding: Finding) -> None:
        super().__init__()
        self._theme, self.finding = theme, finding
        is_bad = finding.severity in BORDERS
        words = QVBoxLayout()
        words.setSpacing(2)
        words.addWidget(label(finding.sentence, "title" if is_bad else "body", wrap=True))
        if finding.mend:
            words.addWidget(label(finding.mend, "body", role="textSecondary", wrap=True))
        if finding.command:
            command = label(finding.command, "code", role="textSecondary", wrap=True)
            command.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            words.addWidget(command)
        self.button = Button(theme, self._word(), size="small")
        self.button.setVisible(bool(self._word()))
        row = QHBoxLayout(self)
        row.setContentsMargins(40, 10 if is_bad else 4, 12, 10 if is_bad else 4)
        row.setSpacing(10)
        row.addLayout(words, 1)
        row.addWidget(self.button, 0, Qt.AlignmentFlag.AlignVCenter)
        self.setAccessibleName(f"{finding.severity}: {finding.sentence} {finding.mend}".strip())

    def _word(self) -> str:
        if self.finding.id in STARTABLE:
            return "Start the master"
        return "Copy the command" if self.finding.command else ""

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        status = theme.status(STATUS[self.finding.severity])
        edge = BORDERS.get(self.finding.severity)
        top = 4.0
        if edge is not None:
            fill = theme.colour(status.tint or "panel")
            paint.box(painter, QRectF(self.rect()), theme.radius("panel"), fill, theme.colour(edge))
            top = 11.0
        paint_icon(painter, QRectF(12, top, 18, 18), status.icon, theme.colour(status.colour))
        painter.end()


class DoctorPanel(PanelWidget):
    """Everything that was looked at, the worst first."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Connection doctor")
        self._seen: tuple[object, ...] = ()
        self._master = ""
        self.rows: list[FindingRow] = []
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        self.again = IconButton(self.theme, "refresh-cw", "Look again", size=26)
        self.again.clicked.connect(self.session.doctor.look)
        self.header = [self.again]
        self._copy = QAction("Copy the report", self)
        self._copy.triggered.connect(self.copy_report)
        self.empty = EmptyState(
            self.theme, "stethoscope", "Looking at the connections", "This takes a second or two."
        )
        self.pages = PanelRows(self.empty, "Connection doctor")
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
        if list(doctor.findings) != [row.finding for row in self.rows]:
            self._show(doctor.findings)
        self.set_title(self.title(), time.strftime("%H:%M:%S", time.localtime(doctor.looked_s)))
        self.pages.show_rows(bool(self.rows))

    def _show(self, found: Sequence[Finding]) -> None:
        for row in self.rows:
            self.pages.drop(row)
        self.rows = [FindingRow(self.theme, finding) for finding in found]
        for place, row in enumerate(self.rows):
            row.button.clicked.connect(lambda _on=False, finding=row.finding: self._mend(finding))
            self.pages.put(place, row)
        bad = [each.severity for each in found if each.severity in BORDERS]
        if bad:
            self.chip.set(str(len(bad)), STATUS[bad[0]])
        else:
            self.chip.set("all is well", "ok")

    def _mend(self, finding: Finding) -> None:
        if finding.id in STARTABLE:
            self.session.companions.ensure_master()
            self.context.toast("Starting the master")
            return
        QGuiApplication.clipboard().setText(finding.command)
        self.context.toast(f"Copied “{finding.command}”")

    def copy_report(self) -> None:
        """Put everything that was found on the clipboard, to be sent to somebody."""
        QGuiApplication.clipboard().setText(report(self.session.doctor.findings))
        self.context.toast("Copied the report")

    def more_actions(self) -> Sequence[QAction]:
        return (self._copy,)


PANEL = Panel("doctor", "Connection doctor", "stethoscope", (), DoctorPanel)
