from __future__ import annotations

import json

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QSignalSpy

from app.core.world.console import Console
from app.ui.panels.watch.console.list import MIN_TEXT_CHARS, LineDelegate, first_line, tooltip_text
from app.ui.panels.watch.console.panel import PANEL, ConsolePanel
from app.ui.widgets import paint
from nep.messages.message import Message
from nep.nodes.log_handler import LOG_TOPIC, LOG_TYPE
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


def test_newest_line_is_first(panel) -> None:
    assert lines(panel)[0] == "info greeting say “Touch my head.” started"
    assert len(lines(panel)) == 6


def test_new_lines_are_inserted_without_a_model_reset(qtmodeltester, panel, window) -> None:
    qtmodeltester.check(panel.model)
    reset, inserted = QSignalSpy(panel.model.modelReset), QSignalSpy(panel.model.rowsInserted)
    window.session.console.add("warn", "studio", "one")
    window.session.console.add("info", "studio", "two")
    panel.refresh()
    assert lines(panel)[:2] == ["info studio two", "warn studio one"]
    assert (reset.count(), inserted.count()) == (0, 1)
    panel.refresh()
    assert inserted.count() == 1  # no update without new records


def test_evicted_records_are_removed_from_the_console_list(qtbot, qapp) -> None:
    session = Session()
    session.console = session.live.console = Console(capacity=3)
    window = Window(session)
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    qtbot.addWidget(panel.header_widgets()[0])
    for number in range(5):
        session.console.add("info", "x", str(number))
        panel.refresh()
    assert isinstance(panel, ConsolePanel)
    assert lines(panel) == ["info x 4", "info x 3", "info x 2"]
    reset, removed = QSignalSpy(panel.model.modelReset), QSignalSpy(panel.model.rowsRemoved)
    session.console.add("info", "x", "5")
    panel.refresh()
    assert lines(panel) == ["info x 5", "info x 4", "info x 3"]
    assert (reset.count(), removed.count()) == (0, 1)
    session.console.add_messages(
        [Message(LOG_TOPIC, b'{"text": "%d"}' % number, "json", LOG_TYPE) for number in range(9)]
    )
    panel.refresh()  # all displayed records were evicted
    assert [line.split()[-1] for line in lines(panel)] == ["8", "7", "6"]


def test_log_levels_are_filtered_and_the_filter_is_restored(qtbot, panel, window) -> None:
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


def test_lines_are_copied_in_chronological_order(panel, window) -> None:
    panel.list.selectAll()
    panel.copy()
    text = QGuiApplication.clipboard().text().splitlines()
    assert text[0].endswith("gateway RIZE joined (original NEP, port 50000)")
    assert len(text) == 6
    assert window.toasts == ["Copied 6 lines"]


def test_empty_console_shows_an_empty_state_until_the_first_record(qtbot, qapp) -> None:
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
    assert panel.empty._title.text() == "No problems reported"


def logged(window, level="info", text="hello", node="Pepper", name="app.robots.driver.tasks", **more) -> None:
    given = {"level": level, "text": text, "node": node, "name": name, "stamp_ns": 10**18, **more}
    window.session.console.add_messages([Message(LOG_TOPIC, json.dumps(given).encode(), "json", LOG_TYPE)])


def test_log_records_of_programs_are_listed_with_level_node_and_logger(panel, window) -> None:
    logged(window, "warning", "the stop command failed", file="tasks.py", line=272)
    logged(window, "debug", "a detail")
    panel.refresh()
    assert lines(panel)[0] == "warn Pepper [app.robots.driver.tasks] the stop command failed"
    record = panel.model.index(0, 0).data(Qt.ItemDataRole.UserRole)
    said, level, place = tooltip_text(record).split("\n")
    assert (said, place) == ("the stop command failed", "app.robots.driver.tasks  tasks.py:272")
    assert level.endswith(" warn  Pepper")
    panel.set_level("debug")
    assert lines(panel)[0].startswith("debug Pepper")


@pytest.mark.parametrize(("percent", "width"), [(100, 446), (200, 446), (200, 700), (200, 1200)])
def test_large_text_leaves_room_for_the_message(panel, window, percent: int, width: int) -> None:
    logged(window, "warning", "the stop command failed")
    panel.refresh()
    record = panel.model.index(0, 0).data(Qt.ItemDataRole.UserRole)
    window.theme.set_text_percent(percent)
    delegate = LineDelegate(window.theme, lambda: "compact", panel.text_font)
    shown = delegate.columns(record, width)
    assert {"icon", "origin"} <= shown.keys()
    letter = paint.width_of(panel.text_font(), "n")
    if len(shown) > 2:  # no further column can be hidden
        assert width - sum(shown.values()) >= MIN_TEXT_CHARS * letter
    if percent == 100 or width == 1200:
        assert {"time", "level"} <= shown.keys()


def test_hidden_console_decodes_no_messages(window) -> None:
    class Unread(Message):
        @property
        def payload(self) -> object:
            raise AssertionError("nobody asked for it")

    window.session.console.add_messages([Unread(LOG_TOPIC, b"{}", "json", LOG_TYPE)])
    window.session.tick()


def test_lines_are_filtered_by_node_and_text(qtbot, panel, window) -> None:
    logged(window, text="walks 1 m")
    logged(window, text="walks 2 m", node="Turtle")
    panel.set_node("Turtle")
    assert lines(panel) == ["info Turtle [app.robots.driver.tasks] walks 2 m"]
    assert panel.filter_button.accessibleName() == "Showing: Everything from Turtle"
    panel.set_node("")
    panel.focus_filter()
    qtbot.keyClicks(panel.find_field, "PEPPER walks")
    assert lines(panel) == ["info Pepper [app.robots.driver.tasks] walks 1 m"]
    qtbot.keyClicks(panel.find_field, " nowhere")
    assert lines(panel) == []
    assert panel.empty.isVisible()
    panel.clear_filters()
    assert len(lines(panel)) == 8
    panel.focus_filter()
    qtbot.keyClicks(panel.find_field, "x")
    qtbot.keyClick(panel.find_field, Qt.Key.Key_Escape)
    assert (panel.find_field.isVisible(), len(lines(panel))) == (False, 8)


def test_scroll_position_is_kept_while_reading_older_lines(qtbot, panel, window) -> None:
    for number in range(50):
        logged(window, text=f"line {number}")
    panel.refresh()
    bar = panel.list.verticalScrollBar()
    qtbot.waitUntil(lambda: bar.maximum() > 500)
    bar.setValue(200)
    read = panel.list.indexAt(panel.list.viewport().rect().center()).data()
    for number in range(3):
        logged(window, text=f"new {number}")
    panel.refresh()
    assert panel.list.indexAt(panel.list.viewport().rect().center()).data() == read
    assert panel.newest_button.isVisible()
    assert panel.newest_button.accessibleName() == "3 new"
    qtbot.mouseClick(panel.newest_button, Qt.MouseButton.LeftButton)
    assert bar.value() == 0
    assert not panel.newest_button.isVisible()
    logged(window, text="newest")
    panel.refresh()
    assert bar.value() == 0
    assert lines(panel)[0].endswith("newest")


def test_console_is_cleared_and_copied(panel, window) -> None:
    _find, copy_all, clear = panel.more_actions()
    copy_all.trigger()
    assert len(QGuiApplication.clipboard().text().splitlines()) == 6
    clear.trigger()
    assert lines(panel) == []
    copy_all.trigger()  # copying an empty list isn't an error
    assert window.toasts == ["Copied 6 lines"]
    logged(window)
    panel.refresh()
    assert len(lines(panel)) == 1


def test_traceback_takes_one_row_and_shows_its_line_count() -> None:
    assert first_line("it broke\nTraceback\nValueError") == "it broke (and 2 more lines)"
    assert first_line("one\ntwo") == "one (and 1 more line)"
    assert first_line("one") == "one"


def test_larger_text_enlarges_rows_and_the_button_to_the_newest_line(qtbot, panel, window) -> None:
    for number in range(50):
        logged(window, text=f"line {number}")
    panel.refresh()
    bar = panel.list.verticalScrollBar()
    qtbot.waitUntil(lambda: bar.maximum() > 500)
    bar.setValue(300)
    before = (panel.list.visualRect(panel.model.index(5, 0)).height(), panel.newest_button.width())
    window.theme.set_text_percent(200)
    after = (panel.list.visualRect(panel.model.index(5, 0)).height(), panel.newest_button.width())
    assert after[0] == 2 * before[0]
    assert after[1] >= panel.newest_button.sizeHint().width() > before[1]


def test_twenty_thousand_lines_scroll_and_only_visible_rows_are_painted(qtbot, qapp, monkeypatch) -> None:
    session = Session()
    session.console = session.live.console = Console(capacity=20_000)
    for number in range(20_000):
        session.console.add("info", "arm", f"line {number}")
    panel = Window(session).make(PANEL, (446, 200))
    qtbot.addWidget(panel)
    assert isinstance(panel, ConsolePanel)
    assert panel.model.rowCount() == 20_000
    painted: list[int] = []
    paint_one = LineDelegate.paint

    def counted(self, painter, option, index) -> None:
        painted.append(index.row())
        paint_one(self, painter, option, index)

    monkeypatch.setattr(LineDelegate, "paint", counted)
    bar = panel.list.verticalScrollBar()
    in_view = panel.list.viewport().height() // panel.list.sizeHintForRow(0) + 2
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        bar.setValue(round(share * bar.maximum()))
        painted.clear()
        panel.list.grab()
        top = round(share * (20_000 - in_view))
        assert 0 < len(set(painted)) <= in_view
        assert all(abs(row - top) <= in_view + 2 for row in painted)
    assert lines(panel)[-1] == "info arm line 0"
    before = panel.list.indexAt(panel.list.viewport().rect().center()).data()
    session.console.add("info", "arm", "the newest")  # the oldest line is evicted, the view stays in place
    bar.setValue(bar.maximum() // 2)
    here = panel.list.indexAt(panel.list.viewport().rect().center()).data()
    panel.refresh()
    assert panel.list.indexAt(panel.list.viewport().rect().center()).data() == here
    assert panel.model.rowCount() == 20_000
    assert before is not None
