"""Tests of lists and functions in the block editor: adding slots, and calls that follow their function."""

from __future__ import annotations

import copy

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import (
    block,
    call,
    define,
    get,
    given,
    list_of,
    number,
    started,
    text,
    workspace,
    write,
)
from tests.ui.blockly_person import WAIT_MS, Person, editor

pytestmark = pytest.mark.web


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([]))


def at(saved: dict, x: int, y: int) -> dict:
    return saved | {"x": x, "y": y}


def greeting() -> dict:
    greet = define("g", "greet", ("who",), write(given("who")) | {"id": "inside"})
    use = call("g", id="c", who=text("Ada") | {"id": "ada"})
    use["extraState"]["name"] = "greet"  # type: ignore[index]
    return workspace(at(started(use), 28, 28), at(greet, 28, 252))


def parts(them: Person, id: str) -> str:
    words = them.ask(f"document.querySelector('.nepTab [data-id={id}]').textContent")
    return str(words).replace("\xa0", " ")


def type_into(them: Person, qtbot, selector: str, words: str) -> None:
    them.click(selector, dx=8, dy=8)
    them.wait_for("!!document.querySelector('.blocklyHtmlInput')")
    QTest.keyClicks(them.target, words)
    them.press(Qt.Key_Return)
    them.wait_for("!document.querySelector('.blocklyHtmlInput')")


def all_blocks(saved: dict) -> dict[str, dict]:
    found: dict[str, dict] = {}
    waiting = list(saved["blocks"]["blocks"])
    while waiting:
        here = waiting.pop()
        found[here["id"]] = here
        for each in (*here.get("inputs", {}).values(), here.get("next") or {}):
            waiting += [each[name] for name in ("block", "shadow") if name in each]
    return found


def test_lists_and_functions_round_trip(person):
    state = greeting()
    state["blocks"]["blocks"].append(at(list_of(text("a"), number(2)), 500, 28))
    state["blocks"]["blocks"].append(
        at(block("lists_get", WHERE="first", NUMBER=number(3), LIST=list_of()), 500, 140)
    )
    lone = copy.deepcopy(state)
    lone["blocks"]["blocks"][3]["inputs"]["LIST"]["block"].pop("inputs", None)
    assert person(state=state).newest()["blocks"] == lone["blocks"]


def test_list_slots_are_added_and_removed_with_undo(qtbot, view, person):
    them = person(state=workspace(at(list_of(text("a"), text("b")) | {"id": "l"}, 28, 28)))
    them.click("[data-id=l] .nepButton:last-of-type", dx=8, dy=8)
    qtbot.waitUntil(lambda: them.tops()[0]["extraState"] == {"items": 3}, timeout=WAIT_MS)
    assert them.tops()[0]["inputs"]["ITEM2"]["shadow"]["fields"] == {"TEXT": ""}
    view.undo()
    qtbot.waitUntil(lambda: them.tops()[0]["extraState"] == {"items": 2}, timeout=WAIT_MS)
    qtbot.wait(QApplication.doubleClickInterval())  # two clicks, not one double click
    them.click("[data-id=l] .nepButton", dx=8, dy=8)
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)  # “b” was moved out, not deleted
    view.undo()
    qtbot.waitUntil(lambda: [len(top.get("inputs", ())) for top in them.tops()] == [2], timeout=WAIT_MS)


def test_list_index_input_is_visible_only_if_items_are_selected_by_index(qtbot, view, person):
    it = block("lists_get", "i", WHERE="number", NUMBER=number(7) | {"id": "n"}, LIST=list_of())
    them = person(state=workspace(at(it, 28, 28)))
    shown = "document.querySelector('[data-id=n]').getBoundingClientRect().width > 0"
    them.wait_for(shown)
    them.click("[data-id=i] .blocklyDropdownField", dx=10, dy=10)
    them.wait_for("!!document.querySelector('.blocklyMenuItem')")
    them.press(Qt.Key_Down)
    them.press(Qt.Key_Return)
    them.wait_for(shown, False)
    qtbot.waitUntil(lambda: "first item" in parts(them, "i"), timeout=WAIT_MS)
    assert them.tops()[0]["fields"] == {"WHERE": "first"}
    view.undo()
    them.wait_for(shown)


def test_calls_follow_a_renamed_function(qtbot, view, person):
    them = person(state=greeting())
    type_into(them, qtbot, "[data-id=g] .blocklyInputField", "say hello")
    qtbot.waitUntil(lambda: "say hello" in parts(them, "c"), timeout=WAIT_MS)
    assert all_blocks(them.newest())["c"]["extraState"]["name"] == "say hello"
    view.undo()
    qtbot.waitUntil(lambda: "greet" in parts(them, "c") and "greet" in parts(them, "g"), timeout=WAIT_MS)


def test_calls_follow_renamed_added_and_removed_function_inputs(qtbot, view, person):
    them = person(state=greeting())
    type_into(them, qtbot, "[data-id=g] .blocklyInputField ~ .blocklyInputField", "name")
    qtbot.waitUntil(lambda: "name" in parts(them, "c") and "name" in parts(them, "inside"), timeout=WAIT_MS)
    at_first = them.box("[data-id=g] .nepButton")
    them.click("[data-id=g] .nepButton ~ .nepButton", dx=8, dy=8)
    qtbot.waitUntil(lambda: "input" in parts(them, "c"), timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: "input" not in parts(them, "c"), timeout=WAIT_MS)
    qtbot.waitUntil(lambda: them.box("[data-id=g] .nepButton") == at_first, timeout=WAIT_MS)  # re-rendered
    before = them.newest()
    them.click("[data-id=g] .nepButton", dx=8, dy=8)
    qtbot.waitUntil(lambda: len(them.tops()) == 3, timeout=WAIT_MS)  # the text “Ada” is next to its block
    assert all_blocks(them.newest())["c"]["extraState"]["inputs"] == []
    view.undo()
    qtbot.waitUntil(lambda: them.newest() == before, timeout=WAIT_MS)


def test_deleted_function_keeps_its_calls_as_errors(qtbot, view, person):
    them = person(state=greeting())
    them.click("[data-id=g] > .blocklyPath", dx=6, dy=8)
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: len(them.tops()) == 1, timeout=WAIT_MS)
    assert "greet" in parts(them, "c")
    (problem,) = compile_behaviour(them.newest(), []).errors
    assert problem.block_id == "c"


def test_copied_function_gets_a_unique_name(qtbot, view, person):
    them = person(state=greeting())
    them.click("[data-id=g] > .blocklyPath", dx=6, dy=8)
    them.press(Qt.Key_C, Qt.ControlModifier)
    them.press(Qt.Key_V, Qt.ControlModifier)
    qtbot.waitUntil(lambda: len(them.tops()) == 3, timeout=WAIT_MS)
    names = [top["fields"]["NAME"] for top in them.tops() if "NAME" in top.get("fields", {})]
    assert sorted(names) == ["greet", "greet 2"]


def test_toolbox_offers_user_defined_functions(qtbot, view, person):
    them = person(state=workspace(at(started(), 28, 28)))
    them.open_category("Functions")
    start = them.hold(".blocklyFlyout .functions_define_result")
    them.move(start, QPoint(900, 300))
    them.drop(QPoint(900, 300))
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    them.open_category("Functions")
    them.drag(".blocklyFlyout .functions_result", QPoint(900, 500))
    qtbot.waitUntil(lambda: len(them.tops()) == 3, timeout=WAIT_MS)
    definition = next(top for top in them.tops() if top["type"] == "functions_define_result")
    use = next(top for top in them.tops() if top["type"] == "functions_result")
    assert use["extraState"] == {"function": definition["id"], "name": "my result", "inputs": []}


@pytest.mark.parametrize(
    "extra", [None, 7, {"items": -3}, {"items": 10**9}, {"inputs": [1, {"id": 3}]}, {"inputs": "x"}]
)
def test_blocks_with_invalid_extra_state_are_loaded_and_preserved(person, extra):
    tops = [
        at(block(each) | {"extraState": extra}, 28, 100 * y)
        for y, each in enumerate(["functions_define", "functions_call", "lists_create", "functions_result"])
    ]
    them = person(state=workspace(*tops))
    assert [top["type"] for top in them.tops()] == [top["type"] for top in tops]


def test_inputs_beyond_the_shape_of_a_block_are_preserved(person):
    odd = call("g", who=text("Ada"))
    odd["inputs"]["IN_other"] = {"block": text("kept")}  # type: ignore[index]
    state = workspace(at(odd, 28, 28), at(list_of(text("a")) | {"extraState": {"items": 0}}, 28, 140))
    assert person(state=state).newest() == {key: state[key] for key in ("blocks",)} | {
        key: value for key, value in state.items() if key != "blocks" and value
    }


def test_variable_in_a_list_block_from_the_toolbox_is_created(qtbot, view, person):
    them = person(state=workspace(at(started(), 28, 28)))
    them.open_category("Lists")
    them.drag(".blocklyFlyout .lists_length", QPoint(900, 500))
    qtbot.waitUntil(lambda: len(them.tops()) == 2, timeout=WAIT_MS)
    assert [each["name"] for each in them.newest()["variables"]] == ["list"]
    assert get("x")["type"] == "variables_get"
