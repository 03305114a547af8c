"""A person's path with the keyboard alone, from the start page to a saved behaviour; all steps are filmed."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from tests.e2e.film import Film, KeysOnly
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(230)
PACE_S = 0.08  # the page moves its focus with the next picture, not with the key
MANY = 40
TAB = "document.querySelector('.nepTab:not([hidden])')"
FOCUSED = (
    "(it => [it.getAttribute('class') ?? '', it.getAttribute('aria-label') ?? '', it.id]"
    ".join(' | '))(document.activeElement)"
)
FIELD = "Find a command, panel, topic, robot or file"


class Fingers:
    """A person who only has keys, and looks at what has the focus."""

    def __init__(self, studio: Studio) -> None:
        self.studio = studio
        self._pause = threading.Event()

    def press(self, name: str, held: Sequence[str] = ()) -> None:
        """One key, at the pace of a quick person."""
        self.studio.screen.key(name, held)
        self._pause.wait(PACE_S)

    def until_on(self, key: str, held: Sequence[str] = (), **wanted: object) -> None:
        """Press a key until such a widget has the keyboard."""
        for _ in range(MANY):
            if self.studio.all(focus=True, **wanted):
                return
            self.press(key, held)
        now = [(each["kind"], each["name"]) for each in self.studio.all(focus=True)]
        raise AssertionError(f"{key} does not lead to {wanted}; the keyboard is on {now}")

    def until_in_page(self, key: str, words: str) -> None:
        """Press a key in the block editor until what has the focus says these words."""
        for _ in range(MANY):
            if words in self.focused():
                return
            self.press(key)
        raise AssertionError(f"{key} does not lead to {words!r} but to {self.focused()}")

    def focused(self) -> str:
        """What has the focus in the page."""
        return str(self.studio.page(FOCUSED))

    def page_says(self, words: str) -> None:
        """Wait until what has the focus in the page says these words."""
        until(
            lambda: words in str(self.studio.page(FOCUSED)), lambda: f"{words}: {self.studio.page(FOCUSED)}"
        )

    def put_down(self, kind: str) -> None:
        """Take the block that has the focus in the toolbox, and put it where the keys were."""
        self.press("Return")
        until(lambda: self.studio.page("!!document.querySelector('.blocklyDragging')"), "the block is taken")
        self.press("Return")
        until(lambda: self.studio.page("!document.querySelector('.blocklyDragging')"), "it is put down")
        until(lambda: self.studio.blocks(f".{kind}") or self._has(kind), f"{kind} is in the workspace")
        self._pause.wait(PACE_S)

    def _has(self, kind: str) -> object:
        return self.studio.page(f"!!{TAB}.querySelector('.blocklyBlockCanvas .{kind}')")

    def find_block(self, words: str, kind: str) -> None:
        """Find a block by its words and put it where the keys were."""
        self.press("f", ["Ctrl", "Shift"])
        self.page_says("Find a block")
        self.studio.screen.type(words)
        first = "document.querySelector('.nepTab:not([hidden]) .blocklyFlyout .blocklyBlock')"
        until(lambda: self.studio.page(f"{first}?.classList.contains('{kind}')"), f"{kind} is found first")
        self.put_down(kind)

    def palette(self, words: str, entry: str) -> None:
        """Ctrl+K, a few letters, Enter."""
        self.press("k", ["Ctrl"])
        self.studio.find(FIELD, focus=True)
        self.studio.screen.type(words)
        until(
            lambda: entry in [row["texts"][0] for row in self.studio.rows("What fits")][1:2], f"{entry} first"
        )


def test_a_persons_path_with_the_keyboard_alone(start: Callable[..., Studio], tmp_path: Path) -> None:
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
        studio.says("Pepper ready", 40)
        studio.says("virtual, ready")
    build(studio, film, fingers)
    run(studio, film, fingers)
    look_at_topics(studio, film, fingers)
    save(studio, film, fingers, home / "Keys.nepb")
    assert len(film.pictures) >= 15


def build(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("Ctrl+N: a new behaviour; Tab: the toolbox"):
        fingers.press("n", ["Ctrl"])
        studio.spot(".blocklyToolboxCategoryLabel")
        fingers.press("1", ["Ctrl"])
        until(lambda: studio.page("document.hasFocus()"), "the page has the keyboard")
        fingers.until_in_page("Tab", "events")
    with film.step("Right: its blocks"):
        fingers.press("Right")
        fingers.page_says("when started")
    with film.step("Enter takes a block, Enter puts it down"):
        fingers.put_down("events_started")
    with film.step("Ctrl+Shift+F: blocks are found by their words"):
        fingers.find_block("forever", "control_forever")
    with film.step("A sentence, a turn and a wait"):
        fingers.find_block("say", "robot_pepper_do_say")
        fingers.find_block("turn", "robot_pepper_do_turn")
        fingers.find_block("wait", "control_wait")


def run(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("F5: the block that runs now glows"):
        fingers.press("F5")
        until(lambda: studio.outlined("running"), "a block glows", 40)
    with film.step("F8: the program waits, the robot holds still"):
        fingers.press("F8")
        studio.says("Paused at “")
    with film.step("F10: one block"):
        before = studio.outlined("stopped")
        fingers.press("F10")
        until(lambda: studio.outlined("stopped") not in ([], before), "another block is next")
    with film.step("F12: every robot has answered"):
        fingers.press("F12")
        studio.says("Pepper stopped (")
        assert not studio.outlined("running")


def look_at_topics(studio: Studio, film: Film, fingers: Fingers) -> None:
    with film.step("Ctrl+K and a few letters: the Developer layout"):
        fingers.palette("developer", "Developer layout")
    with film.step("Enter: the list of topics"):
        fingers.press("Return")
        studio.row("Topics", "/Pepper/state")
    with film.step("Arrow keys choose a topic, Enter shows its newest message"):
        fingers.until_on("F6", name="Topics", kind="TableView")
        for _ in range(3):
            fingers.press("Down")
        fingers.press("Return")
        until(lambda: studio.values("Newest message"), "the inspector shows it")
    with film.step("F6: the Inspector; Ctrl+F finds a value in it"):
        fingers.until_on("F6", **{"in": "inspector"})
        fingers.press("f", ["Ctrl"])
        studio.find("Find a key or value", focus=True)
        studio.screen.type("count")
        studio.says("1 of 1")


def save(studio: Studio, film: Film, fingers: Fingers, path: Path) -> None:
    with film.step("Alt+1: back to the blocks; Ctrl+S asks for a place"):
        fingers.press("1", ["Alt"])
        until(lambda: len(studio.blocks()) >= 5, "the blocks are there")
        fingers.press("s", ["Ctrl"])
        studio.find(kind="FileSheet")
        studio.find(kind="QLineEdit", focus=True)
    with film.step("A name and Enter: saved"):
        fingers.press("a", ["Ctrl"])
        studio.screen.type(str(path))
        fingers.press("Return")
        until(path.exists, "the file is there")
        studio.find("Keys", kind="BehaviourTab")
    words = path.read_text("utf-8")
    assert all(kind in words for kind in ("robot_pepper_do_say", "robot_pepper_do_turn", "control_wait"))
