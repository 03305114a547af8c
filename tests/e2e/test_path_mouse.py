"""Filmed user journey with the mouse alone, from the start page to a saved behaviour."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.e2e.film import Film, MouseOnly, topic
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.teacher_session import Hands, of, words_of
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def colours_of(studio: Studio, block: str) -> str:
    """Return the HTML of the colour field of a block."""
    field = f"document.querySelector(\"[data-id='{block}'] .nepColour\")"
    return str(studio.page(f"{field}.outerHTML"))


def test_user_journey_from_start_page_to_saved_behaviour_by_mouse(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    home = tmp_path / "person"
    home.mkdir()
    studio = start(HOME=str(home))
    studio.screen = mouse = MouseOnly(studio.screen.display)
    film, hand = Film(studio, "mouse", tmp_path), Hands(studio)

    with film.step("The start page asks what you would like to do"):
        studio.says("What would you like to do?")
    with film.step("One click: the virtual robot comes"):
        studio.click("Use the virtual robot")
        studio.says("Pepper ready")
        studio.says("virtual, ready")
    with film.step("A new behaviour, by the menu"):
        studio.choose("File", "New behaviour")
        studio.find("New behaviour", kind="BehaviourTab")
        until(lambda: studio.blocks() == [], "its page is empty")
    with film.step("The first block is dragged from the toolbox"):
        hat = hand.put("Events", "events_started", 60, 40)
    with film.step("What is to be done for ever goes below it"):
        loop = hand.below(hat, "Control", "control_forever")
    with film.step("The eyes, a sentence, a turn and a wait are dragged into it"):
        light = hand.inside(loop, "Face and lights", "robot_pepper_do_light")
        say = hand.below(light, "Speech", "robot_pepper_do_say")
        turn = hand.below(say, "Movement", "robot_pepper_do_turn")
        hand.below(turn, "Control", "control_wait")
    with film.step("A drop-down: turn to the right"):
        hand.choose(turn, "left", "right")
        until(lambda: "right" in words_of(studio, turn), "the block says so")
    with film.step("A colour: the eyes become red"):
        studio.point(f"{of(light)} .nepColour", 12, 9)
        studio.point(".nepPalette [title=red]", 8, 8)
        until(lambda: "#ff3b30" in colours_of(studio, light), "the block has it")
    with film.step("Run: the block that runs now glows"):
        studio.click("Run", kind="RunButton")
        until(lambda: studio.outlined("running"), "a block glows")
        studio.find("Pause", kind="RunButton", enabled=True)
    with film.step("Pause: the program waits, the robot is paused"):
        studio.click("Pause", kind="RunButton")
        studio.says("Paused at “")
        until(lambda: studio.outlined("stopped"), "the next block is outlined")
    with film.step("Resume"):
        studio.click("Resume", kind="RunButton")
        until(lambda: studio.outlined("running"), "it glows again")
    with film.step("Stop: every robot has replied"):
        studio.click("Stop", kind="StopButton")
        studio.says("Pepper stopped (")
        until(lambda: not studio.outlined("running"), "nothing glows")
    see_what_the_robot_says(studio, film, mouse)
    save(studio, film, home)
    assert len(film.pictures) >= 15


def see_what_the_robot_says(studio: Studio, film: Film, mouse: MouseOnly) -> None:
    with film.step("The Developer layout lists the topics"):
        studio.click("Developer")
        studio.row("Topics", "/Pepper/faces")
    with film.step("One click on a topic: its newest message"):
        mouse.click(*topic(studio, "/Pepper/state"))
        until(lambda: "room" in studio.values("Newest message"), "the inspector shows it")
    with film.step("A value is opened"):
        closed = len(studio.rows("Newest message"))
        row = studio.row("Newest message", "objects")
        mouse.click(row["rect"][0] - 8, middle(row["rect"])[1])
        until(lambda: len(studio.rows("Newest message")) > closed, "its parts are there")
    with film.step("One click on a picture topic: the robot's camera"):
        mouse.click(*topic(studio, "/Pepper/camera"))
        view = studio.find(kind="ClickablePicture")
        until(lambda: studio.picture(view)[::5, ::5].std() > 20, "the picture is there")
    with film.step("The wheel makes the picture larger"):
        fitting = studio.find(kind="ClickablePicture")["description"]
        mouse.wheel(*middle(view["rect"]), 5)
        until(lambda: studio.find(kind="ClickablePicture")["description"] != fitting, "it says its size")


def save(studio: Studio, film: Film, home: Path) -> None:
    with film.step("Back to the blocks, as they were left"):
        studio.click("Behaviour", kind="_Segment")
        until(lambda: len(studio.blocks()) >= 6, "the blocks are there")
    with film.step("Save asks for a place"):
        studio.choose("File", "Save")
        studio.find(kind="FileSheet")
    with film.step("Saved"):
        studio.click("Save", kind="Button")
        until(lambda: not studio.all(kind="FileSheet"), "the dialog is gone")
        path = home / "New behaviour.nepb"
        until(path.exists, lambda: f"{path} is there: {list(home.glob('*'))}")
        until(
            lambda: not any("not saved" in str(t["name"]) for t in studio.all(kind="BehaviourTab")), "no dot"
        )
    words = path.read_text("utf-8")
    assert all(kind in words for kind in ("robot_pepper_do_say", "robot_pepper_do_turn", "control_wait"))
    (hat,) = json.loads(words)["workspace"]["blocks"]["blocks"]
    assert hat["type"] == "events_started"
    assert np.all([picture.stat().st_size > 10_000 for picture in film.pictures])
