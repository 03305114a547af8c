"""Tests of the outlines of nested and selected blocks, and of the focus ring."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.ui.theme import tokens
from tests.ui.blockly_person import START, TOKENS, WAIT_MS, Person
from tests.ui.theme.test_tokens import contrast

pytestmark = pytest.mark.web
INSIDE = "[...document.querySelectorAll('.blocklyBlockCanvas .nepInside')].map(e => e.dataset.id).sort()"
SELECTED = "[...document.querySelectorAll('.nepSelection')].map(e => e.parentElement.dataset.id)"


def repeat(name: str, body: dict | None = None, below: dict | None = None) -> dict:
    made: dict = {"type": "control_repeat", "id": name, "inputs": {}}
    if body is not None:
        made["inputs"]["DO"] = {"block": body}
    if below is not None:
        made["next"] = {"block": below}
    return made


def wait(name: str, below: dict | None = None) -> dict:
    made: dict = {"type": "control_wait", "id": name}
    return {**made, "next": {"block": below}} if below is not None else made


def compare(name: str, first: dict) -> dict:
    return {"type": "values_compare", "id": name, "inputs": {"A": {"block": first}}}


def at(block: dict, x: int, y: int) -> dict:
    return {**block, "x": x, "y": y}


SAY = {"type": "robot_pepper_do_say", "id": "say"}
LOOPS = at(
    repeat("outer", repeat("inner", wait("deep", wait("deeper")), wait("beside")), wait("below")), 56, 56
)
VALUES = at(compare("whole", compare("part", {"type": "values_number", "id": "number"})), 420, 56)


def test_block_nested_in_a_block_of_the_same_colour_has_an_outline(person) -> None:
    them = person(LOOPS, VALUES, at(repeat("other", SAY), 420, 200))
    them.wait_for(INSIDE, ["beside", "deep", "deeper", "inner", "number", "part"])


def test_outlines_follow_a_moved_script(qtbot, view, person) -> None:
    them = person(at(repeat("outer", wait("first", wait("second", wait("third")))), 56, 56))
    them.wait_for(INSIDE, ["first", "second", "third"])
    start = them.hold("[data-id=first] > .blocklyPath")
    them.move(start, start + QPoint(320, 160))
    QTest.mouseRelease(them.target, Qt.LeftButton, pos=start + QPoint(320, 160))
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    them.wait_for(INSIDE, [])
    view.undo()
    them.wait_for(INSIDE, ["first", "second", "third"])


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_outline_has_enough_contrast_on_every_colour(view, person, mode) -> None:
    them = person(LOOPS)
    view.set_theme(TOKENS, is_dark=mode == "dark")
    style = "getComputedStyle(document.querySelector('[data-id=inner] > .blocklyPath'))"
    them.wait_for(f"{style}.stroke", "rgb(255, 255, 255)")
    share = float(them.ask(f"{style}.strokeOpacity"))
    for name, parts in tokens.load().blocks.items():
        fill = parts[mode]["primary"]
        assert contrast(mixed("#FFFFFF", fill, share), fill) >= 3, name


def mixed(front: str, back: str, share: float) -> str:
    """Return the colour of `front` over `back` with the opacity `share`."""
    pairs = [(int(front[at : at + 2], 16), int(back[at : at + 2], 16)) for at in (1, 3, 5)]
    return "#" + "".join(f"{round(over * share + under * (1 - share)):02X}" for over, under in pairs)


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_selected_block_has_two_tones_with_enough_contrast(view, person, mode) -> None:
    them = person(LOOPS, at(SAY, 420, 56))
    view.set_theme(TOKENS, is_dark=mode == "dark")
    tones = "[...document.querySelectorAll('.nepSelection path')].map(e => getComputedStyle(e).stroke)"
    for name in ("say", "below", "inner"):
        them.click(f"[data-id={name}] > .blocklyPath", dx=8, dy=8)
        them.wait_for(SELECTED, [name])
        shape = f"document.querySelector('[data-id={name}] > {{}}').getAttribute('d')"
        assert them.ask(shape.format(".nepSelection > path")) == them.ask(shape.format(".blocklyPath"))
    outer, inner = them.ask(tones)
    focus = TOKENS["colour"][mode]["focus"]
    assert inner == "rgb(255, 255, 255)"  # like the text: a contrast of at least 4.5 : 1 on every block
    assert outer == "rgb({}, {}, {})".format(*(int(focus[at : at + 2], 16) for at in (1, 3, 5)))
    assert contrast(focus, TOKENS["colour"][mode]["workspace"]) >= 3
    them.click(".nepTab:not([hidden]) .blocklyMainBackground", dx=500, dy=400)
    them.wait_for(SELECTED, [])


def rings(them: Person) -> list[str]:
    """Return the tags and classes of the elements with a visible outline."""
    return them.ask(
        "[...document.querySelectorAll('body *')].filter(e => { const s = getComputedStyle(e);"
        " return s.outlineStyle !== 'none' && parseFloat(s.outlineWidth) > 0 })"
        ".map(e => e.tagName + '.' + (e.getAttribute('class') ?? ''))"
    )


def test_focus_ring_is_hidden_after_a_click_and_shown_by_the_first_navigation_key(view, person) -> None:
    them = person(START)
    shown = "document.querySelector('.nepTab:not([hidden])')"
    keys = "document.documentElement.classList.contains('nepKeys')"
    them.press(Qt.Key_Tab)
    them.wait_for(keys)
    for place in (
        ".blocklyToolboxCategory",
        ".nepSearch input",
        ".nepZoom button",
        "[data-id=start] > .blocklyPath",
    ):
        them.click(place, dx=9, dy=9)
        them.wait_for(keys, False)
        assert rings(them) == [], place
        them.wait_for(f"{shown}.classList.contains('blocklyKeyboardNavigation')", False)
    them.wait_for(SELECTED, ["start"])  # a clicked block is still shown as selected
    them.press(Qt.Key_Down)
    them.wait_for(keys)
    them.wait_for(f"{shown}.classList.contains('blocklyKeyboardNavigation')")
