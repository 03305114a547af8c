"""Tests of the block editor with real mouse and key events."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QMainWindow

from app.ui.blockly.messages import HistoryChanged
from app.ui.blockly.view import BlocklyView
from tests.ui.blockly_person import DEFINITIONS, START, WAIT_MS, Person, received, workspace

pytestmark = pytest.mark.web


def test_block_dragged_under_the_event_block_snaps_to_the_event_block(qtbot, view, person):
    them = person(START)
    hat = them.box("[data-id=start] > .blocklyPath")
    them.open_category("Control")
    with qtbot.waitSignal(view.changed, timeout=WAIT_MS) as changed:
        start = them.hold(".blocklyFlyout .control_wait")
        end = QPoint(round(hat["left"] + 16), round(hat["bottom"] + 22))
        them.move(start, QPoint(700, 300))
        them.move(QPoint(700, 300), end)
        them.drop(end)
    (top,) = changed.args[1].blocks["blocks"]["blocks"]
    assert top["next"]["block"]["type"] == "control_wait"
    assert top["next"]["block"]["inputs"]["SECONDS"]["shadow"]["fields"] == {"NUMBER": 1}
    assert them.newest() == changed.args[1].blocks


def test_fast_drag_connects_to_the_targeted_connection(qtbot, person):
    """A preview on the way moves the blocks below before the user can see the new layout."""
    wait = {"type": "control_wait", "inputs": {"SECONDS": {"shadow": {"type": "math_number"}}}}
    last = {**wait, "id": "last"}
    them = person({**START, "next": {"block": {**wait, "id": "first", "next": {"block": last}}}})
    hat, lowest = (them.box(f"[data-id={name}] > .blocklyPath") for name in ("start", "last"))
    them.open_category("Control")
    start = them.hold(".blocklyFlyout .control_wait")
    on_the_way = QPoint(round(hat["left"] + 12), round(hat["bottom"] + 18))
    end = QPoint(on_the_way.x(), round(lowest["bottom"] + 18))
    them.move(start, on_the_way)
    them.wait_for("!!document.querySelector('[data-id=start] > .blocklyInsertionMarker')")
    them.move(on_the_way, end, steps=1)
    them.drop(end)
    qtbot.waitUntil(lambda: len(them.tops()) == 1, timeout=WAIT_MS)
    order, block = [], them.tops()[0]
    while block:
        order.append(block["id"])
        block = block.get("next", {}).get("block")
    assert order[:3] == ["start", "first", "last"]
    assert len(order) == 4


def test_flush_during_a_drag_returns_a_valid_workspace(qtbot, view, person):
    them = person(START)
    hat = them.box("[data-id=start] > .blocklyPath")
    them.open_category("Control")
    start = them.hold(".blocklyFlyout .control_wait")
    end = QPoint(round(hat["left"] + 16), round(hat["bottom"] + 22))
    them.move(start, QPoint(700, 300))
    them.move(QPoint(700, 300), end)
    them.wait_for("!!document.querySelector('[data-id=start] .blocklyInsertionMarker')")
    tops = them.tops()
    assert START in tops
    assert [top["type"] for top in tops if top != START] == ["control_wait"]
    them.drop(end)
    qtbot.waitUntil(lambda: "next" in them.tops()[0], timeout=WAIT_MS)


def test_undo_and_redo_emit_history_changes(qtbot, view, person):
    them = person(START)
    history = received(view, HistoryChanged, "can_undo", "can_redo")
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: them.tops() == [] and history[-1:] == [(True, False)], timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: them.tops() == [START] and history[-1] == (False, True), timeout=WAIT_MS)
    view.redo()
    qtbot.waitUntil(lambda: them.tops() == [] and history[-1] == (True, False), timeout=WAIT_MS)
    them.press(Qt.Key_Z, Qt.ControlModifier)
    qtbot.waitUntil(lambda: them.tops() == [START] and history[-1] == (False, True), timeout=WAIT_MS)
    assert history == [(True, False), (False, True), (True, False), (False, True)]


def test_block_is_copied_and_pasted_with_the_keyboard(qtbot, person):
    them = person(START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_C, Qt.ControlModifier)
    them.press(Qt.Key_V, Qt.ControlModifier)
    qtbot.waitUntil(lambda: [top["type"] for top in them.tops()] == ["events_started"] * 2, timeout=WAIT_MS)


def test_typing_in_a_text_field_changes_the_workspace(qtbot, view, person):
    text = {"shadow": {"type": "values_text", "id": "t", "fields": {"TEXT": "x"}}}
    say = {"type": "robot_pepper_do_say", "id": "say", "x": 28, "y": 28, "inputs": {"TEXT": text}}
    them = person(say)
    them.click("[data-id=t] .blocklyInputField", dx=8, dy=8)
    them.wait_for("!!document.querySelector('.blocklyHtmlInput')")
    QTest.keyClicks(them.target, "Hello, you")
    them.press(Qt.Key_Return)

    def typed() -> str:
        return them.tops()[0]["inputs"]["TEXT"]["shadow"]["fields"]["TEXT"]

    qtbot.waitUntil(lambda: typed() == "Hello, you", timeout=WAIT_MS)


def test_colour_is_selected_from_the_palette_or_typed(qtbot, view, person):
    them = person({"type": "robot_pepper_do_light", "id": "light", "x": 28, "y": 28})

    def colour() -> str:
        return them.tops()[0]["fields"]["COLOUR"]

    assert colour() == "#3db8ff"
    them.click("[data-id=light] .nepColour", dx=12, dy=9)
    them.click(".nepPalette [title=red]")
    qtbot.waitUntil(lambda: colour() == "#ff3b30", timeout=WAIT_MS)
    them.click("[data-id=light] .nepColour", dx=12, dy=9)
    them.click(".nepPalette input", dx=60)
    them.press(Qt.Key_A, Qt.ControlModifier)
    QTest.keyClicks(them.target, "#01ABef")
    them.press(Qt.Key_Return)
    qtbot.waitUntil(lambda: colour() == "#01abef", timeout=WAIT_MS)


def test_name_of_a_nonexistent_topic_can_be_typed(qtbot, view, person):
    them = person({"type": "events_message", "id": "on", "x": 56, "y": 56})
    them.click("[data-id=on] .blocklyDropdownField", dx=12, dy=10)
    topics = "[...document.querySelectorAll('.blocklyMenuItemContent')].map(e => e.textContent)"
    them.wait_for(topics, ["/blackboard", "/faces", "Other topic…"])
    for key in (Qt.Key_End, Qt.Key_Return):
        them.press(key)
    them.wait_for("document.activeElement.className", "blocklyDialogInput")
    QTest.keyClicks(them.target, "/not/yet")
    them.press(Qt.Key_Return)
    qtbot.waitUntil(lambda: them.tops()[0]["fields"] == {"TOPIC": "/not/yet"}, timeout=WAIT_MS)


def test_block_is_added_from_the_toolbox_with_the_keyboard_only(qtbot, view, person):
    them = person(START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_B, Qt.ControlModifier)
    them.wait_for("document.activeElement.textContent", "Events")
    them.press(Qt.Key_Down)
    them.wait_for("document.activeElement.textContent", "Control")
    them.press(Qt.Key_Right)
    them.wait_for("!!document.activeElement.closest('.blocklyFlyout .control_wait')")
    them.press(Qt.Key_Return)
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    them.press(Qt.Key_Return)

    def next_type() -> str | None:
        return them.tops()[0].get("next", {}).get("block", {}).get("type")

    qtbot.waitUntil(lambda: next_type() == "control_wait", timeout=WAIT_MS)


def test_f12_reaches_the_window_while_the_page_has_the_focus(qtbot, view, person):
    them = person(START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    with qtbot.waitSignal(view.key_pressed, timeout=WAIT_MS) as pressed:
        them.press(Qt.Key_F12)
    assert pressed.args == ["F12"]


def test_window_shortcut_takes_precedence_over_the_page_and_runs_once(qtbot):
    window = QMainWindow()
    qtbot.addWidget(window)
    view = BlocklyView()
    view.set_definitions(DEFINITIONS)
    window.setCentralWidget(view)
    window.resize(1031, 586)
    stops: list[str] = []
    action = QAction("Stop", window)
    action.setShortcut("F12")
    action.setShortcutContext(Qt.ApplicationShortcut)
    action.triggered.connect(lambda: stops.append("action"))
    window.addAction(action)
    view.key_pressed.connect(stops.append)
    view.load(workspace(START))
    with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
        window.show()
    window.activateWindow()
    them = Person(qtbot, view)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_F12)
    qtbot.waitUntil(lambda: bool(stops), timeout=WAIT_MS)
    qtbot.wait(100)
    assert len(stops) == 1
