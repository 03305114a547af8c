"""Tests of the editor on a narrow page, where the toolbox collapses to tiles."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from tests.ui.blockly_person import START, TOKENS, WAIT_MS, Person

pytestmark = pytest.mark.web
BOX = "document.querySelector('.nepTab:not([hidden]) .blocklyToolbox')"
WIDE = f"{BOX}.getBoundingClientRect().width"
SHOWN = (
    f"[...{BOX}.querySelectorAll('.blocklyToolboxCategoryLabel')]"
    ".filter(e => e.getBoundingClientRect().width > 0).map(e => e.textContent)"
)


def narrow(view, person, width: int = 620) -> Person:
    them = person(START)
    view.resize(width, 420)
    them.wait_for(WIDE, 52)
    return them


def first_tile(them: Person, number: int = 0) -> QPoint:
    script = (
        f"(r => [r.left + r.width / 2, r.top + r.height / 2])({BOX}.querySelectorAll('.nepTile')[{number}]"
    )
    x, y = them.ask(f"{script}.getBoundingClientRect())")
    return QPoint(round(x), round(y))


@pytest.mark.parametrize(
    ("width", "percent", "tiles"), [(780, 100, False), (740, 100, True), (900, 150, True)]
)
def test_narrow_page_or_large_text_collapses_the_toolbox_to_tiles(
    view, person, width, percent, tiles
) -> None:
    them = person(START)
    view.set_theme({**TOKENS, "textPercent": percent}, False)
    view.resize(width, 420)
    them.wait_for(WIDE, 52 if tiles else 196)
    them.wait_for(f"{SHOWN}.length > 0", not tiles)
    left = (
        "document.querySelector('.nepTab:not([hidden]) .blocklyBlockCanvas [data-id=start]')"
        ".getBoundingClientRect().left"
    )
    them.wait_for(f"{left} > {WIDE}")
    room = them.ask(f"(innerWidth - {WIDE}) * devicePixelRatio")
    assert room >= 420


def test_tile_shows_its_name_on_hover_and_opens_its_blocks_on_click(view, person) -> None:
    them = narrow(view, person)
    assert them.ask(SHOWN) == []
    QTest.mouseMove(them.target, first_tile(them))
    them.wait_for(f"{SHOWN}.length", 1)
    chip = them.ask(
        f"(r => [r.left, r.right, r.width])([...{BOX}.querySelectorAll('.blocklyToolboxCategoryLabel')]"
        ".find(e => e.getBoundingClientRect().width > 0).getBoundingClientRect())"
    )
    assert chip[0] >= 52  # next to the tile, without covering the tile
    assert chip[1] < 620
    QTest.mouseClick(them.target, Qt.LeftButton, pos=first_tile(them))
    flyout = "document.querySelector('.nepTab:not([hidden]) .blocklyFlyout')"
    them.wait_for(f"{flyout}.getBoundingClientRect().left", 52)
    them.box(".nepTab:not([hidden]) .blocklyFlyout .blocklyBlock")


def test_search_expands_the_narrow_toolbox_until_the_search_is_closed(qtbot, view, person) -> None:
    them = narrow(view, person)
    them.click(".nepTab:not([hidden]) .nepSearch input")
    them.wait_for(WIDE, 196)
    QTest.keyClicks(them.target, "wait")
    them.wait_for("document.querySelector('.nepSearch input').value", "wait")
    flyout = "document.querySelector('.nepTab:not([hidden]) .blocklyFlyout')"
    them.wait_for(f"{flyout}.getBoundingClientRect().left", 196)
    QTest.keyClick(them.target, Qt.Key_Escape)
    them.wait_for(WIDE, 52)
    qtbot.waitUntil(lambda: them.tops() == [START], timeout=WAIT_MS)
