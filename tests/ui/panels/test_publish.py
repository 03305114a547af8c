"""Tests of the Publish panel: saved messages, validation, arming, single and periodic sending."""

from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.core.run.acting.acting import SessionActing
from app.core.run.acting.arming import Target
from app.core.run.acting.shelf import SavedMessage
from app.core.world.world import World
from app.ui.intents import PublishMessage
from app.ui.panels.act.publish import PANEL
from app.ui.panels.act.publish.panel import PublishPanel
from app.ui.panels.watch.topics import panel as topics
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, press, ticks
from tests.ui.test_accessible import unsaid

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
LOOK = SavedMessage(
    "a", "Look at Aiko", "/look", "json", '{\n  "yaw": {yaw},\n  "pitch": 4.0\n  "speed": 0.3\n}', (), 10.0
)
STILL = SavedMessage("b", "Stand still", "/cmd_vel", "json", '{"x": 0}', (), 50.0)


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> PublishPanel:
    acting = window.session.acting
    acting.saved_messages.set_message(LOOK)
    acting.saved_messages.set_message(STILL)
    made = window.make(PANEL, (760, 640))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, PublishPanel)
    return made


def acting_of(window: Window) -> SessionActing:
    return window.session.acting


def states(panel: PublishPanel) -> list[str]:
    rows = range(panel.list.model().rowCount())
    return [panel.list.cell_at(row, 1).text for row in rows]


def test_syntax_error_is_located_and_fixed_by_a_button(window, panel) -> None:
    form = panel.form
    assert form.message == LOOK
    assert form.problem_label.text().startswith("Line 3, column ")
    assert form.edit.invalid_line == 3
    assert not form.send_button.isEnabled()
    assert states(panel) == ["error, line 3", "not armed"]
    press(form.fix_button)
    assert form.edit.invalid_line == 0
    assert form.problem_label.text() == "Fill in “yaw” first. The message can't be sent yet."
    QTest.keyClicks(form.value_fields.fields["yaw"], "-12.5")
    ticks(window, panel)
    assert not form.problem_label.isVisible()
    assert form.send_button.isEnabled()
    kept = acting_of(window).saved_messages.get("a")
    assert kept is not None
    assert kept.payload() == {"yaw": -12.5, "pitch": 4.0, "speed": 0.3}
    form.edit.edit.undo()
    assert form.edit.invalid_line == 3


def test_auto_indent_keeps_the_indentation_of_the_line(panel) -> None:
    panel.list.select_key("b")
    edit = panel.form.edit.edit
    edit.selectAll()
    QTest.keyClicks(edit, "{")
    QTest.keyClick(edit, Qt.Key.Key_Return)
    QTest.keyClicks(edit, '"x": 1,')
    QTest.keyClick(edit, Qt.Key.Key_Return)
    QTest.keyClicks(edit, '"y": 2}')
    assert edit.toPlainText() == '{\n  "x": 1,\n  "y": 2}'
    assert panel.form.edit.invalid_line == 0
    press(panel.form.format_button)
    assert edit.toPlainText() == '{\n  "x": 1,\n  "y": 2\n}'


def test_sending_arms_only_the_topic_of_the_message_and_the_switch_disarms(window, panel) -> None:
    session, acting = window.session, acting_of(window)
    heard = session.live.source.listen("/cmd_vel", "json")
    panel.list.select_key("b")
    assert panel.form.send_button.text() == "Arm and send"
    QTest.keyClick(panel.form.edit.edit, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert heard.listen(timeout_s=60.0) == (True, {"x": 0})
    ticks(window, panel, 7)
    assert acting.arming.targets == (Target("topic", "/cmd_vel"),)
    assert panel.form.send_button.text() == "Send"
    assert panel.form.last_result_label.text().endswith("1 subscriber")
    assert [token.text() for token in panel.strip.tokens] == ["/cmd_vel"]
    assert panel.strip.text_label.text() == "5:00 left"
    press(panel.form.repeat_button)
    assert heard.listen(timeout_s=60.0)[0]
    ticks(window, panel, 7)
    assert states(panel)[1] == "50.0/s"
    assert panel.badge() == ("1", "warn")
    assert panel.form.count_label.text()
    press(panel.strip.switch)
    assert not acting.arming.is_on
    assert acting.outbox.repeated_messages == ()
    ticks(window, panel, 7)
    assert states(panel)[1] == "not armed"
    assert panel.strip.text_label.text() == "Sending is off"


def test_stop_change_of_source_and_closing_disarm(window, panel) -> None:
    acting = acting_of(window)
    for end in (window.session.runs.stop, panel.dispose):
        assert acting.arm() == ""
        end()
        assert not acting.arming.is_on
    acting.arm()
    acting.allow(Target("topic", "/cmd_vel"))
    window.session.show(World())
    ticks(window, panel)
    assert not acting.arming.is_on


def test_arming_expires_after_its_time_limit(window, panel) -> None:
    acting = acting_of(window)
    acting.arm()
    acting.allow(Target("topic", "/cmd_vel"))
    window.session.clock.now += 301
    ticks(window, panel)
    assert acting.arming.targets == ()
    assert not panel.strip.switch.isChecked()


def test_robot_command_topic_requires_another_confirmation(window, panel) -> None:
    session, acting = window.session, acting_of(window)
    topic = session.fleet.connected[0].robot.topics.command
    heard = session.live.source.listen(topic, "json")
    acting.saved_messages.set_message(replace(STILL, topic=topic))
    panel.list.select_key("b")
    ticks(window, panel)
    press(panel.form.send_button)
    ticks(window, panel)
    assert panel.strip.question_label.text().startswith(f"{topic} moves Pepper.")
    assert acting.arming.targets == ()
    press(panel.strip.cancel_button)
    ticks(window, panel)
    assert not panel.strip.question_label.isVisible()
    assert heard.receive(0.0) is None
    press(panel.form.send_button)
    ticks(window, panel)
    press(panel.strip.allow_button)
    assert heard.listen(timeout_s=60.0) == (True, {"x": 0})
    press(panel.form.send_button)  # still armed: no second question
    assert heard.listen(timeout_s=60.0) == (True, {"x": 0})
    acting.disarm()
    press(panel.form.send_button)
    assert acting.question is not None
    acting.disarm()
    assert acting.question is None


def test_real_robot_is_not_moved_without_permission(window, panel) -> None:
    session, acting = window.session, acting_of(window)
    link = session.fleet.connected[0]
    link.robot = replace(link.robot, virtual=False)
    topic = link.robot.topics.command
    heard = session.live.source.listen(topic, "json")
    acting.arm()
    acting.allow(Target("topic", topic), is_confirmed=True)
    assert acting.send(replace(STILL, topic=topic)) == ""
    question = session.fleet.permission.question
    assert question is not None
    assert heard.receive(0.0) is None
    session.fleet.permission.answer(is_allowed=True)
    assert heard.listen(timeout_s=60.0) == (True, {"x": 0})


def test_last_message_is_the_template(window, panel) -> None:
    panel.open_for("/blackboard")
    assert panel.message is not None
    assert (panel.message.topic, panel.message.msg_type) == ("/blackboard", "json")
    assert panel.form.template_button.text() == "Waiting for a message"
    window.session.send("/blackboard", {"mood": "happy", "n": [1, 2]})
    ticks(window, panel)
    kept = panel.message
    assert kept is not None
    assert kept.payload() == {"mood": "happy", "n": [1, 2]}
    assert panel.form.template_button.text() == "Use the last message"
    assert window.session.watched == []
    panel.open_for("/blackboard")
    assert panel.message == kept, "one that is kept is shown again"


def test_without_a_publisher_the_message_type_is_the_template(window, panel) -> None:
    panel.list.select_key("b")
    panel.form.topic_field.setText("/nowhere")
    panel.form.type_field.clear()
    QTest.keyClicks(panel.form.type_field, "geometry_msgs/Point")
    press(panel.form.template_button)
    assert window.toasts[-1] == "No publisher on this topic: using the fields of the message type"
    assert panel.message is not None
    assert panel.message.payload() == {"x": 0.0, "y": 0.0, "z": 0.0}


def test_topic_names_are_suggested_and_their_type_is_adopted(panel) -> None:
    completer = panel.form.topic_field.completer()
    completer.setCompletionPrefix("black")
    assert completer.currentCompletion() == "/blackboard"
    panel.form.topic_field.setText("/robot/camera")
    assert panel.form.type_field.text() == "image"
    assert panel.form.problem_label.text().startswith("Messages of type image can't be edited by hand.")


def test_saved_messages_are_duplicated_deleted_and_restored_by_undo(window, panel) -> None:
    panel.list.select_key("b")
    QTest.keyClick(panel.list, Qt.Key.Key_D, Qt.KeyboardModifier.ControlModifier)
    names = [each.name for each in acting_of(window).saved_messages.messages]
    assert names == ["Look at Aiko", "Stand still", "Stand still 2"]
    assert panel.message is not None
    assert panel.message.name == "Stand still 2"
    QTest.keyClick(panel.list, Qt.Key.Key_Delete)
    assert window.toasts[-1] == "Deleted “Stand still 2”"
    undo = window.toast_buttons[-1][1]
    assert undo is not None
    undo()
    assert panel.message is not None
    assert panel.message.name == "Stand still 2"


def test_saved_messages_are_filtered_and_an_empty_list_offers_a_new_message(window, panel) -> None:
    panel.filter.setText("cmd")
    assert panel.list.model().rowCount() == 1
    panel.filter.clear()
    for each in acting_of(window).saved_messages.messages:
        panel.delete(each.id)
    assert panel.pages.currentIndex() == 0
    press(button(panel.empty, "New"))
    assert panel.message is not None
    assert panel.form.problem_label.text().startswith("Choose a topic first.")


def test_publish_is_in_the_menu_of_topics_with_fields(qtbot, window) -> None:
    table = window.make(topics.PANEL)
    qtbot.addWidget(table)
    for widget in table.header_widgets():
        qtbot.addWidget(widget)
    action = next(each for each in table.row_actions("/blackboard") if each.text == "Publish to this topic")
    action.run()
    assert window.commands == [PublishMessage("/blackboard")]
    assert "Publish to this topic" not in [each.text for each in table.row_actions("/robot/camera")]


def test_sending_cannot_be_armed_while_a_world_other_than_the_live_network_is_shown(window, panel) -> None:
    window.session.show(World())
    assert acting_of(window).send(STILL) == "A recording is open. Return to live to send."
    ticks(window, panel, 7)
    assert not panel.strip.switch.isEnabled()
    assert not panel.form.send_button.isEnabled()


def test_controls_have_accessible_names_and_fit_a_narrow_panel(panel, qtbot) -> None:
    assert unsaid(panel) == []
    panel.resize(420, 640)
    qtbot.waitUntil(lambda: panel.list.width() > 300)
    assert panel.form.width() <= 420
