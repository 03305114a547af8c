"""Tests of adding and removing branches of an *if* block with its buttons, its menu and the keyboard."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import block, boolean, started, text, workspace, write
from tests.ui.blockly.test_block_menu import choose, looked_at, open_menu
from tests.ui.blockly_person import WAIT_MS, Person, editor

pytestmark = pytest.mark.web

BUTTONS = "document.querySelectorAll('[data-id=if] > .nepButton').length"


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([]))


def choice(extra: dict | None = None, kind: str = "control_if", **parts: object) -> dict:
    made = block(kind, "if", CONDITION=boolean(True), BODY=[write(text("first"))], **parts)
    return workspace(started(made | ({"extraState": extra} if extra else {})) | {"x": 40, "y": 40})


def full() -> dict:
    return choice(
        {"elseIfs": 2, "else": True},
        CONDITION1=boolean(False) | {"id": "c1"},
        BODY1=[write(text("second")) | {"id": "b1"}],
        CONDITION2=boolean(True) | {"id": "c2"},
        BODY2=[write(text("third")) | {"id": "b2"}],
        ELSE=[write(text("none")) | {"id": "last"}],
    )


def the_if(them: Person) -> dict:
    return dict(them.tops()[0]["next"]["block"])


def shape(them: Person) -> object:
    return the_if(them).get("extraState")


def press_button(them: Person, number: int) -> None:
    """Press a button of the *if* block: 0 is the plus, followed by a minus for each branch.

    Buttons are sorted by position: the page adds a new button before it renders the block again, so the
    order of elements is not the order on the screen.
    """
    buttons = "[...document.querySelectorAll('[data-id=if] > .nepButton')]"
    them.ask(f"{buttons}.forEach((each, at) => each.setAttribute('data-test', at))")
    places = range(them.ask(f"{buttons}.length"))
    tops = {at: them.box(f"[data-id=if] > [data-test='{at}']")["top"] for at in places}
    pressed = sorted(tops, key=lambda at: tops[at])[number]
    them.click(f"[data-id=if] > [data-test='{pressed}']", dx=9, dy=9)


def test_branches_round_trip_and_the_if_else_block_of_older_files_is_loaded(person):
    them: Person = person(state=full())
    assert the_if(them) == full()["blocks"]["blocks"][0]["next"]["block"] | the_if(them)
    assert {"CONDITION2", "BODY2", "ELSE"} <= set(the_if(them)["inputs"])
    looked_at(them, "branches")
    old = choice(kind="control_if_else", ELSE=[write(text("none"))])
    them.view.load(old)
    them.wait_for(BUTTONS, 2)
    assert "extraState" not in the_if(them)
    assert "ELSE" in the_if(them)["inputs"]


def test_plus_button_adds_else_then_else_if_with_undo(qtbot, view, person):
    them: Person = person(state=choice())
    press_button(them, 0)
    qtbot.waitUntil(lambda: shape(them) == {"elseIfs": 0, "else": True}, timeout=WAIT_MS)
    them.wait_for("document.querySelectorAll('[data-id=if] > .nepButton').length", 2)  # block re-rendered
    press_button(them, 0)
    qtbot.waitUntil(lambda: shape(them) == {"elseIfs": 1, "else": True}, timeout=WAIT_MS)
    assert compile_behaviour(them.newest(), []).errors  # the missing condition is the only error
    view.undo()
    qtbot.waitUntil(lambda: shape(them) == {"elseIfs": 0, "else": True}, timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: shape(them) is None, timeout=WAIT_MS)
    view.redo()
    view.redo()
    qtbot.waitUntil(lambda: shape(them) == {"elseIfs": 1, "else": True}, timeout=WAIT_MS)


def test_minus_button_removes_a_branch_and_detaches_its_blocks(qtbot, view, person):
    them: Person = person(state=full())
    before = them.newest()
    press_button(them, 1)
    qtbot.waitUntil(lambda: shape(them) == {"elseIfs": 1, "else": True}, timeout=WAIT_MS)
    inputs = the_if(them)["inputs"]
    assert inputs["CONDITION1"]["block"]["id"] == "c2"
    assert inputs["BODY1"]["block"]["id"] == "b2"
    assert inputs["ELSE"]["block"]["id"] == "last"
    assert {top["id"] for top in them.tops()[1:]} == {"c1", "b1"}
    looked_at(them, "branch-away")
    shown = them.box("[data-id=if] > .blocklyPath")
    assert them.box("[data-id=b1] > .blocklyPath")["left"] > shown["right"]
    view.undo()
    qtbot.waitUntil(lambda: them.newest() == before, timeout=WAIT_MS)
    press_button(them, 3)
    qtbot.waitUntil(lambda: shape(them) == {"elseIfs": 2, "else": False}, timeout=WAIT_MS)
    assert {top["id"] for top in them.tops()[1:]} == {"last"}


def test_context_menu_adds_branches_by_arrow_keys_and_by_click(qtbot, view, person):
    them: Person = person(state=choice())
    rows = open_menu(them, "if")
    assert {"Add “else if”", "Add “else”"} <= set(rows)
    for _ in range(rows.index("Add “else if”") + 1):
        them.press(Qt.Key_Down)
    them.press(Qt.Key_Return)
    qtbot.waitUntil(lambda: shape(them) == {"elseIfs": 1, "else": False}, timeout=WAIT_MS)
    choose(them, "if", "Add “else”")
    qtbot.waitUntil(lambda: shape(them) == {"elseIfs": 1, "else": True}, timeout=WAIT_MS)
    assert "Add “else”" not in open_menu(them, "if")
    them.press(Qt.Key_Escape)


def test_collapsed_if_block_has_no_branch_button_labels_in_its_text(person):
    them: Person = person(state=full())
    choose(them, "if", "Collapse")
    them.wait_for("document.querySelector('[data-id=if]').classList.contains('blocklyCollapsed')")
    looked_at(them, "branches-folded")
    words = str(them.ask("document.querySelector('[data-id=if] > .blocklyField').textContent"))
    assert "branch" not in words
