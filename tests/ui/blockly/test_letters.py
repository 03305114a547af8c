"""Tests that letters without a modifier do nothing on the canvas, and of the shortcuts of block commands."""

from __future__ import annotations

import json

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from app.ui.shell.actions.shortcuts import FIXED_KEYS
from tests.blocks.samples import number, robot, started, workspace
from tests.ui.blockly_person import WAIT_MS, Person, editor

pytestmark = pytest.mark.web

LETTERS = [chr(code) for code in range(ord("a"), ord("z") + 1)]
TYPED = [*LETTERS, *map(str.upper, LETTERS), *"0123456789"]
SHOWN = """(shown => JSON.stringify({
    flyout: getComputedStyle(document.querySelector('.blocklyFlyout')).display,
    floating: shown('.blocklyWidgetDiv > *, .blocklyDropDownDiv, .nepHelp, .nepFind, .blocklyToast, [open]'),
    chosen: [...document.querySelectorAll('.blocklyToolboxSelected, .blocklySelected')].map(e => e.id),
    blocks: document.querySelectorAll('.blocklyBlock').length,
    moves: document.querySelectorAll('.blocklyDragging').length,
    keys: document.activeElement.id,
    scrolled: document.querySelector('.blocklyBlockCanvas').getAttribute('transform'),
}))(what => [...document.querySelectorAll(what)].filter(e => e.checkVisibility({opacityProperty: true}))
    .map(e => e.className))"""


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


@pytest.fixture
def them(view, person) -> Person:
    saved: dict[str, object] = {"type": "control_wait", "id": "w"}
    saved["inputs"] = {"SECONDS": {"shadow": number(5) | {"id": "n"}}}
    made: Person = person(state=workspace(started(saved) | {"id": "start", "x": 60, "y": 60}))
    view.setFocus()
    made.wait_for("document.hasFocus()")
    made.ask(
        "document.addEventListener('keyup', () => window.pressed = (window.pressed ?? 0) + 1, true) ?? 0"
    )
    return made


def canvas(them: Person) -> QPoint:
    box = them.box(".nepTab:not([hidden]) .injectionDiv, .injectionDiv")
    return QPoint(round(box["right"] - 200), round(box["bottom"] - 200))


def on_the_canvas(them: Person) -> None:
    QTest.mouseClick(them.target, Qt.LeftButton, pos=canvas(them))
    them.wait_for("document.activeElement.className.baseVal !== undefined")


def on_a_block(them: Person) -> None:
    them.click("[data-id=w] > .blocklyPath")
    them.wait_for("!!document.querySelector('.blocklySelected')")


def on_a_block_of_the_toolbox(them: Person) -> None:
    them.open_category("Control")
    them.press(Qt.Key_Right)
    flyout = "document.querySelector('.blocklyFlyout').contains(document.activeElement)"
    them.wait_for(flyout)


@pytest.mark.parametrize("go", [on_the_canvas, on_a_block, on_a_block_of_the_toolbox])
def test_letters_and_digits_without_a_modifier_have_no_effect(them, go):
    go(them)
    program, shown = them.newest(), them.ask(SHOWN)
    assert len(json.loads(shown)) == 7
    them.ask("window.pressed = 0")
    for each in TYPED:
        held = Qt.ShiftModifier if each.isupper() else Qt.NoModifier
        QTest.keyClick(them.target, Qt.Key(ord(each.upper())), held)
    them.wait_for(f"window.pressed >= {len(TYPED)}")
    assert them.newest() == program
    them.wait_for(SHOWN, shown)


def test_block_is_moved_and_dropped_with_the_keyboard(qtbot, them):
    on_a_block(them)
    them.press(Qt.Key_M, Qt.ControlModifier)
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    them.wait_for("document.querySelector('.blocklyToast')?.textContent.includes('to place it')")
    for _ in range(6):
        them.press(Qt.Key_Right, Qt.ControlModifier)
    them.press(Qt.Key_Return)
    them.wait_for("!document.querySelector('.blocklyDragging')")
    them.wait_for("!!document.querySelector('.blocklyToast')", False)  # it is said no longer than it moves
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)


def test_ctrl_shortcuts_detach_a_block_and_enter_and_leave_the_toolbox(qtbot, them):
    on_a_block(them)
    them.press(Qt.Key_X, Qt.ControlModifier | Qt.ShiftModifier)
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    them.press(Qt.Key_B, Qt.ControlModifier)
    them.wait_for("document.activeElement.closest('.blocklyToolbox') !== null")
    them.press(Qt.Key_B, Qt.ControlModifier | Qt.ShiftModifier)
    them.wait_for("document.activeElement.closest('.blocklyToolbox') === null")


def test_repeated_delete_removes_only_the_selected_block(qtbot, them):
    on_a_block(them)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: "next" not in them.tops()[0], timeout=WAIT_MS)
    them.wait_for("document.querySelector('.blocklySelected') === null")
    them.press(Qt.Key_Backspace)
    them.press(Qt.Key_Delete)
    them.press(Qt.Key_Down)  # the focus isn't lost: the arrow key leads to the remaining block
    them.wait_for("document.activeElement.closest('[data-id]')?.dataset.id", "start")
    assert [top["id"] for top in them.tops()] == ["start"]


def test_focus_moves_to_the_connection_of_the_deleted_block(qtbot, them):
    on_a_block(them)
    them.press_and_see(Qt.Key_Up)
    them.press_and_see(Qt.Key_Down)
    them.wait_for("document.activeElement.closest('[data-id]')?.dataset.id", "w")
    them.press(Qt.Key_Delete)
    them.wait_for("document.activeElement.classList.contains('blocklyHighlightedConnectionPath')")
    them.press(Qt.Key_Delete)
    them.press(Qt.Key_Up)
    them.wait_for("document.activeElement.closest('[data-id]')?.dataset.id", "start")
    assert [top["id"] for top in them.tops()] == ["start"]


def test_block_shortcuts_are_listed_as_fixed_shortcuts():
    listed = {key for fixed in FIXED_KEYS if fixed.scope == "Blocks" for key in fixed.keys.split(", ")}
    assert {"Ctrl+D", "Ctrl+M", "Ctrl+L", "Ctrl+B", "Delete", "Alt+Down"} <= listed
