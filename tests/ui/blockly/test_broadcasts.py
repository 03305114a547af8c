"""Tests of the field for broadcast names: choosing an existing name and adding a new one."""

from __future__ import annotations

import json

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import block, stack, started, text, workspace, write
from tests.ui.blockly_person import WAIT_MS, Person, editor

pytestmark = pytest.mark.web

OFFERED = "[...document.querySelectorAll('.blocklyMenuItemContent')].map(e => e.textContent)"


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([]))


def scripts() -> dict:
    sends = started(block("events_broadcast", "b", NAME="start quiz")) | {"x": 28, "y": 28}
    receives = stack(block("events_received", "r", NAME="the end"), write(text("over"))) | {"x": 28, "y": 280}
    return workspace(sends, receives)


def choose(them: Person, words: str) -> None:
    """Click the entry of the open menu with this text."""
    number = them.ask(f"{OFFERED}.indexOf({json.dumps(words, ensure_ascii=False)})")
    them.ask(f"document.querySelectorAll('.blocklyMenuItem')[{number}].setAttribute('data-test', 'line')")
    them.click("[data-test=line]", dx=20, dy=10)


def name_of(them: Person, place: int) -> str:
    top = them.tops()[place]
    return (top["next"]["block"] if top["type"] == "events_started" else top)["fields"]["NAME"]


def test_broadcast_names_of_the_behaviour_are_offered_and_selectable(qtbot, person):
    them = person(state=scripts())
    them.click("[data-id=r] .blocklyDropdownField", dx=8, dy=8)
    them.wait_for(OFFERED, ["start quiz", "the end", "New message…"])
    choose(them, "start quiz")
    qtbot.waitUntil(lambda: name_of(them, 1) == "start quiz", timeout=WAIT_MS)
    assert compile_behaviour(them.newest(), []).problems == ()


def test_new_broadcast_name_is_offered_to_other_blocks(qtbot, person):
    them = person(state=scripts())
    them.click("[data-id=b] .blocklyDropdownField", dx=8, dy=8)
    them.wait_for(f"{OFFERED}.length", 3)
    choose(them, "New message…")
    them.wait_for("document.activeElement.className", "blocklyDialogInput")
    QTest.keyClicks(them.target, " say  hello ")
    them.press(Qt.Key_Return)
    qtbot.waitUntil(lambda: name_of(them, 0) == "say hello", timeout=WAIT_MS)
    them.click("[data-id=r] .blocklyDropdownField", dx=8, dy=8)
    them.wait_for(OFFERED, ["say hello", "the end", "New message…"])
    them.press(Qt.Key_Escape)


def test_suggested_broadcast_name_can_be_accepted_with_the_mouse(qtbot, person):
    them = person(state=scripts())
    for name in ("message 1", "message 2"):
        them.click("[data-id=b] .blocklyDropdownField", dx=8, dy=8)
        them.wait_for(f"{OFFERED}.includes('New message…')")
        choose(them, "New message…")
        them.wait_for("document.querySelector('.blocklyDialogInput')?.value", name)
        them.click(".blocklyDialogConfirmButton")
        qtbot.waitUntil(lambda name=name: name_of(them, 0) == name, timeout=WAIT_MS)


def test_empty_broadcast_name_is_ignored(qtbot, person):
    them = person(state=scripts())
    them.click("[data-id=b] .blocklyDropdownField", dx=8, dy=8)
    them.wait_for(f"{OFFERED}.length", 3)
    choose(them, "New message…")
    them.wait_for("document.activeElement.className", "blocklyDialogInput")
    QTest.keyClicks(them.target, "  ")
    them.press(Qt.Key_Return)
    them.wait_for("!document.querySelector('.blocklyDialogInput')")
    assert name_of(them, 0) == "start quiz"
