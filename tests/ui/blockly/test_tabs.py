"""Tests of several behaviours in one page, each with its own undo stack, zoom and scroll position."""

from __future__ import annotations

import copy
import os
import signal

import pytest
from PySide6.QtCore import QPoint, Qt

from app.blocks.model.workspace_json import EMPTY_WORKSPACE, WorkspaceJson
from app.ui.blockly.messages import HistoryChanged
from app.ui.blockly.tabs import Tabs
from tests.ui.blockly_person import DEFINITIONS, START, TOKENS, WAIT_MS, outlined, received, workspace

WAIT = {"type": "control_wait", "id": "w", "x": 140, "y": 140}
A, B = workspace(START), workspace(WAIT)
PATH = "[data-id=start] > .blocklyPath"
SHOWN = "document.querySelector('.nepTab:not([hidden])')"
TABS = "document.querySelectorAll('.nepTab').length"


def test_placeholder_tab_is_replaced_by_the_first_document() -> None:
    tabs = Tabs()
    assert tabs.shown_tab.workspace.blocks == EMPTY_WORKSPACE
    assert tabs.show("a", WorkspaceJson.from_blocks(A)) == ""
    assert tabs[""] is None
    assert tabs.show("b", WorkspaceJson.from_blocks(B)) is None
    assert tabs.show("a", WorkspaceJson.from_blocks({})) is None
    assert tabs.shown_tab.workspace.blocks == A


def test_edits_of_a_closed_tab_or_a_replaced_workspace_are_ignored() -> None:
    tabs = Tabs()
    tabs.show("a", WorkspaceJson.from_blocks(A))
    before = tabs.shown_tab.generation
    assert tabs.tab_for_edit("a", before) is tabs.shown_tab
    tabs.replace(WorkspaceJson.from_blocks(B))
    assert tabs.tab_for_edit("a", before) is None
    generation = tabs.shown_tab.generation
    assert tabs.close("a")
    assert tabs.tab_for_edit("a", generation) is None
    assert not tabs.close("a")
    assert tabs.shown_tab.workspace.blocks == EMPTY_WORKSPACE


@pytest.fixture
def two(qtbot, view, person):
    """Simulated user of an editor that shows tab "a" and has shown tab "b" before."""
    view.show_tab("b", B)
    them = person(state=B)
    view.show_tab("a", A)
    them.wait_for(f"!!{SHOWN}.querySelector('[data-id=start]')")
    return them


def delete_the_hat(qtbot, them) -> None:
    them.click(PATH, dy=30)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: them.tops() == [], timeout=WAIT_MS)


def turn_to(them, key: str) -> None:
    them.view.show_tab(key, {})
    block = {"a": "start", "b": "w"}[key]
    them.wait_for(f"!!{SHOWN}.querySelector('[data-id={block}]')")


@pytest.mark.web
def test_each_tab_has_its_own_undo_stack(qtbot, view, two) -> None:
    history = received(view, HistoryChanged, "can_undo", "can_redo")
    delete_the_hat(qtbot, two)
    qtbot.waitUntil(lambda: history[-1:] == [(True, False)], timeout=WAIT_MS)
    turn_to(two, "b")
    assert two.tops() == [WAIT]
    qtbot.waitUntil(lambda: history[-1] == (False, False), timeout=WAIT_MS)
    view.undo()
    assert two.tops() == [WAIT]
    view.show_tab("a", {})
    qtbot.waitUntil(lambda: history[-1] == (True, False), timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: two.tops() == [START], timeout=WAIT_MS)
    qtbot.waitUntil(lambda: history[-1] == (False, True), timeout=WAIT_MS)


@pytest.mark.web
def test_zoom_and_scroll_position_are_kept_per_tab(qtbot, view, two) -> None:
    box = "document.querySelector('[data-id=start]').getBoundingClientRect()"
    place = f"(r => [r.left, r.top, r.width])({box})"
    first = two.ask(place)
    view.zoom_in()
    two.wait_for(f"({place})[2] > {first[2]}")
    before = two.ask(place)
    turn_to(two, "b")
    view.zoom_out()
    view.zoom_out()
    turn_to(two, "a")
    two.until(lambda: two.ask(place) == pytest.approx(before, abs=1), "it is shown as it was left")
    assert view.web.page is not None
    assert two.ask(TABS) == 2


@pytest.mark.web
def test_pending_edit_is_reported_with_its_tab_when_switching(qtbot, view, two) -> None:
    two.open_category("Control")
    told: list[tuple[str, WorkspaceJson]] = []
    view.changed.connect(lambda *each: told.append(each))
    two.drag(".nepTab:not([hidden]) .blocklyFlyout .control_wait", QPoint(700, 400))
    qtbot.waitUntil(lambda: len(two.tops()) == 2, timeout=WAIT_MS)  # the page has handled the drop
    view.show_tab("b", {})
    qtbot.waitUntil(lambda: bool(told), timeout=WAIT_MS)
    assert {key for key, _ in told} == {"a"}
    assert len(view.workspace_of("a")["blocks"]["blocks"]) == 2
    assert view.workspace == B
    assert two.tops() == [WAIT]


@pytest.mark.web
def test_every_tab_is_restored_after_the_web_process_is_killed(qtbot, view, two) -> None:
    delete_the_hat(qtbot, two)
    view.highlight(["start"])
    turn_to(two, "b")
    view.highlight(["w"])
    again: list[bool] = []
    view.recovered.connect(lambda: again.append(True))
    with qtbot.waitSignal(view.recovered, timeout=60_000):
        os.kill(view.web.page.renderProcessPid(), signal.SIGKILL)
    assert two.tops() == [WAIT]
    two.wait_for(outlined("running"), ["w"])
    view.show_tab("a", {})
    assert two.tops() == []
    view.load(A)
    assert two.tops() == [START]
    turn_to(two, "b")
    assert two.tops() == [WAIT]
    assert again == [True]


@pytest.mark.web
def test_hidden_tab_applies_changed_definitions_and_theme_when_shown(qtbot, view, two) -> None:
    changed = copy.deepcopy(DEFINITIONS)
    next(each for each in changed["blocks"] if each["type"] == "control_wait")["message0"] = "%1 pause %2 s"
    view.set_definitions(changed)
    view.set_theme(TOKENS, is_dark=True)
    turn_to(two, "b")
    two.wait_for(f"{SHOWN}.querySelector('[data-id=w]').textContent.includes('pause')")
    dark = TOKENS["block"]["control"]["dark"]["primary"].lower()
    fill = f"{SHOWN}.querySelector('[data-id=w] > .blocklyPath').getAttribute('fill').toLowerCase()"
    two.wait_for(fill, dark)
    assert two.tops() == [WAIT]


@pytest.mark.web
def test_closed_tab_is_discarded(qtbot, view, two) -> None:
    view.close_tab("b")
    two.wait_for(TABS, 1)
    assert two.tops() == [START]
    view.close_tab("a")
    qtbot.waitUntil(lambda: two.tops() == [], timeout=WAIT_MS)
    assert two.ask(TABS) == 1
    view.show_tab("b", B)
    assert two.tops() == [WAIT]
    assert two.ask(TABS) == 1


@pytest.mark.web
def test_keyboard_focus_follows_the_shown_tab(qtbot, view, two) -> None:
    two.click(PATH, dy=30)
    two.wait_for("!!document.querySelector('.blocklySelected[data-id=start]')")
    two.press(Qt.Key_C, Qt.ControlModifier)
    for _ in range(2):  # replies are in order: the key has been handled
        two.tops()
    turn_to(two, "b")
    two.wait_for(f"{SHOWN}.contains(document.activeElement)")
    two.press(Qt.Key_V, Qt.ControlModifier)
    qtbot.waitUntil(lambda: [top["type"] for top in two.tops()] == ["control_wait", "events_started"],
                    timeout=WAIT_MS)  # fmt: skip
    turn_to(two, "a")
    assert two.tops() == [START]


@pytest.mark.parametrize("full", [False, True], ids=["room", "full"])
def test_script_added_by_an_external_change_is_placed_in_the_visible_area(qtbot, person, view, full) -> None:
    wide = {"type": "control_wait", "x": 40, "y": 40}
    filled = [
        {**wide, "id": f"w{x}.{y}", "x": x, "y": y} for x in range(0, 1300, 100) for y in range(0, 900, 60)
    ]
    scripts = [START, *(filled if full else [{**wide, "id": "far", "x": 900}])]
    them = person(*scripts)
    before = them.tops()
    added = {"type": "events_received", "id": "added", "fields": {"NAME": "go"}, "x": 1320, "y": 40}
    view.apply_edit(workspace(*before, added))
    here = them.box("[data-id=added] > .blocklyPath")
    canvas = them.ask(
        "(r => [r.right, r.bottom])(document.querySelector('.blocklySvg').getBoundingClientRect())"
    )
    assert here["right"] <= canvas[0]
    assert here["bottom"] <= canvas[1]
    qtbot.waitUntil(lambda: view.workspace["blocks"]["blocks"] == them.tops(), timeout=WAIT_MS)
    view.undo()
    them.wait_for("document.querySelector('[data-id=added]')", None)
    assert sorted(them.tops(), key=str) == sorted(before, key=str)


def test_external_change_is_one_undo_step(qtbot, two, view) -> None:
    told: list[tuple[str, WorkspaceJson]] = []
    view.changed.connect(lambda key, program: told.append((key, program)))
    here = f"[...{SHOWN}.querySelectorAll('.blocklyBlockCanvas .blocklyDraggable')].map(e => e.dataset.id)"
    before = two.ask(here)
    fixed = workspace({**START, "next": {"block": {"type": "control_wait", "id": "added"}}})
    view.apply_edit(fixed)
    two.wait_for(f"({here}).includes('added')")
    qtbot.waitUntil(lambda: view.workspace == fixed, timeout=WAIT_MS)
    view.undo()
    two.wait_for(f"!({here}).includes('added')")
    assert two.ask(here) == before
    qtbot.waitUntil(lambda: bool(told) and "added" not in told[-1][1].text, timeout=WAIT_MS)
    assert told[-1][0] == "a"
    view.redo()
    two.wait_for(f"({here}).includes('added')")
