"""Tests of the menus with the keyboard alone, also while the block editor has the focus."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import say, started, write
from tests.e2e.studio import Studio
from tests.e2e.test_tabs import tabs
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)

BLOCKS = "document.querySelectorAll('.nepTab:not([hidden]) .blocklyBlockCanvas .blocklyDraggable').length"


@pytest.fixture
def mine(start: Callable[..., Studio], tmp_path: Path) -> Studio:
    """Studio with one file whose “say” block has the focus."""
    studio = start(str(write(tmp_path / "Mine.nepb", started(say("One")))))
    studio.point("[data-id='say One'] > .blocklyPath", 8, 10)
    until(
        lambda: studio.page("document.querySelector('.blocklySelected')?.dataset.id") == "say One", "chosen"
    )
    return studio


def test_alt_and_a_letter_open_a_menu_and_a_letter_runs_its_command(mine: Studio) -> None:
    mine.screen.key("f", ["Alt"])
    until(lambda: mine.menus("popup"), "File is open")
    mine.screen.key("n")
    until(lambda: len(tabs(mine)) == 2, lambda: f"a new behaviour: {tabs(mine)}")


def test_edit_menu_copies_and_pastes_the_focused_block(mine: Studio) -> None:
    before = mine.page(BLOCKS)
    mine.choose("Edit", "Copy")
    mine.choose("Edit", "Paste")
    until(lambda: mine.page(BLOCKS) > before, "it is pasted")


def test_edit_menu_selects_cuts_and_pastes_in_a_text_field_of_the_editor_page(mine: Studio) -> None:
    mine.screen.key("f", ["Ctrl"])
    until(lambda: mine.page("document.activeElement?.tagName") == "INPUT", "the field has the keyboard")
    mine.screen.type("one")
    mine.choose("Edit", "Select all")
    until(lambda: mine.page("(e => e.selectionEnd - e.selectionStart)(document.activeElement)") == 3, "all")
    mine.choose("Edit", "Cut")
    until(lambda: mine.page("document.activeElement?.value") == "", "its words are cut")
    mine.choose("Edit", "Paste")
    until(lambda: mine.page("document.activeElement?.value") == "one", "its words are there again")
