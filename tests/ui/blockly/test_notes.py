"""Tests of notes: focus, saving of typed text, position next to the block, and readability."""

from __future__ import annotations

import itertools
import json

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app import resources
from app.blocks.toolbox.definitions import editor_definitions
from app.core.projects.examples import translated
from app.core.projects.file_format import read_file
from app.robots.description.description import parse, thing_description
from app.robots.simulated import ROBOT as PEPPER
from app.ui.blockly.view import BlocklyView
from nep.i18n import install
from tests.blocks.samples import robot, workspace
from tests.ui.blockly.test_block_menu import ROWS, choose, looked_at, program
from tests.ui.blockly_person import TOKENS, WAIT_MS, Person, editor

pytestmark = pytest.mark.web

WORDS = "Ask Maria first"
TYPES = "document.activeElement.tagName == 'TEXTAREA'"


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


@pytest.fixture
def them(view, person) -> Person:
    made: Person = person(state=program())
    view.setFocus()
    made.wait_for("document.hasFocus()")
    return made


def note_of(them: Person, id: str = "first") -> dict:
    found = [them.tops()[0]]
    while found[-1].get("id") != id:
        found.append(found[-1]["next"]["block"])
    return found[-1].get("icons", {}).get("comment", {})


def add_note(them: Person, words: str = WORDS) -> None:
    choose(them, "first", "Add a note")
    them.wait_for(TYPES)
    QTest.keyClicks(them.target, words)
    them.wait_for("document.activeElement.value", words)


def boxes_of_blocks(them: Person) -> list[list[float]]:
    paths = "[...document.querySelectorAll('.blocklyBlockCanvas .blocklyPath')]"
    return them.ask(f"{paths}.map(e => (r => [r.left, r.top, r.right, r.bottom])(e.getBoundingClientRect()))")


@pytest.mark.parametrize("dark", [False, True])
def test_new_note_is_focused_placed_next_to_its_block_and_saves_typed_text(view, them, dark):
    view.set_theme(TOKENS, dark)
    add_note(them)
    looked_at(them, f"note-{'dark' if dark else 'light'}")
    sheet, room = them.box(".nepNote .blocklyDraggable"), them.box(".blocklySvg")
    for left, top, right, bottom in boxes_of_blocks(them):
        beside = sheet["left"] >= right or sheet["right"] <= left
        assert beside or sheet["top"] >= bottom or sheet["bottom"] <= top
    assert room["left"] <= sheet["left"] < sheet["right"] <= room["right"]
    assert room["top"] <= sheet["top"] < sheet["bottom"] <= room["bottom"]
    assert note_of(them)["text"] == WORDS  # saved while the field has the focus
    shown = "getComputedStyle(document.querySelector('.nepNote textarea'))"
    assert them.ask(f"{shown}.color") != them.ask(f"{shown}.backgroundColor")
    assert "Inter" in them.ask(f"{shown}.fontFamily")


def test_new_note_is_scrolled_into_view_on_a_full_page(view, them):
    view.resize(420, 300)
    them.wait_for("innerHeight", 300)
    add_note(them)
    sheet, room = them.box(".nepNote .blocklyDraggable"), them.box(".blocklySvg")
    assert room["left"] <= sheet["left"] < sheet["right"] <= room["right"]
    assert room["top"] <= sheet["top"] < sheet["bottom"] <= room["bottom"]


def test_typed_note_text_is_saved_when_the_tab_changes(qtbot, view, them):
    view.show_tab("one", them.newest())
    them.wait_for("!!document.querySelector('.nepTab:not([hidden]) [data-id=first]')")
    choose(them, "first", "Add a note")
    them.wait_for(TYPES)
    QTest.keyClicks(them.target, WORDS)
    them.wait_for("document.activeElement.value", WORDS)
    view.show_tab("two", workspace())
    qtbot.waitUntil(lambda: WORDS in str(view.workspace_of("one")), timeout=WAIT_MS)


def test_escape_returns_the_focus_from_note_to_block_and_undo_reverts_the_text(qtbot, view, them):
    add_note(them)
    them.press(Qt.Key_Escape)
    them.wait_for("document.activeElement.closest('[data-id]')?.dataset.id", "first")
    assert note_of(them)["text"] == WORDS
    view.undo()
    qtbot.waitUntil(lambda: not note_of(them).get("text"), timeout=WAIT_MS)
    view.redo()
    qtbot.waitUntil(lambda: note_of(them).get("text") == WORDS, timeout=WAIT_MS)


def test_empty_note_is_removed_when_its_focus_is_lost(qtbot, them):
    choose(them, "first", "Add a note")
    them.wait_for(TYPES)
    them.press(Qt.Key_Escape)
    them.wait_for("document.querySelector('.nepNoteSign') === null")


def test_note_icon_of_the_block_toggles_the_note(qtbot, them):
    add_note(them)
    them.click(".nepNoteSign", dx=8, dy=8)
    them.wait_for("document.querySelector('.nepNote') === null")
    assert note_of(them)["text"] == WORDS
    them.click(".nepNoteSign", dx=8, dy=8)
    them.wait_for("document.querySelector('.nepNote textarea')?.value", WORDS)


def test_note_is_dragged_by_its_title_bar_and_follows_its_block(qtbot, them):
    add_note(them)
    box = them.box(".nepNote .blocklyDraggable")
    start = QPoint(round(box["left"] + 60), round(box["top"] + 8))
    QTest.mouseMove(them.target, start)
    QTest.mousePress(them.target, Qt.LeftButton, pos=start)
    them.move(start, start + QPoint(160, 120))
    them.drop(start + QPoint(160, 120))
    them.wait_for(
        "Math.round(document.querySelector('.nepNote .blocklyDraggable').getBoundingClientRect().left)",
        round(box["left"] + 160),
    )
    moved = note_of(them)
    them.drag("[data-id=start] > .blocklyPath", QPoint(330, 140))
    qtbot.waitUntil(lambda: note_of(them)["x"] > moved["x"] + 20, timeout=WAIT_MS)


def test_note_stays_readable_when_zoomed_out(view, them):
    add_note(them)
    for _ in range(8):
        view.zoom_out()
    note = "document.querySelector('.nepNote textarea')"
    seen = "(e => parseFloat(getComputedStyle(e).fontSize) * e.getBoundingClientRect().width / e.offsetWidth)"
    # The page receives each zoom step separately, and the font size follows one frame later.
    them.wait_for(f"{note}.getBoundingClientRect().width < 120 && {seen}({note}) > 8.5")


def test_canvas_note_is_added_by_menu_saved_and_removed_by_the_delete_key(qtbot, them):
    QTest.mouseClick(them.target, Qt.RightButton, pos=QPoint(700, 300))
    them.wait_for("!!document.querySelector('.blocklyContextMenu')")
    rows = them.ask(ROWS)
    script = f"document.querySelectorAll('.nepMenuRow')[{rows.index('Add a note here')}]"
    them.ask(f"{script}.setAttribute('data-test', 'row')")
    them.click("[data-test=row]")
    them.wait_for(TYPES)
    QTest.keyClicks(them.target, WORDS)
    them.wait_for("document.activeElement.value", WORDS)
    looked_at(them, "note-canvas")
    (note,) = them.newest()["workspaceComments"]
    assert note["text"] == WORDS
    assert len(them.tops()) == 1
    them.press(Qt.Key_Escape)
    them.wait_for("document.activeElement.classList.contains('blocklyComment')")
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: "workspaceComments" not in them.newest(), timeout=WAIT_MS)


NOTES = "[...document.querySelectorAll('.nepTab:not([hidden]) .blocklyComment')]"
SCRIPTS = "[...document.querySelectorAll('.nepTab:not([hidden]) .blocklyBlockCanvas > .blocklyDraggable')]"
BOX = "(r => [r.left, r.top, r.right, r.bottom])(e.getBoundingClientRect())"


def overlap(a: list[float], b: list[float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.fixture
def language(request):
    install(request.param)
    yield request.param
    install("en")


@pytest.mark.parametrize("language", ["en", "fr", "ja"], indirect=True)
def test_scripts_and_notes_of_translated_examples_do_not_overlap(qtbot, language):
    pepper = parse(thing_description(PEPPER.thing_model, "Pepper"))
    view = editor(qtbot, editor_definitions([pepper]), 1320, 760)
    view.set_toolbox_pinned(False)
    them = Person(qtbot, view)
    with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
        view.show()
    for path in sorted((resources.folder() / "examples").glob("*.nepb")):
        state = translated(read_file(path)).always.workspace.blocks
        view.load(state)
        first = state["blocks"]["blocks"][0]["id"]
        them.wait_for(f"!!document.querySelector('.nepTab:not([hidden]) [data-id={json.dumps(first)}]')")
        them.wait_for(f"{NOTES}.length", 1)
        them.render()  # blocks get their size, and scripts their position, in the next frame
        scripts = [
            them.ask(f"[...{SCRIPTS}[{number}].querySelectorAll('.blocklyPath')].map(e => {BOX})")
            for number in range(len(state["blocks"]["blocks"]))
        ]
        groups = [*scripts, them.ask(f"{NOTES}.map(e => {BOX})")]
        overlaps = [
            (a, b)
            for one, other in itertools.combinations(groups, 2)
            for a, b in itertools.product(one, other)
            if overlap(a, b)
        ]
        assert overlaps == [], path.name


def test_scripts_are_separated_on_loading_only_in_files_with_the_key_for_it(qtbot, view):
    second = {"type": "control_wait", "id": "second", "x": 90, "y": 70}
    state = workspace({"type": "events_started", "id": "start", "x": 28, "y": 28}, second)
    view.load(state)
    with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
        view.show()
    them = Person(qtbot, view)
    assert [(top["x"], top["y"]) for top in them.tops()] == [(28, 28), (90, 70)]
    edits = []
    view.changed.connect(lambda *edit: edits.append(edit))
    view.load({**state, "separateScripts": True})
    qtbot.waitUntil(lambda: them.tops()[1]["x"] > 90, timeout=WAIT_MS)
    assert "separateScripts" not in them.newest()
    start, moved = them.tops()
    assert (start["x"], start["y"], moved["y"]) == (28, 28, 70)
    assert edits == []  # the file isn't modified until the user edits it
