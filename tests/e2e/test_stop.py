"""F12 stops everything, whatever has the keyboard: the robot stands still and says so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import nep
from tests.e2e.behaviours import forever, say, started, turn, write
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(240)


@pytest.fixture
def turning(start: Callable[..., Studio], tmp_path: Path) -> Studio:
    """Studio with the virtual robot and a behaviour that turns for ever; it runs."""
    speech = {**say("Round and round"), "x": 420, "y": 56}
    studio = start(str(write(tmp_path / "Turning.nepb", started(forever(turn(300))), speech)))
    studio.choose("Robots", "Use the virtual Pepper")
    studio.says("Pepper ready", 40)
    studio.spot("[data-id=turn]")
    studio.click("Run", kind="RunButton")
    until(lambda: "turn" in studio.outlined("running"), "the block glows")
    return studio


def stands_still(studio: Studio) -> None:
    """The robot answered, and what it says of itself from then on is that it does not move."""
    studio.says("Pepper stopped (")
    with nep.node("listener", master=studio.master) as node:
        states = node.new_sub("/Pepper/state", "json")
        heard = [states.receive(30.0).payload for _ in range(4)]
    assert not any(state["moving"] for state in heard)
    assert len({state["theta_deg"] for state in heard}) == 1
    until(lambda: not studio.children("app.blocks.child"), "the program's process has ended")
    assert not studio.outlined("running")


def test_f12_in_the_web_view_stops(turning: Studio) -> None:
    turning.point("[data-id=turn] > .blocklyPath", dx=60, dy=6)
    until(lambda: turning.page("document.hasFocus()"), "the web view has the keyboard")
    turning.screen.key("F12")
    stands_still(turning)
    assert turning.outlined("stopped")


def test_ctrl_period_while_a_text_in_a_block_is_edited_stops(turning: Studio) -> None:
    turning.point("[data-id='text Round and round'] .blocklyInputField", dx=10, dy=10)
    typing = "document.activeElement && document.activeElement.classList.contains('blocklyHtmlInput')"
    until(lambda: turning.page(typing), "the text is edited")
    turning.screen.type("Hello")
    turning.screen.key(".", ["Ctrl"])
    stands_still(turning)


def test_f12_in_a_field_of_the_developer_layout_stops(turning: Studio) -> None:
    turning.click("Developer")
    turning.click("Filter topics")
    turning.screen.type("pose")
    turning.row("Topics", "/Pepper/pose")
    turning.screen.key("F12")
    stands_still(turning)


def test_stop_ends_a_program_that_hangs(turning: Studio) -> None:
    (program,) = turning.children("app.blocks.child")
    program.suspend()
    turning.screen.click(*middle(turning.find(kind="StopButton")["rect"]))
    stands_still(turning)
    assert not program.is_running()


def test_a_program_that_is_killed_leaves_no_robot_moving(turning: Studio) -> None:
    (program,) = turning.children("app.blocks.child")
    program.kill()
    stands_still(turning)
    turning.says("The behaviour ended by itself.")
