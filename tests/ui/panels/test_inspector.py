from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace

import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, QPointF, Qt
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence, QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMenu, QWidget

from app.core.messages import lazy_json
from app.core.messages.inspected import NO_BASE
from app.core.messages.reader import LARGE_BYTES
from app.ui.intents import NewValueAlarm, OpenPanel
from app.ui.panels.watch.inspector.body import LARGE, NOTHING, RAW, TREE
from app.ui.panels.watch.inspector.diff import changes_text, count_changes
from app.ui.panels.watch.inspector.footer import message_info
from app.ui.panels.watch.inspector.panel import PANEL, InspectorPanel
from app.ui.panels.watch.inspector.tree_model import TreeNode
from app.ui.panels.watch.inspector.values import clipboard_text, image_summary
from nep.messages.clocks import SAME_CLOCK, ClockDifference, PublisherClock
from nep.messages.fields import parse_path
from nep.messages.message import Message, message_kind
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, has_keys, press, ticks
from tests.ui.sample_data import blackboard


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> Iterator[InspectorPanel]:
    made = window.make(PANEL, (330, 700))
    qtbot.addWidget(made)
    for widget in made.header:
        qtbot.addWidget(widget)
    assert isinstance(made, InspectorPanel)
    yield made
    made.dispose()


def choose(panel: InspectorPanel, *path: str | int) -> None:
    panel.tree.setCurrentIndex(panel.model.index_of_path(path))


def test_without_a_topic_the_inspector_links_to_the_topics_panel(panel, window) -> None:
    assert panel.body.page == NOTHING
    assert window.session.watched == []
    press(button(panel.body.empty, "Choose a topic"))
    assert window.commands == [OpenPanel("topics")]


def test_inspector_watches_only_the_shown_topic(panel, window) -> None:
    panel.show_topic("/blackboard")
    panel.show_topic("/odom")
    assert window.session.watched == ["/odom"]
    assert (panel.title(), panel.subtitle()) == ("Inspector", "/odom")
    panel.dispose()
    assert window.session.watched == []


def test_newest_message_is_shown_as_a_tree_with_its_metadata(panel, window) -> None:
    panel.show_topic("/blackboard")
    assert panel.body.page == NOTHING
    window.session.send("/blackboard", blackboard())
    panel.refresh()
    assert panel.body.page == TREE
    choose(panel, "robots", "Pepper", "pose", "y")
    assert panel.foot.path.text() == "robots.Pepper.pose.y"
    assert panel.foot.info.text().startswith("seq 18\u2009204   ")
    assert "latency" in panel.foot.info.text()
    assert panel.live.text == "live"


def test_latched_message_shows_the_time_since_publication(panel, window) -> None:
    now = time.time_ns()
    half_an_hour_ago = Message("/a", b"1", "json", "json")
    half_an_hour_ago.kind = message_kind("/a", "json", "json", is_latched=True)
    half_an_hour_ago.stamp_ns = now - 1800 * 10**9
    assert message_info(half_an_hour_ago, now).endswith("latched, sent 30 min ago")
    half_an_hour_ago.stamp_ns = now - 10**6
    assert "latency" in message_info(half_an_hour_ago, now - 10**9), "it came while somebody looked"


@pytest.mark.parametrize(
    ("took_ns", "known", "words"),
    [
        (3_200_000, ClockDifference(10**12, 400_000), "latency 3.2 ms ± 0.4 ms"),
        (-200_000, ClockDifference(10**12, 400_000), "latency under 0.4 ms"),
        (3_200_000, ClockDifference(10**12, 900), "latency 3.2 ms ± 0.1 ms"),
        (3_200_000, SAME_CLOCK, "latency 3.2 ms"),
        (3_200_000, None, "latency 3.2 ms"),
        (-3_600_000_000_000, None, "latency unknown: clocks not synchronized"),
        (-3_600_000_000_000, ClockDifference(10**12, 400_000), "412 B"),
    ],
)
def test_latency_of_another_computer_is_shown_with_its_uncertainty(took_ns, known, words) -> None:
    message = Message("/a", bytes(412), "bytes", "bytes", stamp_ns=10**18)
    message.kind = message_kind("/a", "bytes", "bytes", clock=PublisherClock(known))
    message.seen_ns = 10**18 + took_ns + (0 if known is None else known.offset_ns)
    assert message_info(message).split("   ")[-1] == words


def test_latched_message_shows_no_latency(panel, window) -> None:
    latched = Message("/blackboard", b"1", "json", "json", stamp_ns=time.time_ns() - 1800 * 10**9, seq=1)
    latched.kind = message_kind("/blackboard", "json", "json", is_latched=True)
    topic = window.session.shown.topics["/blackboard"]
    topic.newest, topic.received = latched, topic.received + 1
    window.session.shown.topics.values_revision += 1
    panel.show_topic("/blackboard")
    panel.refresh()
    assert "seq 1" in panel.foot.info.text()
    assert "latency" not in panel.foot.info.text()


def test_latency_of_a_shown_message_does_not_grow(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", blackboard())
    panel.refresh()
    panel.freeze.setChecked(True)
    said = panel.foot.info.text()
    assert "latency" in said
    panel.inspected.message.stamp_ns -= 600 * 10**9  # as if ten minutes old
    press(button(panel.mode, "Raw"))
    assert panel.body.page == RAW
    assert panel.foot.info.text() == said


class Layouts(QObject):
    """Event filter that counts the layout requests of a widget."""

    def __init__(self, watched: QWidget) -> None:
        super().__init__()
        self.count = 0
        watched.installEventFilter(self)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        self.count += event.type() == QEvent.Type.LayoutRequest
        return False


def test_changing_metadata_does_not_relayout_the_window(qapp, panel, window) -> None:
    panel.show_topic("/blackboard")
    layouts, told = Layouts(panel.body), set()
    for number in range(8):
        panel.clock = lambda now=float(number): now
        window.session.send("/blackboard", blackboard(number))
        ticks(window, panel)
        qapp.processEvents()
        if number == 2:  # the first messages fill the panel and change its layout
            layouts.count = 0
            told.clear()
        told.add(panel.foot.info.text())
        assert panel.foot.info.accessibleName() == panel.foot.info.text()
    assert len(told) == 6
    assert layouts.count == 0


def test_fast_messages_are_shown_at_ten_hertz_and_the_last_message_always(panel, window) -> None:
    now = [0.0]
    panel.clock = lambda: now[0]
    panel.show_topic("/odom")
    ticks(window, panel)
    said = []
    for number in range(61):  # slightly more than two seconds at 30 Hz
        now[0] = 1.0 + number / 30
        window.session.send("/odom", {"n": number})
        ticks(window, panel)
        said.append((panel.model.value()["n"], panel.foot.info.text()))
    assert [number for number, _facts in said[:3]] == [0, 1, 2]  # the first ones immediately
    assert 20 <= len(set(said)) <= 24
    now[0] += 0.1
    ticks(window, panel)
    assert panel.model.value()["n"] == 60
    assert panel.foot.info.text().split("   ")[:2] == message_info(panel.inspected.message).split("   ")[:2]


def test_resumed_panel_shows_the_current_message_immediately(panel, window) -> None:
    panel.clock = lambda: 5.0
    for topic, number, size in (("/blackboard", 1, "8 B"), ("/odom", 22, "9 B")):
        panel.show_topic(topic)
        for value in range(9):  # the last ones exceed the update rate
            window.session.send(topic, {"n": value})
            ticks(window, panel)
        window.session.send(topic, {"n": number})
        ticks(window, panel)
        assert panel.model.value() != {"n": number}
        panel.freeze.setChecked(True)
        panel.freeze.setChecked(False)
        assert panel.model.value() == {"n": number}
        assert panel.foot.info.text().split("   ")[1] == size


def test_next_message_keeps_expanded_items_and_marks_changes(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", blackboard(0))
    panel.refresh()
    joints = panel.model.index_of_path(("robots", "Pepper", "joints"))
    panel.tree.expand(joints)
    window.session.send("/blackboard", blackboard(1))
    panel.refresh()
    assert panel.tree.isExpanded(panel.model.index_of_path(("robots", "Pepper", "joints")))
    assert panel.model.node(panel.model.index_of_path(("stamp",))).changed_s is not None
    assert panel.model.node(panel.model.index_of_path(("note",))).changed_s is None


def test_undecodable_message_is_shown_as_bytes_with_the_reason(panel, window) -> None:
    panel.show_topic("/faces")
    window.session.send("/faces", b"not json \x00\xff")
    panel.refresh()
    assert panel.body.page == RAW
    assert panel.mode.value == "raw"
    assert panel.body.error_label.isVisible()
    assert panel.body.error_label.text().startswith("Can't decode the message as json: ")
    assert "6e 6f 74" in panel.bytes.text()
    window.session.send("/faces", {"good": 1})
    panel.refresh()
    assert panel.body.page == TREE
    assert not panel.body.error_label.isVisible()


def test_raw_view_shows_the_bytes_of_a_valid_message(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"a": 1})
    panel.refresh()
    press(button(panel.mode, "Raw"))
    assert panel.body.page == RAW
    assert "7b" in panel.bytes.text()
    assert not panel.body.error_label.isVisible()
    window.session.send("/blackboard", {"b": 1})
    panel.refresh()
    assert "62" in panel.bytes.text()
    press(button(panel.mode, "Tree"))
    assert panel.model.node(panel.model.index(0, 0)).key == "b"


def test_freeze_button_holds_the_message_until_released(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"n": 1})
    panel.refresh()
    panel.freeze.setChecked(True)
    window.session.send("/blackboard", {"n": 2})
    ticks(window, panel)
    assert panel.model.value() == {"n": 1}
    assert panel.live.text == "frozen"
    panel.freeze.setChecked(False)
    assert panel.model.value() == {"n": 2}


def test_frozen_undecodable_message_is_shown_as_bytes_in_both_views(panel, window) -> None:
    panel.show_topic("/faces")
    window.session.send("/faces", b"not json \x00\xff")
    panel.refresh()
    panel.freeze.setChecked(True)
    window.session.send("/faces", {"good": 1})
    ticks(window, panel)
    press(button(panel.mode, "Tree"))
    assert (panel.body.page, panel.mode.value) == (RAW, "raw")
    assert panel.body.error_label.text().startswith("Can't decode the message as json: ")
    assert "6e 6f 74" in panel.bytes.text()
    panel.freeze.setChecked(False)
    assert panel.model.value() == {"good": 1}


def test_value_and_field_path_are_copied(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", blackboard())
    panel.refresh()
    choose(panel, "people", 0, "name")
    press(panel.foot.copy_value)
    assert QGuiApplication.clipboard().text() == "Aiko"
    press(panel.foot.copy_path)
    assert QGuiApplication.clipboard().text() == "people[0].name"
    assert window.toasts == ["Copied people[0].name", "Copied the path people[0].name"]
    choose(panel, "robots", "Pepper", "pose")
    panel.inspector_actions.copy_value()
    assert json.loads(QGuiApplication.clipboard().text())["y"] == pytest.approx(-0.297)


def test_large_json_message_is_decoded_in_another_thread_and_shown_when_ready(qtbot, panel, window) -> None:
    panel.show_topic("/blackboard")
    rows = [{"id": number, "name": f"n{number}", "note": "x" * 150} for number in range(8_000)]
    message = window.session.send("/blackboard", {"rows": rows, "end": [1, 2]})
    assert message.size_bytes > LARGE_BYTES
    panel.refresh()
    assert panel.body.page == LARGE
    assert panel.body.large._text.text() == "Reading the message…"
    qtbot.waitUntil(lambda: (panel.refresh(), panel.body.page == TREE)[1])
    assert panel.model.rowCount() == 2
    rows_index = panel.model.index(0, 0)
    panel.tree.expand(rows_index)
    panel.model.fetchMore(rows_index)
    assert panel.model.rowCount(rows_index) < 5000  # rows are fetched in pages
    choose(panel, "rows", 7_999, "name")
    assert panel.foot.path.text() == "rows[7999].name"
    QTest.keyClicks(panel.finder.field, "n799")
    assert panel.finder.field.count == "1 of 11"
    assert panel.foot.path.text() == "rows[799].name"


def test_large_message_is_never_decoded_in_the_gui_thread(qtbot, panel, window, monkeypatch) -> None:
    threads: dict[str, set[int]] = {"looked into": set(), "decoded": set()}
    scan, decode = lazy_json._find_separators, Message.payload.fget
    assert decode is not None

    def scanned(data: memoryview) -> object:
        threads["looked into"].add(threading.get_ident())
        return scan(data)

    def decoded(self: Message) -> object:
        if self.size_bytes > LARGE_BYTES:
            threads["decoded"].add(threading.get_ident())
        return decode(self)

    monkeypatch.setattr(lazy_json, "_find_separators", scanned)
    monkeypatch.setattr(Message, "payload", property(decoded))
    panel.show_topic("/blackboard")
    panel.compare.setChecked(True)
    for number in range(3):
        panel.inspected.reader.clear()
        window.session.send("/blackboard", {"n": number, "data": ["x" * 90] * 110_000})
        qtbot.waitUntil(lambda wanted=number: (panel.refresh(), shown_number(panel) == wanted)[1])
    window.session.shown.topics["/speech/words"].newest = Message(
        "/speech/words", b"y" * 2_000_000, "string", "string"
    )
    panel.show_topic("/speech/words")
    panel.refresh()
    press(button(panel.body.large, "Decode the newest message"))
    qtbot.waitUntil(lambda: (panel.refresh(), panel.body.page == TREE)[1])
    assert threads["looked into"]
    assert threads["decoded"]
    assert threading.get_ident() not in threads["looked into"] | threads["decoded"]


def shown_number(panel: InspectorPanel) -> object:
    value = panel.model.value()
    return value.get("n") if panel.body.page == TREE and isinstance(value, Mapping) else None


def test_large_messages_that_are_not_json_are_decoded_only_on_request(qtbot, panel, window) -> None:
    topic = window.session.shown.topics["/speech/words"]
    topic.newest = Message("/speech/words", b"x" * 1_200_000, "string", "string", seq=1)
    panel.show_topic("/speech/words")
    panel.refresh()
    assert panel.body.page == LARGE
    assert panel.body.large._title.text() == "Large message (1.2 MB)"
    press(button(panel.body.large, "Decode the newest message"))
    assert panel.is_frozen  # otherwise the next large message would hide this one
    topic.newest = Message("/speech/words", b"y" * 1_200_000, "string", "string", seq=2)
    qtbot.waitUntil(lambda: (ticks(window, panel), panel.body.page == TREE)[1])
    assert panel.model.value() == {"value": "x" * 1_200_000}


def test_large_malformed_json_message_is_shown_as_bytes(qtbot, panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", b"[" * 1_100_000)
    qtbot.waitUntil(lambda: (panel.refresh(), panel.body.page == RAW)[1])
    assert panel.body.error_label.text() == "Can't decode the message as json: unbalanced brackets."


def test_images_are_summarised() -> None:
    message = Message(
        "/c", b"\xff\xd8jpeg", "image", "image", extension={"shape": [240, 320, 3], "encoding": "jpeg"}
    )
    assert image_summary(message) == {
        "encoding": "jpeg", "width": 320, "height": 240, "channels": 3, "size": "6 B",
    }  # fmt: skip


def test_images_are_not_decoded_to_be_summarised(panel, window) -> None:
    panel.show_topic("/robot/camera")
    topic = window.session.shown.topics["/robot/camera"]
    told = {"shape": [480, 640, 3], "encoding": "jpeg"}
    topic.newest = Message("/robot/camera", b"no picture at all", "image", "image", seq=1, extension=told)
    panel.refresh()
    assert panel.body.page == TREE
    assert panel.model.value()["width"] == 640
    topic.newest = Message("/robot/camera", b"no picture at all", "image", "image", seq=2)
    panel.refresh()
    assert panel.body.page == RAW  # without a shape, bytes that are no image are shown raw


def test_string_is_shown_as_one_value(panel, window) -> None:
    panel.show_topic("/speech/words")
    window.session.send("/speech/words", b"hello")
    panel.refresh()
    assert panel.model.value() == {"value": "hello"}
    assert not window.session.shown.topics["/speech/words"].is_new


def test_search_finds_keys_and_values(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", blackboard())
    panel.refresh()
    QTest.keyClicks(panel.finder.field, "aiko")
    assert panel.foot.path.text() == "people[0].name"
    panel.finder.field.clear()
    QTest.keyClicks(panel.finder.field, "theta")
    assert panel.foot.path.text() == "robots.Pepper.pose.theta"
    panel.finder.field.setText("kind")
    first = panel.foot.path.text()
    panel.finder.step(1)
    assert (first, panel.foot.path.text()) == ("objects[0].kind", "objects[1].kind")
    panel.finder.field.setText("nowhere")
    assert panel.finder.field.property("wrong") == "true"


def test_removed_topic_shows_the_time_since_removal_and_keeps_its_last_message(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"n": 1})
    panel.refresh()
    window.session.shown.topics["/blackboard"].gone_s = 3.2
    panel.refresh()
    assert panel.live.text == "gone for 3 s"
    window.session.remove("/blackboard")
    panel.refresh()
    assert panel.live.text == "gone"
    assert panel.model.value() == {"n": 1}


def test_topic_is_restored_with_the_layout(qtbot, panel, window) -> None:
    panel.show_topic("/odom")
    again = window.make(PANEL)
    qtbot.addWidget(again)
    again.restore_state(panel.save_state())
    assert again.subtitle() == "/odom"


@pytest.mark.parametrize(
    ("value", "words"), [("a", "a"), (1.5, "1.5"), (None, "null"), (b"\x01\x02", "01 02"), ([1], "[\n  1\n]")]
)
def test_values_are_formatted_as_text_for_the_clipboard(value: object, words: str) -> None:
    assert clipboard_text(value) == words


def test_search_counts_matches_and_steps_forwards_and_backwards_across_messages(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"a": "x1", "b": "x2", "c": "x3"})
    panel.refresh()
    field = panel.finder.field
    QTest.keyClicks(field, "x")
    assert (panel.finder.field.count, panel.foot.path.text()) == ("1 of 3", "a")
    QTest.keyClick(field, Qt.Key.Key_Return)
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert (panel.finder.field.count, panel.foot.path.text()) == ("3 of 3", "c")
    QTest.keyClick(field, Qt.Key.Key_Return, Qt.KeyboardModifier.ShiftModifier)
    assert panel.foot.path.text() == "b"
    window.session.send("/blackboard", {"a": "x1", "b": "y", "c": "x3", "d": "x4", "e": "x5"})
    panel.refresh()
    press(panel.finder.next_button)
    assert (panel.finder.field.count, panel.foot.path.text()) == ("3 of 4", "d")
    press(panel.finder.previous_button)
    assert panel.foot.path.text() == "c"
    field.clear()
    assert panel.finder.previous_button.isHidden()
    assert panel.focus_filter()
    field.setText("nowhere")
    assert panel.finder.field.count == "none"


def test_message_is_compared_with_the_previous_message_and_only_changes_can_be_shown(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"same": 1, "n": 1, "gone": 2})
    panel.refresh()
    window.session.send("/blackboard", {"same": 1, "n": 2, "new": {"x": 1}})
    panel.refresh()
    panel.compare.setChecked(True)
    assert panel.strip.isVisible()
    assert panel.strip.text_label.text() == "Previous message: 1 changed, 1 added, 1 removed"
    marks = {node.key: node.mark for node in top(panel)}
    assert marks == {"same": "", "n": "changed", "new": "added", "gone": "removed"}
    panel.strip.changes_only_button.setChecked(True)
    assert [node.key for node in top(panel)] == ["n", "new", "gone"]
    window.session.send("/blackboard", {"same": 1, "n": 2, "new": {"x": 1}})
    panel.refresh()
    assert panel.strip.text_label.text() == "Previous message: no difference"
    assert top(panel) == []
    panel.compare.setChecked(False)
    assert panel.strip.isHidden()
    assert [node.mark for node in top(panel)] == ["", "", ""]


def test_pinned_message_is_kept_as_the_reference_of_the_comparison(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"n": 1})
    panel.refresh()
    panel.pin.setChecked(True)
    assert panel.strip.text_label.text() == "Pinned message: no difference"
    for number in (2, 3):
        window.session.send("/blackboard", {"n": number})
        panel.refresh()
    (node,) = top(panel)
    assert (node.value, node.base, node.mark) == (3, 1, "changed")
    panel.show_topic("/odom")
    assert not panel.pin.isChecked()


def top(panel: InspectorPanel) -> list[TreeNode]:
    return [panel.model.node(panel.model.index(row, 0)) for row in range(panel.model.rowCount())]


def test_whole_message_is_copied_as_json(panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {"a": [1, 2]})
    panel.refresh()
    panel.inspector_actions.copy_message()
    assert QGuiApplication.clipboard().text() == '{"a": [1, 2]}'
    assert window.toasts == ["Copied the message of /blackboard"]
    panel.show_topic("/speech/words")
    window.session.send("/speech/words", b"hello")
    panel.refresh()
    panel.inspector_actions.copy_message()
    assert json.loads(QGuiApplication.clipboard().text()) == {"value": "hello"}
    words = [action.text() for action in panel.more_actions()]
    assert words[:3] == ["Copy value", "Copy path", "Copy the message as JSON"]


def test_comparison_is_restored_with_the_layout(qtbot, panel, window) -> None:
    panel.show_topic("/odom")
    panel.compare.setChecked(True)
    panel.strip.changes_only_button.setChecked(True)
    again = window.make(PANEL)
    qtbot.addWidget(again)
    for widget in again.header:
        qtbot.addWidget(widget)
    again.restore_state(panel.save_state())
    assert isinstance(again, InspectorPanel)
    assert again.is_comparing
    assert again.strip.changes_only_button.isChecked()


def test_nested_change_counts_only_the_changed_value() -> None:
    before, after = {"a": {"b": [1, 2, 3]}, "c": 1}, {"a": {"b": [1, 9]}, "c": 1, "d": {"e": {"f": 1}}}
    counts, whole = count_changes(after, before)
    assert whole
    assert counts == {"changed": 1, "added": 1, "removed": 1}
    assert changes_text(counts) == "1 changed, 1 added, 1 removed"
    assert count_changes(after, NO_BASE) == ({"changed": 0, "added": 0, "removed": 0}, True)
    long = list(range(6000))
    counts, whole = count_changes([*long[:-1], 0], long)
    assert (counts["changed"], whole) == (0, False)
    assert changes_text(counts, whole) == "no difference at the start of long lists"
    assert changes_text(*count_changes([1, *long[1:]], long)) == "at least 1 changed"


def test_topic_without_publisher_is_reported_while_waiting(panel, window) -> None:
    panel.show_topic("/odom")
    panel.refresh()
    assert panel.body.empty._text.text() == "The next message on /odom appears here."
    window.session.shown.topics["/odom"].publishers = 0
    panel.refresh()
    assert panel.body.empty._text.text().startswith("There is no publisher at the moment.")


def test_inspector_ctrl_f_takes_precedence_over_the_window_shortcut(qtbot, panel, window) -> None:
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", blackboard())
    panel.refresh()
    panel.window().activateWindow()
    qtbot.waitUntil(panel.window().isActiveWindow)
    other = QAction("Find in blocks", panel)
    other.setShortcut(QKeySequence("Ctrl+F"))
    asked: list[str] = []
    other.triggered.connect(lambda: asked.append("other"))
    panel.window().addAction(other)
    panel.tree.setFocus()
    QTest.keyClick(panel.tree, Qt.Key.Key_F, Qt.KeyboardModifier.ControlModifier)
    assert has_keys(panel.finder.field)
    assert asked == []


@pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
def test_alarm_is_created_from_a_value_with_any_key_names(panel, window) -> None:
    message = {"a.b": {"c d": [{"": 7}]}, "x": 1}
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", message)
    panel.refresh()
    for steps in (("a.b", "c d", 0, ""), ("x",)):
        choose(panel, *steps)
        panel._show_menu(QPoint(5, 5))
        menu = QApplication.activePopupWidget()
        assert isinstance(menu, QMenu)
        menu.close()
        next(each for each in menu.actions() if each.text() == "New alarm").trigger()
        intent = window.commands[-1]
        assert isinstance(intent, NewValueAlarm)
        assert (intent.topic, parse_path(intent.path)) == ("/blackboard", steps)


def test_value_is_plotted_by_action_or_footer_button_and_can_be_dragged(panel, window, monkeypatch) -> None:
    plotted: list[tuple[str, str]] = []
    dragged: list[tuple[str, str]] = []
    monkeypatch.setattr(panel, "context", replace(panel.context, plot=lambda *field: plotted.append(field)))
    monkeypatch.setattr(
        "app.ui.panels.watch.inspector.panel.FieldDrag", lambda _viewport, *field: dragged.append(field)
    )
    panel.show_topic("/blackboard")
    window.session.send("/blackboard", {**blackboard(), "a b.c": [1, 2]})
    panel.refresh()
    for path, said in (
        (("robots", "Pepper", "pose", "y"), "robots.Pepper.pose.y"),
        (("robots", "Pepper", "joints"), "robots.Pepper.joints[*]"),
        (("robots", "Pepper", "joints", 3), "robots.Pepper.joints[3]"),
        (("a b.c",), '["a b.c"][*]'),
    ):
        choose(panel, *path)
        panel.inspector_actions.plot()
        press(panel.foot.plot)
        assert plotted[-2:] == [("/blackboard", said)] * 2
        place = panel.tree.visualRect(panel.tree.currentIndex()).center()
        viewport = panel.tree.viewport()
        QTest.mousePress(viewport, Qt.MouseButton.LeftButton, pos=place)
        for at in (place, place + QPoint(60, 0)):
            held, nothing = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
            move = QEvent.Type.MouseMove
            global_at = QPointF(viewport.mapToGlobal(at))
            QApplication.sendEvent(viewport, QMouseEvent(move, QPointF(at), global_at, held, held, nothing))
        QTest.mouseRelease(viewport, Qt.MouseButton.LeftButton, pos=place)
        assert dragged[-1] == ("/blackboard", said)
    choose(panel, "robots", "Pepper", "pose")
    panel.inspector_actions.plot()
    assert window.toasts[-1].startswith("Can't plot robots.Pepper.pose. ")
    assert len(plotted) == 8
