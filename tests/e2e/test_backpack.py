"""Test of the backpack with a real mouse: blocks are copied between files and kept across a restart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import say, started, write
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.test_carrying import PATH, carry
from tests.e2e.test_tabs import SHOWN, shown, tabs
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
PACKED = ".nepTab:not([hidden]) .nepPacked .blocklyBlockCanvas > .blocklyBlock"
SENTENCES = f"{SHOWN}.querySelectorAll('.blocklyBlockCanvas .robot_pepper_do_say').length"
TITLE = "document.querySelector('.nepBackpack').title"


def on_the_backpack(studio: Studio) -> tuple[float, float]:
    return middle(studio.spot(".nepBackpack"))


def test_backpack_carries_blocks_between_files_and_persists_after_a_restart(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    greeting = write(tmp_path / "Greeting.nepb", started(say("One", say("Two", say("Three")))))
    quiz = write(tmp_path / "Quiz.nepb", started(say("Four")))
    studio = start(str(quiz), str(greeting))
    until(lambda: "say Three" in shown(studio), "the second shows")
    before = shown(studio)
    carry(studio, "say Two", *on_the_backpack(studio))
    studio.screen.release()
    studio.says("Added 2 blocks to the backpack")
    assert shown(studio) == before
    assert tabs(studio) == ["Quiz", "Greeting"], "nothing is edited"
    studio.screen.key("Tab", ["Ctrl"])
    until(lambda: "say Four" in shown(studio), "the other tab shows")
    studio.screen.click(*on_the_backpack(studio))
    left, top, _, _ = studio.spot(PATH.format("say Four"))
    studio.drag(f"{PACKED} > .blocklyPath", left + 40, top + 200)
    until(lambda: studio.page(f"{SHOWN}.querySelectorAll('.blocklyDragging').length") == 0, "it is let go")
    until(lambda: tabs(studio) == ["Quiz, not saved", "Greeting"], "this one is edited")
    until(lambda: studio.page(TITLE) == "Backpack (1)", "it stays in the backpack")
    studio.screen.key("s", ["Ctrl"])
    until(lambda: tabs(studio) == ["Quiz", "Greeting"], "it is saved")
    assert studio.quit() == 0

    again = start(str(quiz))
    until(lambda: again.page(TITLE) == "Backpack (1)", "it is full at the next start")
    assert again.page(SENTENCES) == 3
    assert again.quit() == 0
