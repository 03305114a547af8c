"""Tests of copying and pasting blocks: position, undo, between tabs, and as text between Studios."""

from __future__ import annotations

import json

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QLineEdit, QVBoxLayout, QWidget

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import number, robot, started, workspace
from tests.ui.blockly_person import WAIT_MS, Person, editor

pytestmark = pytest.mark.web

BOXES = """[...document.querySelectorAll('.nepTab:not([hidden]) .blocklyBlockCanvas > .blocklyDraggable')]
    .map(e => (r => [r.left, r.top, r.right, r.bottom])(e.getBoundingClientRect()))"""


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


def wait_block(id: str, seconds: float = 5) -> dict:
    return {"type": "control_wait", "id": id, "inputs": {"SECONDS": {"shadow": number(seconds)}}}


@pytest.fixture
def them(view, person) -> Person:
    QGuiApplication.clipboard().setText("")
    state = workspace(started(wait_block("w")) | {"id": "start", "x": 60, "y": 60})
    made: Person = person(state=state)
    take_the_keys(made)
    return made


def take_the_keys(them: Person) -> None:
    them.view.setFocus()
    them.wait_for("document.hasFocus()")


def press(them: Person, key: Qt.Key) -> None:
    them.press(key, Qt.ControlModifier)


def types(them: Person) -> list[str]:
    return sorted(top["type"] for top in them.tops())


def apart(boxes: list[list[float]]) -> bool:
    return all(
        one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
        for place, one in enumerate(boxes)
        for other in boxes[place + 1 :]
    )


def test_duplicates_are_placed_unattached_next_to_the_original_in_the_viewport(qtbot, them):
    them.click("[data-id=w] > .blocklyPath")
    them.wait_for("document.hasFocus() && document.querySelector('.blocklySelected')?.dataset.id", "w")
    for count in range(2, 6):
        press(them, Qt.Key_D)
        qtbot.waitUntil(lambda count=count: len(them.tops()) == count, timeout=WAIT_MS)
        # The duplicate gets the focus.
        them.wait_for("document.hasFocus() && !!document.querySelector('.blocklySelected')")
    boxes = them.ask(BOXES)
    assert len(boxes) == 5
    assert apart(boxes)
    room = them.box(".blocklySvg")
    assert all(room["left"] < box[0] and box[2] < room["right"] for box in boxes)
    assert all(room["top"] < box[1] and box[3] < room["bottom"] for box in boxes)
    assert "next" in them.tops()[0]  # the stack is intact, nothing was inserted


def test_rapid_duplicates_leave_the_focus_on_the_newest_duplicate(them):
    """Held keys repeat faster than the page renders frames."""
    them.click("[data-id=w] > .blocklyPath")
    them.wait_for("document.querySelector('.blocklySelected')?.dataset.id", "w")
    for _ in range(4):
        press(them, Qt.Key_D)
    them.wait_for("document.querySelectorAll('.nepTab:not([hidden]) .control_wait').length", 5)
    them.box(".blocklySelected")  # selected after two frames
    them.wait_for("document.activeElement.closest('[data-id]')?.dataset.id", them.tops()[-1]["id"])


def test_copies_are_pasted_at_the_mouse_and_undone_in_one_step(qtbot, them):
    them.click("[data-id=w] > .blocklyPath")
    them.wait_for("document.querySelector('.blocklySelected')?.dataset.id", "w")
    press(them, Qt.Key_C)
    qtbot.waitUntil(lambda: QGuiApplication.clipboard().text().startswith('{"nepStudio":"block"'))
    at = QPoint(700, 400)
    them.hover(at)
    them.wait_for("!!document.querySelector('.nepTab:not([hidden]) .blocklyMainBackground:hover')")
    press(them, Qt.Key_V)
    qtbot.waitUntil(lambda: types(them) == ["control_wait", "events_started"], timeout=WAIT_MS)
    box = them.ask(BOXES)[1]
    assert abs(box[0] - at.x()) < 12
    assert abs(box[1] - at.y()) < 12
    assert them.tops()[1]["inputs"]["SECONDS"]["shadow"]["fields"]["NUMBER"] == 5
    them.view.undo()
    qtbot.waitUntil(lambda: types(them) == ["events_started"], timeout=WAIT_MS)


def test_blocks_cut_in_one_tab_are_pasted_in_another_tab(qtbot, view, them):
    view.show_tab("first", them.newest())
    take_the_keys(them)
    them.click(".nepTab:not([hidden]) [data-id=w] > .blocklyPath")
    them.wait_for("!!document.querySelector('.nepTab:not([hidden]) .blocklySelected')")
    press(them, Qt.Key_X)
    qtbot.waitUntil(lambda: "next" not in them.tops()[0], timeout=WAIT_MS)
    view.show_tab("second", workspace())
    # A key press reaches the page through another channel than a call and may arrive first.
    them.wait_for("document.querySelector('.nepTab:not([hidden]) [data-id=start]') === null")
    press(them, Qt.Key_V)
    qtbot.waitUntil(lambda: types(them) == ["control_wait"], timeout=WAIT_MS)
    view.show_tab("first", workspace())
    assert types(them) == ["events_started"]


def test_paste_works_while_another_widget_of_the_window_has_focus(qtbot, view, them):
    window, other = QWidget(), QLineEdit()
    qtbot.addWidget(window)
    column = QVBoxLayout(window)
    column.addWidget(other)
    column.addWidget(view)
    window.resize(1180, 760)
    window.show()
    them.click("[data-id=w] > .blocklyPath")
    them.wait_for("document.querySelector('.blocklySelected')?.dataset.id", "w")
    other.setFocus()
    them.wait_for("document.hasFocus()", False)
    view.edit("copy")
    them.wait_for("document.hasFocus()")
    view.edit("paste")  # the page has the focus and handles its own keys
    other.setFocus()
    them.wait_for("document.hasFocus()", False)
    view.edit("paste")
    qtbot.waitUntil(lambda: types(them) == ["control_wait", "events_started"], timeout=WAIT_MS)
    view.setParent(None)


def test_edit_menu_cuts_copies_and_pastes_blocks(qtbot, view, them):
    them.click("[data-id=w] > .blocklyPath")
    them.wait_for("document.querySelector('.blocklySelected')?.dataset.id", "w")
    view.edit_from_menu("copy")  # a menu command is executed even if the page has the focus
    qtbot.waitUntil(lambda: "control_wait" in QGuiApplication.clipboard().text(), timeout=WAIT_MS)
    view.edit_from_menu("paste")
    qtbot.waitUntil(lambda: types(them) == ["control_wait", "events_started"], timeout=WAIT_MS)
    view.edit_from_menu("selectAll")
    them.wait_for("document.querySelectorAll('.nepChosen').length > 1")
    view.edit_from_menu("cut")
    qtbot.waitUntil(lambda: types(them) == [], timeout=WAIT_MS)


def test_edit_menu_applies_to_the_focused_text_field_of_the_editor(qtbot, view, them):
    QGuiApplication.clipboard().setText("seven")
    view.open_find()
    them.wait_for("document.activeElement?.tagName", "INPUT")
    view.edit_from_menu("paste")
    them.wait_for("document.activeElement?.value", "seven")
    view.edit_from_menu("selectAll")
    them.wait_for("document.activeElement?.selectionEnd - document.activeElement?.selectionStart", 5)
    view.edit_from_menu("cut")
    them.wait_for("document.activeElement?.value", "")
    assert types(them) == ["events_started"]


def test_blocks_copied_as_text_in_another_studio_are_pasted_and_other_text_is_ignored(qtbot, them):
    clipboard = QGuiApplication.clipboard()
    press(them, Qt.Key_V)
    clipboard.setText("a shopping list")
    press(them, Qt.Key_V)
    clipboard.setText(
        '{"nepStudio":"block","state":{"type":"control_wait","inputs":{"SECONDS":{"block":7}}}}'
    )
    press(them, Qt.Key_V)
    clipboard.setText('{"nepStudio":"block","state":')
    press(them, Qt.Key_V)
    there = {"type": "robot_nao_do_sing", "fields": {"SONG": "la"}}
    clipboard.setText(json.dumps({"nepStudio": "block", "state": there}, separators=(",", ":")))
    press(them, Qt.Key_V)
    qtbot.waitUntil(lambda: "robot_nao_do_sing" in types(them), timeout=WAIT_MS)
    made = next(top for top in them.tops() if top["type"] == "robot_nao_do_sing")
    assert made["fields"] == {"SONG": "la"}  # an unknown block keeps its fields


def test_paste_in_an_open_field_inserts_text(qtbot, them):
    them.click("[data-id=w] > .blocklyPath")
    press(them, Qt.Key_C)
    qtbot.waitUntil(lambda: QGuiApplication.clipboard().text() != "")
    QGuiApplication.clipboard().setText("12")
    them.click("[data-id=w] .blocklyEditableField", dx=8, dy=8)
    them.wait_for("!!document.querySelector('.blocklyHtmlInput')")
    press(them, Qt.Key_V)
    them.wait_for("document.querySelector('.blocklyHtmlInput').value", "12")
    them.press(Qt.Key_Return)
    assert types(them) == ["events_started"]
