"""Tests of trying blocks by a click in the flyout, the try button and Ctrl+Enter, and of shown values."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt

from app.ui.blockly.messages import StackTried
from tests.ui.blockly_person import PICTURE, START, WAIT_MS, received

pytestmark = pytest.mark.web
HANDLE = ".nepTab:not([hidden]) .nepTryHandle"
ANSWER = "(e => e && !e.hidden && e.textContent)(document.querySelector('.nepTryAnswer'))"


@pytest.fixture
def asked(view) -> list[StackTried]:
    """Return the list of requests to try blocks; it grows with each request."""
    return received(view, StackTried)


def test_click_in_the_flyout_runs_the_block_and_adds_no_block_to_the_canvas(qtbot, view, person, asked):
    them = person(START)
    them.open_category("Control")
    them.click(".blocklyFlyout .control_wait > .blocklyPath", dx=8, dy=8)
    qtbot.waitUntil(lambda: bool(asked), timeout=WAIT_MS)
    (what,) = asked
    assert (what.kind, what.state["type"], what.state["id"]) == ("stack", "control_wait", what.id)
    assert what.state["inputs"]["SECONDS"]["shadow"]["fields"] == {"NUMBER": 1}
    assert them.tops() == [START]
    view.highlight([what.id])
    them.wait_for("!!document.querySelector('.blocklyFlyout .nepState-running')")
    view.set_errors({what.id: "“wait” needs a number."})
    them.wait_for(ANSWER, "“wait” needs a number.")
    assert them.box(".nepTryAnswer")["left"] >= them.box(".blocklyFlyout")["right"], (
        "it covers no other block"
    )


def test_dragging_out_of_the_flyout_runs_no_block(qtbot, view, person, asked):
    them = person(START)
    them.open_category("Control")
    start = them.hold(".blocklyFlyout .control_wait")
    end = start.__class__(700, 300)
    them.move(start, end)
    them.drop(end)
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    assert asked == []


def test_try_button_next_to_the_selected_block_runs_its_stack(qtbot, view, person, asked):
    them = person(state=PICTURE)
    them.wait_for(f"document.querySelectorAll('{HANDLE}').length", 0)
    them.click("[data-id=wave] > .blocklyPath", dx=10, dy=10)
    handle, block = them.box(HANDLE), them.box("[data-id=wave] > .blocklyPath")
    assert handle["right"] <= block["left"] + 2
    assert block["top"] - 4 < handle["top"] < block["bottom"]
    them.click(HANDLE, dx=10, dy=10)
    qtbot.waitUntil(lambda: asked == [StackTried("wave", "stack", None)], timeout=WAIT_MS)
    assert them.ask("document.querySelector('.blocklySelected')?.dataset.id") == "wave", "it stays selected"
    them.press(Qt.Key_Return, Qt.ControlModifier)
    qtbot.waitUntil(lambda: len(asked) == 2, timeout=WAIT_MS)
    assert asked[1] == asked[0]


def test_trying_an_event_block_runs_its_script(qtbot, view, person, asked):
    them = person(START)
    them.click("[data-id=start] > .blocklyPath", dy=30)
    them.click(HANDLE, dx=10, dy=10)
    qtbot.waitUntil(lambda: asked == [StackTried("start", "hat", None)], timeout=WAIT_MS)


def test_value_is_shown_next_to_its_block_until_the_next_key_press(qtbot, view, person):
    them = person(state=PICTURE)
    view.show_value("wave", "84 %")
    them.wait_for(ANSWER, "84 %")
    answer, block = them.box(".nepTryAnswer"), them.box("[data-id=wave] > .blocklyPath")
    assert 0 < answer["left"] - block["right"] < 30
    them.press(Qt.Key_Shift)
    them.wait_for(ANSWER, False)
