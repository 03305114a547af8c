"""Filmed first hour of a teacher with the mouse alone: every step has a caption and is checked."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import pytest

import nep
from tests.e2e.film import Film, MouseOnly
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.teacher_session import (
    BACKPACK,
    BIN,
    TAB,
    Counted,
    Hands,
    blocks_of,
    has_no_problem,
    has_problem,
    holds,
    kind_of,
    value_of,
    warnings,
    words_of,
)
from tests.e2e.test_tabs import tabs
from tests.e2e.test_virtual_robots import RoomOnScreen
from tests.e2e.waiting import until
from tests.e2e.x11 import RIGHT

pytestmark = pytest.mark.timeout(900)
MAX_CLICKS, MAX_DRAGS = 4, 2  # from the start to the first motion
HEAD = 150  # height of Pepper's head above the floor, in units of its drawing
FIGHT = "both move Pepper at the same time"
WHY = "document.querySelector('.nepWhy')?.textContent ?? ''"


class Mouse(MouseOnly, Counted):
    """Mouse that counts clicks and drags, on a screen without a keyboard."""


@dataclass
class Hour:
    """Shared state of all parts of the film: window, film, mouse and room."""

    studio: Studio
    film: Film
    hand: Hands
    mouse: Mouse
    room: RoomOnScreen
    home: Path

    def follow(self, studio: Studio) -> None:
        """Continue in another window."""
        studio.screen = self.mouse
        self.studio = self.hand.studio = self.room.studio = studio
        self.film.follow(studio)


@pytest.fixture
def hour(start: Callable[..., Studio], tmp_path: Path, address: str) -> Iterator[Hour]:
    home = tmp_path / "teacher"
    home.mkdir()
    studio = start(HOME=str(home))
    studio.screen = mouse = Mouse(studio.screen.display)
    film = Film(studio, "hour-mouse", tmp_path)
    until(lambda: nep.masters.master.is_running(address, 0.2), "the network is there")
    with nep.node("watcher", master=address) as node:
        yield Hour(studio, film, Hands(studio), mouse, RoomOnScreen(studio, node), home)
    mouse.close()


def test_first_hour_of_a_teacher_is_completed_by_mouse(hour: Hour, start: Callable[..., Studio]) -> None:
    turn = move_the_robot(hour)
    go_the_first_steps(hour, turn)
    greet(hour)
    touched = react_to_touch(hour)
    broadcast(hour, touched)
    make_mistakes(hour)
    fight(hour)
    carry_to_another_tab(hour)
    come_back_after_a_crash(hour, start)
    take_out_of_the_bin(hour)
    pack_for_another(hour)
    keep(hour)
    assert len(hour.film.pictures) >= 30


def run(hour: Hour) -> None:
    hour.studio.click("Run", kind="RunButton")
    until(lambda: hour.studio.outlined("running"), "a block glows")


def stop(hour: Hour) -> None:
    hour.studio.click("Stop", kind="StopButton")
    hour.studio.find("Run", kind="RunButton", enabled=True)
    until(lambda: not hour.studio.outlined("running"), "nothing glows")


def touch(hour: Hour) -> None:
    """Click Pepper's head in the room."""
    at = hour.room.state("Pepper")
    hour.mouse.click(*hour.room.on_screen((at["x"], at["y"]), up=HEAD))


def move_the_robot(hour: Hour) -> str:
    """Film the path from the start page to the first motion; return the id of the turn block."""
    studio, film, hand, mouse = hour.studio, hour.film, hour.hand, hour.mouse
    with film.step("The start page asks what you would like to do"):
        studio.says("What would you like to do?")
    with film.step("One click: a robot, and an empty page that says the first step"):
        studio.click("Use the virtual robot")
        until(lambda: "Drag “when started” here" in str(studio.page("document.body.innerText")), "it says")
        studio.says("Pepper ready")
    with film.step("“when started” is dragged onto the page"):
        hat = hand.put("Events", "events_started", 60, 40)
    with film.step("“turn” is dragged below it"):
        turn = hand.below(hat, "Movement", "robot_pepper_do_turn")
        until(lambda: hour.room.state("Pepper"), "the robot tells how it is")
        before = hour.room.state("Pepper")["theta_deg"]
    with film.step("Run: the robot moves after four clicks and two drags"):
        studio.click("Run", kind="RunButton")
        until(lambda: abs(hour.room.state("Pepper")["theta_deg"] - before) > 2, "the robot turns")
        assert mouse.clicks <= MAX_CLICKS, mouse.clicks
        assert mouse.drags <= MAX_DRAGS, mouse.drags
    return turn


def go_the_first_steps(hour: Hour, turn: str) -> None:
    studio, film, hand = hour.studio, hour.film, hour.hand
    with film.step("Help has first steps; those that are done are checked"):
        studio.choose("Help", "First steps")
        studio.find("Place “say” below it: the next step")
    with film.step("“say” comes between “when started” and “turn”"):
        (hat,) = kind_of(studio, "events_started")
        say = hand.below(hat, "Speech", "robot_pepper_do_say")
        until(lambda: holds(studio, say, turn), "“turn” hangs below it")
        studio.find("Press Run and listen: the next step")
    with film.step("Run: it speaks, and what is built already is checked at once"):
        studio.click("Run", kind="RunButton")
        studio.find("Press Run, then Stop while the robot turns: the next step")
    with film.step("Run again, and Stop: all six are done"):

        def is_stopped_in_time() -> bool:
            """Run, and press Stop; on a busy computer the robot may have come to its end before."""
            run(hour)
            stop(hour)
            return bool(studio.all("First steps done"))

        until(is_stopped_in_time, "the first steps are done")
        studio.says("6 of 6")


def greet(hour: Hour) -> None:
    studio, film, hand = hour.studio, hour.film, hour.hand
    with film.step("Greeting: “if” comes first; Problems says that its condition is missing"):
        (hat,) = kind_of(studio, "events_started")
        condition = hand.below(hat, "Control", "control_if")
        has_problem(studio, "if needs a condition")
    with film.step("“sees a face” goes into the gap: nothing to fix"):
        hand.fill(condition, "Sensors", "robot_pepper_get_sees_face")
        has_no_problem(studio)
    with film.step("“wave” goes into it"):
        wave = hand.inside(condition, "Movement", "robot_pepper_do_wave")
    with film.step("The robot turns to the person again; Run: it greets who is there"):
        studio.click("Reset the robot and its room")
        until(lambda: abs(hour.room.state("Pepper")["theta_deg"]) < 1, "it is where it was at first")
        run(hour)
        until(lambda: wave in studio.outlined("running"), "it waves")
    stop(hour)


def react_to_touch(hour: Hour) -> str:
    """Film a script that counts touches and fills a list; return the id of its last block."""
    studio, film, hand = hour.studio, hour.film, hour.hand
    with film.step("Reaction to touch: its own start block"):
        hat = hand.put("Sensors", "robot_pepper_when_touched", 430, 40)
        sound = hand.below(hat, "Speech", "robot_pepper_do_play_sound")
    with film.step("A sound is chosen"):
        hand.choose(sound, "beep", "cheer")
        until(lambda: "cheer" in words_of(studio, sound), "the block says so")
    with film.step("A counter: a name is suggested, nothing is typed"):
        hand.press_button("Variables", "New variable")
        at = middle(studio.find("New variable", kind="QLineEdit")["rect"])
        hour.mouse.click(*at, RIGHT)
        studio.pick("Copy")  # pasted later as the name of a behaviour
        studio.click("Create")
        change = hand.below(sound, "Variables", "variables_change")
    with film.step("A list, which nothing has set yet: Problems says so"):
        add = hand.below(change, "Lists", "lists_add")
        has_problem(studio, "“list” is used but never set")
    with film.step("One click fixes it"):
        studio.click("Set it to an empty list at the start")
        has_no_problem(studio)
    with film.step("Run, and two touches: the Variables panel shows both values"):
        studio.click("Variables", kind="TitleTab")
        run(hour)
        for number in (1, 2):
            touch(hour)
            until(lambda number=number: value_of(studio, "count") == str(number), f"it has counted {number}")
        until(lambda: value_of(studio, "list") == "2 items: apple, apple", "the list has two")
    stop(hour)
    studio.click("Problems", kind="TitleTab")
    return add


def broadcast(hour: Hour, above: str) -> None:
    studio, film, hand = hour.studio, hour.film, hour.hand
    with film.step("A second robot comes into the same room"):
        studio.choose("Robots", "Use the virtual Turtle")
        studio.says("2 robots")
        before = until(lambda: hour.room.state("Turtle"), "the Turtle tells how it is")
    with film.step("A broadcast, with a name of its own that is suggested"):
        sends = hand.below(above, "Events", "events_broadcast")
        hand.choose(sends, "start quiz", "New message")
        studio.point(".blocklyDialogConfirmButton", 12, 10)
        until(lambda: "message 1" in words_of(studio, sends), "the block says so")
        has_problem(studio, "Nothing receives “message 1”")
    with film.step("One click adds what receives it; it is dragged where there is room"):
        studio.click("Add “when I receive”")
        (receives,) = until(lambda: kind_of(studio, "events_received"), "it is there")
        hand.move(receives, hand.free(420, 330))
        hand.below(receives, "Movement", "robot_diffdrive_do_move", place=1)
        has_no_problem(studio)
    with film.step("A touch on Pepper, and the Turtle moves"):
        run(hour)
        touch(hour)

        def way() -> float:
            now = hour.room.state("Turtle")
            return abs(now["x"] - before["x"]) + abs(now["y"] - before["y"])

        until(lambda: way() > 0.1, "the Turtle moves")
    stop(hour)


def make_mistakes(hour: Hour) -> None:
    studio, film, hand = hour.studio, hour.film, hour.hand
    with film.step("A loose block: Problems says that it does not run"):
        walk = hand.put("Movement", "robot_pepper_do_walk", 60, 400)
        has_problem(studio, "walk doesn't run")
    with film.step("A wrong drop: why unsupported value stands where it was let go"):
        face = hand.take("Sensors", "robot_pepper_get_sees_face", hand.gap(walk))
        until(lambda: studio.page(WHY) == "“walk” needs a number here", "it says why")
        assert not holds(studio, walk, face)
    with film.step("The value goes to the toolbox, which deletes it"):
        hand.delete(face)
        has_no_problem(studio, "sees a face")
    with film.step("The loose block goes to its place: nothing to fix"):
        (wave,) = kind_of(studio, "robot_pepper_do_wave")
        hand.move(walk, hand.end(wave))
        until(lambda: holds(studio, wave, walk), "it hangs there")
        has_no_problem(studio)


def fight(hour: Hour) -> None:
    studio, film, hand = hour.studio, hour.film, hour.hand
    with film.step("A second behaviour in a tab of its own"):
        studio.click("New behaviour", kind="IconButton")
        until(lambda: len(tabs(studio)) == 2 and not blocks_of(studio), "its page is empty")
    with film.step("Two scripts that move one robot at the same time: Problems says so"):
        one = hand.put("Events", "events_started", 60, 40)
        hand.below(one, "Movement", "robot_pepper_do_turn")
        other = hand.put("Events", "events_started", 430, 40)
        walk = hand.below(other, "Movement", "robot_pepper_do_walk")
        has_problem(studio, FIGHT)
    with film.step("Run: the block that lost says by what it was replaced"):
        studio.click("Run", kind="RunButton")
        until(lambda: any("was replaced by" in each for each in warnings(studio)), "the loser says so")
    stop(hour)
    with film.step("One click puts one after the other"):
        studio.click("Run one after the other")
        has_no_problem(studio)
        until(lambda: holds(studio, one, walk), "one script does both")
        until(lambda: not warnings(studio), "nothing warns any more")


def carry_to_another_tab(hour: Hour) -> None:
    studio, film, hand = hour.studio, hour.film, hour.hand
    first = min(studio.all(kind="BehaviourTab"), key=lambda each: each["rect"][0])
    with film.step("The second tab gets a name: pasted, for nothing is typed here"):
        studio.choose("File", "Rename the behaviour")
        field = studio.find(kind="NameField")
        hour.mouse.click(*middle(field["rect"]), RIGHT)
        studio.pick("Paste")
        until(lambda: studio.find(kind="NameField")["text"] == "count", "it is pasted")
        studio.point(f"{TAB} .blocklySvg", 700, 500)
        until(lambda: tabs(studio)[1:] == ["count, not saved"], lambda: f"{tabs(studio)}")
    with film.step("A block is dragged onto the tab of the other behaviour, which takes it"):
        (walk,) = kind_of(studio, "robot_pepper_do_walk")
        hand.carry(walk, *middle(first["rect"]))
        hour.mouse.release()
        studio.says("Moved 1 block to")
        until(lambda: len(kind_of(studio, "robot_pepper_do_walk")) == 2, "its tab is open and has both")


def come_back_after_a_crash(hour: Hour, start: Callable[..., Studio]) -> None:
    journals = hour.studio.home / "journal"
    with hour.film.step("Everything is kept while it is built; then Studio is killed"):
        until(lambda: len(list(journals.glob("*.json"))) == 2, "both behaviours are kept")
        kept = lambda: "".join(each.read_text("utf-8") for each in journals.glob("*.json"))  # noqa: E731
        until(lambda: kept().count('"robot_pepper_do_walk"') == 2, "with the last edit")
    before, names = blocks_of(hour.studio), tabs(hour.studio)
    hour.studio.kill()
    hour.follow(start(HOME=str(hour.home)))
    studio = hour.studio
    with hour.film.step("The next start offers what was not saved"):
        studio.says("Restore unsaved work?")
    with hour.film.step("One click: all is back, and the tab that was worked on shows"):
        studio.click("Restore")
        until(lambda: blocks_of(studio) == before, lambda: f"{blocks_of(studio)} is not {before}")
        assert tabs(studio) == names
        studio.says("2 robots", 60)  # the virtual robots are restarted, too


def take_out_of_the_bin(hour: Hour) -> None:
    studio, film, hand = hour.studio, hour.film, hour.hand
    with film.step("A whole script is dragged onto the toolbox"):
        (touched,) = kind_of(studio, "robot_pepper_when_touched")
        before = blocks_of(studio)
        hand.delete(touched)
    with film.step("The bin has it"):
        hand.open_bin()
    with film.step("A click takes it back"):
        studio.point(f"{BIN} .robot_pepper_when_touched > .blocklyPath", 10, 14)
        until(lambda: blocks_of(studio) == before, "all its blocks are back")


def pack_for_another(hour: Hour) -> None:
    studio, film, hand = hour.studio, hour.film, hour.hand
    with film.step("The script is dragged onto the backpack, which keeps a copy"):
        (touched,) = kind_of(studio, "robot_pepper_when_touched")
        hand.pack(touched)
        label = "document.querySelector('.nepBackpack').getAttribute('aria-label')"
        until(lambda: studio.page(label) == "Backpack (1)", "one script is in it")
    with film.step("Another behaviour: the backpack has it there, too"):
        studio.click("count, not saved", kind="BehaviourTab")
        until(lambda: not kind_of(studio, "robot_pepper_when_touched"), "the other one shows")
        hand.open_backpack()
    with film.step("A click takes it out"):
        studio.point(f"{BACKPACK} .robot_pepper_when_touched > .blocklyPath", 10, 14)
        until(lambda: kind_of(studio, "robot_pepper_when_touched"), "it is there")
        studio.click("New behaviour, not saved", kind="BehaviourTab")
        until(lambda: touched in blocks_of(studio), "the first one has it, too")


def keep(hour: Hour) -> None:
    studio, film = hour.studio, hour.film
    with film.step("A picture of all blocks: where, and as what"):
        studio.choose("File", "Save blocks as image")
        studio.find(kind="FileSheet")
    with film.step("It is saved"):
        studio.click("Save", kind="Button")
        studio.says("Saved New behaviour.png")
        (picture,) = hour.home.glob("*.png")
        read = cv2.imread(str(picture))
        assert min(read.shape[:2]) > 400, "the blocks, twice as large"
        assert read.std() > 20, "there is something on it"
    with film.step("Save: the proposed name is taken"):
        studio.choose("File", "Save")
        studio.click("Save", kind="Button")
        until(lambda: tabs(studio)[0] == "New behaviour", "nothing is unsaved there")
        saved = json.loads((hour.home / "New behaviour.nepb").read_text("utf-8"))
        assert len(saved["workspace"]["blocks"]["blocks"]) >= 3
