"""User of one window: finds its widgets and operates them with mouse and keyboard."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from tests.e2e.waiting import LONG_S, until
from tests.e2e.x11 import LEFT, WHEEL_DOWN, WHEEL_UP, Picture, Screen
from tests.still import LOOK

STEP_S = LONG_S
AGAIN_S = 10.0  # time after which a person would try again
RUNNING = (0xFF, 0xB3, 0x00)  # the token "running" of the light theme
Seen = Mapping[str, object]


class Reaction(NamedTuple):
    """Time from one input event to its result on the screen; ``work_ms`` is the time of the GUI thread."""

    where: str
    what: str
    took_ms: float
    work_ms: float = 0.0


def middle(rect: Sequence[float]) -> tuple[float, float]:
    return rect[0] + rect[2] / 2, rect[1] + rect[3] / 2


class Person:
    """User of one window of Studio; mouse and keyboard are X events."""

    def __init__(self, screen: Screen, ask: Callable[..., object]) -> None:
        self.screen, self._ask = screen, ask

    # -- reading the window -----------------------------------------------------------------------

    def look(self, **wanted: str | bool) -> list[Seen]:
        """Return the visible widgets; none while the window is not shown.

        ``wanted`` filters them: ``named`` (name or text), ``kind``, ``says`` (words in name, text or
        description), ``is_menu``. A narrow filter costs the window least time.
        """
        seen = self._ask("look", wanted=wanted)
        assert not isinstance(seen, dict), seen
        return seen or []

    def all(self, name: str = "", **wanted: object) -> list[Seen]:
        """Return the visible widgets with this accessible name or text and these other properties."""
        return [
            each
            for each in self.look(named=name, kind=wanted.get("kind", ""))
            if each["rect"][2] > 0 and all(each[key] == value for key, value in wanted.items())
        ]

    def find(self, name: str = "", within_s: float = STEP_S, **wanted: object) -> Seen:
        """Wait until such a widget is visible and return the first one."""
        return until(lambda: self.all(name, **wanted), f"no {name} {wanted}", within_s)[0]

    def says(self, words: str, within_s: float = STEP_S) -> str:
        """Wait until a text in the window contains these words and return the whole text."""

        def found() -> str:
            seen = self.look(says=words)
            texts = (str(each[key]) for each in seen for key in ("name", "text", "description"))
            return next((text for text in texts if words in text), "")

        return until(found, f"nothing says {words!r}", within_s)

    def rows(self, table: str) -> list[Seen]:
        """Return the rows of a table or tree by its accessible name."""
        return [row for each in self.all(table) for row in each.get("rows", [])]

    def row(self, table: str, first: str, within_s: float = STEP_S) -> Seen:
        """Wait until a row with this first cell exists and return it."""
        return until(
            lambda: next((row for row in self.rows(table) if row["texts"][0] == first), None),
            f"no row {first!r} in {table}",
            within_s,
        )

    def values(self, tree: str) -> dict[str, str]:
        """Return the rows of a tree as text, by their first cell, as a screen reader announces them."""
        return {row["texts"][0]: row["spoken"].partition(", ")[2] for row in self.rows(tree)}

    def picture(self, seen: Seen) -> Picture:
        """Return the pixels of a widget on the screen."""
        return self.screen.picture(seen["rect"])

    # -- clicks and menus -------------------------------------------------------------------------

    def click(self, name: str = "", **wanted: object) -> Seen:
        """Wait until a widget is enabled and its layout is stable, then click it."""
        seen = self.still(name, enabled=True, takes_mouse=True, **wanted)
        self.screen.click(*middle(seen["rect"]))
        return seen

    def click_row(self, table: str, first: str, button: int = LEFT) -> None:
        """Wait until a row of a table exists and its layout is stable, then click it."""
        self.screen.click(*middle(self.still_row(table, first)["rect"]), button)

    def still(self, name: str = "", **wanted: object) -> Seen:
        """Wait until a widget is visible and its layout is stable, and return it."""
        return self._still(
            lambda: next(iter(self.all(name, **wanted)), None),
            lambda: f"no {name} {wanted} that stands still; {self._alike(name)}",
        )

    def still_row(self, table: str, first: str) -> Seen:
        """Wait until a row with this first cell exists and its layout is stable, and return it."""
        return self._still(
            lambda: next((row for row in self.rows(table) if row["texts"][0] == first), None),
            lambda: f"no row {first!r} in {table} that stands still",
        )

    @staticmethod
    def _still(look: Callable[[], Seen | None], what: Callable[[], str]) -> Seen:
        before: list[object] = []

        def resting() -> Seen | None:
            seen = look()
            stands, before[:] = seen is not None and before == [seen["rect"]], [seen and seen["rect"]]
            return seen if stands else None

        return until(resting, what)

    def _alike(self, name: str) -> str:
        """Return kind, state and position of the widgets of this name, for the message of a failed test."""
        found = [(each["kind"], each["enabled"], each["rect"]) for each in self.all(name)] if name else []
        return f"of this name (kind, enabled, place): {found}"

    def choose(self, menu: str, entry: str) -> None:
        """Choose an entry of a menu of the menu bar, once the previous menu has closed.

        The menu is opened again if the window closes it, as it does when the block editor appears.
        """
        until(lambda: not self.menus("popup"), "the menu before it closes")
        self._entry("bar", menu)
        try:
            self._entry("popup", entry, AGAIN_S)
        except AssertionError:
            if not self.menus("popup"):
                self._entry("bar", menu)
            self._entry("popup", entry)

    def pick(self, entry: str) -> None:
        """Choose an entry of the open menu."""
        self._entry("popup", entry)

    def menus(self, kind: str) -> list[Seen]:
        """Return the visible menus of the menu "bar" or the open "popup" menus."""
        return [each for each in self.look(is_menu=True) if each["menu"] == kind]

    def _entry(self, kind: str, text: str, within_s: float = STEP_S) -> None:
        def found() -> Seen | None:
            entries = [entry for each in self.menus(kind) for entry in each.get("entries", [])]
            return next((e for e in entries if e["text"].replace("&", "").split("\t")[0] == text), None)

        self.screen.click(*middle(until(found, f"no entry {text!r}", within_s)["rect"]))

    # -- in the web view --------------------------------------------------------------------------

    def page(self, script: str) -> object:
        """Return the result of a read-only script in the page of the block editor."""
        found = self._ask("script", script=script)
        return json.loads(found) if isinstance(found, str) and found else None

    def reactions(self) -> list[Reaction]:
        """Return the reactions to input events since the last call.

        The browser reports only events in the page that took 16 ms or more.
        """
        watch = (
            "(w => { if (!w.nepReactions) { w.nepReactions = [];"
            " new PerformanceObserver(list => w.nepReactions.push(...list.getEntries().map(e =>"
            " [e.name, e.duration]))).observe({type: 'event', durationThreshold: 16, buffered: true}); }"
            " return w.nepReactions.splice(0); })(window)"
        )
        page = [["page", *each] for each in self.page(watch) or []]
        return [Reaction(*each) for each in (*(self._ask("reactions") or []), *page)]

    def spot(self, selector: str) -> list[float]:
        """Return the position of an element of the page on the screen, once it no longer moves."""
        look = f"({LOOK})({json.dumps(selector)})"
        self.page(look)
        again = f"window.nepStill === undefined ? {look} : window.nepStill"  # the page may have reloaded
        left, top, right, bottom = until(lambda: self.page(again), f"no {selector} in the page")
        view = self.find(kind="QWebEngineView")["rect"]
        return [view[0] + left, view[1] + top, right - left, bottom - top]

    def point(self, selector: str, dx: float = 14, dy: float = 14) -> None:
        """Click into an element of the page, near its corner."""
        rect = self.spot(selector)
        self.screen.click(rect[0] + dx, rect[1] + dy)

    def open_category(self, name: str, place: int = 0) -> None:
        """Open a category of the toolbox and wait for its blocks.

        ``place`` is the index of the category among those of this name.
        """
        self.find(kind="QWebEngineView")
        shown = "document.querySelector('.nepTab:not([hidden]) .blocklyToolbox')"
        labels = f"[...({shown}?.querySelectorAll('.blocklyToolboxCategoryLabel') ?? [])]"
        named = f"{labels}.filter(e => e.textContent == {json.dumps(name)})"
        until(lambda: self.page(f"!!{named}[{place}]"), f"no category {name}")
        view = self.find(kind="QWebEngineView")["rect"]
        before: list[object] = []

        def in_sight() -> list[float] | None:
            """Scroll the category into view and return its rectangle once it no longer moves."""
            rect, box = self.page(
                f"[{named}[{place}].closest('.blocklyToolboxCategory'), {shown}]"
                ".map(e => (r => [r.left, r.top, r.width, r.height])(e.getBoundingClientRect()))"
            )
            x, y = view[0] + box[0] + box[2] / 2, view[1] + box[1] + box[3] / 2
            still, before[:] = before == [rect], [rect]
            if rect[1] < box[1]:
                self.screen.click(x, y, WHEEL_UP)
            elif rect[1] + rect[3] > box[1] + box[3]:
                self.screen.click(x, y, WHEEL_DOWN)
            elif still:
                return list(rect)
            return None

        rect = until(in_sight, f"{name} does not come into sight")
        self.screen.click(view[0] + rect[0] + rect[2] / 2, view[1] + rect[1] + rect[3] / 2)
        self.spot(".nepTab:not([hidden]) .blocklyFlyout .blocklyDraggable")

    def drag(self, selector: str, x: float, y: float) -> None:
        """Drag a block by its left edge; the grabbed point ends at (x, y)."""
        left, top, _, _ = self.spot(selector)
        self.screen.move(left + 12, top + 18)
        self.screen.press()
        self.screen.glide(left + 60, top + 40, 6)
        self.screen.glide(x, y)
        self.screen.release()

    def blocks(self, selector: str = "") -> list[str]:
        """Return the ids of the blocks in the workspace that match ``selector``."""
        where = ".blocklyBlockCanvas [data-id]" + selector
        inside = "e => !e.closest('.blocklyFlyout') && !e.classList.contains('blocklyInsertionMarker')"
        ids = f"[...document.querySelectorAll({json.dumps(where)})].filter({inside}).map(e => e.dataset.id)"
        return self.page(ids) or []

    def outlined(self, state: str) -> list[str]:
        """Return the ids of the blocks outlined as "running", "stopped" or "error"."""
        marks = f"[...document.querySelectorAll('.nepState-{state}')]"
        return self.page(f"{marks}.map(e => e.parentElement.dataset.id)") or []


def amber(picture: Picture) -> int:
    """Return the number of pixels in the colour of the running block."""
    return int((abs(picture.astype(int) - RUNNING).max(axis=2) < 12).sum())
