"""Tests of deleting blocks by dragging, and of the bin from which they can be restored."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt

from app.ui.blockly.messages import BlocksDeleted
from tests.ui.blockly_person import START, WAIT_MS, Person, received, workspace

pytestmark = pytest.mark.web

WAITS = {
    "type": "control_wait",
    "id": "one",
    "x": 84,
    "y": 224,
    "next": {"block": {"type": "control_wait", "id": "two"}},
}
HINT = "!document.querySelector('.nepDropHere').hidden"
IN_BIN = (
    "[...document.querySelectorAll('.nepSheet .blocklyBlockCanvas > .blocklyBlock')].map(e => e.dataset.id)"
)
SHEET = "getComputedStyle(document.querySelector('.blocklyFlyout.nepSheet')).display"
TOOLBOX = QPoint(100, 560)


@pytest.fixture
def them(person) -> Person:
    return person(state=workspace(START, WAITS))


@pytest.fixture
def told(view) -> list[int]:
    return received(view, BlocksDeleted, "count")


def ids(them: Person) -> list[str]:
    return sorted(top["id"] for top in them.tops())


def delete_the_hat(them: Person) -> None:
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.press(Qt.Key_Delete)
    them.wait_for("!document.querySelector('[data-id=start]')")


def open_bin(them: Person) -> None:
    them.click(".nepBin")
    them.wait_for(SHEET, "block")


def centre(them: Person, selector: str) -> QPoint:
    box = them.box(selector)
    return QPoint(round(box["left"] + box["right"]) // 2, round(box["top"] + box["bottom"]) // 2)


def test_block_dragged_over_the_toolbox_shows_the_bin_and_is_deleted_with_undo_offer(qtbot, view, them, told):
    start = them.hold("[data-id=one] > .blocklyPath")
    them.move(start, QPoint(500, 300))
    assert them.ask(HINT) is False
    them.move(QPoint(500, 300), TOOLBOX)
    them.wait_for(HINT)
    assert "Drop here to delete" in them.ask("document.querySelector('.nepDropHere').textContent")
    them.wait_for("getComputedStyle(document.querySelector('.blocklyDragging')).opacity", "0.5")
    them.move(TOOLBOX, QPoint(500, 300))
    them.wait_for(HINT, False)
    them.move(QPoint(500, 300), TOOLBOX)
    them.drop(TOOLBOX)
    qtbot.waitUntil(lambda: told == [2], timeout=WAIT_MS)
    them.wait_for(HINT, False)
    assert ids(them) == ["start"]
    view.undo_deletion()
    qtbot.waitUntil(lambda: ids(them) == ["one", "start"], timeout=WAIT_MS)


def test_dropping_a_block_on_the_open_flyout_deletes_the_block(qtbot, view, them, told):
    view.set_toolbox_pinned(True)
    them.box(".nepCategory.blocklyFlyout .blocklyBlock")
    right = them.box(".nepCategory.blocklyFlyout")["right"]
    end = QPoint(round(right) - 30, 400)
    start = them.hold("[data-id=one] > .blocklyPath")
    them.move(start, end)
    them.wait_for(HINT)
    them.drop(end)
    qtbot.waitUntil(lambda: told == [2], timeout=WAIT_MS)


def test_new_block_returned_to_the_toolbox_does_not_count_as_a_deletion(qtbot, view, them, told):
    them.open_category("Control")
    start = them.hold(".nepCategory .control_wait")
    them.move(start, QPoint(600, 300))
    them.move(QPoint(600, 300), TOOLBOX)
    them.wait_for("!!document.querySelector('.blocklyDraggingDelete')")
    assert them.ask(HINT) is False
    them.drop(TOOLBOX)
    them.wait_for("!document.querySelector('.blocklyDragging')")
    open_bin(them)
    assert them.ask(IN_BIN) == []
    assert told == []


def test_block_dropped_on_the_bin_is_deleted_and_the_bin_lists_the_newest_first(qtbot, view, them, told):
    delete_the_hat(them)
    bin_ = centre(them, ".nepBin")
    start = them.hold("[data-id=one] > .blocklyPath")
    them.move(start, bin_)
    them.wait_for("document.querySelector('.nepBin').classList.contains('nepOver')")
    assert them.ask(HINT) is False
    them.drop(bin_)
    qtbot.waitUntil(lambda: told == [1, 2], timeout=WAIT_MS)
    them.wait_for("document.querySelector('.nepBin').title", "Deleted blocks (2)")
    open_bin(them)
    them.wait_for(IN_BIN, ["one", "start"])


def test_click_on_a_block_in_the_bin_restores_the_block_at_a_visible_position(qtbot, view, them, told):
    start = them.hold("[data-id=one] > .blocklyPath")
    them.move(start, TOOLBOX)
    them.drop(TOOLBOX)
    qtbot.waitUntil(lambda: told == [2], timeout=WAIT_MS)
    open_bin(them)
    them.click(".nepSheet [data-id=one] > .blocklyPath")
    them.wait_for(SHEET, "none")
    qtbot.waitUntil(lambda: ids(them) == ["one", "start"], timeout=WAIT_MS)
    box = them.box(".blocklyMainBackground ~ .blocklyWorkspace [data-id=one], [data-id=one] > .blocklyPath")
    hat = them.box("[data-id=start] > .blocklyPath")
    assert box["left"] > 196
    assert box["top"] > hat["bottom"] or box["left"] > hat["right"]
    open_bin(them)
    assert them.ask(IN_BIN) == []
    view.undo()
    qtbot.waitUntil(lambda: ids(them) == ["start"], timeout=WAIT_MS)


def test_block_dragged_out_of_the_bin_is_restored_on_the_canvas(qtbot, them):
    delete_the_hat(them)
    open_bin(them)
    them.drag(".nepSheet [data-id=start] > .blocklyPath", QPoint(500, 400))
    qtbot.waitUntil(lambda: ids(them) == ["one", "start"], timeout=WAIT_MS)
    them.wait_for(SHEET, "none")


def test_bin_works_with_the_keyboard_only(qtbot, them):
    delete_the_hat(them)
    them.ask("document.querySelector('.nepBin').focus()")
    them.press(Qt.Key_Return)
    them.wait_for("document.activeElement.closest('.nepSheet [data-id=start]') !== null")
    them.press(Qt.Key_Escape)
    them.wait_for(SHEET, "none")
    them.ask("document.querySelector('.nepBin').focus()")
    them.press(Qt.Key_Return)
    them.wait_for("document.activeElement.closest('.nepSheet [data-id=start]') !== null")
    them.press(Qt.Key_Return)
    qtbot.waitUntil(lambda: ids(them) == ["one", "start"], timeout=WAIT_MS)
    them.wait_for("document.activeElement.closest('[data-id=start]') !== null")


def test_undo_of_a_deletion_empties_the_bin_and_redo_fills_the_bin(qtbot, view, them, told):
    delete_the_hat(them)
    full = "document.querySelector('.nepBin').classList.contains('nepFull')"
    them.wait_for(full)
    view.undo()
    them.wait_for(full, False)
    view.redo()
    them.wait_for(full)
    assert told == [1]


def test_block_removed_by_undo_is_not_in_the_bin(qtbot, view, them, told):
    them.open_category("Control")
    them.drag(".nepCategory .control_wait", QPoint(700, 300))
    qtbot.waitUntil(lambda: len(them.tops()) == 3, timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    open_bin(them)
    assert (them.ask(IN_BIN), told) == ([], [])


def test_fix_that_moves_blocks_does_not_count_as_a_deletion(qtbot, view, them, told):
    hat = {**START, "id": "other", "x": 400, "next": {"block": {"type": "control_wait", "id": "three"}}}
    view.apply_edit(workspace(START, WAITS, hat))
    them.wait_for("!!document.querySelector('[data-id=other] [data-id=three]')")
    view.apply_edit(workspace({**START, "next": hat["next"]}, WAITS))
    them.wait_for("!!document.querySelector('[data-id=start] [data-id=three]')")
    them.wait_for("!document.querySelector('[data-id=other]')")
    them.click("[data-id=two] > .blocklyPath", dy=10)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: told != [], timeout=WAIT_MS)
    assert told == [1]
    open_bin(them)
    them.wait_for(IN_BIN, ["two"])


def test_deletion_can_be_undone_after_later_edits(qtbot, view, them, told):
    delete_the_hat(them)
    qtbot.waitUntil(lambda: told == [1], timeout=WAIT_MS)
    them.drag("[data-id=one] > .blocklyPath", QPoint(700, 400))
    qtbot.waitUntil(lambda: them.tops()[0]["x"] > 300, timeout=WAIT_MS)
    them.wait_for("!document.querySelector('.blocklyDragging')")
    view.undo_deletion()
    qtbot.waitUntil(lambda: ids(them) == ["one", "start"], timeout=WAIT_MS)
    assert all(top["x"] > 300 for top in them.tops() if top["id"] == "one")


def test_bin_holds_at_most_fifty_deletions_and_each_behaviour_has_its_own_bin(qtbot, view, them):
    many = [START | {"id": f"s{n}", "x": 60 * (n % 10), "y": 90 * (n // 10)} for n in range(53)]
    view.show_tab("many", workspace(*many))
    them.wait_for("!!document.querySelector('[data-id=s52]')")
    for number in range(53):
        view.show_block(f"s{number}")
        them.wait_for(f"document.activeElement.closest('[data-id=s{number}]') !== null")
        them.press(Qt.Key_Delete)
        them.wait_for(f"!document.querySelector('[data-id=s{number}]')")
    them.wait_for("document.querySelector('.nepBin').title", "Deleted blocks (50)")
    view.show_tab("other", workspace(START))
    them.wait_for("document.querySelector('.nepBin').title", "Deleted blocks")
