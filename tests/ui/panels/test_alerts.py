from __future__ import annotations

import pytest

from app.intents import Inspect
from app.ui.panels.watch.alerts import PANEL, AlertsPanel
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> AlertsPanel:
    made = window.make(PANEL, (446, 300))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, AlertsPanel)
    return made


def test_alert_is_shown_with_its_severity_and_next_step(panel, window) -> None:
    assert panel.rows[0].accessibleName().startswith("error: /faces sends text that is not JSON")
    press(panel.rows[0].button)
    assert window.commands == [Inspect("/faces")]
    assert (panel.chip.text, panel.chip.status) == ("1", "error")


def test_alerts_are_sorted_by_severity_and_disappear_when_resolved(panel, window) -> None:
    alerts = window.session.alerts
    alerts.raise_alert("silent:/cam", "warn", "The camera has been silent for 4 s.")
    panel.refresh()
    assert [alert.severity for alert in panel.shown_alerts] == ["error", "warn"]
    assert not panel.rows[1].button.isVisibleTo(panel)
    alerts.resolve("message:/faces")
    panel.refresh()
    assert panel.chip.status == "warn"
    alerts.resolve("silent:/cam")
    panel.refresh()
    assert panel.rows == []
    assert panel.empty.isVisible()
    assert panel.chip.text == ""


def test_dismissed_alert_stays_in_the_alerts_panel(panel, window) -> None:
    rows = list(panel.rows)
    window.session.alerts.dismiss("message:/faces")
    panel.refresh()
    assert panel.rows == rows
