"""Tests of the Alarms panel: editing conditions, states, snooze and history."""

from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMenu, QWidget

from app.ui.panels.row_actions import departure_alarm, silence_alarm
from app.ui.panels.watch.alarms import PANEL
from app.ui.panels.watch.alarms.columns import csv_text
from app.ui.panels.watch.alarms.panel import AlarmsPanel
from app.ui.panels.watch.alarms.phrases import (
    PhrasePart,
    initial_text,
    parse_limit,
    parse_time,
    parts_of,
    with_kind,
    with_slot_text,
)
from app.ui.panels.watch.nodes import panel as nodes
from app.ui.panels.watch.topics import panel as topics
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmRule
from nep.programs.alarms.history import ActionResult, AlarmRecord
from nep.programs.alarms.rule import KINDS, problem_of
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, has_keys, press, ticks
from tests.ui.test_accessible import unsaid

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
BELOW = AlarmRule(
    "d", AlarmCondition("below", "/blackboard", "robots.Pepper.battery", 20), (AlarmAction("banner"),)
)


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> AlarmsPanel:
    made = window.make(PANEL, (752, 600))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, AlarmsPanel)
    made.now_s = window.session.clock.epoch_s
    return made


def said(panel: AlarmsPanel, row: int = 0) -> str:
    rule = panel.alarms.rules[row]
    return " ".join(part.text for part in parts_of(rule) if part.text)


def choose(words: str) -> None:
    """Trigger an item of the open menu by its text."""
    menu = QApplication.activePopupWidget()
    assert isinstance(menu, QMenu)
    action = next(each for each in menu.actions() if each.text() == words)
    menu.close()
    action.trigger()


def slot(panel: AlarmsPanel, key: str, row: int = 0):
    return panel.rows[row].slots[key]


def type_in(panel: AlarmsPanel, text: str, key: Qt.Key = Qt.Key.Key_Return) -> None:
    field = panel.field
    assert field is not None
    field.selectAll()
    QTest.keyClicks(field, text)
    popup = field.completer().popup()
    assert popup is not None
    popup.hide()
    QTest.keyClick(field, key)


def test_alarm_added_in_the_empty_panel_watches_the_entered_topic(panel, window) -> None:
    assert panel.pages.currentIndex() == 0
    panel.add_alarm()
    assert panel.pages.currentIndex() == 1
    assert panel.field is not None
    assert "/robot/camera" in panel._completions_for(slot(panel, "subject").part, panel.rows[0])
    type_in(panel, "/robot/camera")
    assert panel.field is None
    assert said(panel) == "When /robot/camera is silent for 2 s , show a banner"
    assert window.session.alarms.alarms.evaluator.topics == {"/robot/camera"}


@pytest.mark.parametrize("width", [752, 420])
def test_words_after_the_text_field_of_a_slot_stay_visible(panel, qtbot, width: int) -> None:
    panel.resize(width, 600)
    panel.alarms.set_rule(BELOW)
    panel.refresh()
    limit = slot(panel, "limit")
    row = panel.rows[0]
    qtbot.waitUntil(lambda: limit.width() < 100 and row.width() > 300)
    width_before = limit.width()
    press(limit)
    qtbot.waitUntil(lambda: panel.field.width() >= 200)

    def covered() -> list[QWidget]:
        children = row.sentence.findChildren(QWidget, options=Qt.FindChildOption.FindDirectChildrenOnly)
        field = panel.field.geometry().translated(-row.sentence.pos())
        return [each for each in children if each is not limit and each.geometry().intersects(field)]

    qtbot.waitUntil(lambda: covered() == [])
    QTest.keyClick(panel.field, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: limit.width() == width_before)


def test_comma_follows_the_previous_word_without_a_gap(panel, qtbot) -> None:
    panel.alarms.set_rule(BELOW)
    panel.refresh()
    comma = next(each for each in panel.rows[0]._labels if each.text() == ",")
    qtbot.waitUntil(lambda: comma.x() > 0)
    assert comma.x() == slot(panel, "time").geometry().right() + 1


def test_parts_of_an_alarm_sentence_are_edited_by_keyboard(panel) -> None:
    panel.alarms.set_rule(BELOW)
    panel.refresh()
    press(slot(panel, "kind"))
    choose("A value is above a limit")
    assert panel.alarms.rules[0].condition.kind == "above"
    assert panel.alarms.rules[0].condition.path == "robots.Pepper.battery"
    slot(panel, "limit").setFocus()
    QTest.keyClick(slot(panel, "limit"), Qt.Key.Key_Return)
    type_in(panel, "much")
    assert panel.field is not None  # the text isn't a number
    assert panel.field.property("wrong") == "true"
    QTest.keyClick(panel.field, Qt.Key.Key_Escape)
    assert panel.field is None
    assert panel.alarms.rules[0].condition.limit == 20
    press(slot(panel, "time"))
    type_in(panel, "1.5 min", Qt.Key.Key_Tab)
    assert panel.alarms.rules[0].condition.for_s == 90
    assert said(panel) == "When robots.Pepper.battery of /blackboard is above 20 for 90 s , show a banner"


def test_field_paths_of_a_topic_are_suggested(panel, window) -> None:
    panel.alarms.set_rule(replace(BELOW, condition=replace(BELOW.condition, path="")))
    panel.refresh()
    press(slot(panel, "value"))
    window.session.send("/blackboard", {"pose": {"x": 1.0, "y": [2]}})
    ticks(window, panel, 1)
    window.session.send("/blackboard", {"pose": {"x": 1.0, "y": [2]}})
    panel.field.set_completions(panel._completions_for(slot(panel, "value").part, panel.rows[0]))
    assert panel.field.completer().model().stringList() == ["pose.x", "pose.y[0]"]


def test_every_control_in_a_row_has_an_accessible_name(panel) -> None:
    panel.alarms.set_rule(
        replace(BELOW, actions=(AlarmAction("call", payload={"n": 1}), AlarmAction("stop")))
    )
    panel.refresh()
    assert unsaid(panel) == []
    assert slot(panel, "add").accessibleName() == "Add an action"
    assert slot(panel, "limit").accessibleName() == "Limit: 20"


def test_selected_suggestion_is_accepted_immediately(panel, qtbot) -> None:
    panel.add_alarm()
    field = panel.field
    assert field is not None
    QTest.keyClicks(field, "odom")
    popup = field.completer().popup()
    assert popup is not None
    QTest.keyClick(popup, Qt.Key.Key_Down)
    QTest.keyClick(popup, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: panel.field is None)
    assert panel.alarms.rules[0].condition.name == "/odom"
    assert has_keys(slot(panel, "subject"))


def test_banner_shows_the_value_that_triggered_the_alarm(panel, window) -> None:
    session = window.session
    session.alarms.set_rule(BELOW)
    ticks(window, panel, 1)
    for battery in (12, 84):
        session.send("/blackboard", {"robots": {"Pepper": {"battery": battery}}})
        ticks(window, panel, 1)
    session.alarms.check()
    (alert,) = [each for each in session.alerts.active if each.id == "alarm:d"]
    assert "is 12, below 20" in alert.title


def test_alarm_actions_are_added_changed_and_removed(panel) -> None:
    panel.alarms.set_rule(BELOW)
    panel.refresh()
    press(slot(panel, "add"))
    choose("Call a service")
    type_in(panel, "restart_lidar")
    press(slot(panel, "payload:1"))
    type_in(panel, '{"now": tru}')
    assert panel.field is not None
    type_in(panel, '{"now": true}')
    assert panel.alarms.rules[0].actions[1] == AlarmAction("call", "restart_lidar", {"now": True})
    press(slot(panel, "action:0"))
    choose("Stop all robots")
    assert [action.kind for action in panel.alarms.rules[0].actions] == ["stop", "call"]
    QTest.keyClick(slot(panel, "action:0"), Qt.Key.Key_Delete)
    assert [action.kind for action in panel.alarms.rules[0].actions] == ["call"]


def test_active_alarm_is_shown_in_row_title_alerts_and_history(panel, window) -> None:
    session = window.session
    session.alarms.set_rule(BELOW)
    ticks(window, panel, 2)
    assert panel.rows[0].chip.text == "waits for /blackboard"
    session.send("/blackboard", {"robots": {"Pepper": {"battery": 84}}})
    ticks(window, panel, 1)
    session.send("/blackboard", {"robots": {"Pepper": {"battery": 12}}})
    ticks(window, panel, 2)
    panel._show_states()
    assert panel.rows[0].chip.text.endswith("12 now")
    assert panel.chip.text == "1 active"
    assert panel.badge() == ("1", "error")
    (alert,) = [each for each in session.alerts.active if each.id == "alarm:d"]
    assert alert.title == "Robots.Pepper.battery of /blackboard is 12, below 20."
    assert panel.model.cell_at(0, 1).text == "robots.Pepper.battery of /blackboard is 12, below 20"
    press(panel.rows[0].snooze_button)
    panel._show_states()
    assert "snoozed until" in panel.rows[0].chip.text
    assert session.alerts.is_dismissed("alarm:d")
    press(panel.rows[0].snooze_button)
    panel._show_states()
    assert "snoozed" not in panel.rows[0].chip.text


def test_alarm_is_disabled_deleted_and_restored(panel, window) -> None:
    panel.alarms.set_rule(BELOW)
    panel.refresh()
    press(panel.rows[0].switch)
    assert not panel.alarms.rules[0].is_enabled
    assert panel.alarms.alarms.evaluator.topics == frozenset()
    press(panel.rows[0].more_button)
    choose("Delete")
    assert panel.alarms.rules == ()
    assert window.toasts[-1].startswith("Deleted the alarm")
    undo = window.toast_buttons[-1][1]
    assert undo is not None
    undo()
    panel.refresh()
    assert len(panel.rows) == 1
    press(panel.rows[0].more_button)
    choose("Duplicate")
    assert len({rule.id for rule in panel.alarms.rules}) == 2


def test_entering_a_limit_enables_the_alarm(panel) -> None:
    panel.alarms.set_rule(replace(BELOW, is_enabled=False))
    panel.edit("d", "limit")
    type_in(panel, "15")
    assert panel.alarms.rules[0].is_enabled
    assert panel.alarms.rules[0].condition.limit == 15


def test_history_is_filtered_and_exported_as_csv(panel, tmp_path) -> None:
    record = AlarmRecord("x", "=cmd|' /C calc'!A0", panel.now_s() - 60, 4.0, count=2)
    record.add(ActionResult("call", "restart replied"))
    panel.alarms.history.add(record)
    panel.alarms.history.add(AlarmRecord("y", "/cam is silent", panel.now_s()))
    panel.refresh()
    assert panel.pages.currentIndex() == 1
    panel.filter.setText("silent")
    assert panel.model.rowCount() == 1
    panel._write_history(tmp_path / "h.csv", None)
    lines = (tmp_path / "h.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "at,alarm,lasted_s,times,did"
    assert ",'=cmd|' /C calc'!A0,4.000,2,restart replied" in lines[1]
    assert csv_text([]).count("\n") == 1


@pytest.mark.parametrize("kind", KINDS)
def test_every_alarm_kind_has_a_sentence_and_slot_texts_round_trip(kind: str) -> None:
    rule = with_kind(AlarmRule("r", AlarmCondition("silent", "/t", for_s=2.0)), kind)
    condition = rule.condition
    name = condition.name or "node"
    rule = replace(
        rule, condition=replace(condition, name=name, path="x" if condition.is_about_value else "")
    )
    assert problem_of(rule) is None
    for part in parts_of(rule):
        if part.kind != "word" and part.role not in {"kind", "add"}:
            assert with_slot_text(rule, part, initial_text(rule, part)) == rule, part


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("", 0), ("2", 2), ("2 s", 2), ("0,5 s", 0.5), ("1.5 min", 90), ("1 h", 3600), ("250 ms", 0.25),
     ("-1", None), ("soon", None), ("nan", None), ("1e9", None), ("s", None),
     ("1.234,5 s", None), ("1 234 s", None)],
)  # fmt: skip
def test_durations_are_parsed_in_common_notations(text: str, seconds: float | None) -> None:
    assert parse_time(text) == seconds


def test_limits_are_parsed_as_numbers_for_comparisons_and_otherwise_as_json() -> None:
    number, text = AlarmCondition("below"), AlarmCondition("equals")
    assert parse_limit(number, "20 %") == 20
    assert parse_limit(number, "0,4") == 0.4
    for wrong in ("", "x", "nan", "inf", "1.234,5", "1 234"):
        part = PhrasePart("limit", "")
        assert with_slot_text(AlarmRule("r", number), part, wrong) is None
    assert [parse_limit(text, each) for each in ("true", "null", "idle", '"5"', "5", "{}", "")] == [
        True, None, "idle", "5", 5, "{}", "",
    ]  # fmt: skip


def test_menus_of_topics_and_nodes_offer_an_alarm(qtbot, window) -> None:
    for panel, key, wanted in (
        (topics.PANEL, "/odom", silence_alarm("/odom")),
        (nodes.PANEL, "", None),
    ):
        made = window.make(panel)
        qtbot.addWidget(made)
        for widget in made.header_widgets():
            qtbot.addWidget(widget)
        made.rebuild()
        row = made.model.row_at(made.model.index(0, 0))
        made.table.select_key(key or made.model.key_of(row))
        at = made.table.visualRect(made.table.currentIndex()).center()
        reason = QContextMenuEvent.Reason.Mouse
        QApplication.sendEvent(
            made.table.viewport(), QContextMenuEvent(reason, at, made.table.viewport().mapToGlobal(at))
        )
        choose("New alarm")
        assert window.commands[-1] == (wanted or departure_alarm(row.node.name))
