"""Filmed user journey with the keyboard alone, from the start page to a saved behaviour."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.film import Film, KeysOnly
from tests.e2e.fingers import Fingers
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def test_user_journey_from_start_page_to_saved_behaviour_by_keyboard(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    home = tmp_path / "person"
    home.mkdir()
    studio = start(HOME=str(home))
    studio.screen = KeysOnly(studio.screen.display)
    film, fingers = Film(studio, "keys", tmp_path), Fingers(studio)

    with film.step("Tab goes over the start page"):
        studio.says("What would you like to do?")
        fingers.until_on("Tab", name="Open the Developer layout")
        fingers.until_on("Tab", ["Shift"], name="Use the virtual robot")
    with film.step("Enter: the virtual robot comes"):
        fingers.press("Return")
        studio.says("Pepper ready")
        studio.says("virtual, ready")
    with film.step("Ctrl+N: a new behaviour; its blocks are found by their words"):
        fingers.press("n", held=["Ctrl"])
        studio.spot(".blocklyToolboxCategoryLabel")
        fingers.to_canvas()
        fingers.find_block("when started", "events_started")
        fingers.find_block("forever", "control_forever")
        fingers.find_block("say", "robot_pepper_do_say")
        fingers.find_block("wait", "control_wait")
    run(studio, film, fingers)
    look_at_topics(studio, film, fingers)
    save(studio, film, fingers, home / "Keys.nepb")


def run(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("F5: the block that runs now glows"):
        fingers.press("F5")
        until(lambda: studio.outlined("running"), "a block glows")
    with film.step("F8: the program waits, the robot is paused"):
        fingers.press("F8")
        studio.says("Paused at “")
    with film.step("F10: one block"):
        before = until(lambda: studio.outlined("stopped"), "the next block is outlined")
        fingers.press("F10")
        until(lambda: studio.outlined("stopped") not in ([], before), "another block is next")
    with film.step("F12: every robot has replied"):
        fingers.press("F12")
        studio.says("Pepper stopped (")
        until(lambda: not studio.outlined("running"), "nothing glows")


def look_at_topics(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("Ctrl+K and a few letters: the Developer layout lists the topics"):
        fingers.do("developer", "Developer layout")
        studio.row("Topics", "/Pepper/state")
    with film.step("A filter and an arrow key choose a topic, Enter shows its newest message"):
        fingers.until_on("F6", name="Topics", kind="TopicsTable")
        fingers.press("/")
        studio.find("Filter topics", focus=True)
        studio.screen.type("faces")  # topics of the program that has ended leave the list at any time
        until(
            lambda: [row["texts"][0] for row in studio.rows("Topics")] == ["/Pepper/faces"],
            "only this topic is listed",
        )
        fingers.press("Return")
        studio.find("Topics", kind="TopicsTable", focus=True)
        fingers.press("Down", "Return")
        until(lambda: studio.values("Newest message"), "the inspector shows it")
    with film.step("F6: the Inspector; Ctrl+F finds a value in it"):
        fingers.until_on("F6", **{"in": "inspector"})
        fingers.press("f", held=["Ctrl"])
        studio.find("Find a key, value or $ path", focus=True)
        studio.screen.type("count")
        studio.says("1 of 1")


def save(studio: Studio, film: Film, fingers: Fingers, path: Path) -> None:
    with film.step("Alt+1: back to the blocks; Ctrl+S asks for a place"):
        fingers.press("1", held=["Alt"])
        until(lambda: len(studio.blocks()) >= 4, "the blocks are there")
        fingers.press("s", held=["Ctrl"])
        studio.find(kind="FileSheet")
        studio.find(kind="QLineEdit", focus=True)
    with film.step("A name and Enter: saved"):
        fingers.write(str(path))
        fingers.press("Return")
        until(path.exists, "the file is there")
        studio.find("Keys", kind="BehaviourTab")
    assert "robot_pepper_do_say" in path.read_text("utf-8")
