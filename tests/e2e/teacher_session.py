"""The hour of a teacher: what is looked for in every film of it, and hands with a mouse on the blocks."""

from __future__ import annotations

import json
from collections.abc import Sequence

from tests.e2e.person import Person, middle
from tests.e2e.waiting import until
from tests.e2e.x11 import LEFT, RIGHT, WHEEL_DOWN, WHEEL_UP, Screen

TAB = ".nepTab:not([hidden])"
CANVAS = f"{TAB} .blocklySvg > .blocklyWorkspace > .blocklyBlockCanvas"
FLYOUT = f"{TAB} .blocklyFlyout.nepCategory"
PLACE = "(r => [r.left, r.top, r.width, r.height])(e.getBoundingClientRect())"
BIN, BACKPACK = f"{TAB} .nepSheet:not(.nepPacked)", f"{TAB} .nepSheet.nepPacked"
OPEN = (
    f"(e => e && e.style.display !== 'none')(document.querySelector('{FLYOUT}')) &&"
    f" document.querySelector('{TAB} .blocklyToolboxSelected .blocklyToolboxCategoryLabel')?.textContent"
)
GRIP = 12, 18  # where a hand takes a block, from its corner
INDENT = 16  # how far the blocks inside another one stand to the right

Place = tuple[float, float]


# -- what is seen, whoever looks --------------------------------------------------------------------


def words_of(studio: Person, block: str) -> str:
    """All words on a block, and on those in it and below it."""
    return str(studio.page(f"{_first(of(block))}?.textContent") or "").replace("\u00a0", " ")


def _first(selector: str) -> str:
    return f"document.querySelector({json.dumps(selector)})"


def _all(selector: str) -> str:
    return f"[...document.querySelectorAll({json.dumps(selector)})]"


def of(block: str) -> str:
    """The selector of a block of the behaviour that shows."""
    return f"{CANVAS} [data-id='{block}']"


def holds(studio: Person, outer: str, inner: str) -> bool:
    """Whether a block stands in or below another one."""
    inside = f"[data-id='{inner}']"
    return bool(
        studio.page(f"!!document.querySelector({json.dumps(of(outer))})?.querySelector({json.dumps(inside)})")
    )


def kind_of(studio: Person, kind: str) -> list[str]:
    """The ids of the blocks of this type in the behaviour that shows."""
    found = _all(f"{CANVAS} .{kind}:not(.blocklyInsertionMarker)")
    return studio.page(f"{found}.map(e => e.dataset.id)") or []


def blocks_of(studio: Person) -> set[str]:
    """The ids of all blocks of the behaviour that shows."""
    return set(kind_of(studio, "blocklyDraggable"))


def problems(studio: Person) -> list[str]:
    """The sentences of the panel Problems."""
    return [str(each["name"]) for each in studio.all(kind="ProblemRow")]


def has_problem(studio: Person, words: str) -> None:
    """Wait until Problems says so."""
    until(lambda: any(words in each for each in problems(studio)), lambda: f"{words}: {problems(studio)}")


def has_no_problem(studio: Person, words: str = "") -> None:
    """Wait until Problems no longer says so; without words, until it says nothing."""
    until(lambda: not any(words in each for each in problems(studio)), lambda: f"{problems(studio)}")


def warnings(studio: Person) -> list[str]:
    """What stands beside blocks as a warning."""
    return studio.page(f"{_all(f'{TAB} .nepBubble-warning')}.map(e => e.textContent)") or []


def value_of(studio: Person, variable: str) -> str:
    """What the panel Variables says of it."""
    rows = {row["texts"][0]: row["texts"][1] for row in studio.rows("Variables")}
    return str(rows.get(variable, ""))


# -- the mouse --------------------------------------------------------------------------------------


class Counted(Screen):
    """The mouse of a hand that counts: presses that stay where they are, and those that pull something."""

    clicks = drags = 0
    _pressed_at: Place | None = None

    def press(self, button: int = LEFT) -> None:
        self._pressed_at = self._at
        super().press(button)

    def release(self, button: int = LEFT) -> None:
        if button in (LEFT, RIGHT):
            dragged = self._pressed_at != self._at
            self.drags += dragged
            self.clicks += not dragged
        super().release(button)


class Hands:
    """What hands with a mouse do with blocks."""

    def __init__(self, studio: Person) -> None:
        self.studio = studio

    # -- places -------------------------------------------------------------------------------------

    def rect(self, block: str) -> Sequence[float]:
        """Where a block's own shape is on the screen."""
        return self.studio.spot(f"{of(block)} > .blocklyPath")

    def free(self, dx: float, dy: float) -> Place:
        """A place of the page, from the corner beside the toolbox."""
        left, top, _, _ = self.studio.spot(f"{TAB} .blocklyToolbox")
        wide = self.studio.spot(f"{TAB} .blocklyToolbox")[2]
        return left + wide + dx, top + dy

    def gap(self, block: str, number: int = 0) -> Place:
        """The corner of a gap of a block that has nothing in it yet, or a grey value."""
        kinds = ":is(.blocklyOutlinePath, .blocklyShadow)"
        found = (
            f"{_all(f'{of(block)} > {kinds}')}.map(e => {PLACE})"
            f".filter(r => r[2] > 0).sort((one, other) => one[0] - other[0])[{number}]"
        )
        left, top, _, _ = until(lambda: self.studio.page(found), f"gap {number} of {block}")
        view = self.studio.find(kind="QWebEngineView")["rect"]
        return view[0] + left, view[1] + top

    # -- blocks out of the toolbox --------------------------------------------------------------------

    def take(self, category: str, kind: str, corner: Place, place: int = 0) -> str:
        """Drag a block out of the toolbox until its corner is there; its id.

        ``place`` is that of the category among those of this name: each robot has its own.
        """
        before = set(kind_of(self.studio, kind))
        offered = f"{FLYOUT} .blocklyDraggable.{kind}"
        if self.studio.page(OPEN) != category or not self.studio.page(f"!!{_first(offered)}"):
            self.studio.open_category(category, place)
        self._bring_into_sight(offered)
        self.studio.drag(offered, corner[0] + GRIP[0], corner[1] + GRIP[1])
        (made,) = until(lambda: set(kind_of(self.studio, kind)) - before, f"{kind} is on the page")
        until(lambda: not self._dragging(), f"{kind} is let go")
        return str(made)

    def _bring_into_sight(self, offered: str) -> None:
        """Turn the wheel over the open category until a block of it can be taken."""

        script = f"[{_first(FLYOUT)}, {_first(offered)}].map(e => e && {PLACE})"
        before: list[object] = []

        def in_sight() -> bool:
            before.append(self.studio.page(script))
            if before[-1] != before[-2:][0] or len(before) < 2 or None in before[-1]:
                return False
            (left, top, _, height), (_, mine, _, high) = before[-1]
            view = self.studio.find(kind="QWebEngineView")["rect"]
            beside = view[0] + left + 8, view[1] + top + height / 2
            if mine + high > top + height:
                self.studio.screen.click(*beside, WHEEL_DOWN)
            elif mine < top:
                self.studio.screen.click(*beside, WHEEL_UP)
            else:
                return True
            return False

        until(in_sight, f"{offered} does not come into sight")

    def _dragging(self) -> bool:
        return bool(self.studio.page("!!document.querySelector('.blocklyDragging')"))

    def put(self, category: str, kind: str, dx: float, dy: float, place: int = 0) -> str:
        """Drag a block onto a free place of the page; its id."""
        return self.take(category, kind, self.free(dx, dy), place)

    def below(self, above: str, category: str, kind: str, place: int = 0) -> str:
        """Drag a block out of the toolbox to below another one; its id."""
        return self._into(above, category, kind, self.end(above), place)

    def end(self, above: str) -> Place:
        """Where the block below another one has its corner."""
        left, top, _, height = self.rect(above)
        return left, top + height

    def inside(self, outer: str, category: str, kind: str) -> str:
        """Drag a block out of the toolbox into the empty mouth of another one; its id."""
        return self._into(outer, category, kind, self.mouth(outer))

    def fill(self, outer: str, category: str, kind: str, number: int = 0) -> str:
        """Drag a value out of the toolbox into a gap of a block; its id."""
        return self._into(outer, category, kind, self.gap(outer, number))

    def mouth(self, outer: str) -> Place:
        """Where the first block in another one has its corner."""
        left, top, _, height = self.rect(outer)
        return left + INDENT, top + max(height / 2 - 12, 40)

    def _into(self, outer: str, category: str, kind: str, corner: Place, place: int = 0) -> str:
        made = self.take(category, kind, corner, place)
        until(lambda: holds(self.studio, outer, made), lambda: f"{kind} is at its place")
        return made

    # -- blocks of the page ---------------------------------------------------------------------------

    def carry(self, block: str, x: float, y: float) -> None:
        """Hold a block of the page at a place of the screen; `drop` lets it go."""
        left, top, _, _ = self.rect(block)
        self.studio.screen.move(left + GRIP[0], top + GRIP[1])
        self.studio.screen.press()
        self.studio.screen.glide(left + 60, top + 40, 6)
        self.studio.screen.glide(x, y)
        until(self._dragging, "the page has seen that it is held")

    def drop(self) -> None:
        """Let go what is held."""
        self.studio.screen.release()
        until(lambda: not self._dragging(), "it is let go")

    def move(self, block: str, corner: Place) -> None:
        """Drag a block, with what hangs below it, until its corner is there."""
        self.carry(block, corner[0] + GRIP[0], corner[1] + GRIP[1])
        self.drop()

    def delete(self, block: str) -> None:
        """Drag a block, with what hangs below it, onto the toolbox."""
        left, top, wide, height = self.studio.spot(f"{TAB} .blocklyToolbox")
        self.carry(block, left + wide / 2, top + height / 2)
        self.drop()
        until(lambda: block not in blocks_of(self.studio), f"{block} is deleted")

    def choose(self, block: str, shows: str, wanted: str) -> None:
        """Choose from the drop-down of a block that shows these words."""
        fields = f"[...document.querySelectorAll({json.dumps(f'{of(block)} .blocklyDropdownField')})]"
        self._press(
            f"{fields}.find(e => e.textContent.replaceAll('\\u00a0', ' ').includes({json.dumps(shows)}))"
        )
        self.pick(wanted)

    def pick(self, wanted: str) -> None:
        """Choose from the drop-down that is open."""
        words = f"e => e.textContent.includes({json.dumps(wanted)})"
        self._press(f"{_all('.blocklyMenuItem')}.find({words})")

    def press_button(self, category: str, words: str) -> None:
        """Press a button above the blocks of a category."""
        self.studio.open_category(category)
        same = f"e => e.textContent.replaceAll('\\u00a0', ' ') == {json.dumps(words)}"
        self._press(f"{_all(f'{FLYOUT} .blocklyFlyoutButton')}.find({same})")

    def menu(self, block: str, entry: str) -> None:
        """Choose from the menu of a block."""
        left, top, _, _ = self.rect(block)
        self.studio.screen.click(left + GRIP[0], top + GRIP[1], RIGHT)
        self.pick(entry)

    def _press(self, element: str) -> None:
        """Press an element of the page in its middle, when it stands still."""
        before: list[object] = []

        def still() -> Sequence[float] | None:
            before.append(self.studio.page(f"(e => e && {PLACE})({element})"))
            found = before[-1]
            return found if len(before) > 1 and found == before[-2] and found and found[2] else None

        place = until(still, f"no {element}")
        view = self.studio.find(kind="QWebEngineView")["rect"]
        x, y = middle(place)
        self.studio.screen.click(view[0] + x, view[1] + y)

    # -- the bin, and the backpack --------------------------------------------------------------------

    def open_bin(self) -> None:
        """Show what was deleted."""
        self.studio.point(".nepBin", 12, 12)
        self.studio.spot(BIN)

    def open_backpack(self) -> None:
        """Show what is kept for other behaviours."""
        self.studio.point(".nepBackpack", 12, 12)
        self.studio.spot(BACKPACK)

    def pack(self, block: str) -> None:
        """Drag a block, with what hangs below it, onto the backpack: it keeps a copy."""
        self.carry(block, *middle(self.studio.spot(".nepBackpack")))
        self.drop()
