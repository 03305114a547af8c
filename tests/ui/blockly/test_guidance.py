"""Tests of the hint on the empty canvas and of the ring that points to a block."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint, Qt

from app.ui.blockly.messages import CanvasButtonPressed
from app.ui.blockly.view import BlocklyView
from tests.ui.blockly_person import START, Person, received

pytestmark = pytest.mark.web
MANY = 12
SHOWN = "!document.querySelector('.nepBegin').hidden"
SAID = "document.querySelector('.nepBeginPlace').textContent"
BUTTONS = "[...document.querySelectorAll('.nepBegin button')].filter(e => !e.hidden).map(e => e.textContent)"
RING = "document.querySelector('.nepRing:not([hidden])') !== null"
BUBBLE = "document.querySelector('.nepRingBubble:not([hidden])')?.textContent ?? ''"
FIRST = ".blocklyFlyout .blocklyDraggable"


@pytest.fixture
def empty(view: BlocklyView, person: Callable[..., Person]) -> Person:
    view.set_canvas_hint("when started", False)
    made = person()
    made.wait_for(SHOWN)
    return made


def test_hint_requested_before_the_page_is_loaded_is_shown_after_loading(
    view: BlocklyView, person: Callable[..., Person]
) -> None:
    view.point_at("events_started", "when started")
    person().wait_for(RING)


def middle_of(person: Person, selector: str) -> QPoint:
    box = person.box(selector)
    return QPoint(round((box["left"] + box["right"]) / 2), round((box["top"] + box["bottom"]) / 2))


def test_empty_canvas_shows_the_first_step_and_offers_a_robot_until_a_robot_connects(
    empty: Person, view: BlocklyView
) -> None:
    empty.wait_for(SAID, "Drag “when started” here")
    empty.wait_for(BUTTONS, ["Use the virtual robot", "Show me", "Open an example"])
    asked = received(view, CanvasButtonPressed, "button")
    empty.click(".nepBegin button:nth-child(1)", dx=20)
    empty.click(".nepBegin button:nth-child(3)", dx=20)
    empty.until(lambda: asked == ["robot", "examples"], "the window hears what was pressed")
    view.set_canvas_hint("when started", True)
    empty.wait_for(BUTTONS, ["Show me", "Open an example"])


def test_empty_canvas_hint_does_not_overlap_the_zoom_buttons_on_a_low_page(
    empty: Person, view: BlocklyView
) -> None:
    view.resize(700, 200)
    empty.wait_for("innerHeight <= 260")
    parts = "[...document.querySelector('.nepBegin').children]"
    lowest = f"Math.max(...{parts}.map(e => e.getBoundingClientRect().bottom))"
    low = f"{lowest} <= document.querySelector('.nepZoom').getBoundingClientRect().top"
    empty.wait_for(low)


def test_block_dropped_on_the_empty_canvas_hides_the_hint(empty: Person) -> None:
    empty.open_category("Events")
    place = middle_of(empty, ".nepBeginPlace")
    start = empty.hold(FIRST)
    empty.move(start, place)
    empty.wait_for("document.querySelector('.nepBegin').className", "nepBegin dragging")
    assert empty.ask(SHOWN), "the place stays while the block is in the hand"
    empty.drop(place)
    empty.wait_for(SHOWN, False)
    (block,) = empty.tops()
    assert block["type"] == "events_started"
    empty.wait_for("!!document.querySelector('.blocklySelected')")  # the keys go to it
    empty.render()
    empty.press(Qt.Key.Key_Delete)
    empty.wait_for(SHOWN)
    assert empty.tops() == []


def test_empty_canvas_hint_is_next_to_the_open_flyout(empty: Person) -> None:
    empty.open_category("Events")
    flyout = empty.box(".blocklyFlyout")
    empty.wait_for(
        f"document.querySelector('.nepBegin').getBoundingClientRect().left >= {flyout['right'] - 2}"
    )


def test_behaviour_with_blocks_has_no_empty_canvas_hint(
    view: BlocklyView, person: Callable[..., Person]
) -> None:
    view.set_canvas_hint("when started", False)
    made = person(START)
    made.wait_for("document.querySelectorAll('.blocklyBlockCanvas [data-id=start]').length", 1)
    made.wait_for(SHOWN, False)


def test_show_me_points_to_the_category_and_then_to_the_block_until_the_block_is_placed(
    empty: Person,
) -> None:
    empty.click(".nepBegin button:nth-child(2)", dx=20)
    empty.wait_for(BUBBLE, "You'll find “when started” under Events")
    ring, row = empty.box(".nepRing"), empty.box(".blocklyToolboxCategory")
    assert abs(ring["left"] - row["left"]) < 8
    assert abs(ring["bottom"] - row["bottom"]) < 8
    empty.open_category("Events")
    empty.wait_for(BUBBLE, "Drag it onto the page")
    empty.drag(FIRST, middle_of(empty, ".nepBeginPlace"))
    empty.wait_for("document.querySelector('.nepRing') === null")
    assert len(empty.tops()) == 1


def test_keyboard_user_is_shown_keyboard_hints_and_the_category_is_focused(empty: Person) -> None:
    said = "document.querySelector('.nepBeginKeys').textContent"
    assert empty.ask(said).startswith("With the keyboard: press Ctrl+B, choose the block with the arrow keys")
    empty.view.setFocus()
    empty.wait_for("document.hasFocus()")
    for _ in range(MANY):
        if empty.ask("document.activeElement.textContent") == "Show me":
            break
        before = empty.ask("document.activeElement.outerHTML")
        empty.press(Qt.Key.Key_Tab)
        empty.wait_for(f"document.activeElement.outerHTML !== {json.dumps(before)}")
    empty.press(Qt.Key.Key_Return)
    empty.wait_for("document.activeElement.id.toLowerCase().includes('events')")
    empty.wait_for(f"({BUBBLE}).startsWith('Press Enter to pick it up')")


def test_hint_ring_is_removed_by_escape_and_by_the_window(empty: Person, view: BlocklyView) -> None:
    view.point_at("events_started", "when started", "Drag it")
    empty.wait_for(RING)
    empty.click(".blocklySvg", 500, 20)
    empty.press(Qt.Key.Key_Escape)
    empty.wait_for(RING, False)
    view.point_at("events_started", "when started", "Drag it")
    empty.wait_for(RING)
    view.point_at("")
    empty.wait_for(RING, False)


def test_unknown_block_shows_no_hint_ring(empty: Person, view: BlocklyView) -> None:
    view.point_at("robot_nobody_do_say", "say", "Drag it")
    empty.open_category("Events")
    assert not empty.ask(RING)
