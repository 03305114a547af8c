"""Tests that moving, resizing, opening and closing a note is reported as an edit and is one undo step."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import number, robot, started, workspace
from tests.ui.blockly_person import WAIT_MS, Person, editor

pytestmark = pytest.mark.web

ON_BLOCK = {"text": "Ask Maria", "pinned": True, "width": 230, "height": 128, "x": 420, "y": 80}
ON_CANVAS = {"text": "To do", "id": "todo", "x": 420, "y": 300, "width": 200, "height": 120}
HEADS = {"block": ".nepNote .blocklyDraggable", "canvas": ".blocklyCommentTopbarBackground"}
CORNERS = {"block": ".nepNote .blocklyResizeHandle", "canvas": ".blocklyComment .blocklyResizeHandle"}

Note = dict


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


@pytest.fixture
def told(view) -> list[dict]:
    """Return the list of programs that the page reports; the newest is the last."""
    programs: list[dict] = []
    view.changed.connect(lambda _key, program: programs.append(dict(program.blocks)))
    return programs


@pytest.fixture
def them(qtbot, view, told, person) -> Person:
    wait = {"type": "control_wait", "id": "wait", "inputs": {"SECONDS": {"shadow": number(1)}}}
    wait["icons"] = {"comment": ON_BLOCK}
    script = started(wait) | {"id": "start", "x": 60, "y": 60}
    made: Person = person(state=workspace(script) | {"workspaceComments": [ON_CANVAS]})
    view.setFocus()
    made.wait_for("document.hasFocus()")
    made.box(".nepNote textarea")
    return made


def on_block(program: dict) -> Note:
    (start,) = program["blocks"]["blocks"]
    return dict(start["next"]["block"]["icons"]["comment"])


def on_canvas(program: dict) -> Note:
    (note,) = program["workspaceComments"]
    return dict(note)


WHICH: dict[str, Callable[[dict], Note]] = {"block": on_block, "canvas": on_canvas}


def drag(them: Person, selector: str, inside: QPoint, way: QPoint) -> None:
    box = them.box(selector)
    start = QPoint(round(box["left"]), round(box["top"])) + inside
    QTest.mouseMove(them.target, start)
    QTest.mousePress(them.target, Qt.LeftButton, pos=start)
    them.move(start, start + way)
    them.drop(start + way)


def one_step(qtbot, them: Person, told: list[dict], which: str, before: dict) -> Note:
    """Wait for the reported change of a note, undo and redo it; return the changed note."""
    qtbot.waitUntil(lambda: bool(told) and WHICH[which](told[-1]) != WHICH[which](before), timeout=WAIT_MS)
    them.wait_for("!document.querySelector('.blocklyDragging')")
    them.render()  # what was dropped snaps to the grid
    qtbot.waitUntil(lambda: told[-1] == them.newest(), timeout=WAIT_MS)
    changed = WHICH[which](told[-1])
    them.view.undo()
    qtbot.waitUntil(lambda: told[-1] == before, timeout=WAIT_MS)
    them.view.redo()
    qtbot.waitUntil(lambda: WHICH[which](told[-1]) == changed, timeout=WAIT_MS)
    return changed


@pytest.mark.parametrize("which", WHICH)
def test_moving_a_note_is_reported_and_is_one_undo_step(qtbot, them, told, which):
    before = them.newest()
    drag(them, HEADS[which], QPoint(60, 8), QPoint(84, 56))
    after = one_step(qtbot, them, told, which, before)
    was = WHICH[which](before)
    assert abs(after["x"] - was["x"] - 84) < 30
    assert abs(after["y"] - was["y"] - 56) < 30


@pytest.mark.parametrize("which", WHICH)
def test_resizing_a_note_is_reported_and_is_one_undo_step(qtbot, them, told, which):
    before = them.newest()
    drag(them, CORNERS[which], QPoint(4, 4), QPoint(60, 40))
    after = one_step(qtbot, them, told, which, before)
    was = WHICH[which](before)
    assert after["width"] > was["width"] + 40
    assert after["height"] > was["height"] + 20


def test_closing_and_reopening_a_note_are_reported_as_edits_and_closing_is_one_undo_step(qtbot, them, told):
    before = them.newest()
    them.click(".nepNoteSign", dx=8, dy=8)
    assert one_step(qtbot, them, told, "block", before)["pinned"] is False
    them.wait_for("document.querySelector('.nepNote') === null")
    them.click(".nepNoteSign", dx=8, dy=8)
    qtbot.waitUntil(lambda: told[-1] == before, timeout=WAIT_MS)


def test_collapsing_a_canvas_note_is_reported_and_is_one_undo_step(qtbot, them, told):
    before = them.newest()
    them.click(".blocklyComment .blocklyFoldoutIcon", dx=6, dy=6)
    assert one_step(qtbot, them, told, "canvas", before)["collapsed"] is True


def test_undo_restores_a_removed_note_unchanged(qtbot, them, told):
    before = them.newest()
    them.click(".nepNoteButton:last-of-type", dx=8, dy=8)
    qtbot.waitUntil(lambda: bool(told) and "icons" not in str(told[-1]), timeout=WAIT_MS)
    them.view.undo()
    qtbot.waitUntil(lambda: told[-1] == before, timeout=WAIT_MS)
