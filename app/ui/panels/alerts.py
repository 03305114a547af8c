"""Alerts: all present problems of the network and the robots, each with its next step."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QVBoxLayout, QWidget

from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.text.numbers import grouped
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Chip, EmptyState, label, paint
from app.ui.widgets.lists.scroll_areas import PanelRows

if TYPE_CHECKING:
    from app.core.alerts import Alert

LEAST_WORDS = 220  # px at 100 % that the words have beside the button
BORDERS = {"error": "errorBorder", "warn": "warnBorder", "info": "borderStrong"}


class AlertRow(QWidget):
    """One alert: what is wrong in bold, what it means, since when, its next step."""

    def __init__(self, theme: Theme, alert: Alert) -> None:
        super().__init__()
        self._theme, self.alert = theme, alert
        self._lines = (
            label("", "title", wrap=True),
            label("", "body", role="textSecondary", wrap=True),
            label("", "small", role="textTertiary"),
        )
        words = QVBoxLayout()
        words.setSpacing(2)
        for line in self._lines:
            words.addWidget(line)
        self.button = Button(theme, "", size="small")
        self._row = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        self._row.setContentsMargins(40, 10, 12, 10)
        self._row.setSpacing(10)
        self._row.addLayout(words, 1)
        self._row.addWidget(self.button, 0, Qt.AlignmentFlag.AlignVCenter)
        self.renew(alert)

    def renew(self, alert: Alert) -> None:
        """Say what is known of it now; the button stays, also under a mouse that is pressed."""
        self.alert = alert
        clock = time.localtime(alert.since_s)
        since = f"since {clock.tm_hour}:{clock.tm_min:02d}"
        if alert.count > 1:
            since += f", {grouped(alert.count)} times"
        for line, text in zip(self._lines, (alert.title, alert.detail, since), strict=True):
            line.setText(text)
            paint.show_when(line, bool(text))
        self.button.set_word(alert.button or "")
        paint.show_when(self.button, bool(alert.button))
        self.setAccessibleName(f"{alert.severity}: {alert.title} {alert.detail}".strip())
        self.update()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        room = self.width() - self.button.sizeHint().width()
        beside = self.button.isHidden() or room >= self._theme.scaled(LEAST_WORDS)
        wanted = QBoxLayout.Direction.LeftToRight if beside else QBoxLayout.Direction.TopToBottom
        if self._row.direction() != wanted:
            self._row.setDirection(wanted)

    def minimumSizeHint(self) -> QSize:
        return QSize(160, super().minimumSizeHint().height())

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        status = theme.status(self.alert.severity)
        edge = theme.colour(BORDERS[self.alert.severity])
        paint.box(
            painter, QRectF(self.rect()), theme.radius("panel"), theme.colour(status.tint or "panel"), edge
        )
        paint_icon(painter, QRectF(12, 11, 18, 18), status.icon, theme.colour(status.colour))
        painter.end()


class AlertsPanel(PanelWidget):
    """Everything that is wrong now, the worst first."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Alerts")
        self._seen = -1
        self.rows: list[AlertRow] = []
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        self.empty = EmptyState(
            self.theme, "circle-check", "All is well", "What goes wrong appears here, with its next step."
        )
        self.pages = PanelRows(self.empty, "Alerts")
        self.pages.fill(self)

    def refresh(self) -> None:
        alerts = self.session.alerts
        if alerts.revision == self._seen:
            return
        self._seen = alerts.revision
        active = list(alerts.active)
        if active != [row.alert for row in self.rows]:
            self._show(active)

    def _show(self, active: list[Alert]) -> None:
        """Rows that are there stay: an alert that counts on is the same one."""
        known = {row.alert.id: row for row in self.rows}
        self.rows = [known.pop(each.id) if each.id in known else self._made(each) for each in active]
        for row in known.values():
            self.pages.drop(row)
        for place, (row, alert) in enumerate(zip(self.rows, active, strict=True)):
            if row.alert != alert:
                row.renew(alert)
            self.pages.put(place, row)
        self.pages.show_rows(bool(active))
        self.chip.set(str(len(active)) if active else "", active[0].severity if active else "ok")

    def _made(self, alert: Alert) -> AlertRow:
        row = AlertRow(self.theme, alert)
        row.button.clicked.connect(lambda: self._next_step(row))
        return row

    def _next_step(self, row: AlertRow) -> None:
        if row.alert.action is not None:
            self.context.run(row.alert.action)


PANEL = Panel("alerts", "Alerts", "bell", (), AlertsPanel)
