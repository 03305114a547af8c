"""User without a mouse: presses keys and checks which widget or block has the focus."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from tests.e2e.person import Person
from tests.e2e.teacher_session import CANVAS, kind_of
from tests.e2e.waiting import until
from tests.still import KEYS_SEEN

PACE_S = 0.08  # the page moves its focus in the next frame, not with the key press
MANY = 40
TAB = "document.querySelector('.nepTab:not([hidden])')"
FOCUSED = (
    "(it => [it.getAttribute('class') ?? '', it.getAttribute('aria-label') ?? '', it.id]"
    ".join(' | '))(document.activeElement)"
)
DRAGGING = "!!document.querySelector('.blocklyDragging')"
FIELD = "Find a command, panel, topic, robot or file"


class Fingers:
    """Keyboard of a user who presses keys and finds widgets and blocks by their focus."""

    def __init__(self, studio: Person) -> None:
        self.studio = studio
        self._pause = threading.Event()

    # -- keys -----------------------------------------------------------------------------------------

    def press(self, *names: str, held: Sequence[str] = ()) -> None:
        """Press keys one after the other at the speed of a fast user."""
        for name in names:
            self.studio.screen.key(name, held)
            self._pause.wait(PACE_S)

    def _press_in_page(self, key: str, held: Sequence[str] = ()) -> None:
        """Press a key in the page and wait until its result is rendered, which may take long."""
        before = until(lambda: self.studio.page(f"[{KEYS_SEEN}]"), "the page answers")
        self.press(key, held=held)
        until(lambda: self.studio.page(f"[{KEYS_SEEN}]") != before, f"the page has seen {key}")

    def until_on(self, key: str, held: Sequence[str] = (), **wanted: object) -> None:
        """Press a key until a widget with these attributes has the focus."""
        for _ in range(MANY):
            if self.studio.all(focus=True, **wanted):
                return
            self.press(key, held=held)
            self.studio.all(kind="MainWindow")  # replies after the window has handled earlier events
        now = [(each["kind"], each["name"]) for each in self.studio.all(focus=True)]
        raise AssertionError(f"{key} does not lead to {wanted}; the keyboard is on {now}")

    def write(self, words: str) -> None:
        """Replace the text of the focused field."""
        self.press("a", held=["Ctrl"])
        self.studio.screen.type(words)

    def do(self, words: str, command: str) -> None:
        """Run a command or open a panel with Ctrl+K, a few letters and Enter."""
        self.palette(words, command)
        self.press("Return")

    def palette(self, words: str, entry: str) -> None:
        """Press Ctrl+K, type a few letters and wait until the entry is the first match."""
        self.press("k", held=["Ctrl"])
        self.studio.find(FIELD, focus=True)
        self.studio.screen.type(words)
        until(
            lambda: entry in [row["texts"][0] for row in self.studio.rows("Matches")][1:2],
            lambda: f"{entry} first: {[row['texts'][0] for row in self.studio.rows('Matches')][:4]}",
        )

    # -- in the block editor --------------------------------------------------------------------------

    def to_page(self) -> None:
        """Focus the block editor with Ctrl+1."""
        self.press("1", held=["Ctrl"])
        until(lambda: self.studio.page("document.hasFocus()"), "the page has the keyboard")

    def to_canvas(self) -> None:
        """Focus the canvas, without a block."""
        self.to_page()
        self.press("b", held=["Ctrl", "Shift"])
        self.page_says("stack")

    def focused(self) -> str:
        """Return a description of the focused element of the page."""
        return str(self.studio.page(FOCUSED)).replace("\u00a0", " ")

    def page_says(self, words: str) -> None:
        """Wait until the description of the focused element contains these words."""
        until(lambda: words in self.focused(), lambda: f"{words}: {self.focused()}")

    def until_in_page(self, key: str, words: str, held: Sequence[str] = ()) -> None:
        """Press a key in the block editor until the focused element's description contains ``words``."""
        for _ in range(MANY):
            if words in self.focused():
                return
            self._press_in_page(key, held)
        raise AssertionError(f"{key} does not lead to {words!r} but to {self.focused()}")

    def put_down(self, kind: str) -> str:
        """Insert the focused block of the toolbox at the canvas cursor and return its id."""
        before = set(kind_of(self.studio, kind))
        self.press("Return")
        until(lambda: self.studio.page(DRAGGING), "the block is taken")
        self.press("Return")
        until(lambda: not self.studio.page(DRAGGING), "it is put down")
        made = until(lambda: set(kind_of(self.studio, kind)) - before, f"{kind} is in the workspace")
        self._pause.wait(PACE_S)
        return str(made.pop())

    def find_block(self, words: str, kind: str) -> str:
        """Search for a block by its words, insert it at the canvas cursor and return its id."""
        self.press("f", held=["Ctrl", "Shift"])
        self.page_says("Find a block")
        self.write(words)
        first = f"{TAB}.querySelector('.blocklyFlyout.nepCategory .blocklyBlock')"
        until(
            lambda: self.studio.page(f"{first}?.classList.contains('{kind}')"),
            lambda: f"{kind} is found first: {self.studio.page(f'{first}?.className.baseVal')}",
        )
        return self.put_down(kind)

    def go_to(self, block: str) -> None:
        """Press Down until this block has the focus."""
        node = f"document.querySelector(\"{CANVAS} [data-id='{block}'] > .blocklyPath\")"
        for _ in range(MANY):
            if self.studio.page(f"document.activeElement === {node}"):
                return
            self._press_in_page("Down")
        raise AssertionError(f"Down does not lead to {block} but to {self.focused()}")

    def reword(self, says: str, words: str) -> None:
        """Press Right until the slot with this text has the focus, and replace its text."""
        self.until_in_page("Right", f"| {says}")
        self.press("Return")
        self.page_says("blocklyHtmlInput")
        self.write(words)
        self.press("Return")
        self.page_says(f"| {words}")
