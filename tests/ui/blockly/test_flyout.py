"""Tests of the flyout: when it stays open, its layout, and adding its blocks to the canvas."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.messages import CommandRequested, FlyoutPinned, HistoryChanged
from tests.blocks.samples import nao, robot
from tests.ui.blockly_person import START, WAIT_MS, Person, editor, received, workspace

pytestmark = pytest.mark.web

WIDE, NARROW = 1320, 1000
SHOWN = "getComputedStyle(document.querySelector('.nepTab:not([hidden]) .nepCategory.blocklyFlyout')).display"
TITLE = "document.querySelector('.nepCategory.nepFlyoutHead span').textContent"
PIN = ".nepCategory.nepFlyoutHead button"
TURN = ".blocklyFlyout .robot_pepper_do_turn"
CANVAS = QPoint(850, 500)


@pytest.fixture
def opened(qtbot):
    """Function that opens an editor of a given width with a start block; a robot has wide blocks."""

    def show(width: int, *blocks: dict, pinned: bool | None = None) -> Person:
        view = editor(qtbot, editor_definitions([robot("Pepper"), nao()]), width, 640)
        view.set_toolbox_pinned(pinned)
        view.load(workspace(START, *blocks))
        with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
            view.show()
        them = Person(qtbot, view)
        them.box(".nepSearch")
        return them

    return show


def click_canvas(them: Person) -> None:
    QTest.mouseClick(them.target, Qt.LeftButton, pos=CANVAS)


def test_first_category_is_open_and_stays_open_on_a_wide_page(qtbot, opened):
    them = opened(WIDE)
    them.box(".blocklyFlyout .events_started")
    assert them.ask(TITLE) == "Events"
    click_canvas(them)
    them.open_category("Movement")
    them.drag(TURN, CANVAS)
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    click_canvas(them)
    assert (them.ask(SHOWN), them.ask(TITLE)) == ("block", "Movement")


def test_find_bar_does_not_cover_the_open_flyout(opened):
    them = opened(860)
    them.open_category("Movement")
    pin = ".nepTab:not([hidden]) .nepFlyoutHead.nepCategory button"
    them.click(pin, 8, 8)
    them.wait_for(f"document.querySelector('{pin}').getAttribute('aria-pressed')", "true")
    them.view.open_find()
    them.wait_for("!!document.querySelector('.nepFind:not([hidden])')")
    assert them.ask(SHOWN) == "block"
    assert them.box(".nepFind")["left"] >= them.box(".nepFlyoutHead.nepCategory")["right"]


def test_flyout_closes_after_use_on_a_narrow_page(qtbot, opened):
    them = opened(NARROW)
    them.wait_for(SHOWN, "none")
    them.open_category("Movement")
    them.drag(TURN, CANVAS)
    them.wait_for(SHOWN, "none")
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)


def test_flyout_opens_and_closes_with_the_page_width(opened):
    them = opened(NARROW)
    them.view.resize(WIDE, 640)
    them.wait_for(SHOWN, "block")
    them.view.resize(NARROW, 640)
    them.wait_for(SHOWN, "none")


def test_pin_of_the_flyout_is_reported_and_overrides_the_page_width(qtbot, opened):
    them = opened(WIDE)
    told = received(them.view, FlyoutPinned, "is_pinned")
    them.click(PIN)
    qtbot.waitUntil(lambda: told == [False], timeout=WAIT_MS)
    them.wait_for(SHOWN, "block")
    click_canvas(them)
    them.wait_for(SHOWN, "none")
    them.open_category("Control")
    them.click(PIN)
    qtbot.waitUntil(lambda: told == [False, True], timeout=WAIT_MS)
    them.view.resize(NARROW, 640)
    click_canvas(them)
    assert them.ask(SHOWN) == "block"


def test_saved_pin_setting_applies_at_start(opened):
    opened(WIDE, pinned=False).wait_for(SHOWN, "none")
    them = opened(NARROW, pinned=True)
    them.wait_for(SHOWN, "block")


def test_blocks_are_placed_next_to_the_open_flyout(opened):
    far = {"type": "events_started", "id": "far", "x": 1500, "y": 900}
    them = opened(WIDE, far)
    right = them.box(".blocklyFlyout")["right"]
    assert them.box("[data-id=start] > .blocklyPath")["left"] > right
    them.view.zoom_to_fit()
    them.wait_for("document.querySelector('[data-id=far]').getBoundingClientRect().right < innerWidth")
    assert them.box("[data-id=start] > .blocklyPath")["left"] > right


def test_canvas_keeps_its_position_when_the_category_changes(opened):
    them = opened(WIDE)
    them.open_category("Lists")
    before = them.box("[data-id=start] > .blocklyPath")
    for name in ("Variables", "Movement", "Lists"):
        them.open_category(name)
        them.wait_for(TITLE, name)
        assert them.box("[data-id=start] > .blocklyPath") == before


def test_flyout_blocks_keep_their_size_when_zoomed_out_and_are_dragged_under_the_mouse(opened):
    them = opened(WIDE)
    them.open_category("Movement")
    before = them.box(f"{TURN} > .blocklyPath")
    start = "document.querySelector('[data-id=start]').getBoundingClientRect().height"
    for _ in range(3):  # the page receives each step separately
        full = them.ask(start)
        them.view.zoom_out()
        them.wait_for(f"{start} < {full}")
    assert them.box(f"{TURN} > .blocklyPath") == before
    held = them.hold(f"{TURN} > .blocklyPath")
    them.move(held, CANVAS)
    shape = "document.querySelector('.blocklyDragging > .blocklyPath')"
    them.wait_for(f"{shape}.getBoundingClientRect().left > 800")
    box = them.box(".blocklyDragging > .blocklyPath")
    them.drop(CANVAS)
    assert box["left"] < CANVAS.x() < box["left"] + 13
    assert box["top"] < CANVAS.y() < box["bottom"]


def test_wide_flyout_blocks_fit_or_can_be_scrolled_to(opened):
    them = opened(WIDE)
    paths = (
        "[...document.querySelectorAll('.blocklyFlyout .blocklyBlockCanvas > .blocklyBlock')]"
        ".map(each => each.getBoundingClientRect().right)"
    )
    assert max(them.ask(paths)) < them.box(".blocklyFlyout")["right"]
    them.view.resize(700, 640)
    them.open_category("Events")
    them.view.resize(640, 640)
    them.wait_for("document.querySelector('.blocklyFlyout').getBoundingClientRect().width < 640 * .46 + 26")
    wide = max(them.ask(paths))
    assert wide > them.box(".blocklyFlyout")["right"]
    them.ask(
        "document.querySelector('.blocklyFlyout .events_message').dispatchEvent("
        "new WheelEvent('wheel', {deltaX: 400, bubbles: true, cancelable: true}))"
    )
    them.wait_for(
        f"Math.max(...{paths}) < document.querySelector('.blocklyFlyout').getBoundingClientRect().right"
    )


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_canvas_scrollbar_does_not_cover_the_flyout_blocks(opened, width):
    them = opened(width)
    them.open_category("Movement")
    box = them.box(".blocklyFlyout")
    over = "document.elementsFromPoint({x}, {y})[0].closest('.blocklyMainWorkspaceScrollbar') !== null"
    for x in range(round(box["left"]) + 6, round(box["right"]), 20):
        assert not them.ask(over.format(x=x, y=633))


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_dropdown_choice_in_the_flyout_applies_to_the_dragged_block(qtbot, opened, width):
    them = opened(width)
    them.open_category("Movement")
    them.ask(
        f"[...document.querySelectorAll('{TURN} .blocklyDropdownField')]"
        ".find(each => each.textContent.includes('left')).setAttribute('data-test', 'way')"
    )
    them.click("[data-test=way]", dx=8, dy=10)
    them.wait_for("document.querySelector('.blocklyDropDownDiv')?.textContent.includes('right')")
    them.press(Qt.Key_Down)
    them.press(Qt.Key_Return)
    them.wait_for(f"document.querySelector('{TURN}').textContent.includes('right')")
    assert len(them.tops()) == 1
    them.drag(f"{TURN} > .blocklyPath", CANVAS)
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    assert them.tops()[1]["fields"]["DIRECTION"] == "right"


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_new_variable_appears_in_the_flyout_immediately(qtbot, opened, width):
    them = opened(width)
    them.open_category("Variables")
    asked = received(them.view, CommandRequested, "command")
    them.click(".blocklyFlyoutButton")
    qtbot.waitUntil(lambda: asked == ["variable.new"], timeout=WAIT_MS)
    them.view.edit_variable({"do": "new", "name": "steps"})
    gets = "[...document.querySelectorAll('.blocklyFlyout .variables_get')].map(e => e.textContent.trim())"
    them.wait_for(f"{gets}.join().includes('steps')")
    assert them.ask(SHOWN) == "block"
    assert "steps" in them.ask("document.querySelector('.blocklyFlyout .variables_set').textContent")
    them.view.undo()
    them.wait_for(f"{gets}.join().includes('steps')", False)


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_block_returned_to_the_flyout_adds_no_undo_step(opened, width):
    them = opened(width)
    told = received(them.view, HistoryChanged, "can_undo", "can_redo")
    them.open_category("Movement")
    start = them.hold(TURN)
    # On a narrow page the flyout closes during a drag: only the toolbox is left.
    back = start if width == WIDE else QPoint(90, 420)
    them.move(start, CANVAS)
    them.until(lambda: told[-1:] == [(True, False)], "it is on the canvas")
    them.move(CANVAS, back)
    them.drop(back)
    them.until(lambda: told[-1:] == [(False, False)], "there is nothing to undo")
    assert [top["id"] for top in them.tops()] == ["start"]
