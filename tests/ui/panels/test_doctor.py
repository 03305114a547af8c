from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication

from app.core.network.master import MasterState
from app.ui.panels.doctor import PANEL, DoctorPanel
from nep.programs.doctor import Finding
from tests.ui.fakes import Session
from tests.ui.panel_case import Window
from tests.ui.sample_data import FOUND


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> DoctorPanel:
    made = window.make(PANEL, (640, 480))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, DoctorPanel)
    return made


def test_it_looks_when_it_is_first_seen_and_shows_the_worst_first(panel, window) -> None:
    assert window.session.doctor.looked == 1
    assert panel.shown == list(FOUND)
    assert len(panel.rows) == len(FOUND)
    assert panel.rows[0].accessibleName().startswith("error: Port 7780 is held by")
    assert panel.chip.accessibleName() == "2"
    panel.refresh()
    assert window.session.doctor.looked == 1  # nothing changed, nothing done


def test_a_command_is_copied(qtbot, panel, window) -> None:
    row = panel.rows[0]
    assert row.button.accessibleName() == "Copy the command"
    qtbot.mouseClick(row.button, Qt.MouseButton.LeftButton)
    assert QGuiApplication.clipboard().text() == "nep master --port 7781"
    assert window.toasts == ["Copied “nep master --port 7781”"]
    assert not panel.rows[1].button.isVisible()


def test_studio_starts_the_master_and_looks_again_when_it_is_there(qtbot, panel, window) -> None:
    missing = Finding("master:none", "error", "No master runs.", "Start one.", "nep master")
    window.session.doctor.found = (missing,)
    qtbot.mouseClick(panel.again, Qt.MouseButton.LeftButton)
    panel.refresh()
    (row,) = panel.rows
    assert row.button.accessibleName() == "Start the master"
    qtbot.mouseClick(row.button, Qt.MouseButton.LeftButton)
    assert window.session.launcher.masters_asked_for == 1
    window.session.doctor.found = (Finding("master", "ok", "A master runs."),)
    window.session.master = MasterState("searching", "127.0.0.1:7780")
    panel.refresh()
    assert [each.id for each in panel.shown] == ["master"]
    assert panel.chip.accessibleName() == "all is well"


def test_the_report_is_copied_as_text(panel, window) -> None:
    (copy,) = panel.more_actions()
    copy.trigger()
    text = QGuiApplication.clipboard().text()
    assert text.startswith("x Port 7780 is held by")
    assert text.count("\n") >= len(FOUND)
    assert window.toasts == ["Copied the report"]


def test_while_it_looks_the_button_waits_and_the_last_findings_stay(panel, window) -> None:
    window.session.doctor.looking = True
    panel.refresh()
    assert not panel.again.isEnabled()
    assert len(panel.rows) == len(FOUND)
    window.session.doctor.looking = False
    panel.refresh()
    assert panel.again.isEnabled()


def test_before_the_first_answer_it_says_that_it_looks(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.doctor.look = lambda: None
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    for widget in panel.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(panel, DoctorPanel)
    assert panel.empty.isVisible()
