"""Tests of the Services panel: list of services, request form, reply and past calls."""

from __future__ import annotations

import threading

import pytest
from msgspec.structs import replace
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLineEdit

from app.core.run.acting.arming import Target
from app.ui.intents import SelectService
from app.ui.panels.act.services import PANEL
from app.ui.panels.act.services.panel import ServicesPanel
from app.ui.panels.act.services.reply_view import MAX_ROWS, MAX_TEXT_CHARS, reply_rows
from app.ui.panels.row_actions import service_actions
from app.ui.widgets import Switch
from nep.protocol.graph_view import ServerInfo, ServiceInfo
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press, ticks
from tests.ui.test_accessible import unsaid

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
REQUEST = '{"name": "Aiko", "pictures": 12, "quality": 0.5, "replace": true, "box": [1, 2]}'


def offer(session: Session, **services: str) -> None:
    """Let the fake master report these services, each served by the node with the given id."""
    view = session.live.graph
    assert view is not None
    infos = {
        name: ServiceInfo(name, "json", (ServerInfo(1, node, (), 0, 0, 0),))
        for name, node in services.items()
    }
    infos["/nep/parameters/1"] = ServiceInfo("/nep/parameters/1", "json", (ServerInfo(2, "1", (), 0, 0, 0),))
    session.live.source.tell(replace(view, revision=view.revision + 1, services=infos))
    session.take_over()


@pytest.fixture
def window(qapp) -> Window:
    session = Session.full()
    offer(session, remember_face="1", forget_face="1", set_language="2")
    session.acting.saved_messages.set_request("remember_face", REQUEST)
    return Window(session)


@pytest.fixture
def panel(qtbot, window) -> ServicesPanel:
    made = window.make(PANEL, (720, 640))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, ServicesPanel)
    made.list.select_key("remember_face")
    return made


def answered(window: Window, panel: ServicesPanel, qtbot) -> None:
    """Wait until no call is in flight."""

    def is_over() -> bool:
        ticks(window, panel)
        return window.session.acting.calls.in_flight is None

    qtbot.waitUntil(is_over, timeout=30_000)


def test_services_are_listed_with_their_nodes_and_without_parameter_services(panel) -> None:
    names = [panel.list.cell_at(row, 0).accessible_text for row in range(panel.list.model().rowCount())]
    assert names == [
        "forget_face, camera_driver",
        "remember_face, camera_driver",
        "set_language, pepper_driver",
    ]
    assert panel.count_label.text() == "3 services of 2 nodes"
    panel.filter.setText("pepper")
    assert panel.list.model().rowCount() == 1


def test_form_is_built_from_the_last_request_and_edits_its_json(panel) -> None:
    fields = panel.form.fields
    assert list(fields) == ["name", "pictures", "quality", "replace", "box"]
    assert isinstance(fields["replace"], Switch)
    assert fields["replace"].isChecked()
    for name, text in (("name", "Grey Ada"), ("pictures", "30"), ("quality", "1"), ("box", '{"x": 1}')):
        field = fields[name]
        assert isinstance(field, QLineEdit)
        field.selectAll()
        QTest.keyClicks(field, text)
        assert panel.form.fields[name] is field, "the keyboard stays"
    press(fields["replace"])
    assert panel._parse_text().fill({}) == {
        "name": "Grey Ada", "pictures": 30, "quality": 1, "replace": False, "box": {"x": 1},
    }  # fmt: skip
    press(panel.format_switch.findChildren(type(panel.format_switch.selected_button()))[1])
    assert panel.edit.isVisible()
    panel.edit.set_text('{"name": "Bo"}')
    panel._set_mode("form")
    assert list(panel.form.fields) == ["name"]


def test_invalid_field_is_reported_and_disables_the_call(panel) -> None:
    field = panel.form.fields["pictures"]
    assert isinstance(field, QLineEdit)
    field.selectAll()
    QTest.keyClicks(field, "many")
    assert panel.problem_label.text() == "pictures needs a whole number."
    assert not panel.call_button.isEnabled()
    field.selectAll()
    QTest.keyClicks(field, "3")
    assert panel.problem_label.text() == ""
    assert panel.call_button.isEnabled()
    panel._set_mode("json")
    panel.edit.set_text("{'name': 1}")
    assert panel.problem_label.text().startswith("Line 1, column 2: ")
    press(panel.fix_button)
    assert panel.edit.text() == '{"name": 1}'
    panel.edit.set_text("[1]")
    panel._set_mode("form")
    assert panel.format_switch.value == "json", "a list has no fields"


def test_call_shows_reply_duration_and_history(window, panel, qtbot) -> None:
    session = window.session
    asked: list[object] = []

    def serve(request: object) -> object:
        asked.append(request)
        return {"ok": True, "faces": [{"id": 7}], "quality": 0.93}

    session.live.source.node.new_server("remember_face", serve, threads=1)
    assert panel.call_button.text() == "Arm and call"
    press(panel.call_button)
    answered(window, panel, qtbot)
    assert asked == [panel._parse_text().fill({})]
    assert session.acting.arming.targets == (Target("service", "remember_face"),)
    rows = panel.reply_view.model
    shown = [(rows.cell_at(row, 0).text, rows.cell_at(row, 1).text) for row in range(rows.rowCount())]
    assert shown == [("ok", "true"), ("faces", "[1]"), ("0", "{1}"), ("id", "7"), ("quality", "0.93")]
    assert panel.reply_view.chip.text.startswith("replied in ")
    assert panel.reply_view.details.text().endswith("B")
    panel.reply_view.format_switch.set_value("json")
    panel.reply_view._set_mode("json")
    assert '"quality": 0.93' in panel.reply_view.text.text()
    press(panel.reply_view.copy_button)
    assert '"ok": true' in QGuiApplication.clipboard().text()
    assert panel.call_button.text() == "Call"
    assert panel.calls_model.cell_at(0, 1).text.startswith("name Aiko, pictures 12")
    assert panel.calls_model.cell_at(0, 2).role == "ok"
    panel._clear_calls()
    assert panel.calls_model.rowCount() == 0


def test_rejected_timed_out_and_cancelled_calls_are_reported(window, panel, qtbot) -> None:
    session, go_on, mode = window.session, threading.Event(), ["refuse"]

    def serve(_request: object) -> object:
        if mode[0] == "refuse":
            raise ValueError("no face in sight")
        return go_on.wait(30)

    session.live.source.node.new_server("remember_face", serve, threads=3)
    press(panel.call_button)
    answered(window, panel, qtbot)
    assert panel.reply_view.message_label.text() == "rejected: no face in sight"
    mode[0] = "wait"
    panel.timeout_field.setText("0.2")
    QTest.keyClick(panel.timeout_field, Qt.Key.Key_Return)
    press(panel.call_button)
    assert not panel.call_button.isEnabled()
    answered(window, panel, qtbot)
    assert panel.reply_view.chip.text == "no reply within 0.2 s"
    panel.timeout_field.setText("60")
    QTest.keyClick(panel.timeout_field, Qt.Key.Key_Return)
    press(panel.call_button)
    ticks(window, panel)
    assert panel.call_button.text().startswith("Waiting ")
    press(panel.cancel_button)
    assert panel.reply_view.chip.text.startswith("cancelled")
    assert not panel.cancel_button.isVisible()
    go_on.set()


def test_closing_disarms_and_a_network_without_services_shows_the_empty_page(window, panel) -> None:
    window.session.acting.arm()
    panel.dispose()
    assert not window.session.acting.arming.is_on
    offer(window.session)
    ticks(window, panel)
    assert panel.pages.currentIndex() == 0


def test_service_from_a_menu_command_is_selected(window, panel) -> None:
    panel.open_for("set_language")
    assert panel.service == "set_language"
    assert panel.form.hint_label.isVisible()
    assert panel.text == "{}"
    for action in service_actions(window.context(), "set_language"):
        action.run()
    assert window.commands == [SelectService("set_language")]


def test_large_and_deeply_nested_replies_are_shown_in_a_bounded_number_of_rows() -> None:
    assert [row.text for row in reply_rows(None)] == ["null"]
    assert all(len(row.text) < 2 * MAX_TEXT_CHARS for row in reply_rows("x" * 1000))
    assert len(reply_rows(list(range(10_000)))) == MAX_ROWS + 1
    deep: object = 1
    for _each in range(2000):
        deep = [deep]
    assert len(reply_rows(deep)) < 20


def test_controls_have_accessible_names_and_fit_a_narrow_panel(panel, qtbot) -> None:
    assert unsaid(panel) == []
    panel.resize(400, 640)
    qtbot.waitUntil(lambda: panel.list.width() > 300)


def test_reply_is_not_clipped_at_the_width_of_the_developer_layout(window, panel, qtbot) -> None:
    panel.resize(328, 700)
    window.session.live.source.node.new_server("remember_face", lambda _request: {"ok": True}, threads=1)
    press(panel.call_button)
    answered(window, panel, qtbot)
    assert panel.reply_view.chip.text.startswith("replied in ")
    right = panel.mapToGlobal(panel.rect().topRight()).x()
    for widget in (
        panel.reply_view.table,
        panel.reply_view.format_switch,
        panel.reply_view.copy_button,
        panel.calls_table,
        panel.format_switch,
    ):
        assert widget.isVisible()
        qtbot.waitUntil(lambda each=widget: each.mapToGlobal(each.rect().topRight()).x() <= right)
    panel.resize(720, 640)
    qtbot.waitUntil(lambda: panel.reply_view.copy_button.y() < panel.reply_view.chip.geometry().bottom())
