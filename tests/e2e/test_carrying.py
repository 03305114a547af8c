"""Tests of blocks dragged out of the page: a tab accepts them, and other targets don't lose them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import say, started, write
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.test_tabs import SHOWN, shown, tabs
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
ACCENT = (0x2F, 0x4F, 0xD0)  # the token "accent" of the light theme
SENTENCES = f"{SHOWN}.querySelectorAll('.blocklyBlockCanvas .robot_pepper_do_say').length"
SELECTED = f"[...{SHOWN}.querySelectorAll('.blocklyBlockCanvas .blocklySelected')].map(e => e.textContent)"
VISIBLE = ".nepTab:not([hidden])"
PATH = f"{VISIBLE} .blocklyBlockCanvas [data-id='{{}}'] > .blocklyPath"


def carry(studio: Studio, block: str, x: float, y: float) -> None:
    """Drag a block to a position on the screen without releasing it."""
    left, top, _, _ = studio.spot(PATH.format(block))
    studio.screen.move(left + 12, top + 18)
    studio.screen.press()
    studio.screen.glide(left + 60, top + 40, 6)
    until(lambda: studio.page("!!document.querySelector('.blocklyDragging')"), "the page has seen it held")
    studio.screen.glide(x, y)


def place_of(studio: Studio, name: str) -> tuple[float, float]:
    return middle(studio.find(name, kind="BehaviourTab")["rect"])


def ringed(studio: Studio, name: str) -> bool:
    """Return whether the border of this tab has the accent colour."""
    picture = studio.picture(studio.find(name, kind="BehaviourTab"))
    return bool(abs(picture[picture.shape[0] // 2, 0].astype(int) - ACCENT).max() < 12)


@pytest.fixture
def studio(start: Callable[..., Studio], tmp_path: Path) -> Studio:
    greeting = write(tmp_path / "Greeting.nepb", started(say("One", say("Two", say("Three")))))
    quiz = write(tmp_path / "Quiz.nepb", started(say("Four")))
    made = start(str(quiz), str(greeting))
    until(lambda: tabs(made) == ["Quiz", "Greeting"], "the files are open")
    until(lambda: "say Three" in shown(made), "the second shows")
    return made


def test_blocks_dropped_on_another_tab_are_moved_to_that_tab(studio: Studio) -> None:
    before, alone = shown(studio), {"started", "say Four", "text Four"}
    carry(studio, "say Two", *place_of(studio, "Quiz"))
    until(lambda: ringed(studio, "Quiz"), "a ring is round the tab that would take it")
    until(lambda: not ringed(studio, "Greeting"), "and round no other")
    until(lambda: "say Four" in shown(studio), "it has opened meanwhile")
    studio.screen.release()
    studio.says("Moved 2 blocks to Quiz")
    studio.screen.move(*middle(studio.find("Undo", kind="Button")["rect"]))  # the toast stays while hovered
    until(lambda: alone < shown(studio), "its tab is open")
    until(lambda: studio.page(SENTENCES) == 3, "with both blocks")
    until(lambda: len(studio.page(SELECTED) or []) == 1, "what came is selected")
    until(lambda: not ringed(studio, "Quiz"), "the ring goes")
    until(lambda: tabs(studio) == ["Quiz, not saved", "Greeting, not saved"], "both are edited")
    studio.click("Undo", kind="Button")
    until(lambda: shown(studio) == before, "they are back in their stack")
    studio.screen.key("Tab", ["Ctrl"])
    until(lambda: "say Four" in shown(studio), "the other tab shows")
    until(lambda: shown(studio) == alone, "and gone there")
    assert studio.quit() == 0


def test_blocks_dropped_outside_return_and_blocks_dropped_on_plus_create_a_behaviour(studio: Studio) -> None:
    before = shown(studio)
    studio.find("Quiz", kind="BehaviourTab")
    stack = studio.spot(PATH.format("say Two"))
    robot = studio.find("Problems", kind="Dock")["rect"]
    for x, y in (middle(robot), (2.0, stack[1])):
        carry(studio, "say Two", x, y)
        studio.screen.release()
        until(lambda: not studio.page("!!document.querySelector('.blocklyDragging')"), "it is let go")
        assert studio.spot(PATH.format("say Two")) == stack, "it is where it was"
        assert shown(studio) == before
    assert tabs(studio) == ["Quiz", "Greeting"], "nothing is edited"

    plus = studio.find("New behaviour", kind="IconButton")["rect"]
    studio.screen.hold("Ctrl")
    carry(studio, "say Three", *middle(plus))
    studio.screen.release()
    studio.screen.let_go("Ctrl")
    studio.says("Copied 1 block to New behaviour")
    until(lambda: tabs(studio) == ["Quiz", "Greeting", "New behaviour, not saved"], "a new one has it")
    assert studio.quit() == 0


def test_tab_opens_under_dragged_blocks_and_the_drag_continues_in_that_tab(studio: Studio) -> None:
    before = shown(studio)
    carry(studio, "say Two", *place_of(studio, "Quiz"))
    picture = studio.find(kind="DragImage")["rect"]
    x, y = place_of(studio, "Quiz")
    assert 0 < picture[0] - x < 40, "it is at the mouse"
    assert 0 < picture[1] - y < 40
    until(lambda: "say Four" in shown(studio), "the tab has opened")
    assert studio.find(kind="DragImage"), "the blocks are still in the hand"
    left, top, wide, high = studio.spot(PATH.format("say Four"))
    bottom = top + high
    studio.screen.move(*middle(studio.spot(f"{VISIBLE} .blocklyToolbox")))
    until(lambda: not studio.all(kind="DragImage"), "the page shows them itself")
    studio.screen.glide(left + 60, bottom + 60)
    there = studio.spot(PATH.format("say Four"))
    assert there == pytest.approx((left, top, wide, high), abs=1), "nothing on the page moves for them"
    studio.screen.glide(left + 14, bottom + 14, 6)
    until(
        lambda: studio.page(f"!!{SHOWN}.querySelector('.blocklyInsertionMarker')"),
        "it shows where they would go",
    )
    studio.screen.release()
    studio.says("Moved 2 blocks to Quiz")
    studio.screen.move(*middle(studio.find("Undo", kind="Button")["rect"]))  # the toast stays while hovered
    under = f"{SHOWN}.querySelector('[data-id=\"say Four\"]').querySelectorAll('.robot_pepper_do_say').length"
    until(lambda: studio.page(under) == 2, "they hang below the script of this tab")
    until(lambda: tabs(studio) == ["Quiz, not saved", "Greeting, not saved"], "both are edited")
    studio.click("Undo", kind="Button")
    until(lambda: shown(studio) == before, "they are back in their stack")
    assert studio.quit() == 0
