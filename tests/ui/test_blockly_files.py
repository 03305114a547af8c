"""Programs in the block editor: what goes in comes out, whatever it is."""

from __future__ import annotations

import copy

import pytest
from PySide6.QtCore import QPoint, Qt

from tests.ui.blockly_person import DEFINITIONS, PICTURE, START, UNKNOWN, WAIT_MS, workspace

pytest_plugins = ["tests.ui.blockly_fixtures"]
pytestmark = pytest.mark.web

WAIT = {"type": "control_wait", "id": "w", "x": 28, "y": 28}


def test_what_was_loaded_is_what_is_saved(person):
    assert person(state=PICTURE).newest() == PICTURE


def test_loading_says_nothing_is_changed(qtbot, view, person):
    with qtbot.assertNotEmitted(view.changed, wait=400):
        them = person(state=PICTURE)
        view.load(workspace(START))
        view.set_live_values({"Pepper/battery": "84 %"})
        view.highlight(["start"])
    assert them.newest() == workspace(START)


def test_parts_of_the_file_that_are_not_blocks_are_kept(person):
    state = {**workspace(START), "variables": [{"name": "count", "id": "v1"}], "fromLater": {"a": [1]}}
    assert person(state=state).newest() == state


def test_before_the_page_exists_the_view_knows_its_program(qtbot, view):
    got: list[dict] = []
    view.load(PICTURE)
    view.flush(got.append)
    assert got == [PICTURE]


def test_blocks_nobody_knows_come_back_as_they_were(person):
    them = person(state=UNKNOWN)
    assert them.newest() == UNKNOWN
    assert them.ask("document.querySelectorAll('.blocklyBlockCanvas .nepAbsent').length") >= 7


def test_a_stack_that_cannot_be_made_is_kept_whole(person):
    number = {"type": "values_number", "id": "n", "fields": {"NUMBER": 1}}
    compare = {"type": "values_compare", "id": "c", "fields": {"OP": "<"}, "inputs": {"A": {"block": number}}}
    # A shadow block cannot hold a real one.
    shadowed = {**WAIT, "inputs": {"SECONDS": {"shadow": compare}}}
    state = workspace(shadowed, START)
    assert person(state=state).newest() == state


def test_unknown_blocks_survive_moving_copying_and_undo(qtbot, view, person):
    rover = {"type": "robot_rover_do_wave", "id": "r", "x": 140, "y": 140, "fields": {"A": 1}}
    them = person(rover)
    them.drag("[data-id=r]", QPoint(640, 400))
    qtbot.waitUntil(lambda: them.tops()[0]["x"] > 300, timeout=WAIT_MS)
    moved = them.tops()[0]
    assert {**moved, "x": 0, "y": 0} == {**rover, "x": 0, "y": 0}
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: them.tops() == [], timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: them.tops() == [moved], timeout=WAIT_MS)


def test_a_definition_that_comes_later_wakes_the_kept_block(qtbot, view, person):
    rover = {"type": "robot_rover_do_wave", "id": "r", "x": 140, "y": 140, "fields": {"TIMES": 2}}
    them = person(rover)
    more = copy.deepcopy(DEFINITIONS)
    times = {"type": "field_number", "name": "TIMES"}
    wave = {"type": "robot_rover_do_wave", "message0": "wave %1 times", "args0": [times], "style": "robot"}
    more["blocks"].append({**wave, "previousStatement": None, "nextStatement": None})
    view.set_definitions(more)
    them.wait_for("document.querySelector('[data-id=r]').classList.contains('robot_rover_do_wave')")
    assert them.ask("document.querySelector('[data-id=r]').classList.contains('nepAbsent')") is False
    assert them.tops() == [rover]
