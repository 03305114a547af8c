"""Tests of F12, which stops the robot and the program whichever widget has the focus."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

import nep
from tests.e2e.behaviours import block, forever, say, started, turn, write
from tests.e2e.person import Seen, middle
from tests.e2e.shared_studio import SharedStudio
from tests.e2e.studio import Studio
from tests.e2e.waiting import until
from tests.e2e.x11 import RIGHT

pytestmark = pytest.mark.timeout(400)


@pytest.fixture
def turning(shared: SharedStudio, tmp_path: Path) -> Studio:
    """Studio that runs a behaviour which turns the virtual robot in an endless loop."""
    speech = {**say("Round and round"), "x": 420, "y": 56}
    lights = {"ROBOT": "Pepper", "WHERE": "eyes", "COLOUR": "#35b0fa"}
    light = {**block("robot_pepper_do_light", fields=lights), "x": 56, "y": 360}
    path = write(tmp_path / "Turning.nepb", started(forever(turn(300))), speech, light)
    studio = shared.open(path)
    studio.click("Run", kind="RunButton")
    until(lambda: "turn" in studio.outlined("running"), "the block glows")
    return studio


def run_again(studio: Studio) -> None:
    """Start the program again, with no menu open and no block dragged."""
    studio.click("Run", kind="RunButton")
    until(lambda: "turn" in studio.outlined("running"), "the block glows again")


def stands_still(studio: Studio) -> None:
    """Check that the stop is confirmed, the published state stays still and the program has ended."""

    def can_run() -> bool:
        """Until Run is enabled, the text is that of an earlier stop; the Developer layout shows none."""
        return bool(studio.all("Run", kind="RunButton", enabled=True)) or not studio.all(kind="RunButton")

    until(can_run, "the behaviour has stopped")
    studio.says("Pepper stopped (")
    with nep.node("listener", master=studio.master) as node:
        states = node.new_sub("/Pepper/state", "json")
        heard = [states.receive(30.0).payload for _ in range(4)]
    assert not any(state["moving"] for state in heard)
    assert len({state["theta_deg"] for state in heard}) == 1
    until(lambda: not studio.programs(), "the program's process has ended")
    until(lambda: not studio.outlined("running"), "nothing glows any more")


def test_f12_in_the_web_view_stops(turning: Studio) -> None:
    turning.point("[data-id=turn] > .blocklyPath", dx=60, dy=6)
    until(lambda: turning.page("document.hasFocus()"), "the web view has the keyboard")
    turning.screen.key("F12")
    stands_still(turning)
    until(lambda: turning.outlined("stopped"), "the block where it stopped is outlined")


def test_ctrl_period_while_a_block_text_is_edited_stops(turning: Studio) -> None:
    turning.point("[data-id='text Round and round'] .blocklyInputField", dx=10, dy=10)
    typing = "document.activeElement && document.activeElement.classList.contains('blocklyHtmlInput')"
    until(lambda: turning.page(typing), "the text is edited")
    turning.screen.type("Hello")
    turning.screen.key(".", ["Ctrl"])
    stands_still(turning)


def filter_topics(studio: Studio, words: str) -> None:
    """Replace the filter of the topics in the Developer layout, which keeps the previous one."""
    studio.click("Developer")
    studio.click("Filter topics")
    studio.screen.key("a", ["Ctrl"])
    studio.screen.type(words)


def test_f12_in_a_field_of_the_developer_layout_stops(turning: Studio) -> None:
    filter_topics(turning, "pose")
    turning.row("Topics", "/Pepper/pose")
    turning.screen.key("F12")
    stands_still(turning)


def test_f12_during_the_drag_of_a_field_stops(turning: Studio) -> None:
    filter_topics(turning, "pose")
    until(lambda: len(turning.rows("Topics")) == 1, "only the topic of the pose is listed")
    turning.click_row("Topics", "/Pepper/pose")
    x, y = middle(turning.still_row("Newest message", "theta")["rect"])
    turning.screen.move(x, y)
    turning.screen.press()
    turning.screen.glide(x + 200, y + 100)
    turning.screen.key("F12")
    stands_still(turning)
    turning.screen.release()


@pytest.mark.timeout(300)  # three runs
def test_stop_works_while_blocks_are_dragged_or_a_block_field_is_edited(turning: Studio) -> None:
    """Stop works at once, and the drag or the menu is not cancelled by it."""
    before = sorted(turning.blocks())
    left, top, _, _ = turning.spot("[data-id='say Round and round'] > .blocklyPath")
    turning.screen.move(left + 12, top + 18)
    turning.screen.press()
    turning.screen.glide(left + 160, top + 90)
    until(lambda: turning.page("!!document.querySelector('.blocklyDragging')"), "the block is in the hand")
    turning.screen.key("F12")
    stands_still(turning)
    turning.screen.release()
    until(lambda: not turning.page("!!document.querySelector('.blocklyDragging')"), "the block is put down")
    assert sorted(turning.blocks()) == before

    run_again(turning)
    turning.point("[data-id=light] .nepColour", dx=8, dy=8)
    typing = "document.hasFocus() && document.activeElement.matches('.nepPalette input')"

    def has_the_keyboard() -> bool:
        """Click the field again until it has the focus: a click may miss while the palette still moves."""
        turning.point(".nepPalette input", dx=12, dy=10)
        return bool(turning.page(typing))

    until(has_the_keyboard, "the number of the colour has the keyboard")
    turning.screen.key("a", ["Ctrl"])
    turning.screen.type("#12")
    number = "document.querySelector('.nepPalette input').value"
    until(lambda: turning.page(number) == "#12", "the number is typed")
    turning.screen.key(".", ["Ctrl"])
    stands_still(turning)
    assert turning.page(number) == "#12", "as it was typed"
    turning.screen.key("Escape")
    until(lambda: not turning.page("!!document.querySelector('.nepPalette')"), "the palette is closed")

    run_again(turning)
    turning.point("[data-id=turn] .blocklyDropdownField", dx=10, dy=10)
    turning.spot(".blocklyDropDownDiv .blocklyMenuItem")
    turning.screen.click(*middle(turning.find(kind="StopButton")["rect"]))
    stands_still(turning)


def menus(studio: Studio) -> list[Seen]:
    """Return the open menus of Studio."""
    return studio.menus("popup")


def a_menu_in_a_menu(studio: Studio) -> None:
    studio.choose("View", "Panels")
    until(lambda: any("Console" in str(each["entries"]) for each in menus(studio)), "it is open")


def the_menu_of_a_tab(studio: Studio) -> None:
    studio.screen.click(*middle(studio.find("Turning", kind="BehaviourTab")["rect"]), RIGHT)
    until(lambda: menus(studio), "the tab's menu is open")


def the_menu_of_a_block(studio: Studio) -> None:
    left, top, _, _ = studio.spot("[data-id='say Round and round'] > .blocklyPath")

    there = "!!document.querySelector('.blocklyContextMenu')"

    def is_open() -> bool:
        """Right-click until the menu opens: X may still grab the mouse for the previous menu."""
        studio.screen.click(left + 12, top + 18, RIGHT)
        with suppress(AssertionError):
            return until(lambda: bool(studio.page(there)), "it is open", 5.0)
        return False

    until(is_open, "the block's menu is open")


def a_menu_in_the_palette(studio: Studio) -> None:
    studio.screen.key("k", ["Ctrl"])
    field = studio.find(kind="_Field", focus=True)
    studio.screen.click(*middle(field["rect"]), RIGHT)
    until(lambda: menus(studio), "the field's menu is open")


def settings(studio: Studio) -> None:
    studio.screen.key(",", ["Ctrl"])
    studio.find(kind="SettingsSheet")


def a_name_that_is_typed(studio: Studio) -> None:
    studio.screen.key("s", ["Ctrl", "Shift"])
    studio.find("File name", focus=True)
    studio.screen.key("a", ["Ctrl"])
    studio.screen.type("Half")


def test_stop_key_and_one_click_on_stop_work_while_a_menu_sheet_or_name_field_is_open(
    turning: Studio,
) -> None:
    """X grabs the mouse for a popup, so the first click outside must not only close it."""
    answers: list[nep.Message] = []
    with nep.node("listener", master=turning.master) as node:
        node.new_sub("/Pepper/answer", "robot/answer", sink=answers.extend)
        until(lambda: answers, "the answers to the turns are heard: a stop is answered only once")
        opened = (
            a_menu_in_a_menu, the_menu_of_a_tab, the_menu_of_a_block, a_menu_in_the_palette, settings,
            a_name_that_is_typed,
        )  # fmt: skip
        for number, open_it in enumerate(opened):
            open_it(turning)
            place = middle(turning.find(kind="StopButton")["rect"])
            for press in (lambda: turning.screen.key("F12"), lambda at=place: turning.screen.click(*at)):
                before = len(stops_of(answers))
                press()
                until(lambda before=before: len(stops_of(answers)) > before, f"Stop, with {open_it.__name__}")
            if number == 0:
                stands_still(turning)
            if open_it is not a_name_that_is_typed:
                turning.screen.key("Escape")
                until(lambda: not menus(turning) and not turning.all(kind="Scrim"), "all is closed")
    turning.screen.type("way")
    name = "File name"
    until(lambda: turning.find(name, focus=True)["text"] == "Halfway", "it is typed where it was")
    turning.screen.key("Escape")
    until(lambda: not turning.all(kind="FileSheet"), "the sheet has the keys")


def stops_of(messages: list[nep.Message]) -> list[str]:
    """Return the ids of the stops that the robot has executed."""
    told = [message.payload for message in messages]
    return [each["id"] for each in told if each["op"] == "stop" and each["state"] == "succeeded"]


def test_stop_ends_a_hung_program(turning: Studio) -> None:
    (program,) = turning.programs()
    program.suspend()
    turning.screen.click(*middle(turning.find(kind="StopButton")["rect"]))
    stands_still(turning)
    until(lambda: not program.is_running(), "Studio has noticed its end")  # until then it is a zombie


def test_robot_stops_when_its_program_is_killed(turning: Studio) -> None:
    (program,) = turning.programs()
    program.kill()
    stands_still(turning)
    turning.says("The behaviour stopped unexpectedly.")
