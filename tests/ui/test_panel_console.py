from __future__ import annotations

import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QSignalSpy

from app.core.console import Console
from app.ui.panels.console import PANEL, ConsolePanel
from tests.ui.fakes import Session
from tests.ui.panel_case import Window


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> ConsolePanel:
    made = window.make(PANEL, (446, 200))
    qtbot.addWidget(made)
    qtbot.addWidget(made.header_widgets()[0])
    assert isinstance(made, ConsolePanel)
    return made


def lines(panel: ConsolePanel) -> list[str]:
    model = panel.model
    return [str(model.data(model.index(row, 0))).split(" ", 1)[1] for row in range(model.rowCount())]


def test_the_newest_line_is_first(panel) -> None:
    assert lines(panel)[0] == "info greeting say “Touch my head.” started"
    assert len(lines(panel)) == 6


def test_new_lines_are_inserted_not_reset(qtmodeltester, panel, window) -> None:
    qtmodeltester.check(panel.model)
    reset, inserted = QSignalSpy(panel.model.modelReset), QSignalSpy(panel.model.rowsInserted)
    window.session.console.add("warn", "studio", "one")
    window.session.console.add("info", "studio", "two")
    panel.refresh()
    assert lines(panel)[:2] == ["info studio two", "warn studio one"]
    assert (reset.count(), inserted.count()) == (0, 1)
    panel.refresh()
    assert inserted.count() == 1  # nothing new, nothing done


def test_a_full_ring_is_shown_anew(qtbot, qapp) -> None:
    session = Session()
    session.console = Console(capacity=3)
    window = Window(session)
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    qtbot.addWidget(panel.header_widgets()[0])
    for number in range(5):
        session.console.add("info", "x", str(number))
        panel.refresh()
    assert isinstance(panel, ConsolePanel)
    assert lines(panel) == ["info x 4", "info x 3", "info x 2"]


def test_levels_can_be_left_out_and_the_choice_comes_back(qtbot, panel, window) -> None:
    panel.set_level("warn")
    assert [line.split()[0] for line in lines(panel)] == ["warn", "error"]
    panel.set_level("error")
    assert len(lines(panel)) == 1
    again = window.make(PANEL)
    qtbot.addWidget(again)
    qtbot.addWidget(again.header_widgets()[0])
    again.restore_state(panel.save_state())
    assert isinstance(again, ConsolePanel)
    assert again.level == "error"
    again.restore_state({"level": "nonsense"})
    assert again.level == "error"


def test_lines_are_copied_in_the_order_in_which_they_happened(panel, window) -> None:
    panel.list.selectAll()
    panel.copy()
    text = QGuiApplication.clipboard().text().splitlines()
    assert text[0].endswith("gateway RIZE joined (original NEP, port 50000)")
    assert len(text) == 6
    assert window.toasts == ["Copied 6 lines"]


def test_with_nothing_it_says_what_will_appear(qtbot, qapp) -> None:
    window = Window(Session())
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    qtbot.addWidget(panel.header_widgets()[0])
    assert isinstance(panel, ConsolePanel)
    assert panel.empty.isVisible()
    window.session.console.add("info", "master", "connected")
    panel.refresh()
    assert panel.list.isVisible()
    panel.set_level("error")
    assert panel.empty._title.text() == "No problem was told"
