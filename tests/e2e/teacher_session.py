"""Checks and mouse operations for the films of a teacher's lesson of one hour."""

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
GRIP = 12, 18  # where a block is grabbed, from its corner
INDENT = 16  # indentation of nested blocks

Place = tuple[float, float]


# -- reading the page -------------------------------------------------------------------------------


def words_of(studio: Person, block: str) -> str:
    """Return the text of a block and of the blocks inside and below it."""
    return str(studio.page(f"{_first(of(block))}?.textContent") or "").replace("\u00a0", " ")


def _first(selector: str) -> str:
    return f"document.querySelector({json.dumps(selector)})"


def _all(selector: str) -> str:
    return f"[...document.querySelectorAll({json.dumps(selector)})]"


def of(block: str) -> str:
    """Return the selector of a block in the visible behaviour."""
    return f"{CANVAS} [data-id='{block}']"


def holds(studio: Person, outer: str, inner: str) -> bool:
    """Return whether a block is inside or below another one."""
    inside = f"[data-id='{inner}']"
    return bool(
        studio.page(f"!!document.querySelector({json.dumps(of(outer))})?.querySelector({json.dumps(inside)})")
    )


def kind_of(studio: Person, kind: str) -> list[str]:
    """Return the ids of the blocks of this type in the visible behaviour."""
    found = _all(f"{CANVAS} .{kind}:not(.blocklyInsertionMarker)")
    return studio.page(f"{found}.map(e => e.dataset.id)") or []


def blocks_of(studio: Person) -> set[str]:
    """Return the ids of all blocks in the visible behaviour."""
    return set(kind_of(studio, "blocklyDraggable"))


def problems(studio: Person) -> list[str]:
    """Return the texts of the Problems panel."""
    return [str(each["name"]) for each in studio.all(kind="ProblemRow")]


def has_problem(studio: Person, words: str) -> None:
    """Wait until a problem contains these words."""
    until(lambda: any(words in each for each in problems(studio)), lambda: f"{words}: {problems(studio)}")


def has_no_problem(studio: Person, words: str = "") -> None:
    """Wait until no problem contains these words; "" waits until there is no problem."""
    until(lambda: not any(words in each for each in problems(studio)), lambda: f"{problems(studio)}")


def warnings(studio: Person) -> list[str]:
    """Return the texts of the warning bubbles of the blocks."""
    return studio.page(f"{_all(f'{TAB} .nepBubble-warning')}.map(e => e.textContent)") or []


def value_of(studio: Person, variable: str) -> str:
    """Return the value of a variable in the Variables panel, or "" if it is not listed."""
    rows = {row["texts"][0]: row["texts"][1] for row in studio.rows("Variables")}
    return str(rows.get(variable, ""))


# -- the mouse --------------------------------------------------------------------------------------


class Counted(Screen):
    """Screen that counts clicks and drags of the mouse."""

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
    """Mouse of a user who works with blocks."""

    def __init__(self, studio: Person) -> None:
        self.studio = studio

    # -- positions ----------------------------------------------------------------------------------

    def rect(self, block: str) -> Sequence[float]:
        """Return the rectangle of a block's own shape on the screen."""
        return self.studio.spot(f"{of(block)} > .blocklyPath")

    def free(self, dx: float, dy: float) -> Place:
        """Return a position on the canvas, in pixels from its corner next to the toolbox."""
        left, top, _, _ = self.studio.spot(f"{TAB} .blocklyToolbox")
        wide = self.studio.spot(f"{TAB} .blocklyToolbox")[2]
        return left + wide + dx, top + dy

    def gap(self, block: str, number: int = 0) -> Place:
        """Return the corner of a block's slot that is empty or has a shadow block.

        ``number`` is the index among such slots, from left to right.
        """
        kinds = ":is(.blocklyOutlinePath, .blocklyShadow)"
        found = (
            f"{_all(f'{of(block)} > {kinds}')}.map(e => {PLACE})"
            f".filter(r => r[2] > 0).sort((one, other) => one[0] - other[0])[{number}]"
        )
        left, top, _, _ = until(lambda: self.studio.page(found), f"gap {number} of {block}")
        view = self.studio.find(kind="QWebEngineView")["rect"]
        return view[0] + left, view[1] + top

    # -- blocks from the toolbox ----------------------------------------------------------------------

    def take(self, category: str, kind: str, corner: Place, place: int = 0) -> str:
        """Drag a block out of the toolbox until its corner is at ``corner``; return its id.

        ``place`` is the index of the category among those of this name, because each robot has its own.
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
        """Scroll the open category until a block of it can be grabbed."""

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
        """Drag a block from the toolbox to a free position on the canvas; return its id."""
        return self.take(category, kind, self.free(dx, dy), place)

    def below(self, above: str, category: str, kind: str, place: int = 0) -> str:
        """Drag a block from the toolbox to below another one; return its id."""
        return self._into(above, category, kind, self.end(above), place)

    def end(self, above: str) -> Place:
        """Return the corner of a block connected below another one."""
        left, top, _, height = self.rect(above)
        return left, top + height

    def inside(self, outer: str, category: str, kind: str) -> str:
        """Drag a block from the toolbox into the empty statement slot of another one; return its id."""
        return self._into(outer, category, kind, self.mouth(outer))

    def fill(self, outer: str, category: str, kind: str, number: int = 0) -> str:
        """Drag a value from the toolbox into a slot of a block; return its id."""
        return self._into(outer, category, kind, self.gap(outer, number))

    def mouth(self, outer: str) -> Place:
        """Return the corner of the first block inside another one."""
        left, top, _, height = self.rect(outer)
        return left + INDENT, top + max(height / 2 - 12, 40)

    def _into(self, outer: str, category: str, kind: str, corner: Place, place: int = 0) -> str:
        made = self.take(category, kind, corner, place)
        until(lambda: holds(self.studio, outer, made), lambda: f"{kind} is at its place")
        return made

    # -- blocks on the page ---------------------------------------------------------------------------

    def carry(self, block: str, x: float, y: float) -> None:
        """Drag a block to a position on the screen without releasing it; `drop` releases it."""
        left, top, _, _ = self.rect(block)
        self.studio.screen.move(left + GRIP[0], top + GRIP[1])
        self.studio.screen.press()
        self.studio.screen.glide(left + 60, top + 40, 6)
        self.studio.screen.glide(x, y)
        until(self._dragging, "the page has seen that it is held")

    def drop(self) -> None:
        """Release the dragged block."""
        self.studio.screen.release()
        until(lambda: not self._dragging(), "it is let go")

    def move(self, block: str, corner: Place) -> None:
        """Drag a block, with the blocks below it, until its corner is at ``corner``."""
        self.carry(block, corner[0] + GRIP[0], corner[1] + GRIP[1])
        self.drop()

    def delete(self, block: str) -> None:
        """Drag a block, with the blocks below it, onto the toolbox."""
        left, top, wide, height = self.studio.spot(f"{TAB} .blocklyToolbox")
        self.carry(block, left + wide / 2, top + height / 2)
        self.drop()
        until(lambda: block not in blocks_of(self.studio), f"{block} is deleted")

    def choose(self, block: str, shows: str, wanted: str) -> None:
        """Choose an entry of the drop-down of a block that shows ``shows``."""
        fields = f"[...document.querySelectorAll({json.dumps(f'{of(block)} .blocklyDropdownField')})]"
        self._press(
            f"{fields}.find(e => e.textContent.replaceAll('\\u00a0', ' ').includes({json.dumps(shows)}))"
        )
        self.pick(wanted)

    def pick(self, wanted: str) -> None:
        """Choose an entry of the open drop-down."""
        words = f"e => e.textContent.includes({json.dumps(wanted)})"
        self._press(f"{_all('.blocklyMenuItem')}.find({words})")

    def press_button(self, category: str, words: str) -> None:
        """Press a button above the blocks of a category."""
        self.studio.open_category(category)
        same = f"e => e.textContent.replaceAll('\\u00a0', ' ') == {json.dumps(words)}"
        self._press(f"{_all(f'{FLYOUT} .blocklyFlyoutButton')}.find({same})")

    def menu(self, block: str, entry: str) -> None:
        """Choose an entry of a block's context menu."""
        left, top, _, _ = self.rect(block)
        self.studio.screen.click(left + GRIP[0], top + GRIP[1], RIGHT)
        self.pick(entry)

    def _press(self, element: str) -> None:
        """Click the centre of an element of the page once it no longer moves."""
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
        """Open the bin of deleted blocks."""
        self.studio.point(".nepBin", 12, 12)
        self.studio.spot(BIN)

    def open_backpack(self) -> None:
        """Open the backpack."""
        self.studio.point(".nepBackpack", 12, 12)
        self.studio.spot(BACKPACK)

    def pack(self, block: str) -> None:
        """Drag a block, with the blocks below it, onto the backpack to copy it."""
        self.carry(block, *middle(self.studio.spot(".nepBackpack")))
        self.drop()
