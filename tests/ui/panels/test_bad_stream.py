"""Test of the alert about a publisher that sends undecodable messages at 1 kHz."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

import nep
from app.core.session import Session
from app.core.storage.settings import Settings
from app.ui.panels.watch.alerts import PANEL, AlertsPanel
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow
from nep.masters.master import Master
from tests.ui.shell_parts import PANELS

pytest_plugins = ["tests.ui.shell_fixtures"]

BAD = b'{"joints": [1, 2, 3'
SENT, EACH_S = 1500, 0.001


@pytest.fixture
def session(master: Master, home: Path) -> Iterator[Session]:
    made = Session(
        Settings(home), address=master.address, journal_folder=home / "journal", start_processes=False
    )
    made.start()
    yield made
    made.close()


@pytest.fixture
def window(qtbot, theme, session: Session) -> Iterator[MainWindow]:
    made = MainWindow(session, theme, {**PANELS, "alerts": PANEL}, [])
    qtbot.addWidget(made)
    theme.apply()
    made.resize(1440, 900)
    yield made
    made.close()


def test_undecodable_stream_raises_one_alert_with_exact_count_and_no_dialog(
    qtbot, window: MainWindow, commands: Commands, session: Session
) -> None:
    window.show()
    panel = window.show_layout("developer").open("alerts").panel
    assert isinstance(panel, AlertsPanel)
    with nep.node("talker") as node, session.live.watch("/bad"):
        publisher = node.new_pub("/bad", "json")
        qtbot.waitUntil(lambda: (window.tick(), publisher.subscribers == 1)[1])
        windows = [each for each in QApplication.topLevelWidgets() if each.isVisible()]
        seen = set()
        pause, began = threading.Event(), time.perf_counter()
        for number in range(SENT):
            publisher.publish_bytes(BAD)
            while time.perf_counter() < began + number * EACH_S:
                pause.wait(0.005)
                window.tick()
                QApplication.processEvents()
                seen |= set(panel.rows)
                assert QApplication.activeModalWidget() is None

        def counted() -> bool:
            window.tick()
            return [alert.count for alert in panel.shown_alerts] == [SENT]

        qtbot.waitUntil(counted)
        words = f"{SENT} messages on /bad"
        qtbot.waitUntil(lambda: (window.tick(), words in window.banner.banner.accessibleName())[1])
        assert window.banner.isVisible()
        assert len(seen) == 1, "it is the same row all the time: its button can be pressed"
        assert [each for each in QApplication.topLevelWidgets() if each.isVisible()] == windows
        told = [record for record in session.console.records if "/bad" in record.text]
        assert len(told) <= 1

        button = panel.rows[0].button
        QTest.mousePress(button, Qt.MouseButton.LeftButton)
        publisher.publish_bytes(BAD)
        qtbot.waitUntil(lambda: (window.tick(), panel.shown_alerts[0].count == SENT + 1)[1])
        QTest.mouseRelease(button, Qt.MouseButton.LeftButton)
        assert window.bench is not None
        assert window.bench.docks["inspector"].panel.topics == ["/bad"], "its next step was taken"
