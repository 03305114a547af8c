"""Tests of the block editor with the keyboard only, including help and search."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QMainWindow

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import block, list_of, number, robot, started, workspace
from tests.ui.blockly_person import WAIT_MS, Person, editor

pytestmark = pytest.mark.web

FOUND = (("append", "lists_add"), ("loop", "control_repeat"), ("rep fore", "control_forever"))
PACE_MS = 80
EDGE = 40
CARD = "document.querySelector('.nepHelp')?.textContent ?? ''"
FOCUSED = (
    "(it => [it.getAttribute('class') ?? '', it.getAttribute('aria-label') ?? '', it.id])"
    "(document.activeElement)"
)


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


@pytest.fixture
def them(qtbot, view, person) -> Person:
    saved: dict[str, object] = {"type": "control_wait", "id": "w"}
    saved["inputs"] = {"SECONDS": {"shadow": number(5) | {"id": "n"}}}
    tops = started(saved) | {"id": "start", "x": 60, "y": 60}
    made = person(state=workspace(tops))
    take_the_keys(made)
    return made


def goes_to(them: Person, part: str) -> None:
    """Wait until the focus is on an element with this text in its class, label or id."""
    them.wait_for(f"{FOCUSED}.some(each => each.includes({part!r}))")


def take_the_keys(them: Person) -> None:
    them.view.setFocus()
    them.wait_for("document.hasFocus()")


def begin_to_search(them: Person) -> None:
    """Open the search and wait until its field is focused and its text is selected."""
    them.view.open_search()
    goes_to(them, "Find a block")
    marked = "(it => it.selectionEnd - it.selectionStart == it.value.length)(document.activeElement)"
    them.wait_for(marked)


def press(them: Person, *keys: Qt.Key) -> None:
    """Press keys one after the other, because the page moves the focus with the next frame."""
    for key in keys:
        them.press_and_see(key)
        QTest.qWait(PACE_MS)


def hold(them: Person, key: Qt.Key, held=Qt.ControlModifier) -> None:
    """Press a key with Ctrl or other modifiers."""
    them.press_and_see(key, held)
    QTest.qWait(PACE_MS)


def to_the_canvas(them: Person) -> None:
    """Move the focus to the canvas."""
    hold(them, Qt.Key_B, Qt.ControlModifier | Qt.ShiftModifier)


def test_behaviour_is_built_with_the_keyboard_only(qtbot, view, person):
    them = person(state=workspace())
    take_the_keys(them)
    press(them, Qt.Key_Tab)
    goes_to(them, "events")
    press(them, Qt.Key_Right)
    goes_to(them, "when started")
    press(them, Qt.Key_Return)  # picks the block up
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    press(them, Qt.Key_Return)  # drops the block
    qtbot.waitUntil(lambda: [top["type"] for top in them.tops()] == ["events_started"], timeout=WAIT_MS)
    assert min(them.tops()[0]["x"], them.tops()[0]["y"]) >= EDGE, "its signs at the left are whole"
    hold(them, Qt.Key_B)
    goes_to(them, "events")
    press(them, Qt.Key_Down)
    goes_to(them, "control")
    press(them, Qt.Key_Right)
    goes_to(them, "wait")
    press(them, Qt.Key_Return)
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    press(them, Qt.Key_Return)  # below the event block, which had the focus
    qtbot.waitUntil(lambda: "next" in them.tops()[0], timeout=WAIT_MS)
    them.wait_for("!document.querySelector('.blocklyDragging')")
    them.render()
    press(them, Qt.Key_Right)
    goes_to(them, "Edit number: 2")
    press(them, Qt.Key_Return)
    them.wait_for("!!document.querySelector('.blocklyHtmlInput')")
    QTest.keyClicks(them.target, "7")
    press(them, Qt.Key_Return)
    goes_to(them, "Edit number: 7")
    program = compile_behaviour(them.newest(), [])
    assert "wait(7)" in program.source
    assert not program.problems


def test_robot_block_is_found_by_search_and_inserted_at_the_focus(qtbot, view, them):
    press(them, Qt.Key_Tab)
    to_the_canvas(them)
    press(them, Qt.Key_Down)
    goes_to(them, "when started")
    view.open_search()
    goes_to(them, "Find a block")
    QTest.keyClicks(them.target, "say")
    them.wait_for("document.querySelector('.blocklyFlyout .blocklyBlock')?.textContent.includes('say')")
    press(them, Qt.Key_Return)
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    press(them, Qt.Key_Return)
    qtbot.waitUntil(lambda: "next" in them.tops()[0], timeout=WAIT_MS)
    assert them.tops()[0]["next"]["block"]["type"] == "robot_pepper_do_say"
    them.wait_for("!document.querySelector('.blocklyDragging')")
    them.render()
    them.wait_for("document.querySelector('.nepSearch input').value", "")
    press(them, Qt.Key_Right)
    goes_to(them, "Pepper")


def test_search_finds_blocks_by_synonyms_and_word_parts_and_reports_no_match(view, them):
    first = "document.querySelector('.blocklyFlyout .blocklyBlock')?.getAttribute('class') ?? ''"
    labels = "[...document.querySelectorAll('.blocklyFlyoutLabel')]"
    shown = f"{labels}.map(each => each.textContent.replace(/\\u00a0/g, ' '))"
    for words, block_type in (
        ("append", "lists_add"),
        ("loop", "control_repeat"),
        ("rep fore", "control_forever"),
    ):
        view.open_search()
        goes_to(them, "Find a block")
        QTest.keyClicks(them.target, words)
        them.wait_for(f"({first}).includes({block_type!r})")
    begin_to_search(them)
    QTest.keyClicks(them.target, "zzz")
    them.wait_for(f"({shown})[0]", "No blocks match “zzz”")
    assert "turn" in them.ask(f"({shown})[1]")
    press(them, Qt.Key_Escape)
    them.wait_for("getComputedStyle(document.querySelector('.blocklyFlyout')).display", "none")


def test_down_key_in_an_empty_search_focuses_the_categories(view, them):
    view.open_search()
    goes_to(them, "Find a block")
    press(them, Qt.Key_Down)
    goes_to(them, "events")


def test_find_in_workspace_wraps_around_and_focuses_the_match_on_close(view, them):
    view.open_find()
    goes_to(them, "Find in blocks")
    count = "document.querySelector('.nepFind span').textContent"
    now = "[...document.querySelectorAll('.nepFoundNow')].map(e => e.dataset.id)"
    QTest.keyClicks(them.target, "wa")
    them.wait_for(count, "1 of 1")
    them.wait_for(now, ["w"])
    QTest.keyClicks(them.target, "x")
    them.wait_for(count, "No results")
    press(them, Qt.Key_Backspace, Qt.Key_Backspace, Qt.Key_Backspace)
    QTest.keyClicks(them.target, "t")
    them.wait_for(count, "1 of 2")
    press(them, Qt.Key_Return)
    them.wait_for(count, "2 of 2")
    press(them, Qt.Key_Return)
    them.wait_for(now, ["start"])
    press(them, Qt.Key_Escape)
    goes_to(them, "when started")
    them.wait_for("document.querySelectorAll('.nepFound').length", 0)
    press(them, Qt.Key_Down)
    goes_to(them, "wait")


def test_f1_explains_the_focused_block_and_otherwise_reaches_the_window(qtbot, view, them):
    window = QMainWindow()
    qtbot.addWidget(window)
    pressed: list[str] = []
    action = QAction("keys", window)
    action.setShortcut("F1")
    action.triggered.connect(lambda: pressed.append("window"))
    window.addAction(action)
    window.setCentralWidget(view)
    window.resize(1300, 700)
    window.show()
    window.activateWindow()
    take_the_keys(them)
    press(them, Qt.Key_Tab)
    goes_to(them, "events")
    them.press(Qt.Key_F1)
    qtbot.waitUntil(lambda: pressed == ["window"], timeout=WAIT_MS)
    to_the_canvas(them)
    press(them, Qt.Key_Down, Qt.Key_Down)
    goes_to(them, "wait")
    qtbot.waitUntil(lambda: view._is_block_focused, timeout=WAIT_MS)
    them.press(Qt.Key_F1)
    them.wait_for(f"({CARD}).includes('Waits this number of seconds')")
    goes_to(them, "Close help")
    assert "secondsa number; 2 by default" in them.ask(CARD)
    press(them, Qt.Key_Escape)
    goes_to(them, "wait")
    them.wait_for(CARD, "")
    assert pressed == ["window"]
    view.setParent(None)  # the test owns the view, not the window


def test_context_menu_help_explains_a_block_on_the_canvas(view, them):
    box = them.box("[data-id=w] > .blocklyPath")
    at = (round(box["left"] + 14), round(box["top"] + 20))
    QTest.mouseClick(them.target, Qt.RightButton, pos=QPoint(*at))
    items = "[...document.querySelectorAll('.blocklyMenuItem')].map(e => e.textContent)"
    number_of = f"({items}).findIndex(each => each.startsWith('Help'))"
    them.wait_for(f"{number_of} >= 0")
    them.ask(f"document.querySelectorAll('.blocklyMenuItem')[{number_of}].setAttribute('data-test', 'help')")
    them.click("[data-test=help]")
    them.wait_for(f"({CARD}).includes('Waits this number of seconds')")


def test_colour_is_selected_with_the_keyboard(qtbot, view, person):
    light = block("robot_pepper_do_light", "l", ROBOT="Pepper", WHERE="eyes", COLOUR="#ffffff")
    them = person(state=workspace(light | {"x": 60, "y": 60}))
    take_the_keys(them)
    press(them, Qt.Key_Tab)
    to_the_canvas(them)
    press(them, Qt.Key_Down, Qt.Key_Right, Qt.Key_Right, Qt.Key_Right)
    goes_to(them, "colour: white")
    press(them, Qt.Key_Return)
    them.wait_for("document.activeElement.title", "white")
    press(them, Qt.Key_Right, Qt.Key_Down)
    them.wait_for("document.activeElement.title", "blue")
    press(them, Qt.Key_Return)
    goes_to(them, "colour: blue")
    assert them.tops()[0]["fields"]["COLOUR"] == "#0a5cff"


def test_aria_labels_of_blocks_contain_no_placeholders(them):
    press(them, Qt.Key_Tab)
    to_the_canvas(them)
    press(them, Qt.Key_Down)
    goes_to(them, "Start of a stack, when started")
    press(them, Qt.Key_Down)
    goes_to(them, "wait, 5, s")
    assert "empty" not in them.ask("document.activeElement.getAttribute('aria-label')").lower()


def test_button_on_a_block_has_a_label_and_is_activated_by_enter(qtbot, view, person):
    them = person(state=workspace(list_of() | {"id": "l", "x": 60, "y": 60}))
    take_the_keys(them)
    press(them, Qt.Key_Tab)
    to_the_canvas(them)
    press(them, Qt.Key_Down, Qt.Key_Right)
    goes_to(them, "Remove the last slot")
    press(them, Qt.Key_Right)
    goes_to(them, "Add a slot")
    press(them, Qt.Key_Return)
    qtbot.waitUntil(lambda: them.tops()[0]["extraState"] == {"items": 1}, timeout=WAIT_MS)


def test_enter_on_a_text_field_opens_its_editor(qtbot, view, person):
    say = block("robot_pepper_do_say", "s", ROBOT="Pepper")
    say["inputs"] = {"TEXT": {"shadow": {"type": "values_text", "id": "t", "fields": {"TEXT": "Hello"}}}}
    them = person(state=workspace(say | {"x": 60, "y": 60}))
    take_the_keys(them)
    press(them, Qt.Key_Tab)
    to_the_canvas(them)
    press(them, Qt.Key_Down, Qt.Key_Right, Qt.Key_Right)
    goes_to(them, "Hello")
    press(them, Qt.Key_Return)
    them.wait_for("!!document.querySelector('.blocklyHtmlInput')")
    QTest.keyClicks(them.target, "Good day")
    press(them, Qt.Key_Return)
    qtbot.waitUntil(lambda: "Good day" in str(them.tops()), timeout=WAIT_MS)


def test_value_of_the_wrong_type_for_the_focused_slot_shows_the_reason(qtbot, view, them):
    to_the_canvas(them)
    press(them, Qt.Key_Down, Qt.Key_Down, Qt.Key_Right)
    goes_to(them, "Edit number: 5")
    begin_to_search(them)
    QTest.keyClicks(them.target, "empty list")
    them.wait_for("document.querySelector('.blocklyFlyout .lists_empty') !== null")
    press(them, Qt.Key_Return)
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    press(them, Qt.Key_Return)
    them.wait_for("document.querySelector('.nepWhy').textContent", "“wait” needs a number here")
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)


def test_shift_tab_moves_focus_out_of_the_search(them):
    begin_to_search(them)
    them.press(Qt.Key_Tab, Qt.ShiftModifier)
    them.wait_for("document.activeElement.closest('.blocklyToolbox') === null")
