"""Tests of notes on the canvas that are selected, moved, copied and deleted together with blocks."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.messages import HistoryChanged
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import robot, started, workspace
from tests.ui.blockly.test_block_menu import ROWS, looked_at
from tests.ui.blockly.test_selection import CHOSEN, click, undo, wait_block
from tests.ui.blockly_person import WAIT_MS, Person, editor, received

pytestmark = pytest.mark.web

HEAD = ".blocklyCommentTopbarBackground"


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


@pytest.fixture
def can_undo(view) -> list[bool]:
    return received(view, HistoryChanged, "can_undo")


def note(id: str, y: int) -> dict:
    return {"id": id, "text": f"about {id}", "x": 420, "y": y, "width": 180, "height": 90}


@pytest.fixture
def them(view, person) -> Person:
    """Simulated user of a script, a separate wait block and two notes."""
    QGuiApplication.clipboard().setText("")
    script = started(wait_block("a")) | {"id": "start", "x": 60, "y": 60}
    state = workspace(script, wait_block("d") | {"x": 420, "y": 60})
    made: Person = person(state=state | {"workspaceComments": [note("one", 160), note("two", 300)]})
    made.view.setFocus()
    made.wait_for("document.hasFocus()")
    return made


def frame_right(them: Person) -> None:
    """Draw a rubber band around the separate block and the first note."""
    block, sheet = them.box("[data-id=d] > .blocklyPath"), them.box("[data-id=one] .blocklyCommentHighlight")
    start = QPoint(round(block["left"] - 12), round(block["top"] - 8))
    end = QPoint(round(sheet["right"] + 8), round(sheet["bottom"] - 20))
    QTest.mousePress(them.target, Qt.LeftButton, Qt.ShiftModifier, start)
    them.move(start, end)
    QTest.mouseRelease(them.target, Qt.LeftButton, Qt.ShiftModifier, end)
    them.wait_for(CHOSEN, ["d", "one"])


def press_head(them: Person, id: str, modifier=Qt.NoModifier, button=Qt.LeftButton) -> QPoint:
    box = them.box(f"[data-id={id}] {HEAD}")
    at = QPoint(round(box["left"] + 70), round(box["top"] + 8))
    QTest.mousePress(them.target, button, modifier, at)
    return at


def click_head(them: Person, id: str, modifier=Qt.NoModifier, button=Qt.LeftButton) -> None:
    at = press_head(them, id, modifier, button)
    QTest.mouseRelease(them.target, button, modifier, at)


def notes(state: dict) -> dict[str, dict]:
    return {each["id"]: each for each in state.get("workspaceComments", [])}


def blocks(state: dict) -> dict[str, dict]:
    return {each["id"]: each for each in state["blocks"]["blocks"]}


def way(one: dict, other: dict) -> tuple[float, float]:
    return other["x"] - one["x"], other["y"] - one["y"]


def test_rubber_band_selects_notes_and_delete_removes_the_selection_in_one_step(qtbot, them, can_undo):
    before = them.newest()
    frame_right(them)
    looked_at(them, "chosen-notes")
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: list(notes(them.newest())) == ["two"], timeout=WAIT_MS)
    assert list(blocks(them.newest())) == ["start"]
    undo(them, can_undo)
    qtbot.waitUntil(lambda: notes(them.newest()) == notes(before), timeout=WAIT_MS)
    assert blocks(them.newest()) == blocks(before)


def test_select_all_includes_notes_and_deleting_from_a_note_deletes_all(qtbot, them, can_undo):
    before = them.newest()
    click_head(them, "one")
    them.press(Qt.Key_A, Qt.ControlModifier)
    them.wait_for(CHOSEN, ["a", "d", "one", "start", "two"])
    click_head(them, "two", button=Qt.RightButton)
    qtbot.waitUntil(lambda: "Delete the selection" in them.ask(ROWS), timeout=WAIT_MS)
    them.press(Qt.Key_Escape)
    them.wait_for("document.querySelector('.blocklyContextMenu') === null")
    them.wait_for("document.activeElement.dataset.id", "two")
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: not notes(them.newest()) and "blocks" not in them.newest(), timeout=WAIT_MS)
    undo(them, can_undo)
    qtbot.waitUntil(lambda: notes(them.newest()) == notes(before), timeout=WAIT_MS)
    assert blocks(them.newest()) == blocks(before)


def test_modifier_click_toggles_selection_of_a_note(them):
    click(them, "d")
    click_head(them, "two", Qt.ControlModifier)
    click_head(them, "one", Qt.ControlModifier)
    them.wait_for(CHOSEN, ["d", "one", "two"])
    click_head(them, "one", Qt.ControlModifier)
    them.wait_for(CHOSEN, ["d", "two"])
    click(them, "a")
    them.wait_for(CHOSEN, [])


@pytest.mark.parametrize("held", ["d", "one"])
def test_dragging_moves_blocks_and_notes_and_a_single_undo_reverts_the_move(qtbot, them, can_undo, held):
    before = them.newest()
    frame_right(them)
    start = press_head(them, "one") if held == "one" else them.hold("[data-id=d] > .blocklyPath")
    end = start + QPoint(90, 110)
    them.move(start, end)
    them.drop(end)

    def moved() -> tuple[object, object]:
        now = them.newest()
        return way(notes(before)["one"], notes(now)["one"]), way(blocks(before)["d"], blocks(now)["d"])

    # the dragged note snaps to the grid in the next frame and moves the other selected elements
    qtbot.waitUntil(lambda: moved()[0] == moved()[1] and moved()[0][1] > 80, timeout=WAIT_MS)
    now = them.newest()
    assert notes(now)["two"] == notes(before)["two"]
    undo(them, can_undo)
    qtbot.waitUntil(lambda: notes(them.newest()) == notes(before), timeout=WAIT_MS)
    assert blocks(them.newest()) == blocks(before)


def test_copies_of_blocks_and_notes_keep_their_relative_positions(qtbot, them, can_undo):
    before = them.newest()
    frame_right(them)
    them.press(Qt.Key_C, Qt.ControlModifier)
    them.press(Qt.Key_V, Qt.ControlModifier)
    qtbot.waitUntil(lambda: len(notes(them.newest())) == 3, timeout=WAIT_MS)
    now = them.newest()
    (copy,) = (each for id, each in notes(now).items() if id not in notes(before))
    (block,) = (each for id, each in blocks(now).items() if id not in blocks(before))
    assert copy["text"] == "about one"
    assert way(block, copy) == way(blocks(before)["d"], notes(before)["one"])
    them.wait_for(CHOSEN, sorted([block["id"], copy["id"]]))
    undo(them, can_undo)
    qtbot.waitUntil(lambda: notes(them.newest()) == notes(before), timeout=WAIT_MS)


def test_several_selected_notes_are_cut_and_pasted(qtbot, them):
    click_head(them, "one")
    click_head(them, "two", Qt.ControlModifier)
    them.wait_for(CHOSEN, ["one", "two"])
    them.press(Qt.Key_X, Qt.ControlModifier)
    qtbot.waitUntil(lambda: not notes(them.newest()), timeout=WAIT_MS)
    them.press(Qt.Key_V, Qt.ControlModifier)
    qtbot.waitUntil(lambda: len(notes(them.newest())) == 2, timeout=WAIT_MS)
    assert {each["text"] for each in notes(them.newest()).values()} == {"about one", "about two"}
