"""Tests of dragging blocks and notes out of the page and onto another tab."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest

from app.ui.blockly.messages import (
    BlocksDeleted,
    BlocksDraggedOutside,
    BlocksDroppedOutside,
    BlocksTransferred,
    DragImageRendered,
    HistoryChanged,
    PanelMessage,
)
from tests.ui.blockly_person import START, WAIT_MS, Person, received, workspace

pytestmark = pytest.mark.web

WAITS = {
    "type": "control_wait",
    "id": "one",
    "x": 280,
    "y": 224,
    "next": {
        "block": {"type": "control_wait", "id": "two", "next": {"block": {"type": "control_wait", "id": "3"}}}
    },
}
NOTE = {"height": 100, "width": 160, "id": "note", "x": 420, "y": 56, "text": "Look"}
TWO = ".nepTab:not([hidden]) [data-id=two] > .blocklyPath"
SHOWN = "document.querySelector('.nepTab:not([hidden])')"
ABOVE, LEFT = QPoint(500, -40), QPoint(-30, 300)


class Told:
    def __init__(self, view) -> None:
        self.places: list[QPoint | None] = []
        self.dropped: list[QPoint] = []
        self.brought: list[tuple[int, str]] = []
        self.homes: list[str] = []
        self.pictures: list[tuple[bytes, float]] = []
        self.deleted: list[int] = []
        self._view = view
        view.message_received.connect(self._add)

    def _add(self, message: PanelMessage) -> None:
        match message:
            case BlocksDraggedOutside(position):
                self.places.append(self._view.to_screen(position) if position is not None else None)
            case BlocksDroppedOutside(position):
                self.dropped.append(self._view.to_screen(position))
            case BlocksTransferred(count, how, home):
                self.brought.append((count, how))
                self.homes.append(home)
            case DragImageRendered(png, ratio):
                self.pictures.append((png, ratio))
            case BlocksDeleted(count):
                self.deleted.append(count)


@pytest.fixture
def told(view) -> Told:
    return Told(view)


@pytest.fixture
def them(view, person) -> Person:
    """Simulated user of an editor that shows tab "a" and has shown tab "b" before."""
    view.show_tab("b", workspace(START))
    person_there = person(state=workspace(START))
    view.show_tab("a", {**workspace(START, WAITS), "workspaceComments": [NOTE]})
    person_there.wait_for(f"!!{SHOWN}.querySelector('[data-id=two]')")
    return person_there


def carry(
    them: Person, told: Told, selector: str, to: QPoint, modifiers=Qt.KeyboardModifier.NoModifier
) -> None:
    box = them.box(selector)
    start = QPoint(
        round(box["left"]) + (60 if "Comment" in selector else 12), round(box["top"] + box["bottom"]) // 2
    )
    QTest.mouseMove(them.target, start)
    QTest.mousePress(them.target, Qt.MouseButton.LeftButton, pos=start)
    them.move(start, start + QPoint(60, 30))
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    them.move(start + QPoint(60, 30), to)
    them.until(lambda: told.places[-1:] == [them.view.mapToGlobal(to)], "the window knows where it is")
    QTest.mouseRelease(them.target, Qt.MouseButton.LeftButton, modifiers, to)
    them.wait_for("!!document.querySelector('.blocklyDragging')", False)


def chain(top: dict) -> list[str]:
    below = top.get("next", {}).get("block")
    return [top["type"].rpartition("_")[2], *(chain(below) if below else [])]


def chains(them: Person) -> list[list[str]]:
    return [chain(each) for each in them.tops()]


def bring(qtbot, view, told: Told, key: str = "b") -> None:
    qtbot.waitUntil(lambda: bool(told.dropped), timeout=WAIT_MS)
    view.show_tab(key, {})
    view.move_dragged_blocks()
    qtbot.waitUntil(lambda: bool(told.brought), timeout=WAIT_MS)


BEFORE = [["started"], ["wait", "wait", "wait"]]


@pytest.mark.parametrize("to", [ABOVE, LEFT])
def test_block_dropped_outside_the_page_returns_to_its_position_without_an_edit(
    qtbot, view, them, told, to
) -> None:
    before, changes = them.newest(), []
    view.changed.connect(lambda key, _program: changes.append(key))
    carry(them, told, TWO, to)
    qtbot.waitUntil(lambda: bool(told.dropped), timeout=WAIT_MS)
    assert told.dropped == [view.mapToGlobal(to)]
    them.until(lambda: told.places[-1] is None, "the ring goes")
    them.until(lambda: them.newest() == before, "it is where it was")
    assert (changes, told.deleted) == ([], [])
    them.wait_for("document.querySelector('.nepDropHere').hidden")


def test_window_is_notified_while_a_drag_is_outside_the_page(qtbot, view, them, told) -> None:
    start = them.hold(TWO)
    them.move(start, start + QPoint(60, 30))
    them.move(start + QPoint(60, 30), ABOVE)
    qtbot.waitUntil(lambda: told.places[-1:] == [view.mapToGlobal(ABOVE)], timeout=WAIT_MS)
    them.move(ABOVE, QPoint(600, 300))
    qtbot.waitUntil(lambda: told.places[-1] is None, timeout=WAIT_MS)
    them.drop(QPoint(600, 300))
    qtbot.waitUntil(lambda: chains(them) == [["started"], ["wait"], ["wait", "wait"]], timeout=WAIT_MS)
    assert told.dropped == []


def test_stack_moved_to_another_tab_is_one_undo_step_in_each_tab(qtbot, view, them, told) -> None:
    carry(them, told, TWO, ABOVE)
    bring(qtbot, view, told)
    assert told.brought == [(2, "moved")]
    assert chains(them) == [["started"], ["wait", "wait"]]
    them.wait_for(f"{SHOWN}.querySelectorAll('.blocklySelected').length", 1)
    view.undo()
    qtbot.waitUntil(lambda: chains(them) == [["started"]], timeout=WAIT_MS)
    view.show_tab("a", {})
    them.until(lambda: chains(them) == [["started"], ["wait"]], "it is gone there")
    view.undo()
    qtbot.waitUntil(lambda: chains(them) == BEFORE, timeout=WAIT_MS)
    assert told.deleted == [], "it is no deletion"
    assert them.ask("document.querySelector('.nepBin').title") == "Deleted blocks"


@pytest.mark.parametrize("edited", [False, True])
def test_undo_from_the_toast_reverts_the_move_in_both_tabs(qtbot, view, them, told, edited: bool) -> None:
    carry(them, told, TWO, ABOVE)
    bring(qtbot, view, told)
    rest = [["started"]]
    if edited:
        rest = []
        them.click(".nepTab:not([hidden]) [data-id=start] > .blocklyPath", dy=30)
        them.press(Qt.Key.Key_Delete)
        them.until(lambda: chains(them) == [["wait", "wait"]], "another edit came later")
    view.show_tab("a", {})
    view.undo_block_move()
    qtbot.waitUntil(lambda: chains(them) == BEFORE, timeout=WAIT_MS)
    view.show_tab("b", {})
    qtbot.waitUntil(lambda: chains(them) == rest, timeout=WAIT_MS)


def test_multi_selection_is_moved_together_or_not_at_all(qtbot, view, them, told) -> None:
    before = them.newest()
    path = ".nepTab:not([hidden]) [data-id='{}'] > .blocklyPath"
    them.click(path.format("one"))
    box = them.box(path.format("3"))
    at = QPoint(round(box["left"]) + 12, round(box["top"]) + 18)
    QTest.mouseClick(them.target, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier, at)
    them.wait_for("document.querySelectorAll('.nepTab:not([hidden]) .nepChosen').length", 2)
    carry(them, told, path.format("one"), ABOVE)
    qtbot.waitUntil(lambda: bool(told.dropped), timeout=WAIT_MS)
    them.until(lambda: them.newest() == before, "they are where they were")
    bring(qtbot, view, told)
    assert told.brought == [(2, "moved")]
    assert chains(them) == [["started"], ["wait"], ["wait"]]
    view.show_tab("a", {})
    them.until(lambda: chains(them) == [["started"], ["wait"]], "the script closes behind them")
    view.undo_block_move()
    them.until(lambda: chains(them) == BEFORE, "they are in their script again")
    view.show_tab("b", {})
    them.until(lambda: chains(them) == [["started"]], "and gone there")
    assert told.deleted == []


def test_ctrl_drag_copies_to_another_tab(qtbot, view, them, told) -> None:
    carry(them, told, TWO, ABOVE, Qt.KeyboardModifier.ControlModifier)
    bring(qtbot, view, told)
    assert told.brought == [(2, "copied")]
    assert chains(them) == [["started"], ["wait", "wait"]]
    view.show_tab("a", {})
    qtbot.waitUntil(lambda: chains(them) == BEFORE, timeout=WAIT_MS)


def test_toolbox_block_is_dropped_directly_on_another_tab(qtbot, view, them, told) -> None:
    them.open_category("Control")
    carry(them, told, ".nepTab:not([hidden]) .nepCategory .control_wait", ABOVE)
    bring(qtbot, view, told)
    assert told.brought == [(1, "added")]
    assert chains(them) == [["started"], ["wait"]]
    view.show_tab("a", {})
    qtbot.waitUntil(lambda: chains(them) == BEFORE, timeout=WAIT_MS)


def test_note_is_moved_to_another_tab(qtbot, view, them, told) -> None:
    carry(them, told, ".nepTab:not([hidden]) .blocklyCommentTopbar", ABOVE)
    bring(qtbot, view, told)
    assert told.brought == [(0, "moved")]
    assert [each["text"] for each in them.newest()["workspaceComments"]] == ["Look"]
    view.show_tab("a", {})
    qtbot.waitUntil(lambda: "workspaceComments" not in them.newest(), timeout=WAIT_MS)


# -- a tab that opens under a held block -----------------------------------------------------------


def hold_outside(them: Person, told: Told, selector: str, to: QPoint = ABOVE) -> None:
    """Drag an element out of the page without releasing the mouse button."""
    box = them.box(selector)
    start = QPoint(
        round(box["left"]) + (60 if "Comment" in selector else 12), round(box["top"] + box["bottom"]) // 2
    )
    QTest.mouseMove(them.target, start)
    QTest.mousePress(them.target, Qt.MouseButton.LeftButton, pos=start)
    them.move(start, start + QPoint(60, 30))
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    go(them, told, to, start + QPoint(60, 30))


def go(them: Person, told: Told, to: QPoint, start: QPoint) -> None:
    them.move(start, to)
    them.until(lambda: told.places[-1:] == [them.view.mapToGlobal(to)], "the window knows where it is")


def open_tab(view, them: Person, key: str, block: str) -> None:
    view.show_tab(key, {})
    them.wait_for(
        f"!!{SHOWN}.querySelector('[data-id={block}]') && !document.querySelector('.blocklyDragging')"
    )


def below(them: Person, block: str) -> QPoint:
    """Return the mouse position at which a block held at its left end connects below this block."""
    box = them.box(f".nepTab:not([hidden]) [data-id={block}] > .blocklyPath")
    return QPoint(round(box["left"]) + 16, round(box["bottom"]) + 16)


def drop_at(them: Person, place: QPoint, start: QPoint = ABOVE) -> None:
    them.move(start, place)
    them.wait_for("!!document.querySelector('.blocklyDragging')")
    them.move(place - QPoint(0, 6), place)
    QTest.mouseRelease(them.target, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, place)
    them.wait_for("!!document.querySelector('.blocklyDragging')", False)


def test_drag_continues_in_the_opened_tab_and_connects_to_a_script(qtbot, view, them, told) -> None:
    hold_outside(them, told, TWO)
    open_tab(view, them, "b", "start")
    drop_at(them, below(them, "start"))
    qtbot.waitUntil(lambda: bool(told.brought), timeout=WAIT_MS)
    assert (told.brought, told.homes, told.dropped) == ([(2, "moved")], ["a"], [])
    them.until(lambda: chains(them) == [["started", "wait", "wait"]], "it hangs below the script there")
    view.undo()
    qtbot.waitUntil(lambda: chains(them) == [["started"]], timeout=WAIT_MS)
    view.redo()
    qtbot.waitUntil(lambda: chains(them) == [["started", "wait", "wait"]], timeout=WAIT_MS)
    view.show_tab("a", {})
    them.until(lambda: chains(them) == [["started"], ["wait"]], "and is gone where it was")
    view.undo_block_move()
    them.until(lambda: chains(them) == BEFORE, "both are as before")
    view.show_tab("b", {})
    them.until(lambda: chains(them) == [["started"]], "in both tabs")
    assert told.deleted == []


def test_drag_through_a_tab_changes_neither_its_blocks_nor_its_undo_stack(qtbot, view, them, told) -> None:
    changes: list[str] = []
    view.changed.connect(lambda key, _program: changes.append(key))
    hold_outside(them, told, TWO)
    open_tab(view, them, "b", "start")
    before = them.newest()
    histories = received(view, HistoryChanged, "can_undo", "can_redo")
    them.move(ABOVE, QPoint(600, 300))
    them.wait_for(f"{SHOWN}.querySelectorAll('.blocklyDragging .control_wait').length", 1)
    go(them, told, ABOVE, QPoint(600, 300))
    them.wait_for("!!document.querySelector('.blocklyDragging')", False)
    them.until(lambda: histories[-1:] == [(False, False)], "there is nothing to undo")
    assert them.newest() == before
    open_tab(view, them, "a", "two")
    place = QPoint(600, 420)
    drop_at(them, place)
    them.until(lambda: chains(them) == [["started"], ["wait"], ["wait", "wait"]], "it is at home")
    assert told.brought == [], "it went nowhere"
    view.undo()
    qtbot.waitUntil(lambda: chains(them) == BEFORE, timeout=WAIT_MS)
    assert "b" not in changes


@pytest.mark.parametrize("how", ["outside", "toolbox", "escape"])
def test_drag_released_outside_or_cancelled_in_another_tab_restores_the_block(
    qtbot, view, them, told, how: str
) -> None:
    before = them.newest()
    hold_outside(them, told, TWO)
    open_tab(view, them, "b", "start")
    there = them.newest()
    if how == "outside":
        QTest.mouseRelease(them.target, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, ABOVE)
        qtbot.waitUntil(lambda: bool(told.dropped), timeout=WAIT_MS)
    elif how == "toolbox":
        drop_at(them, QPoint(40, 300))
    else:
        them.press(Qt.Key.Key_Escape)
        them.until(lambda: told.places[-1] is None, "nothing is carried any more")
        them.move(ABOVE, QPoint(600, 300))
        assert them.ask("!!document.querySelector('.blocklyDragging')") is False
        QTest.mouseRelease(
            them.target, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, QPoint(600, 300)
        )
    them.until(lambda: them.newest() == there, "the other tab is as before")
    view.show_tab("a", {})
    them.until(lambda: chains(them) == BEFORE, "it is where it was")
    assert them.newest() == before
    assert (told.brought, told.deleted) == ([], [])


def test_toolbox_block_is_dragged_through_an_opened_tab(qtbot, view, them, told) -> None:
    them.open_category("Control")
    hold_outside(them, told, ".nepTab:not([hidden]) .nepCategory .control_wait")
    open_tab(view, them, "b", "start")
    drop_at(them, below(them, "start"))
    qtbot.waitUntil(lambda: bool(told.brought), timeout=WAIT_MS)
    assert told.brought == [(1, "added")]
    them.until(lambda: chains(them) == [["started", "wait"]], "it hangs there")
    view.show_tab("a", {})
    qtbot.waitUntil(lambda: chains(them) == BEFORE, timeout=WAIT_MS)


def choose_mixed(them: Person) -> None:
    """Select the last block of the script and the note."""
    them.click(".nepTab:not([hidden]) [data-id='3'] > .blocklyPath")
    box = them.box(".nepTab:not([hidden]) .blocklyCommentTopbar")
    at = QPoint(round(box["left"]) + 60, round(box["top"] + box["bottom"]) // 2)
    QTest.mouseClick(them.target, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier, at)
    them.wait_for("document.querySelectorAll('.nepTab:not([hidden]) .nepChosen').length", 2)


@pytest.mark.parametrize("through", [False, True])
def test_mixed_selection_of_blocks_and_notes_is_moved_to_another_tab(
    qtbot, view, them, told, through: bool
) -> None:
    choose_mixed(them)
    path = ".nepTab:not([hidden]) [data-id='3'] > .blocklyPath"
    if through:
        hold_outside(them, told, path)
        open_tab(view, them, "b", "start")
        drop_at(them, QPoint(560, 320))
        qtbot.waitUntil(lambda: bool(told.brought), timeout=WAIT_MS)
    else:
        carry(them, told, path, ABOVE)
        bring(qtbot, view, told)
    assert told.brought == [(1, "moved")]
    assert chains(them) == [["started"], ["wait"]]
    assert [each["text"] for each in them.newest()["workspaceComments"]] == ["Look"]
    view.show_tab("a", {})
    them.until(lambda: chains(them) == [["started"], ["wait", "wait"]], "the block is gone")
    assert "workspaceComments" not in them.newest()
    view.undo_block_move()
    them.until(lambda: chains(them) == BEFORE, "the block is back")
    assert [each["text"] for each in them.newest()["workspaceComments"]] == ["Look"]
    view.show_tab("b", {})
    them.until(lambda: chains(them) == [["started"]], "and gone there")
    assert "workspaceComments" not in them.newest()


def test_window_receives_an_image_of_the_dragged_blocks(qtbot, view, them, told) -> None:
    hold_outside(them, told, TWO)
    qtbot.waitUntil(lambda: bool(told.pictures), timeout=WAIT_MS)
    data, ratio = told.pictures[-1]
    picture = QImage.fromData(data)
    wide, high = picture.width() / ratio, picture.height() / ratio
    assert 100 < wide <= 360
    assert 60 < high <= 240
    colours = {picture.pixelColor(x, picture.height() // 2).name() for x in range(picture.width())}
    assert len(colours) > 3, "a block is on it"
    QTest.mouseRelease(them.target, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, ABOVE)
    qtbot.waitUntil(lambda: bool(told.dropped), timeout=WAIT_MS)
