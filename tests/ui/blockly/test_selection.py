"""Tests of selecting several blocks by rubber band, clicks or Select all, and of editing the selection."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.messages import HistoryChanged
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import number, robot, started, workspace
from tests.ui.blockly_person import WAIT_MS, Person, editor, received

pytestmark = pytest.mark.web

CHOSEN = "[...document.querySelectorAll('.nepTab:not([hidden]) .nepChosen')].map(e => e.dataset.id).sort()"
OUTLINED = "[...document.querySelectorAll('.nepTab:not([hidden]) .nepChosen > .nepSelection')].length"


def wait_block(id: str, below: dict | None = None) -> dict:
    block = {"type": "control_wait", "id": id, "inputs": {"SECONDS": {"shadow": number(1)}}}
    return block | ({"next": {"block": below}} if below else {})


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


@pytest.fixture
def can_undo(view) -> list[bool]:
    """Return the list of reports whether undo is available; the newest is the last."""
    return received(view, HistoryChanged, "can_undo")


@pytest.fixture
def them(view, person) -> Person:
    """Simulated user of a script of a start and three waits, and two separate waits to its right."""
    QGuiApplication.clipboard().setText("")
    script = started(wait_block("a", wait_block("b", wait_block("c")))) | {"id": "start", "x": 60, "y": 60}
    state = workspace(script, wait_block("d") | {"x": 420, "y": 60}, wait_block("e") | {"x": 420, "y": 200})
    made: Person = person(state=state)
    made.view.setFocus()
    made.wait_for("document.hasFocus()")
    return made


def click(them: Person, id: str, modifier=Qt.NoModifier) -> None:
    box = them.box(f".nepTab:not([hidden]) [data-id={id}] > .blocklyPath")
    at = QPoint(round(box["left"] + 14), round(box["top"] + 14))
    QTest.mouseClick(them.target, Qt.LeftButton, modifier, at)


def frame(them: Person, first: str, last: str, modifier=Qt.ShiftModifier) -> None:
    """Draw a rubber band from above the first block to below the last."""
    one, other = (them.box(f"[data-id={each}] > .blocklyPath") for each in (first, last))
    start = QPoint(round(one["left"] - 12), round(one["top"] - 6))
    end = QPoint(round(other["right"] + 8), round(other["bottom"] - 8))
    QTest.mousePress(them.target, Qt.LeftButton, modifier, start)
    them.move(start, end)
    QTest.mouseRelease(them.target, Qt.LeftButton, modifier, end)


def undo(them: Person, known: list[bool]) -> None:
    """Undo the last step as soon as the page reports it."""
    them.until(lambda: known and known[-1], "there is something to undo")
    them.press(Qt.Key_Z, Qt.ControlModifier)


def way(them: Person, id: str, before: dict) -> tuple[float, float]:
    """Return how far a script has moved since `before`, as (x, y)."""
    now = by_id(them)[id]
    return now["x"] - before["x"], now["y"] - before["y"]


def by_id(them: Person) -> dict[str, dict]:
    return {top["id"]: top for top in them.tops()}


def ids(top: dict) -> list[str]:
    below = top.get("next", {}).get("block")
    return [top["id"], *(ids(below) if below else [])]


def test_rubber_band_selects_intersected_blocks_without_scrolling_the_canvas(them):
    before = them.box("[data-id=e] > .blocklyPath")
    frame(them, "d", "e")
    them.wait_for(CHOSEN, ["d", "e"])
    them.wait_for(OUTLINED, 2)
    assert them.box("[data-id=e] > .blocklyPath") == before
    them.press(Qt.Key_Escape)
    them.wait_for(CHOSEN, [])


def test_selection_button_makes_the_next_drag_draw_one_rubber_band(them):
    them.click(".nepFrameButton")
    frame(them, "d", "e", Qt.NoModifier)
    them.wait_for(CHOSEN, ["d", "e"])
    them.wait_for("document.querySelector('.nepFrameButton').getAttribute('aria-pressed')", "false")


@pytest.mark.parametrize("key", [Qt.ControlModifier, Qt.ShiftModifier])
def test_modifier_click_toggles_selection_and_plain_click_clears_the_selection(them, key):
    click(them, "d")
    click(them, "e", key)
    click(them, "b", key)
    them.wait_for(CHOSEN, ["b", "d", "e"])
    click(them, "d", key)
    them.wait_for(CHOSEN, ["b", "e"])
    click(them, "a")
    them.wait_for(CHOSEN, [])


def test_dragging_moves_all_selected_blocks_and_a_single_undo_reverts_the_move(qtbot, them, can_undo):
    before = them.tops()
    click(them, "d")
    click(them, "e", Qt.ControlModifier)
    them.wait_for(CHOSEN, ["d", "e"])
    start = them.hold("[data-id=e] > .blocklyPath")
    end = start + QPoint(110, 90)
    them.move(start, end)
    them.drop(end)
    # The dragged block snaps to the grid after the next frame, which may be delayed.
    qtbot.waitUntil(lambda: way(them, "e", before[2]) != (0, 0), timeout=WAIT_MS)
    qtbot.waitUntil(lambda: way(them, "d", before[1]) == way(them, "e", before[2]), timeout=WAIT_MS)
    assert way(them, "d", before[1])[0] > 60
    them.wait_for(CHOSEN, ["d", "e"])
    undo(them, can_undo)
    qtbot.waitUntil(lambda: them.tops() == before, timeout=WAIT_MS)


def test_selected_blocks_inside_a_script_are_moved_and_the_remaining_blocks_reconnect(qtbot, them, can_undo):
    before = them.tops()
    click(them, "a")
    click(them, "b", Qt.ControlModifier)
    click(them, "e", Qt.ControlModifier)
    them.wait_for(CHOSEN, ["a", "b", "e"])
    start = them.hold("[data-id=b] > .blocklyPath")
    end = start + QPoint(160, 220)
    them.move(start, end)
    them.drop(end)
    qtbot.waitUntil(lambda: len(them.tops()) == 4, timeout=WAIT_MS)
    assert sorted(ids(top) for top in them.tops()) == [["a", "b"], ["d"], ["e"], ["start", "c"]]
    undo(them, can_undo)
    qtbot.waitUntil(lambda: them.tops() == before, timeout=WAIT_MS)


def test_delete_removes_all_selected_blocks_in_one_undo_step(qtbot, them, can_undo):
    before = by_id(them)
    click(them, "b")
    click(them, "d", Qt.ControlModifier)
    them.wait_for(CHOSEN, ["b", "d"])
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: sorted(map(ids, them.tops())) == [["e"], ["start", "a", "c"]], timeout=WAIT_MS)
    undo(them, can_undo)
    qtbot.waitUntil(lambda: by_id(them) == before, timeout=WAIT_MS)


def test_dropping_on_the_bin_deletes_all_dragged_blocks(qtbot, them, can_undo):
    before = by_id(them)
    frame(them, "d", "e")
    them.wait_for(CHOSEN, ["d", "e"])
    button = them.box(".nepBin")
    start = them.hold("[data-id=d] > .blocklyPath")
    end = QPoint(round(button["left"] + 12), round(button["top"] + 12))
    them.move(start, end)
    them.drop(end)
    qtbot.waitUntil(lambda: list(by_id(them)) == ["start"], timeout=WAIT_MS)
    undo(them, can_undo)
    qtbot.waitUntil(lambda: by_id(them) == before, timeout=WAIT_MS)


def test_pasted_copies_keep_their_relative_positions(qtbot, them, can_undo):
    before = by_id(them)
    frame(them, "d", "e")
    them.wait_for(CHOSEN, ["d", "e"])
    them.press(Qt.Key_C, Qt.ControlModifier)
    them.press(Qt.Key_V, Qt.ControlModifier)
    qtbot.waitUntil(lambda: len(them.tops()) == 5, timeout=WAIT_MS)
    one, other = (top for id, top in by_id(them).items() if id not in before)
    assert other["y"] - one["y"] == before["e"]["y"] - before["d"]["y"]
    assert other["x"] == one["x"]
    new = sorted([one["id"], other["id"]])
    them.wait_for(CHOSEN, new)
    undo(them, can_undo)
    qtbot.waitUntil(lambda: by_id(them) == before, timeout=WAIT_MS)


def test_select_all_selects_every_block_and_the_menu_shows_the_count(qtbot, them):
    click(them, "d")
    them.press(Qt.Key_A, Qt.ControlModifier)
    them.wait_for(CHOSEN, ["a", "b", "c", "d", "e", "start"])
    box = them.box("[data-id=d] > .blocklyPath")
    at = QPoint(round(box["left"] + 14), round(box["top"] + 14))
    QTest.mouseClick(them.target, Qt.RightButton, Qt.NoModifier, at)
    rows = "[...document.querySelectorAll('.blocklyContextMenu .nepMenuRow > span')].map(e => e.textContent)"
    qtbot.waitUntil(lambda: "Delete 6 blocks" in them.ask(rows), timeout=WAIT_MS)
    assert "Add a note" not in them.ask(rows)


def test_all_selected_blocks_are_disabled_together(qtbot, them):
    click(them, "d")
    click(them, "e", Qt.ControlModifier)
    them.wait_for(CHOSEN, ["d", "e"])
    them.press(Qt.Key_E, Qt.ControlModifier)
    qtbot.waitUntil(
        lambda: [id for id, top in by_id(them).items() if top.get("disabledReasons")] == ["d", "e"],
        timeout=WAIT_MS,
    )
