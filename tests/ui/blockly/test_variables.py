"""Tests of variables in the page: value cards, the drop-down menu, and edits requested by the window."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt

from app.blocks.runtime.variables import VariableValue, display_value
from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.messages import CommandRequested, VariablesWatched
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import block, get, list_of, number, started, workspace, write
from tests.ui.blockly_person import WAIT_MS, Person, editor, received

pytestmark = pytest.mark.web

SAVED = workspace(
    started(
        block("variables_set", "set", VAR={"id": "score"}, VALUE=number(3)),
        write(get("score") | {"id": "get"}),
    ),
    variables=("score", "names"),
)
SAVED["blocks"]["blocks"][0] |= {"x": 60, "y": 60}  # type: ignore[index]
WORDS = "e => [e.children[0].textContent, e.children[1].textContent]"
CARDS = f"[...document.querySelectorAll('.nepWatch')].map({WORDS})"
UNKNOWN = "\u2013"
MENU = "[...document.querySelectorAll('.blocklyMenuItem')].map(e => e.textContent)"


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions(()), 1031, 586)


@pytest.fixture
def them(person) -> Person:
    return person(state=SAVED)


def values(**held: object) -> dict[str, VariableValue]:
    return {id: display_value(id, value) for id, value in held.items()}


def test_watched_variable_shows_a_value_card_that_is_saved_in_the_file(qtbot, view, them) -> None:
    watched = received(view, VariablesWatched, "ids")
    view.edit_variable({"do": "watch", "id": "score"})
    qtbot.waitUntil(lambda: watched == [("score",)], timeout=WAIT_MS)
    them.wait_for(CARDS, [["score", UNKNOWN]])
    view.set_variable_values(values(score=2**64 - 1))
    them.wait_for(CARDS, [["score", "18446744073709551615"]])
    view.set_variable_values(values(score=["Ada", "Grace"]))
    them.wait_for(CARDS, [["score", "2"]])
    them.wait_for("[...document.querySelectorAll('.nepWatch li')].map(e => e.textContent)", ["Ada", "Grace"])
    assert them.newest()["nepWatched"] == [{"id": "score"}]
    them.click(".nepWatch button", 6, 6)
    them.wait_for(CARDS, [])
    qtbot.waitUntil(lambda: "nepWatched" not in them.newest(), timeout=WAIT_MS)


def test_dragged_variable_card_stays_inside_the_page_and_its_position_is_saved(qtbot, view, them) -> None:
    view.edit_variable({"do": "watch", "id": "score"})
    them.wait_for("document.querySelectorAll('.nepWatch').length", 1)
    them.drag(".nepWatch", QPoint(500, 300))
    qtbot.waitUntil(lambda: "top" in them.newest()["nepWatched"][0], timeout=WAIT_MS)
    saved = them.newest()
    box = them.box(".nepWatch")
    assert abs(box["top"] - 282) < 12
    them.drag(".nepWatch", QPoint(3000, -400))
    after = them.box(".nepWatch")
    assert after["right"] <= 1031
    assert after["top"] >= 0
    view.load(saved)
    qtbot.waitUntil(lambda: them.box(".nepWatch") == box, timeout=WAIT_MS)


def test_variable_dropdown_requests_the_new_and_rename_dialogs_of_the_window(qtbot, view, them) -> None:
    asked = received(view, CommandRequested, "command")
    them.click("[data-id=get] .blocklyDropdownField")
    them.wait_for(f"{MENU}.length >= 4")
    entries = them.ask(MENU)
    assert entries[:3] == ["names", "score", "New variable"]
    choose(them, "New variable")
    qtbot.waitUntil(lambda: asked == ["variable.new"], timeout=WAIT_MS)
    view.edit_variable({"do": "new", "name": "counter", "list": False})
    qtbot.waitUntil(lambda: "counter" in str(them.newest()["variables"]), timeout=WAIT_MS)
    (made,) = [each["id"] for each in them.newest()["variables"] if each["name"] == "counter"]
    getter = them.tops()[0]["next"]["block"]["next"]["block"]["inputs"]["VALUE"]["block"]
    assert getter["fields"]["VAR"] == {"id": made}  # the drop-down is updated immediately
    them.click("[data-id=get] .blocklyDropdownField")
    them.wait_for(f"{MENU}.length >= 5")
    choose(them, next(each for each in them.ask(MENU) if each.startswith("Rename")))
    qtbot.waitUntil(lambda: asked[1:] == [f"variable.rename:{made}"], timeout=WAIT_MS)


def choose(them: Person, words: str) -> None:
    them.ask("document.querySelector('[data-test=entry]')?.removeAttribute('data-test')")
    found = (
        f"[...document.querySelectorAll('.blocklyMenuItem')].find(e => e.textContent.startsWith({words!r}))"
    )
    them.ask(f"{found}.setAttribute('data-test', 'entry')")
    them.click("[data-test=entry]", 30, 8)


def test_rename_and_delete_of_a_variable_are_one_undo_step_each(qtbot, view, them) -> None:
    before = them.newest()
    view.edit_variable({"do": "rename", "id": "score", "name": "points"})
    qtbot.waitUntil(lambda: "points" in str(them.newest()["variables"]), timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: them.newest() == before, timeout=WAIT_MS)
    view.edit_variable({"do": "delete", "id": "score"})
    qtbot.waitUntil(lambda: "score" not in str(them.newest()), timeout=WAIT_MS)
    (hat,) = them.tops()
    assert hat["next"]["block"]["type"] == "messages_write"  # moved up to the place of the deleted block
    view.undo()
    qtbot.waitUntil(
        lambda: them.newest()["blocks"] == before["blocks"] and len(them.newest()["variables"]) == 2,
        timeout=WAIT_MS,
    )


def test_block_menu_offers_to_show_the_value_of_its_variable(qtbot, view, them) -> None:
    asked = received(view, CommandRequested, "command")
    them.click("[data-id=set] > .blocklyPath", 10, 8)
    them.press(Qt.Key.Key_F10, Qt.KeyboardModifier.ShiftModifier)
    them.wait_for(f"{MENU}.some(e => e.startsWith('Show the value of “score”'))")
    choose(them, "Show the value of “score”")
    qtbot.waitUntil(lambda: asked == ["variable.watch:score"], timeout=WAIT_MS)


def test_page_can_only_trigger_allowed_commands(qtbot, view, them) -> None:
    asked = received(view, CommandRequested, "command")
    view._bridge.message('{"type": "commandRequested", "command": "file.quit"}')
    view._bridge.message('{"type": "commandRequested", "command": "variable.new"}')
    assert asked == ["variable.new"]


def test_new_list_becomes_the_default_of_the_list_blocks(qtbot, view, them) -> None:
    asked = received(view, CommandRequested, "command")
    them.open_category("Lists")
    words = "[...document.querySelectorAll('.blocklyFlyout .blocklyFlyoutButton')].map(e => e.textContent)"
    assert them.ask(words) == ["New list"]
    them.click(".blocklyFlyout .blocklyFlyoutButton", 30, 12)
    qtbot.waitUntil(lambda: asked == ["variable.new_list"], timeout=WAIT_MS)
    view.edit_variable({"do": "new", "name": "shopping", "list": True})
    first = "document.querySelector('.blocklyFlyout .blocklyBlock')"
    them.wait_for(f"{first}?.classList.contains('variables_set')")
    assert "shopping" in them.ask(f"{first}.textContent")
    adds = "document.querySelector('.blocklyFlyout .lists_add').textContent"
    assert "shopping" in them.ask(adds)
    them.drag(".blocklyFlyout .variables_set", QPoint(760, 330))
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    made = them.tops()[1]
    (id,) = [each["id"] for each in them.newest()["variables"] if each["name"] == "shopping"]
    assert made["fields"]["VAR"] == {"id": id}
    assert made["inputs"]["VALUE"]["block"]["type"] == "lists_create"
    assert len(them.newest()["variables"]) == 3


def test_list_blocks_default_to_a_variable_that_is_assigned_a_list(qtbot, view, person) -> None:
    saved = workspace(
        started(block("variables_set", VAR={"id": "names"}, VALUE=list_of(number(1)))),
        variables=("names", "x"),
    )
    them = person(state=saved)
    them.open_category("Lists")
    assert "names" in them.ask("document.querySelector('.blocklyFlyout .lists_add').textContent")


def test_variable_without_a_name_gets_a_placeholder_that_is_not_saved(qtbot, view, person) -> None:
    saved = workspace(started(block("variables_set", "set", VAR={"id": "gone"}, VALUE=number(3))))
    saved["blocks"]["blocks"][0] |= {"x": 60, "y": 60}  # type: ignore[index]
    them = person(state=saved)
    them.wait_for("document.querySelector('[data-id=set]').textContent.includes('unnamed\\u00a0variable')")
    assert "variables" not in them.newest()
    view.edit_variable({"do": "rename", "id": "gone", "name": "score"})
    qtbot.waitUntil(lambda: "variables" in them.newest(), timeout=WAIT_MS)
    assert them.newest()["variables"] == [{"name": "score", "id": "gone"}]
    view.undo()
    qtbot.waitUntil(lambda: "variables" not in them.newest(), timeout=WAIT_MS)
