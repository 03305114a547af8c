"""Tests of the context menus of blocks and canvas, and of collapsed and disabled blocks."""

from __future__ import annotations

import os
from itertools import count
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import number, robot, workspace
from tests.ui.blockly_person import TOKENS, WAIT_MS, Person, editor, outlined

pytestmark = pytest.mark.web

ROWS = "[...document.querySelectorAll('.nepMenuRow')].map(e => e.querySelector('span').textContent)"


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


def wait(id: str, seconds: float = 1) -> dict:
    return {"type": "control_wait", "id": id, "inputs": {"SECONDS": {"shadow": number(seconds)}}}


def program() -> dict:
    inner = wait("a", 1) | {"next": {"block": wait("b", 2)}}
    loop = {"type": "control_forever", "id": "loop", "inputs": {"BODY": {"block": inner}}}
    first = wait("first", 3) | {"next": {"block": loop}}
    return workspace({"type": "events_started", "id": "start", "x": 60, "y": 60, "next": {"block": first}})


@pytest.fixture
def them(view, person) -> Person:
    made: Person = person(state=program())
    view.setFocus()
    made.wait_for("document.hasFocus()")
    return made


def looked_at(them: Person, name: str) -> None:
    """Save a screenshot to the folder NEP_LOOK, if this environment variable is set."""
    folder = os.environ.get("NEP_LOOK")
    if folder:
        QTest.qWait(150)
        them.view.grab().save(str(Path(folder) / f"{name}.png"))


def open_menu(them: Person, id: str) -> list[str]:
    box = them.box(f"[data-id={id}] > .blocklyPath")
    at = QPoint(round(box["left"] + 14), round(box["top"] + 20))
    QTest.mouseClick(them.target, Qt.RightButton, pos=at)
    them.wait_for("!!document.querySelector('.blocklyContextMenu')")
    return them.ask(ROWS)


def choose(them: Person, id: str, words: str) -> None:
    rows = open_menu(them, id)
    assert words in rows
    script = f"document.querySelectorAll('.blocklyContextMenu .nepMenuRow')[{rows.index(words)}]"
    them.ask("document.querySelector('[data-test=row]')?.removeAttribute('data-test')")
    them.ask(f"{script}.setAttribute('data-test', 'row')")
    them.click("[data-test=row]")
    them.wait_for("document.querySelector('.blocklyContextMenu') === null")


def test_context_menu_fits_into_a_low_page(view, them) -> None:
    view.resize(700, 480)
    them.wait_for("innerHeight", 480)
    open_menu(them, "b")  # in the middle of the page
    menu = "document.querySelector('.blocklyContextMenu')"
    them.wait_for(f"(e => e.scrollHeight <= e.clientHeight)({menu})")
    assert them.ask(f"(r => r.top >= 0 && r.bottom <= innerHeight)({menu}.getBoundingClientRect())")


_times_ms = count(10_000, 10_000)


def double_click(them: Person, id: str) -> None:
    """Click a block twice at the same time on the page's clock: a busy page handles the clicks too late."""
    them.ask(f"(now => {{ performance.now = () => now; }})({next(_times_ms)})")
    box = them.box(f"[data-id={id}] > .blocklyPath")
    at = QPoint(round(box["left"] + 60), round(box["top"] + 8))
    for _ in range(2):
        QTest.mouseClick(them.target, Qt.LeftButton, pos=at)


@pytest.mark.parametrize("dark", [False, True])
def test_block_menu_has_tall_rows_with_icons_and_shortcuts(view, them, dark):
    view.set_theme(TOKENS, dark)
    rows = open_menu(them, "loop")
    looked_at(them, f"menu-{'dark' if dark else 'light'}")
    assert rows[:5] == ["Run from here", "Duplicate", "Copy", "Cut", "Paste"]
    assert {"Collapse", "Disable block", "Help"} <= set(rows)
    assert rows[-1] == "Delete 3 blocks"
    heights = (
        "[...document.querySelectorAll('.blocklyContextMenu .blocklyMenuItem')].map(e => e.offsetHeight)"
    )
    assert min(them.ask(heights)) >= 36
    keys = "[...document.querySelectorAll('.nepMenuRow kbd')].map(e => e.textContent)"
    assert them.ask(keys)[:2] == ["Ctrl+↵", "Ctrl+D"]
    assert them.ask("document.querySelectorAll('.nepMenuRow svg').length") == len(rows)
    them.press(Qt.Key_Escape)


def test_canvas_context_menu_lists_paste_undo_redo_and_tidy_up(qtbot, them):
    QTest.mouseClick(them.target, Qt.RightButton, pos=QPoint(900, 500))
    them.wait_for("!!document.querySelector('.blocklyContextMenu')")
    rows = them.ask(ROWS)
    looked_at(them, "menu-canvas")
    assert [row for row in rows if row in {"Paste", "Undo", "Redo", "Tidy up"}] == [
        "Paste",
        "Undo",
        "Redo",
        "Tidy up",
    ]
    them.press(Qt.Key_Down)
    them.press(Qt.Key_Escape)
    them.wait_for("document.querySelector('.blocklyContextMenu') === null")


def test_disabled_block_is_skipped_and_the_next_block_runs(qtbot, them):
    choose(them, "first", "Disable block")
    them.wait_for("document.querySelector('[data-id=first]').classList.contains('blocklyDisabled')")
    looked_at(them, "off")
    made = compile_behaviour(them.newest(), [])
    assert "wait(3)" not in made.source
    assert "wait(1)" in made.source
    assert not made.problems
    assert "Enable block" in open_menu(them, "first")
    them.press(Qt.Key_Escape)
    choose(them, "first", "Enable block")
    qtbot.waitUntil(lambda: "wait(3)" in compile_behaviour(them.newest(), []).source, timeout=WAIT_MS)


def test_disabling_the_event_block_greys_out_its_script(qtbot, them):
    choose(them, "start", "Disable block")
    them.wait_for("document.querySelectorAll('.blocklyDisabled').length >= 5")
    made = compile_behaviour(them.newest(), [])
    assert "wait(" not in made.source
    assert not any(each.severity == "error" for each in made.problems)
    them.view.undo()
    them.wait_for("document.querySelectorAll('.blocklyDisabled').length", 0)


def test_double_click_collapses_a_block_that_still_shows_running_and_error_state(qtbot, view, them):
    double_click(them, "loop")
    qtbot.waitUntil(lambda: '"collapsed": True' in str(them.newest()).replace("'", '"'), timeout=WAIT_MS)
    view.highlight(["b"])
    them.wait_for(outlined("running"), ["loop"])
    looked_at(them, "folded")
    view.set_errors({"b": "The robot isn't responding."})
    view.highlight([])
    them.wait_for(outlined("error"), ["loop"])
    them.wait_for("document.querySelector('.nepBubble').getBoundingClientRect().left > 250")
    double_click(them, "loop")
    them.wait_for(outlined("error"), ["b"])


def test_double_click_next_to_the_fields_of_a_small_block_has_no_effect(them):
    before = them.newest()
    double_click(them, "first")
    assert them.newest() == before


def test_pause_here_sets_a_breakpoint_that_is_saved_and_can_be_undone(qtbot, view, them):
    choose(them, "first", "Pause here")
    them.wait_for("document.querySelector('.nepPauseMark').parentElement.dataset.id", "first")
    looked_at(them, "pause")
    kept = them.newest()
    assert compile_behaviour(kept, []).breakpoints == ("first",)
    view.undo()
    them.wait_for("document.querySelector('.nepPauseMark') === null")
    assert compile_behaviour(them.newest(), []).breakpoints == ()
    view.load(kept)
    them.wait_for("document.querySelectorAll('.nepPauseMark').length", 1)
    choose(them, "first", "Don't pause here")
    qtbot.waitUntil(lambda: "data" not in str(them.newest()), timeout=WAIT_MS)
