"""Tests of the marks on a collapsed block for hidden notes and breakpoints."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import robot
from tests.ui.blockly.test_block_menu import choose, double_click, looked_at, open_menu, program
from tests.ui.blockly_person import TOKENS, WAIT_MS, Person, editor

pytestmark = pytest.mark.web

MARKS = (
    "[...document.querySelectorAll('.nepInsideMark')].map(e => [e.parentElement.dataset.id, e.classList[1]])"
)
BOTH = [["loop", "nepInside-pause"], ["loop", "nepInside-note"]]
TITLES = "[...document.querySelectorAll('.nepInsideMark title')].map(e => e.textContent)"
FOCUSED = "document.activeElement.closest('[data-id]')?.dataset.id"
NOTE = {"text": "Ask Maria first", "pinned": True, "width": 200, "height": 100, "x": 420, "y": 200}


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


@pytest.fixture
def state() -> dict:
    """Return a program with a collapsed loop around a block with a breakpoint and one with an open note."""
    made = program()
    loop = made["blocks"]["blocks"][0]["next"]["block"]["next"]["block"]
    loop["collapsed"] = True
    first = loop["inputs"]["BODY"]["block"]
    first["data"] = '{"pause":true}'
    first["next"]["block"]["icons"] = {"comment": NOTE}
    return made


@pytest.fixture
def them(view, person, state) -> Person:
    made: Person = person(state=state)
    view.setFocus()
    made.wait_for("document.hasFocus()")
    made.wait_for(MARKS, BOTH)
    return made


def sheet_is_seen(them: Person, seen: bool) -> None:
    them.wait_for("!!document.querySelector('.nepNote')?.getBoundingClientRect().width", seen)


@pytest.mark.parametrize("dark", [False, True])
def test_collapsed_block_shows_a_mark_for_each_kind_of_hidden_content(view, them, dark):
    view.set_theme(TOKENS, dark)
    them.wait_for(MARKS, BOTH)
    sheet_is_seen(them, False)
    looked_at(them, f"inside-{'dark' if dark else 'light'}")
    assert "Contains a note: Ask Maria first" in them.ask(TITLES)


@pytest.mark.parametrize(("name", "id"), [("note", "b"), ("pause", "a")])
def test_click_on_a_mark_expands_the_block_and_focuses_the_marked_item(qtbot, view, them, name, id):
    before = them.newest()
    them.click(f".nepInside-{name}", dx=11, dy=11)
    them.wait_for(MARKS, [])
    them.wait_for(FOCUSED, id)
    sheet_is_seen(them, True)
    view.undo()
    them.wait_for(MARKS, BOTH)
    qtbot.waitUntil(lambda: them.newest() == before, timeout=WAIT_MS)
    sheet_is_seen(them, False)


def test_block_menu_lists_and_focuses_existing_hidden_items(them):
    double_click(them, "loop")
    them.wait_for(MARKS, [])
    choose(them, "a", "Don't pause here")
    double_click(them, "loop")
    them.wait_for(MARKS, BOTH[1:])
    rows = open_menu(them, "loop")
    assert "Show the pause inside this block" not in rows
    them.press(Qt.Key_Escape)
    choose(them, "loop", "Show the note inside this block")
    them.wait_for(FOCUSED, "b")
