"""Tests of the inspector's queries, tables of objects and message history."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest

from app.ui.panels.watch.inspector.body import RAW, TABLE, TREE
from app.ui.panels.watch.inspector.panel import PANEL, InspectorPanel
from app.ui.widgets.table.model import CELL_ROLE
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press, ticks
from tests.ui.sample_data import Topic

TOPIC = "/people"
LONG_MS = 30_000


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> Iterator[InspectorPanel]:
    made = window.make(PANEL, (360, 700))
    qtbot.addWidget(made)
    for widget in made.header:
        qtbot.addWidget(widget)
    assert isinstance(made, InspectorPanel)
    window.session.put(Topic(TOPIC))
    made.show_topic(TOPIC)
    yield made
    made.dispose()


def seen(*ages: int, stamp: int = 0) -> dict[str, object]:
    names = ("Ann", "Bea", "Cy", "Di")
    people = [{"name": name, "age": age} for name, age in zip(names, ages, strict=False)]
    return {"stamp": stamp, "people": people, "doors": [{"open": True}, {"open": False}]}


def send(window: Window, panel: InspectorPanel, value: object) -> None:
    window.session.send(TOPIC, value)
    ticks(window, panel)


@pytest.fixture
def soon(qtbot, window, panel) -> Callable[[Callable[[], object]], None]:
    """Function that ticks the window until a condition holds; queries run in a thread."""

    def wait(true: Callable[[], object]) -> None:
        qtbot.waitUntil(lambda: (ticks(window, panel), bool(true()))[1], timeout=LONG_MS)

    return wait


def rows(panel: InspectorPanel) -> list[str]:
    model = panel.model
    return [model.node(model.index(row, 0)).path for row in range(model.rowCount())]


def test_input_starting_with_dollar_is_a_query_and_the_tree_shows_its_results(panel, window, soon) -> None:
    send(window, panel, seen(7, 41))
    panel.compare.setChecked(True)
    panel.finder.field.setText("$.people[?@.age > 18].name")
    soon(lambda: rows(panel) == ["people[1].name"])
    assert panel.query.text_label.text() == "1 found."
    assert panel.query.isVisible()
    assert not panel.strip.isVisible()  # query results aren't compared
    send(window, panel, seen(30, 41))  # the query is repeated for every message
    soon(lambda: rows(panel) == ["people[0].name", "people[1].name"])
    panel.tree.setCurrentIndex(panel.model.index(1, 0))
    panel.inspector_actions.copy_path()
    assert QGuiApplication.clipboard().text() == "people[1].name"
    panel.inspector_actions.plot()
    assert window.plotted == [(TOPIC, "people[1].name")]
    panel.inspector_actions.copy_message()
    assert '"doors"' in QGuiApplication.clipboard().text()
    panel.finder.field.clear()
    assert rows(panel) == ["stamp", "people", "doors"]
    assert not panel.query.isVisible()
    assert panel.compare.isVisible()
    ticks(window, panel)
    assert panel.strip.isVisible()


def test_invalid_query_shows_an_error_until_corrected(panel, window, soon) -> None:
    send(window, panel, seen(7))
    panel.finder.field.setText("$.people[")
    assert panel.query.text_label.text().startswith("the query is incomplete: ")
    assert panel.query.isVisible()
    assert panel.finder.field.property("wrong") == "true"
    assert rows(panel) == []
    QTest.keyClicks(panel.finder.field, "*]")
    soon(lambda: rows(panel) == ["people[0]"])
    assert panel.finder.field.property("wrong") == "false"
    panel.finder.field.setText("$.nobody")
    soon(lambda: panel.query.text_label.text() == "0 found.")
    assert rows(panel) == []


def test_query_is_restored_with_the_layout_and_inactive_in_raw_view(qtbot, panel, window, soon) -> None:
    send(window, panel, seen(7))
    panel.finder.field.setText("$..age")
    soon(lambda: rows(panel) == ["people[0].age"])
    panel.mode.changed.emit("raw")
    assert panel.body.page == RAW
    assert not panel.query.isVisible()
    again = window.make(PANEL, (360, 700))
    qtbot.addWidget(again)
    assert isinstance(again, InspectorPanel)
    again.restore_state(panel.save_state())
    assert again.finder.field.text() == "$..age"
    again.dispose()


def as_table(panel: InspectorPanel) -> None:
    panel.mode.set_value("table")
    panel.mode.changed.emit("table")


def table(panel: InspectorPanel) -> list[list[str]]:
    shown = panel.body.objects.table
    assert shown is not None
    model = shown.model()
    return [
        [model.data(model.index(row, column), CELL_ROLE).text for column in range(model.columnCount())]
        for row in range(model.rowCount())
    ]


def head(panel: InspectorPanel, section: int) -> None:
    shown = panel.body.objects.table
    assert shown is not None
    shown.horizontalHeader().sectionClicked.emit(section)


def test_list_of_objects_is_a_table_whose_order_is_stable_while_values_change(panel, window) -> None:
    now = panel.clock()
    panel.clock = lambda: now
    send(window, panel, seen(7, 41, 30))
    panel.tree.setCurrentIndex(panel.model.index_of_path(("people", 1, "age")))
    as_table(panel)
    assert panel.body.page == TABLE
    assert table(panel) == [["0", "Ann", "7"], ["1", "Bea", "41"], ["2", "Cy", "30"]]
    assert panel.body.objects.text_label.text() == "people   3 rows"
    head(panel, 2)  # descending by age
    assert [row[1] for row in table(panel)] == ["Bea", "Cy", "Ann"]
    made = panel.body.objects.table
    send(window, panel, seen(99, 41, 30))  # within one second, values change but the order stays
    assert table(panel) == [["1", "Bea", "41"], ["2", "Cy", "30"], ["0", "Ann", "99"]]
    panel.clock = lambda: now + 2
    send(window, panel, seen(99, 41, 30, 50))
    assert [row[1] for row in table(panel)] == ["Ann", "Di", "Bea", "Cy"]
    assert panel.body.objects.table is made  # the table is reused, not rebuilt for every message
    press(panel.body.objects.copy)
    lines = list(csv.reader(QGuiApplication.clipboard().text().splitlines()))
    assert lines[:2] == [["#", "name", "age"], ["0", "Ann", "99"]]
    assert window.toasts[-1] == "Copied 4 rows as CSV"


def test_table_shows_the_first_or_the_selected_list_and_reports_a_message_without_lists(
    panel, window
) -> None:
    send(window, panel, seen(7))
    as_table(panel)
    assert table(panel) == [["0", "Ann", "7"]]
    panel.body.objects._list_selected(("doors",))
    assert [row[1] for row in table(panel)] == ["true", "false"]
    panel.body.objects.reveal_requested.emit(("doors", 1))
    assert panel.body.page == TREE
    assert panel.foot.path.text() == "doors[1]"
    as_table(panel)
    send(window, panel, {"numbers": [1, 2]})
    assert panel.body.objects.table is None
    assert panel.body.objects.empty.isVisible()
    assert not panel.body.objects.copy.isEnabled()


def test_query_result_is_shown_as_a_table(panel, window, soon) -> None:
    send(window, panel, seen(7, 41, 30))
    panel.finder.field.setText("$.people[?@.age > 18]")
    as_table(panel)
    soon(lambda: panel.body.objects.table is not None)
    assert table(panel) == [["people[1]", "Bea", "41"], ["people[2]", "Cy", "30"]]


def test_column_headers_are_the_untranslated_keys_of_the_message(panel, window) -> None:
    send(window, panel, {"people": [{"": 1, "Age": 2, "Topic": 3}]})
    as_table(panel)
    model = panel.body.objects.table.model()
    heads = [model.headerData(section, Qt.Orientation.Horizontal) for section in range(model.columnCount())]
    assert heads == ["#", '[""]', "Age", "Topic"]


def shown_stamp(panel: InspectorPanel) -> object:
    value = panel.model.value()
    assert isinstance(value, dict)
    return value["stamp"]


def test_history_steps_back_through_messages_and_compares_with_a_pinned_message(panel, window) -> None:
    for number in range(5):
        send(window, panel, seen(number, stamp=number))
    panel.history.refresh(at_once=True)
    assert panel.history.isVisible()
    assert panel.history.text_label.text() == "the newest of 5"
    press(panel.history.back)
    ticks(window, panel)
    assert shown_stamp(panel) == 3
    assert panel.live.text == "earlier"
    assert panel.history.text_label.text().startswith("4 of 5")
    send(window, panel, seen(9, stamp=9))  # new messages are stored, the displayed one stays
    assert shown_stamp(panel) == 3
    panel.history.track.setValue(0)
    assert shown_stamp(panel) == 0
    assert not panel.history.back.isEnabled()
    panel.pin.setChecked(True)
    QTest.keyClick(panel.tree, Qt.Key.Key_Right, Qt.KeyboardModifier.AltModifier)
    panel.history.step(1)
    assert panel.strip.text_label.text().startswith("Pinned message from ")
    assert panel.strip.text_label.text().endswith(": 2 changed")
    press(panel.history.newest)
    ticks(window, panel)
    assert shown_stamp(panel) == 9
    assert panel.live.text == "live"


def test_earlier_message_is_compared_with_its_predecessor(panel, window) -> None:
    for number in (0, 0, 5):
        send(window, panel, seen(number, stamp=number))
    panel.compare.setChecked(True)
    assert panel.strip.text_label.text() == "Previous message: 2 changed"
    press(panel.history.back)
    assert panel.strip.text_label.text() == "Previous message: no difference"


def test_history_omits_messages_received_while_suspended_and_is_cleared_for_another_topic(
    panel, window
) -> None:
    send(window, panel, seen(1, stamp=1))
    send(window, panel, seen(2, stamp=2))
    panel.suspend()
    send(window, panel, seen(3, stamp=3))
    assert len(panel.history.history) == 2
    panel.resume()
    send(window, panel, seen(4, stamp=4))
    assert len(panel.history.history) == 3
    panel.show_topic("/odom")
    assert len(panel.history.history) == 0
    assert not panel.history.isVisible()
    panel.dispose()
    assert window.session.shown.series.topics == ()
