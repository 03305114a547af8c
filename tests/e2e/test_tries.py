"""Test of trying blocks on the robot: from the toolbox, from a stack, and the value of a sensor."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import say, started, turn, write
from tests.e2e.film import Film
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
CLOSED = "[...document.querySelectorAll('.blocklyFlyout')].every(e => e.style.display === 'none')"
WATCH = """(() => {
    window.nepHasGlowed = false;
    new MutationObserver(() => {
        window.nepHasGlowed ||= !!document.querySelector('.blocklyFlyout .nepState-running');
    }).observe(document.body, {subtree: true, childList: true});
})()"""
"""JavaScript that records whether a block of the toolbox glows, which may be shorter than two looks."""
ANSWER = "(e => e && !e.hidden && e.textContent)(document.querySelector('.nepTryAnswer'))"


@pytest.mark.parametrize("theme", ["dark"])  # test_fights.py uses the light theme
def test_blocks_can_be_tried_from_the_toolbox_and_from_a_selected_block_on(
    start: Callable[..., Studio], tmp_path: Path, theme: str
) -> None:
    path = write(tmp_path / "Tries.nepb", started(say("First", {**turn(180), "id": "turn"})))
    studio = start(str(path), "--theme", theme)
    film = Film(studio, f"tries-{theme}", tmp_path)
    studio.use_virtual_pepper("turn")
    before = studio.blocks()
    with film.step("A click on a block of the toolbox lets the robot do it"):
        studio.open_category("Movement")
        studio.page(WATCH)
        studio.point(".blocklyFlyout .robot_pepper_do_turn > .blocklyPath", dx=10, dy=10)
        studio.says("Trying “turn”")
        until(lambda: studio.page("window.nepHasGlowed"), "it has glowed")
    studio.says("Tried “turn”")
    assert studio.blocks() == before, "nothing is added to the program"
    with film.step("A click on a sensor shows its value"):
        studio.open_category("Sensors")
        studio.point(".blocklyFlyout .robot_pepper_get_battery > .blocklyPath", dx=10, dy=10)
        value = str(until(lambda: studio.page(ANSWER), "its value is shown"))
        assert re.fullmatch(r"\d+ %", value)
        studio.says(value)
    with film.step("The round button runs from the selected block on"):
        left, top, width, height = studio.spot(".blocklySvg")
        studio.screen.click(left + width - 120, top + height / 2)  # closes the flyout
        until(lambda: studio.page(CLOSED), "the toolbox is closed")
        studio.point("[data-id=turn] > .blocklyPath", dx=12, dy=12)
        studio.point(".nepTryHandle", dx=10, dy=10)
        studio.says("Trying “turn”")
        until(lambda: "turn" in studio.outlined("running"), "the real block glows")
        assert "say First" not in studio.outlined("running")
    studio.says("Tried “turn”")
    studio.point("[data-id='say First'] > .blocklyPath", dx=12, dy=12)
    studio.screen.key("Return", ["Ctrl"])
    studio.says("Trying “say”")
    studio.screen.key("F12")
    studio.says("“say” was stopped")
