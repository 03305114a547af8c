"""Tests of culling: scripts far outside the viewport are not rendered, without visible consequences."""

from __future__ import annotations

import pytest

from tests.ui.blockly_person import workspace

pytestmark = pytest.mark.web

SHOWN = ".nepTab:not([hidden])"
DRAWN = f"[...document.querySelectorAll('{SHOWN} [data-id]')].filter(e => e.getClientRects().length)"
FOCUSED = "document.activeElement.closest('[data-id]')?.dataset.id"


def script(name: str, x: int, y: int) -> dict:
    wait = {
        "type": "control_wait",
        "id": f"{name}_wait",
        "inputs": {"SECONDS": {"shadow": {"type": "values_number", "id": f"{name}_n", "fields": {"NUM": 2}}}},
    }
    return {"type": "events_started", "id": name, "x": x, "y": y, "next": {"block": wait}}


def drawn(*names: str) -> str:
    """Return JavaScript that lists which of these blocks are rendered."""
    return f"{list(names)}.filter(name => {DRAWN}.some(e => e.dataset.id === name))"


def test_script_is_rendered_when_scrolled_into_the_viewport(person):
    them = person(script("here", 40, 40), script("below", 40, 1400), script("right", 2400, 40))
    them.wait_for(drawn("here", "below", "right"), ["here"])
    them.view.show_block("below_wait")
    them.wait_for(drawn("here", "below", "below_wait", "right"), ["below", "below_wait"])
    them.wait_for(FOCUSED, "below_wait")
    them.view.zoom_to_fit()
    them.wait_for(drawn("here", "below", "right"), ["here", "below", "right"])
    assert [each["id"] for each in them.tops()] == ["here", "below", "right"]


def test_focused_script_stays_rendered_and_focused_outside_the_viewport(person):
    them = person(script("here", 40, 40), script("below", 40, 1400))
    them.view.show_block("here_wait")
    them.wait_for(FOCUSED, "here_wait")
    for _ in range(12):
        them.wheel(-600)
    them.wait_for("document.querySelector('[data-id=here]').getBoundingClientRect().bottom < -250")
    them.wait_for(drawn("here", "below"), ["here", "below"])
    assert them.ask(FOCUSED) == "here_wait"


def test_script_with_a_note_is_always_rendered(person):
    # Blockly reads the rendered position of the block when it places the note.
    below = script("below", 40, 1400)
    below["icons"] = {"comment": {"text": "look", "pinned": True, "height": 80, "width": 160}}
    them = person(script("here", 40, 40), below)
    them.wait_for("document.querySelectorAll('.blocklyBubble').length", 1)
    them.wait_for(drawn("here", "below"), ["here", "below"])


def test_culling_preserves_the_stacking_order(person):
    them = person(script("under", 40, 1400), script("here", 40, 40), script("over", 60, 1410))
    them.wait_for(drawn("under", "over", "here"), ["here"])
    them.view.zoom_to_fit()
    order = "[...document.querySelectorAll('.blocklyBlockCanvas > g')].map(e => e.dataset.id)"
    them.wait_for(order, ["under", "here", "over"])


def test_far_script_is_rendered_after_redo_joins_it_to_a_visible_script(person):
    below = script("below", 40, 1400)
    them = person(script("here", 40, 40), below)
    them.wait_for(drawn("here", "below"), ["here"])
    joined = script("here", 40, 40)
    joined["next"]["block"]["next"] = {"block": below["next"]["block"]}
    them.view.apply_edit(workspace(joined))
    them.wait_for(drawn("here_wait", "below_wait"), ["here_wait", "below_wait"])
    them.view.undo()
    them.wait_for(f"{drawn('here_wait', 'below_wait')}.length", 1)  # Blockly may render the restored blocks
    them.view.redo()
    them.wait_for(drawn("here_wait", "below_wait"), ["here_wait", "below_wait"])
    them.wait_for("document.querySelectorAll('.nepFar').length", 0)


def test_every_block_has_an_aria_label(person):
    them = person(*(script(f"s{number}", 40, 40 + 400 * number) for number in range(30)))
    silent = f"[...document.querySelectorAll('{SHOWN} .blocklyBlockCanvas [data-id] > .blocklyPath')]"
    them.wait_for(f"{silent}.filter(e => !e.closest('[data-id$=_n]') && !e.ariaLabel).length", 0)
    fields = "[...document.querySelectorAll('[data-id$=_n] .blocklyField, .blocklyField[data-id$=_n]')]"
    them.wait_for(f"{fields}.filter(e => !e.ariaLabel).length", 0)
