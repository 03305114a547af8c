"""Filmed first hour of a teacher with the keyboard alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

import nep
from tests.e2e.film import Film, KeysOnly
from tests.e2e.fingers import TAB, Fingers
from tests.e2e.studio import Studio
from tests.e2e.teacher_session import has_no_problem, has_problem, kind_of, value_of, warnings, words_of
from tests.e2e.test_tabs import tabs
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(900)  # 34 steps, on a slow computer too
BEGIN = "document.querySelector('.nepBegin:not([hidden]) .nepBeginKeys')?.textContent ?? ''"
RING = "document.querySelector('.nepRingBubble:not([hidden])')?.textContent ?? ''"
WHY = f"{TAB}.querySelector('.nepWhy').textContent"
PACK = "document.querySelector('.nepBackpack')"
BIN = f"{TAB}.querySelector('.nepSheet .blocklyBlock') !== null"
FIGHT = "both move Pepper at the same time"


def test_first_hour_of_a_teacher_is_completed_by_keyboard(
    start: Callable[..., Studio], tmp_path: Path, address: str
) -> None:
    home = tmp_path / "person"
    home.mkdir()
    studio = start(HOME=str(home))
    studio.screen = KeysOnly(studio.screen.display)
    film, fingers = Film(studio, "hour-keys", tmp_path), Fingers(studio)
    with film.step("The start page asks what you would like to do"):
        studio.says("What would you like to do?")
    first_steps(studio, film, fingers)
    with nep.node("listener", master=address) as node:
        ears = Ears(node)
        greeting(studio, film, fingers, ears)
        touch(studio, film, fingers, ears)
        count(studio, film, fingers)
        two_robots(studio, film, fingers, ears)
    mistakes(studio, film, fingers)
    missing_value(studio, film, fingers)
    fight(studio, film, fingers)
    work_in_tabs(studio, film, fingers)
    with film.step("kill -9"):
        journals = studio.home / "journal"
        kept = lambda: [each.read_text("utf-8") for each in journals.glob("*.json")]  # noqa: E731
        until(lambda: len(kept()) >= 3, "all of it is kept")
        until(lambda: "".join(kept()).count('"robot_pepper_do_turn"') == 2, "with the last edit")
        tabs_file = studio.home / "settings.json"
        until(lambda: '"Quiz"' in "".join([*kept(), tabs_file.read_text("utf-8")]), "and the new name")
    studio.kill()
    again = start(HOME=str(home))
    again.screen = studio.screen
    film.follow(again)
    fingers = Fingers(again)
    restore(again, film, fingers)
    take_back(again, film, fingers)
    picture(again, film, fingers, home)
    assert len(film.pictures) >= 30


class Ears:
    """Recorder of everything that Pepper speaks, including speech between two checks of the screen."""

    def __init__(self, node: nep.Node) -> None:
        self.said: list[str] = []
        self._states = node.new_sub("/Pepper/state", "json", sink=self._hear)
        self._places: list[tuple[float, float]] = []
        self._turtle = node.new_sub("/Turtle/state", "json", sink=self._see)

    def _see(self, messages: Iterable[nep.Message]) -> None:
        self._places += [(message.payload["x"], message.payload["y"]) for message in messages]

    def _hear(self, messages: Iterable[nep.Message]) -> None:
        for message in messages:
            words = message.payload.get("speech")
            if words and words != (self.said or [""])[-1]:
                self.said.append(words)

    def turtle_moves(self) -> bool:
        """Return whether the Turtle has been more than 5 cm away from its first position."""
        return any(math.dist(self._places[0], each) > 0.05 for each in self._places)

    def hear(self, words: str) -> None:
        """Wait until Pepper has spoken these words."""
        until(lambda: words in self.said, lambda: f"{words}: {self.said}")


def done(studio: Studio, words: str) -> None:
    """Wait until this item of the first steps is done."""
    until(
        lambda: f"{words}: done" in [each["name"] for each in studio.all(kind="StepRow")],
        lambda: f"{words}: {[each['name'] for each in studio.all(kind='StepRow')]}",
    )


def new_page(studio: Studio, fingers: Fingers) -> None:
    """Open an empty page with Ctrl+N and focus its canvas."""
    before = len(tabs(studio))
    fingers.press("n", held=["Ctrl"])
    until(lambda: len(tabs(studio)) > before, "a new tab")
    until(lambda: "Ctrl+B" in str(studio.page(BEGIN)), "its page is empty")
    fingers.to_canvas()


def to_room(fingers: Fingers) -> None:
    """Press F6 and Tab until the room has the focus."""
    fingers.until_on("F6", **{"in": "robot"})
    fingers.until_on("Tab", kind="RoomView")


def first_steps(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("Ctrl+N: the empty canvas says the first step, also without a mouse"):
        until(lambda: studio.all(focus=True), "the window has the keyboard")
        fingers.press("n", held=["Ctrl"])
        until(lambda: "Ctrl+B" in str(studio.page(BEGIN)), "it says the keys")
    with film.step("Help, First steps; Enter: the virtual robot comes"):
        fingers.do("first steps", "First steps")
        studio.find("Use the virtual robot", focus=True, **{"in": "first_steps"})
        fingers.press("Return")
        studio.says("Pepper ready")
        studio.find("Show me", focus=True)
    with film.step("Show me, Ctrl+B, Right: the block that comes first"):
        fingers.press("Return")
        fingers.to_page()
        fingers.press("b", held=["Ctrl"])
        fingers.until_in_page("Right", "when started")
        until(lambda: str(studio.page(RING)).startswith("Press Enter to pick it up"), "the ring says how")
    with film.step("Enter takes it, Enter puts it down; a sentence is found by its word"):
        fingers.put_down("events_started")
        done(studio, "Drag “when started” onto the page")
        fingers.find_block("say", "robot_pepper_do_say")
        done(studio, "Place “say” below it")
    with film.step("F5: the robot speaks"):
        fingers.press("F5")
        done(studio, "Press Run and listen")
    with film.step("A turn; F5, and F12 while it moves: all first steps are done"):
        fingers.find_block("turn", "robot_pepper_do_turn")
        done(studio, "Place “turn” below “say”")

        def is_stopped_in_time() -> bool:
            """Run, and press Stop; on a busy computer the robot may have come to its end before."""
            fingers.press("F5")
            until(lambda: studio.outlined("running"), "it runs")
            fingers.press("F12")
            studio.says("Pepper stopped (")
            studio.find("Run", kind="RunButton", enabled=True)
            return bool(studio.look(says="First steps done"))

        until(is_stopped_in_time, "all first steps are done")


def greeting(studio: Studio, film: Film, fingers: Fingers, ears: Ears) -> None:
    with film.step("A greeting: if Pepper sees a face, it says hello"):
        new_page(studio, fingers)
        fingers.find_block("when started", "events_started")
        fingers.find_block("if", "control_if")
        fingers.until_in_page("Right", "connection")
        fingers.find_block("sees a face", "robot_pepper_get_sees_face")
        fingers.until_in_page("Down", "End of if")
        fingers.find_block("say", "robot_pepper_do_say")
        fingers.reword("Hello!", "Nice to see you")
        has_no_problem(studio)
    with film.step("The room's menu, Shift+F10: Pepper looks straight ahead again"):
        to_room(fingers)
        fingers.press("F10", held=["Shift"])
        until(lambda: studio.menus("popup"), "the menu is open")
        fingers.press("Up", "Return")
        until(lambda: not studio.menus("popup"), "it is done")
    with film.step("F5: it sees Aiko and greets her"):
        fingers.press("F5")
        ears.hear("Nice to see you")


def touch(studio: Studio, film: Film, fingers: Fingers, ears: Ears) -> None:
    with film.step("A second script: when its head is touched, it laughs"):
        fingers.to_canvas()
        fingers.find_block("when touched", "robot_pepper_when_touched")
        fingers.find_block("say", "robot_pepper_do_say")
        fingers.reword("Hello!", "That tickles")
    with film.step("F5, F6 to the room, Space: a touch on the head"):
        fingers.press("F5")
        studio.says("Running, ")  # touches have no effect during “Starting”
        to_room(fingers)
        fingers.press(" ")
        ears.hear("That tickles")


def count(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("A new variable: the touches are counted"):
        fingers.to_page()
        fingers.do("new variable", "New variable")
        studio.find("New variable", focus=True)
        fingers.write("touches")
        fingers.press("Return")
        until(lambda: not studio.all("New variable"), "it is made")
        fingers.to_page()
        fingers.until_in_page("Left", "say")
        fingers.find_block("change", "variables_change")
        assert "touches" in words_of(studio, kind_of(studio, "variables_change")[0])
    with film.step("A new list: a mistake, nothing ever sets it"):
        fingers.do("new list", "New list")
        studio.find("New list", focus=True)
        fingers.write("words")
        fingers.press("Return")
        until(lambda: not studio.all("New list"), "it is made")
        fingers.to_page()
        fingers.find_block("append", "lists_add")
        has_problem(studio, "words")
    with film.step("Problems, Tab, Enter: its button sets the list at the start"):
        fingers.do("problems", "Problems")
        fingers.until_on("Tab", kind="Button", **{"in": "problems"})
        fingers.press("Return")
        has_no_problem(studio)
        assert kind_of(studio, "lists_empty")
    with film.step("Variables: two touches, live"):
        fingers.do("variables", "Variables")
        fingers.press("F5", held=["Ctrl"])
        until(lambda: value_of(studio, "touches") == "0", lambda: f"{studio.rows('Variables')}")
        to_room(fingers)
        for number in ("1", "2"):
            fingers.press(" ")
            until(lambda number=number: value_of(studio, "touches") == number, "it counts")
        until(lambda: "apple" in value_of(studio, "words"), "the list has them, too")


def two_robots(studio: Studio, film: Film, fingers: Fingers, ears: Ears) -> None:
    with film.step("A second robot in the same room"):
        fingers.do("virtual turtle", "Use the virtual Turtle")
        studio.says("2 robots")
    with film.step("Pepper broadcasts “start quiz”, Turtle drives when it receives that"):
        fingers.to_canvas()
        fingers.go_to(kind_of(studio, "lists_add")[0])
        fingers.find_block("broadcast", "events_broadcast")
        fingers.to_canvas()
        fingers.find_block("receive", "events_received")
        fingers.find_block("drive", "robot_diffdrive_do_drive")
        assert "start quiz" in words_of(studio, kind_of(studio, "events_received")[0])
    with film.step("One touch on Pepper's head, and Turtle drives"):
        fingers.press("F5")
        until(lambda: value_of(studio, "touches") == "0", "it began anew")
        to_room(fingers)
        fingers.press(" ")
        until(ears.turtle_moves, "it drives: its block has ended at once, the robot goes on")
        fingers.press("F12")
        studio.says("stopped (")


def mistakes(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("A list where a number belongs: the editor says why it does not join"):
        new_page(studio, fingers)
        fingers.find_block("when started", "events_started")
        fingers.find_block("walk", "robot_pepper_do_walk")
        fingers.until_in_page("Right", "Edit number")
        fingers.find_block("empty list", "lists_empty")
        until(lambda: studio.page(WHY) == "“walk” needs a number here", "it says why")
    with film.step("It lies loose: Problems leads to it, Delete takes it away"):
        fingers.do("problems", "Problems")
        has_problem(studio, "isn't used")
        fingers.until_on("Tab", kind="ProblemRow")
        fingers.press("Return")
        fingers.page_says("empty list")
        fingers.press("Delete")
        has_no_problem(studio)


def missing_value(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("A missing value: “if” needs a condition"):
        fingers.to_canvas()
        fingers.go_to(kind_of(studio, "robot_pepper_do_walk")[0])
        fingers.find_block("if", "control_if")
        has_problem(studio, "needs a condition")
    with film.step("Enter on the problem, Right to the gap, and the value is there"):
        fingers.do("problems", "Problems")
        studio.find(kind="ProblemRow", focus=True)
        fingers.press("Return")
        fingers.page_says("if")
        fingers.until_in_page("Right", "connection")
        fingers.find_block("sees a face", "robot_pepper_get_sees_face")
        has_no_problem(studio)


def fight(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("A second script that moves Pepper, too: Problems says that they fight"):
        fingers.to_canvas()
        fingers.find_block("when started", "events_started")
        fingers.find_block("turn", "robot_pepper_do_turn")
        has_problem(studio, FIGHT)
    with film.step("F5: the loser says so at its block"):
        fingers.press("F5")
        until(lambda: warnings(studio), "its block says it")
        fingers.press("F12")
        studio.says("stopped (")
    with film.step("Problems, Tab, Enter: one after the other"):
        fingers.do("problems", "Problems")
        fingers.until_on("Tab", name="Run one after the other")
        fingers.press("Return")
        has_no_problem(studio, FIGHT)
        assert len(kind_of(studio, "events_started")) == 1


def work_in_tabs(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("Ctrl+X, Ctrl+Tab, Ctrl+V: a block goes to another behaviour"):
        fingers.to_canvas()
        fingers.go_to(kind_of(studio, "robot_pepper_do_turn")[0])
        fingers.press("x", held=["Ctrl"])
        until(lambda: not kind_of(studio, "robot_pepper_do_turn"), "it is cut out")
        fingers.press("Tab", held=["Ctrl"])
        until(lambda: len(kind_of(studio, "robot_pepper_do_turn")) == 1, "the first behaviour shows")
        fingers.press("v", held=["Ctrl"])
        until(lambda: len(kind_of(studio, "robot_pepper_do_turn")) == 2, "it is there")
    with film.step("F2: the tab gets a name"):
        fingers.press("F2")
        studio.find(kind="NameField", focus=True)
        fingers.write("Quiz")
        fingers.press("Return")
        until(lambda: tabs(studio)[0].startswith("Quiz"), lambda: f"{tabs(studio)}")


def restore(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("Started again: Put it back, and all is there"):
        studio.find("Restore")
        fingers.until_on("Tab", name="Restore")
        fingers.press("Return")
        until(lambda: len(tabs(studio)) == 3, lambda: f"{tabs(studio)}")
        assert tabs(studio)[0].startswith("Quiz")
        until(lambda: len(kind_of(studio, "robot_pepper_do_turn")) == 2, "the one that was worked on shows")
        studio.says("2 robots", 60)  # the virtual robots are restarted, too


def take_back(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("Delete, Tab to the bin, Enter: what was deleted"):
        fingers.to_canvas()
        fingers.go_to(kind_of(studio, "robot_pepper_do_say")[0])
        fingers.press("Delete")
        until(lambda: not kind_of(studio, "robot_pepper_do_say"), "the other side closed the connection")
        fingers.until_in_page("Tab", "nepBin")
        fingers.press("Return")
        until(lambda: studio.page(BIN), "the bin shows it")
        fingers.page_says("say")
    with film.step("Enter takes it back"):
        fingers.press("Return")
        until(lambda: kind_of(studio, "robot_pepper_do_say"), "it is back")
    with film.step("Ctrl+Shift+P puts it into the backpack; Tab to it, Enter: it is open"):
        fingers.page_says("say")
        fingers.press("p", held=["Ctrl", "Shift"])
        until(lambda: studio.page(f"{PACK}?.classList.contains('nepFull')"), "the backpack has it")
        new_page(studio, fingers)
        fingers.until_in_page("Tab", "nepBackpack")
        fingers.press("Return")
        fingers.page_says("say")
    with film.step("Enter: the block is in the new behaviour, too"):
        fingers.press("Return")
        until(lambda: kind_of(studio, "robot_pepper_do_say"), "it is there")


def picture(studio: Studio, film: Film, fingers: Fingers, home: Path) -> None:
    with film.step("A picture of the blocks: Ctrl+K, its name, Enter"):
        fingers.do("blocks as image", "Save blocks as image")
        studio.find(kind="FileSheet")
        studio.find(kind="QLineEdit", focus=True)
        fingers.press("Return")
        studio.says("Saved ")
        (made,) = home.glob("*.png")
        assert made.stat().st_size > 5_000, "the blocks are on it"
