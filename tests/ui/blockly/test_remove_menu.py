"""Tests of removing list items and function inputs with the context menu, and of undo."""

from __future__ import annotations

import json

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import call, define, given, list_of, started, text, workspace, write
from tests.ui.blockly_person import Person, editor

pytestmark = pytest.mark.web

MENU = "[...document.querySelectorAll('.blocklyContextMenu .blocklyMenuItem')].map(e => e.textContent)"
LIGHT = "document.querySelector('.blocklyMenuItemHighlight')?.textContent ?? ''"
FOCUSED = "document.activeElement.closest('[data-id]')?.dataset.id"


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([]))


def grey(words: str, id: str) -> dict:
    return {"shadow": {"type": "values_text", "id": id, "fields": {"TEXT": words}}}


def words_list() -> dict:
    """Return a list block with two edited shadow blocks and an ordinary block between them."""
    made = list_of(text("a"), text("b"), text("c")) | {"id": "l"}
    made["inputs"] = {
        "ITEM0": grey("a", "a"),
        "ITEM1": {"block": text("b") | {"id": "b"}, **grey("", "under")},
        "ITEM2": grey("c", "c"),
    }
    return made


def written(saved: dict) -> list[str]:
    """Return the text in each slot."""
    inputs = saved["inputs"]
    each = (inputs[f"ITEM{number}"] for number in range(saved["extraState"]["items"]))
    return [(it.get("block") or it["shadow"])["fields"]["TEXT"] for it in each]


def in_the_gap(them: Person) -> dict:
    said = them.tops()[0]["next"]["block"]
    return said["inputs"]["VALUE"]["block"]


def choose(them: Person, begin: str) -> None:
    """Choose the menu entry that starts with this text, using the arrow keys."""
    them.wait_for(f"{MENU}.some(words => words.startsWith({begin!r}))")
    entries = them.ask(MENU)
    for _ in range(len(entries) + 1):
        lit = str(them.ask(LIGHT))
        if lit.startswith(begin):
            break
        them.press(Qt.Key_Down)
        them.wait_for(f"({LIGHT}) !== {json.dumps(lit)}")
    assert str(them.ask(LIGHT)).startswith(begin)
    them.press(Qt.Key_Return)
    them.wait_for(f"{MENU}.length", 0)


def right_click(them: Person, selector: str) -> None:
    box = them.box(selector)
    at = QPoint(round(box["left"] + 8), round((box["top"] + box["bottom"]) / 2))
    QTest.mouseClick(them.target, Qt.RightButton, pos=at)


def test_list_item_with_shadow_block_is_removed_by_keyboard_menu(view, person):
    them = person(state=workspace(started(write(words_list())) | {"x": 40, "y": 40}))
    view.setFocus()
    them.wait_for("document.hasFocus()")
    view.show_block("a")
    them.wait_for(FOCUSED, "a")
    before = them.newest()
    them.press(Qt.Key_F10, Qt.ShiftModifier)
    choose(them, "Remove item 1 from the list")
    them.until(lambda: written(in_the_gap(them)) == ["b", "c"], "the first one is gone")
    assert in_the_gap(them)["inputs"]["ITEM0"]["block"]["id"] == "b"
    them.wait_for(FOCUSED, "b")
    view.undo()
    them.until(lambda: them.newest() == before, "all as it was")


def test_list_item_under_mouse_is_removed_by_context_menu(view, person):
    them = person(state=workspace(words_list() | {"x": 40, "y": 40}))
    before = them.newest()
    right_click(them, "[data-id=b] > .blocklyPath")
    choose(them, "Remove item 2 from the list")
    them.until(lambda: written(them.tops()[0]) == ["a", "c"], "the middle one is gone")
    view.undo()
    them.until(lambda: them.newest() == before, "all as it was")
    right_click(them, "[data-id=c] > .blocklyPath")
    choose(them, "Remove item 3 from the list")
    them.until(lambda: written(them.tops()[0]) == ["a", "b"], "the last one is gone")
    right_click(them, "[data-id=l] > .blocklyPath")
    them.wait_for(f"{MENU}.length > 0")
    assert not any(words.startswith("Remove item") for words in them.ask(MENU))


def test_removing_a_function_input_updates_its_calls_and_can_be_undone(view, person):
    greet = define("g", "greet", ("who", "when"), write(given("who")))
    use = call("g", id="c", who=text("Ada"), when=text("now"))
    them = person(state=workspace(started(use) | {"x": 28, "y": 28}, greet | {"x": 28, "y": 252}))
    right_click(them, "[data-id=g] > .blocklyPath")
    choose(them, "Remove the input “who”")
    shown = "document.querySelector('[data-id=c]').textContent"
    them.wait_for(f"{shown}.includes('when') && !{shown}.includes('who')")
    view.undo()
    them.wait_for(f"{shown}.includes('when') && {shown}.includes('who')")
