"""Tests of commands and Stop with the keyboard alone, also from inside the page."""

from __future__ import annotations

import pytest

from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
FIELD = "Find a command, panel, topic, robot or file"


def chosen_first(studio: Studio, words: str) -> None:
    """Wait until this entry is the first match of the palette."""
    until(
        lambda: words in [row["texts"][0] for row in studio.rows("Matches")][1:2],
        lambda: f"{words} is first: {studio.rows('Matches')[:3]}",
    )


def test_command_palette_opened_from_the_page_runs_a_command_and_changes_a_shortcut(studio: Studio) -> None:
    studio.click("New behaviour")
    studio.point(".blocklySvg", 300, 200)  # moves the keyboard focus into the page
    studio.screen.key("k", ["Ctrl"])
    studio.find(FIELD, focus=True)
    studio.screen.type("larger")
    chosen_first(studio, "Larger text")
    small = studio.find("Blocks")["rect"]
    studio.screen.key("Return")
    until(lambda: not studio.all(FIELD), "the palette closes")
    until(lambda: studio.find("Blocks")["rect"][2] > small[2], "the text grows")

    studio.screen.key("k", ["Ctrl"])
    studio.find(FIELD, focus=True)
    studio.screen.type("smaller")
    chosen_first(studio, "Smaller text")
    studio.screen.key("Return", ["Ctrl"])  # assigns another shortcut
    studio.says("Press the new shortcut for “Smaller text”")
    studio.screen.key("F7")
    studio.says("The shortcut of “Smaller text” is now F7.")
    studio.screen.key("Escape")
    until(lambda: not studio.all("Reset all"), "the sheet closes")

    studio.point(".blocklySvg", 300, 200)
    studio.screen.key("F7")
    until(lambda: studio.find("Blocks")["rect"][2] == small[2], "the new key works inside the page")


def test_stop_key_and_button_work_while_the_palette_is_open(studio: Studio) -> None:
    studio.click("Use the virtual robot")
    studio.says("Pepper ready")
    studio.screen.key("k", ["Ctrl"])
    studio.find(FIELD, focus=True)
    studio.screen.key("F12")
    studio.says("Pepper stopped (")
    assert studio.all(FIELD)

    def colour() -> tuple[int, ...]:
        red = studio.picture(studio.find("Stop", kind="StopButton"))
        return tuple(map(int, red[red.shape[0] // 2, 12]))

    # The token "stop" of the light theme: not dimmed.
    until(lambda: colour() == (0xC8, 0x28, 0x2D), lambda: f"Stop is red: {colour()}")
    studio.click("Stop", kind="StopButton")
    studio.find(FIELD, focus=True)  # pressing Stop doesn't take the keyboard focus
    studio.screen.key("Escape")
    until(lambda: not studio.all(FIELD), "Esc leaves the palette")
