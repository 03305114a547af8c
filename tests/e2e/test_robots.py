"""Tests of the first use of the virtual robots and of a real one, its permission and Stop."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.e2e.programs import ROOT, Program
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def press(studio: Studio, name: str) -> None:
    """Wait until a widget no longer moves, then click it: the layout of a new panel takes a while."""
    places: list[object] = []

    def rests() -> bool:
        places.append(studio.find(name)["rect"])
        return places[-3:] == [places[-1]] * 3

    until(rests, f"{name} comes to rest")
    studio.click(name)


@pytest.fixture
def table(start: Callable[..., Studio], tmp_path: Path) -> Iterator[Studio]:
    """Studio with the example driver, which is no virtual robot.

    The robot turns one degree per second, so that it still turns when Stop is pressed on a slow
    computer.
    """
    studio = start()
    network = {"NEP_MASTER": studio.master}
    fast = (ROOT / "examples" / "thirty_line_driver.py").read_text("utf-8")
    assert "call.wait(0.01)" in fast
    slow = tmp_path / "table.py"
    slow.write_text(fast.replace("call.wait(0.01)", "call.wait(1)"), "utf-8")
    with Program(str(slow), "--name", "Table", environment=network):
        studio.says("Table ready")
        studio.choose("Robots", "Try what a robot can do")
        studio.find("Try turn")
        yield studio


def test_real_robot_moves_only_after_permission_which_is_requested_once(table: Studio) -> None:
    press(table, "Try turn")
    table.says("Allow Table to move?")
    table.says("“turn” moves Table.")
    table.click("Cancel")
    until(lambda: not table.all("Allow motion"), "the question has gone")
    assert not table.all("Cancel turn")
    press(table, "Try turn")
    table.click("Allow motion")
    table.find("Cancel turn")
    table.screen.key("F12")
    table.says("Table stopped (")
    table.says("stopped after ")
    press(table, "Try turn")
    table.find("Cancel turn")
    assert not table.all("Allow motion")
    table.click("Cancel turn")
    table.find("Try turn")


def test_start_page_leads_to_a_connected_robot(studio: Studio) -> None:
    studio.click("Use the virtual robot")
    studio.says("Pepper ready")
    studio.says("virtual, ready")
    studio.find("Stop", kind="StopButton", enabled=True)
    studio.open_category("Movement")

    def colours() -> int:
        drawing = studio.picture(studio.find(kind="RoomView"))
        return len({tuple(pixel) for pixel in drawing[::7, ::7].reshape(-1, 3)})

    until(lambda: colours() > 20, "the room is drawn")
    (robot,) = studio.children("app.robots.simulated")
    assert studio.quit() == 0
    until(lambda: not robot.is_running(), "the virtual robot ends with its window")


def test_virtual_turtle_connects_and_moves_without_a_motion_permission(start: Callable[..., Studio]) -> None:
    studio = start()
    studio.choose("Robots", "Use the virtual Turtle")
    studio.says("Turtle ready")
    studio.choose("Robots", "Try what a robot can do")
    studio.find("Robots in their room")
    press(studio, "Try turn")  # virtual robots need no permission
    studio.says("done in ")
    assert not studio.all("Allow motion")
