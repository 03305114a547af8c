"""Tests that the error bubble next to a block is completely visible at every position and zoom level."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import block, number
from tests.ui.blockly_person import WAIT_MS, Person, editor, workspace

pytestmark = pytest.mark.web

SENTENCE = "“wait” needs a number. Put one into the gap, or delete the block that is in it now."
TOOLBOX = 196


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions(()), 900, 500)


def wait_block(id: str, x: int, y: int) -> dict[str, object]:
    return block("control_wait", id, SECONDS=number(1)) | {"x": x, "y": y}


def shown_beside(
    qtbot, them: Person, view: BlocklyView, id: str
) -> tuple[dict[str, float], dict[str, float]]:
    """Show an error at a block and return the boxes of its bubble and of the block."""
    view.set_errors({id: SENTENCE})
    them.wait_for("document.querySelectorAll('.nepBubble').length", 1)
    return them.box(".nepBubble > path"), them.box(f"[data-id={id}] > .blocklyPath")


@pytest.mark.parametrize(("x", "y"), [(20, 20), (760, 20), (760, 540), (20, 540)])
def test_bubble_is_visible_next_to_its_block(qtbot, view, person, x: int, y: int) -> None:
    corners = [wait_block("first", 0, 0), wait_block("w", x, y), wait_block("last", 780, 560)]
    them = person(state=workspace(*corners))
    bubble, its = shown_beside(qtbot, them, view, "w")
    assert TOOLBOX < bubble["left"] < bubble["right"] < 900
    assert 0 <= bubble["top"] < bubble["bottom"] <= 500
    apart = bubble["left"] >= its["right"] or bubble["top"] >= its["bottom"] or bubble["bottom"] <= its["top"]
    assert apart, (bubble, its)


def test_bubble_text_stays_readable_when_zoomed_out(qtbot, view, person) -> None:
    them = person(state=workspace(wait_block("w", 20, 20)))
    near, _its = shown_beside(qtbot, them, view, "w")
    for _ in range(12):
        view.zoom_out()
    them.wait_for("document.querySelector('[data-id=w] > .blocklyPath').getBoundingClientRect().width < 70")
    far, _its = shown_beside(qtbot, them, view, "w")
    assert far["right"] - far["left"] > 0.9 * (near["right"] - near["left"])


def test_bubble_scrolls_with_its_block(qtbot, view, person) -> None:
    them = person(state=workspace(wait_block("w", 0, 0), wait_block("far", 0, 3000)))
    bubble, _its = shown_beside(qtbot, them, view, "w")
    view.show_block("far")
    qtbot.waitUntil(lambda: them.box(".nepBubble > path")["bottom"] < bubble["top"] - 300, timeout=WAIT_MS)


def test_bubble_of_a_block_covered_by_the_open_flyout_is_hidden(qtbot, view, person) -> None:
    them = person(state=workspace(wait_block("w", 20, 20)))
    shown_beside(qtbot, them, view, "w")
    visible = "document.querySelector('.nepBubble').checkVisibility({visibilityProperty: true})"
    assert them.ask(visible)
    them.open_category("Control")  # the flyout's blocks cover this block
    them.wait_for(visible, False)
    them.press(Qt.Key_Escape)
    them.wait_for(visible)
