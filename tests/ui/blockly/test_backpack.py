"""Tests of the backpack, which stores blocks for other files, with mouse and keyboard."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.core.projects.backpack import Backpack
from app.ui.blockly.messages import BackpackMessage, PanelMessage
from app.ui.panels.build.behaviour.backpack_storage import BackpackController
from tests.ui.blockly_person import START, Person, workspace

pytestmark = pytest.mark.web

WAITS = {
    "type": "control_wait",
    "id": "one",
    "x": 280,
    "y": 224,
    "next": {"block": {"type": "control_wait", "id": "two"}},
}
SHOWN = "document.querySelector('.nepTab:not([hidden])')"
SHEET = f"getComputedStyle({SHOWN}.querySelector('.blocklyFlyout.nepPacked')).display"
STACKS = f"[...{SHOWN}.querySelectorAll('.nepPacked .blocklyBlockCanvas > .blocklyBlock')]"
IN_SHEET = ".nepTab:not([hidden]) .nepPacked .blocklyBlockCanvas > .blocklyBlock"
BLOCK = ".nepTab:not([hidden]) .blocklyBlockCanvas [data-id='{}'] > .blocklyPath"
FREE = QPoint(300, 260), QPoint(520, 420)


class Window:
    """Fake window that stores the backpack in a file and records toasts."""

    def __init__(self, view, folder: Path) -> None:
        self.said: list[str] = []
        self.undo: list = []
        self.backpack = Backpack(folder)
        self.keeper = BackpackController(self, self.backpack, view)  # type: ignore[arg-type]
        view.message_received.connect(self._receive)

    def _receive(self, message: PanelMessage) -> None:
        if isinstance(message, BackpackMessage):
            self.keeper.handle(message)

    def show_toast(self, words: str, _button: str = "", run=None) -> None:
        self.said.append(words)
        self.undo.append(run)

    @property
    def types(self) -> list[list[str]]:
        return [chain(item.block) for item in self.backpack.items]


def chain(top: dict) -> list[str]:
    below = top.get("next", {}).get("block")
    return [top["type"].rpartition("_")[2], *(chain(below) if below else [])]


def chains(them: Person) -> list[list[str]]:
    return [chain(each) for each in them.tops()]


@pytest.fixture
def window(view, tmp_path: Path) -> Window:
    return Window(view, tmp_path)


@pytest.fixture
def them(view, person, window) -> Person:
    """Simulated user of an editor that shows tab "a" and has shown tab "b" before."""
    view.show_tab("b", workspace(START))
    person_there = person(state=workspace(START))
    view.show_tab("a", workspace(START, WAITS))
    person_there.wait_for(f"!!{SHOWN}.querySelector('[data-id=two]')")
    return person_there


def centre(them: Person, selector: str) -> QPoint:
    box = them.box(selector)
    return QPoint(round(box["left"] + box["right"]) // 2, round(box["top"] + box["bottom"]) // 2)


def put_in(them: Person, window: Window, block: str) -> None:
    before = len(window.backpack.items)
    end = centre(them, ".nepBackpack")
    start = them.hold(BLOCK.format(block))
    them.move(start, end)
    them.wait_for("document.querySelector('.nepBackpack').classList.contains('nepOver')")
    them.drop(end)
    them.until(lambda: len(window.backpack.items) == before + 1, "it is in the backpack")


def open_it(them: Person, count: int) -> None:
    them.click(".nepBackpack")
    them.wait_for(SHEET, "block")
    them.wait_for(f"{STACKS}.length", count)


def show(them: Person, key: str) -> None:
    them.view.show_tab(key, {})
    them.wait_for(f"{SHOWN} !== null && true")


def test_stack_dropped_on_the_backpack_is_stored_and_stays_on_the_canvas(qtbot, view, them, window) -> None:
    before, edits = them.newest(), []
    view.changed.connect(lambda key, _program: edits.append(key))
    put_in(them, window, "one")
    assert window.types == [["wait", "wait"]]
    assert window.said == ["Added 2 blocks to the backpack"]
    them.until(lambda: them.newest() == before, "it is where it was")
    assert edits == []
    them.wait_for("document.querySelector('.nepBackpack').title", "Backpack (1)")
    them.wait_for("document.querySelector('.nepBackpack').classList.contains('nepOver')", False)
    assert "id" not in window.backpack.items[0].block
    window.undo[0]()
    them.wait_for("document.querySelector('.nepBackpack').classList.contains('nepFull')", False)


def test_backpack_stack_can_be_dragged_into_another_file_repeatedly(qtbot, view, them, window) -> None:
    put_in(them, window, "one")
    show(them, "b")
    for count in (1, 2):
        open_it(them, 1)
        them.drag(f"{IN_SHEET} > .blocklyPath", FREE[count - 1])
        them.until(lambda: len(chains(them)) == 1 + count, "it is on the canvas")  # noqa: B023
        them.wait_for(SHEET, "none")
    assert chains(them) == [["started"], ["wait", "wait"], ["wait", "wait"]]
    ids = {each["id"] for each in them.tops()}
    assert len(ids) == 3
    assert not ids & {"one", "two"}
    assert window.types == [["wait", "wait"]], "it stays in the backpack"


def test_click_on_a_backpack_stack_adds_the_stack_to_the_canvas_as_one_undo_step(
    qtbot, view, them, window
) -> None:
    put_in(them, window, "two")
    show(them, "b")
    open_it(them, 1)
    them.click(f"{IN_SHEET} > .blocklyPath")
    them.until(lambda: chains(them) == [["started"], ["wait"]], "it is on the canvas")
    them.wait_for(SHEET, "none")
    view.undo()
    them.until(lambda: chains(them) == [["started"]], "one step")


def test_backpack_works_with_the_keyboard_only(qtbot, view, them, window) -> None:
    them.click(BLOCK.format("two"))
    held = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    them.press(Qt.Key.Key_P, held)
    them.until(lambda: window.types == [["wait"]], "the key puts it in")
    them.click(BLOCK.format("one"))
    them.press(Qt.Key.Key_P, held)
    them.until(lambda: window.types == [["wait", "wait"], ["wait"]], "with what hangs below")
    show(them, "b")
    them.ask("document.querySelector('.nepBackpack').focus()")
    them.press(Qt.Key.Key_Return)
    them.wait_for(f"{STACKS}.length", 2)
    on = f"{STACKS}.findIndex(each => each.contains(document.activeElement))"
    them.wait_for(on, 0)
    them.press(Qt.Key.Key_Down)
    them.wait_for(on, 1)
    them.press(Qt.Key.Key_Delete)
    them.until(lambda: window.types == [["wait", "wait"]], "Delete takes it out")
    them.wait_for(on, 0)
    them.press(Qt.Key.Key_Return)
    them.until(lambda: chains(them) == [["started"], ["wait", "wait"]], "Enter puts it on the canvas")
    them.wait_for(SHEET, "none")


def test_removing_one_or_all_backpack_stacks_can_be_undone(qtbot, view, them, window) -> None:
    put_in(them, window, "one")
    put_in(them, window, "two")
    open_it(them, 2)
    them.click(f"{IN_SHEET}:first-child .nepTakeOut")
    them.wait_for(f"{STACKS}.length", 1)
    assert window.types == [["wait", "wait"]]
    assert window.said[-1] == "Removed from the backpack"
    window.undo[-1]()
    them.wait_for(f"{STACKS}.length", 2)
    assert window.types == [["wait"], ["wait", "wait"]], "where it was"
    them.click(".nepTab:not([hidden]) .nepFlyoutHead:not([hidden]) .nepEmpty")
    them.wait_for(f"{STACKS}.length", 0)
    assert window.said[-1] == "Emptied the backpack"
    window.undo[-1]()
    them.wait_for(f"{STACKS}.length", 2)


def test_block_menu_adds_to_the_backpack_and_the_menu_of_its_stacks_offers_removal(
    qtbot, view, them, window
) -> None:
    them.click(BLOCK.format("one"))
    them.press(Qt.Key.Key_F10, Qt.KeyboardModifier.ShiftModifier)
    row = "[...document.querySelectorAll('.blocklyMenuItem')].find(e => e.textContent.includes({}))"
    label = json.dumps("Add to backpack")
    them.wait_for(f"!!{row.format(label)}")
    assert "Ctrl+Shift+P" in them.ask(f"{row.format(label)}.textContent")
    them.ask(f"{row.format(label)}.setAttribute('data-test', 'row')")
    them.click("[data-test=row]")
    them.until(lambda: window.types == [["wait", "wait"]], "it is in the backpack")
    open_it(them, 1)
    box = them.box(f"{IN_SHEET} > .blocklyPath")
    QTest.mouseClick(them.target, Qt.RightButton, pos=QPoint(round(box["left"]) + 14, round(box["top"]) + 14))
    label = json.dumps("Remove from backpack")
    them.wait_for(f"!!{row.format(label)}")
    assert not them.ask(f"!!{row.format(json.dumps('Add to'))}")


def test_variables_of_backpack_stacks_are_matched_by_name(qtbot, view, them, window) -> None:
    def gets(id: str, name: str, block: str, y: int) -> dict:
        field = {"id": id, "name": name, "type": ""}
        return {"type": "variables_get", "id": block, "x": 300, "y": y, "fields": {"VAR": field}}

    variables = [{"id": "v1", "name": "score"}, {"id": "v2", "name": "lives"}]
    blocks = workspace(gets("v1", "score", "g1", 100), gets("v2", "lives", "g2", 200))
    view.show_tab("from", {**blocks, "variables": variables})
    them.wait_for(f"!!{SHOWN}.querySelector('[data-id=g2]')")
    put_in(them, window, "g1")
    put_in(them, window, "g2")
    # The other file has a variable with this name and another id, and one with this id and another name.
    other = [{"id": "own", "name": "score"}, {"id": "v2", "name": "other"}]
    view.show_tab("to", {**workspace(START), "variables": other})
    them.wait_for(f"{STACKS}.length === 0 && !{SHOWN}.querySelector('[data-id=g2]')")
    for number in (1, 2):
        open_it(them, 2)
        them.click(f"{IN_SHEET}:nth-child({number}) > .blocklyPath")
        them.until(lambda: len(them.tops()) == 1 + number, "it is on the canvas")  # noqa: B023
    used = {top["fields"]["VAR"]["id"] for top in them.tops() if "fields" in top and "VAR" in top["fields"]}
    names = {each["id"]: each["name"] for each in them.newest()["variables"]}
    assert sorted(names[id] for id in used) == ["lives", "score"]
    assert sorted(names.values()) == ["lives", "other", "score"]
    assert names["v2"] == "other"
    assert names["own"] == "score"


def test_backpack_of_another_studio_is_loaded_and_unknown_blocks_are_preserved(
    qtbot, view, them, window, tmp_path
) -> None:
    strange = {
        "type": "robot_none_do_fly",
        "fields": {"HOW": "far"},
        "next": {"block": {"type": "control_wait"}},
    }
    wrong = {"type": "control_wait", "inputs": {"SECONDS": {"block": {"type": "control_wait"}}}}
    Backpack(tmp_path).add([strange, wrong, {"type": "control_wait", "extraState": 5, "icons": 7}])
    open_it(them, 3)  # opening validates the blocks
    them.wait_for("document.querySelector('.nepBackpack').title", "Backpack (3)")
    them.click(f"{IN_SHEET}:first-child > .blocklyPath")
    them.until(lambda: len(chains(them)) == 3, "it is on the canvas")
    made = next(top for top in them.tops() if top["type"] == "robot_none_do_fly")
    assert made["fields"] == {"HOW": "far"}
    assert set(made) == {"type", "fields", "next", "id", "x", "y"}


def test_stack_dragged_from_the_backpack_is_not_stored_again(qtbot, view, them, window) -> None:
    put_in(them, window, "two")
    open_it(them, 1)
    end = centre(them, ".nepBackpack")
    start = them.hold(f"{IN_SHEET} > .blocklyPath")
    them.move(start, QPoint(500, 300))
    them.move(QPoint(500, 300), end)
    them.drop(end)
    them.wait_for("!document.querySelector('.blocklyDragging')")
    assert chains(them) == [["started"], ["wait", "wait"]]
    assert window.types == [["wait"]]


@pytest.mark.parametrize("held", ["block", "note"])
def test_blocks_of_a_mixed_selection_are_stored_without_notes_and_the_user_is_notified(
    qtbot, view, them, window, held: str
) -> None:
    note = {"height": 100, "width": 160, "id": "note", "x": 520, "y": 56, "text": "Look"}
    view.load({**workspace(START, WAITS), "workspaceComments": [note]})
    bar = ".nepTab:not([hidden]) .blocklyCommentTopbar"
    them.wait_for(f"!!document.querySelector('{bar}')")
    them.click(BLOCK.format("two"))
    box = them.box(bar)
    at = QPoint(round(box["left"]) + 60, round(box["top"] + box["bottom"]) // 2)
    QTest.mouseClick(them.target, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier, at)
    them.wait_for("document.querySelectorAll('.nepTab:not([hidden]) .nepChosen').length", 2)
    before, end = them.newest(), centre(them, ".nepBackpack")
    start = at if held == "note" else None
    if start is None:
        start = them.hold(BLOCK.format("two"))
    else:
        QTest.mouseMove(them.target, start)
        QTest.mousePress(them.target, Qt.MouseButton.LeftButton, pos=start)
    them.move(start, end)
    them.wait_for("document.querySelector('.nepBackpack').classList.contains('nepOver')")
    middle = f"document.elementFromPoint({end.x()}, {end.y()}).closest('.nepBackpack') !== null"
    assert them.ask(middle) is True, "its ring is seen over what is in the hand"
    them.drop(end)
    them.until(lambda: len(window.backpack.items) == 1, "the block is in the backpack")
    assert window.types == [["wait"]]
    assert window.said == [
        "Added 1 block to the backpack. Notes weren't added: the backpack can only hold blocks."
    ]
    them.until(lambda: them.newest() == before, "all is where it was")
