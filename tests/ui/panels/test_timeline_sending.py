"""Test of sending selected topics of a recording to the live network from the Timeline."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.core.run.acting.arming import Target
from app.ui.panels.record.timeline import PANEL
from app.ui.panels.record.timeline.panel import TimelinePanel
from app.ui.shell.bars.status_bar import StatusFormatter
from tests.nep.recordings.messages import json_message, record
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, has_keys
from tests.ui.test_accessible import unsaid

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
COUNT = 40


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Recording of alternating messages on /a and /base/cmd_vel."""
    path = tmp_path / "Tour.mcap"
    record(path, [[json_message(seq, ("/a", "/base/cmd_vel")[seq % 2]) for seq in range(COUNT)]])
    return path


def until(qtbot, window: Window, panel: TimelinePanel, true: Callable[[], object]) -> None:
    """Tick the session and refresh the panel until a condition holds."""

    def tick() -> bool:
        window.session.tick()
        panel.refresh()
        return bool(true())

    qtbot.waitUntil(tick, timeout=60_000)


def chosen(panel: TimelinePanel) -> list[str]:
    """Return the texts of the "Sent as" column."""
    table = panel.chooser.table
    return [table.cell_at(row, 3).text for row in range(panel.chooser.model.rowCount())]


def test_recorded_topics_are_selected_renamed_armed_confirmed_sent_and_counted(qtbot, qapp, path):
    session = Session()
    window = Window(session)
    panel = window.make(PANEL, (1000, 340))
    qtbot.addWidget(panel)
    assert isinstance(panel, TimelinePanel)
    for widget in panel.header_widgets():
        qtbot.addWidget(widget)
    replay = session.open_recording(path)
    sending = replay.sending
    assert sending is not None
    until(
        qtbot,
        window,
        panel,
        lambda: replay.opened_recording is not None and panel.transport.armed.isVisible(),
    )
    panel.refresh()
    assert panel.transport.sending_off_label.text() == "Sending is off"
    assert not panel.strip.isVisible()
    heard = session.live.source.listen("/test/a", "json")

    panel.transport.armed.setFocus()
    QTest.keyClick(panel.transport.armed, Qt.Key.Key_Space)
    assert not panel.transport.armed.isChecked()
    chooser = panel.chooser
    until(qtbot, window, panel, lambda: sending.is_analyzed)
    assert chooser.isVisible()
    assert has_keys(chooser.table)
    assert unsaid(panel) == []
    assert not chooser.arm.isEnabled()
    QTest.keyClick(chooser.table, Qt.Key.Key_Return)
    assert chosen(panel) == ["/a", ""]
    QTest.keyClicks(chooser.name, "two words")
    assert chooser.problem.isVisible()
    assert not chooser.arm.isEnabled()
    QTest.keyClick(chooser.name, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    QTest.keyClicks(chooser.name, "/test/a")
    assert not chooser.problem.isVisible()
    QTest.keyClick(chooser.table, Qt.Key.Key_Down)
    assert chooser.name.placeholderText() == "/base/cmd_vel"
    QTest.keyClick(chooser.table, Qt.Key.Key_Return)
    assert chosen(panel) == ["/test/a", "/base/cmd_vel"]
    assert [chooser.table.cell_at(row, 2).accessible_text for row in (0, 1)] == ["", "moves a robot"]
    assert not session.acting.arming.is_on
    QTest.mouseClick(chooser.arm, Qt.MouseButton.LeftButton)

    session.tick(), panel.refresh()
    assert not chooser.isVisible()
    assert has_keys(panel.strip.switch)
    assert panel.strip.isVisible()
    assert not panel.transport.armed.isVisible()
    assert panel.strip.question_label.text().startswith("/base/cmd_vel commands robots.")
    QTest.mouseClick(panel.strip.allow_button, Qt.MouseButton.LeftButton)
    session.tick(), panel.refresh()
    assert [token.text() for token in panel.strip.tokens] == ["/a as /test/a", "/base/cmd_vel"]
    going = sending.outbox.active_topics
    until(qtbot, window, panel, lambda: all(each.is_ready for each in going))
    until(qtbot, window, panel, lambda: going[0].subscriber_count)
    replay.play()
    until(qtbot, window, panel, lambda: sum(each.count + each.dropped_count for each in going) == COUNT)
    assert heard.listen(timeout_s=60.0)[0]
    session.tick(), panel.refresh()
    sent = sum(each.count for each in going)
    assert panel.strip.summary_label.text().startswith(f"{sent} sent")
    assert panel.strip.summary_label.text().endswith("1 subscriber")
    assert "Sending 2 topics of the recording" in StatusFormatter(session).arming()[1]
    assert unsaid(panel) == []

    QTest.mouseClick(panel.strip.tokens[1], Qt.MouseButton.LeftButton)
    session.tick(), panel.refresh()
    assert [each.route.recorded for each in sending.outbox.active_topics] == ["/a"]
    assert session.acting.arming.targets == (Target("topic", "/test/a"),)
    QTest.mouseClick(panel.strip.change, Qt.MouseButton.LeftButton)
    assert chooser.isVisible()
    QTest.keyClick(chooser.table, Qt.Key.Key_Escape)
    assert not chooser.isVisible()
    session.runs.stop()
    session.tick(), panel.refresh()
    assert sending.outbox.active_topics == ()
    assert not panel.strip.isVisible()
    assert panel.transport.armed.isVisible()
