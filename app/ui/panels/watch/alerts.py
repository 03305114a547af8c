"""Alerts panel: current problems of the network and the robots, each with a suggested next step."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.home import RowHome, TabHome
from app.ui.text.numbers import group_digits
from app.ui.widgets import Chip, EmptyState
from app.ui.widgets.cards import AlertRow
from app.ui.widgets.lists.scroll_areas import PanelRows
from nep.i18n import _, lazy, ngettext

if TYPE_CHECKING:
    from app.core.alerts.alerts import ActiveAlert


class AlertsPanel(PanelWidget):
    """Panel with the active alerts, most severe first."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Alerts"))
        self._last_revision = -1
        self.rows: list[AlertRow] = []
        self.shown_alerts: list[ActiveAlert] = []  # parallel to `rows`
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        self.empty = EmptyState(
            self.theme,
            "circle-check",
            _("No problems"),
            _("Problems and how to fix them appear here."),
        )
        self.pages = PanelRows(self.empty, _("Alerts"))
        self.pages.fill(self)

    def refresh(self) -> None:
        alerts = self.session.alerts
        if alerts.revision == self._last_revision:
            return
        self._last_revision = alerts.revision
        # Behaviour layout: hides alerts for developers, such as ports
        is_plain = self.density == "comfortable"
        active = [alert for alert in alerts.active if not (is_plain and alert.for_developers)]
        if active != self.shown_alerts:
            self._show(active)

    def _show(self, active: list[ActiveAlert]) -> None:
        rows_by_id = {alert.id: row for alert, row in zip(self.shown_alerts, self.rows, strict=True)}
        self.shown_alerts = active
        self.rows = [
            rows_by_id.pop(each.id) if each.id in rows_by_id else self._create_row(each.id) for each in active
        ]
        for row in rows_by_id.values():
            self.pages.remove_row(row)
        for index, (row, alert) in enumerate(zip(self.rows, active, strict=True)):
            row.set_texts(
                alert.severity, alert.title, alert.detail, note=_since_text(alert), button=alert.button or ""
            )
            self.pages.insert_row(index, row)
        self.pages.show_rows(bool(active))
        self.chip.set(str(len(active)) if active else "", active[0].severity if active else "ok")

    def _create_row(self, alert_id: str) -> AlertRow:
        row = AlertRow(self.theme)
        row.button.clicked.connect(lambda: self._run_action(alert_id))
        return row

    def _run_action(self, alert_id: str) -> None:
        intent = next((alert.intent for alert in self.shown_alerts if alert.id == alert_id), None)
        if intent is not None:
            self.context.request(intent)


def _since_text(alert: ActiveAlert) -> str:
    clock = time.localtime(alert.since_s)
    since = f"{clock.tm_hour}:{clock.tm_min:02d}"
    if alert.count < 2:
        return _("since {clock}").format(clock=since)
    template = ngettext("since {clock}, {count} time", "since {clock}, {count} times", alert.count)
    return template.format(clock=since, count=group_digits(alert.count))


PANEL = Panel(
    "alerts",
    lazy("Alerts"),
    "bell",
    (),
    AlertsPanel,
    home=(TabHome("behaviour", "problems"), RowHome("developer", 2, 1, 394, tab=1)),
)
