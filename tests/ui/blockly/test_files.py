"""Tests that the block editor saves every loaded workspace unchanged, also unknown and damaged ones."""

from __future__ import annotations

import copy
import random

import pytest
from PySide6.QtCore import QPoint, Qt

from app.blocks.model import deep_json
from app.blocks.model.workspace_json import WorkspaceJson
from tests.ui.blockly_person import DEFINITIONS, PICTURE, START, UNKNOWN, WAIT_MS, workspace

pytestmark = pytest.mark.web

WAIT = {"type": "control_wait", "id": "w", "x": 28, "y": 28}


def test_loaded_workspace_is_saved_unchanged(person):
    assert person(state=PICTURE).newest() == PICTURE


def test_loading_live_values_and_highlights_emit_no_change(qtbot, view, person):
    with qtbot.assertNotEmitted(view.changed, wait=400):
        them = person(state=PICTURE)
        view.load(workspace(START))
        view.set_live_values({"Pepper/battery": "84 %"})
        view.highlight(["start"])
    assert them.newest() == workspace(START)


def test_every_block_of_a_stack_of_700_is_saved(person):
    block: dict = {"type": "control_wait", "id": "b0"}
    for number in range(1, 700):
        block = {"type": "control_wait", "id": f"b{number}", "next": {"block": block}}
    state = workspace({**block, "x": 28, "y": 28})
    them = person(state=state)
    assert deep_json.dumps(them.newest()).count("control_wait") == 700


def test_file_parts_other_than_blocks_are_preserved(person):
    state = {**workspace(START), "variables": [{"name": "count", "id": "v1"}], "fromLater": {"a": [1]}}
    assert person(state=state).newest() == state


def test_damaged_file_is_preserved_unchanged(person):
    damaged = {**workspace({"id": "no type", "x": 0, "y": 0}), "variables": {"not": "a list"}}
    assert person(state=damaged).newest() == damaged


def test_flush_before_the_page_is_loaded_returns_the_workspace(qtbot, view):
    got: list[WorkspaceJson] = []
    view.load(PICTURE)
    view.flush(got.append)
    assert [each.blocks for each in got] == [PICTURE]


def test_unknown_blocks_round_trip(person):
    them = person(state=UNKNOWN)
    assert them.newest() == UNKNOWN
    them.wait_for("document.querySelectorAll('.blocklyBlockCanvas .nepAbsent').length >= 7")


def test_stack_with_invalid_shadow_blocks_is_preserved(person):
    number = {"type": "values_number", "id": "n", "fields": {"NUMBER": 1}}
    compare = {"type": "values_compare", "id": "c", "fields": {"OP": "<"}, "inputs": {"A": {"block": number}}}
    # A shadow block can't contain a real block.
    shadowed = {**WAIT, "inputs": {"SECONDS": {"shadow": compare}}}
    state = workspace(shadowed, START)
    assert person(state=state).newest() == state


def is_on_grid(block: dict) -> bool:
    """Return True if a block is at a point of the page's grid, whose spacing is 28."""
    return block["x"] % 28 == block["y"] % 28 == 14


def test_unknown_blocks_survive_moving_deleting_and_undo(qtbot, view, person):
    rover = {"type": "robot_rover_do_wave", "id": "r", "x": 140, "y": 140, "fields": {"A": 1}}
    them = person(rover)
    them.drag("[data-id=r]", QPoint(640, 400))
    # the dropped block snaps to the grid after the next frame, which may be delayed
    qtbot.waitUntil(lambda: them.tops()[0]["x"] > 300 and is_on_grid(them.tops()[0]), timeout=WAIT_MS)
    them.wait_for("!document.querySelector('.blocklyDragging')")
    moved = them.tops()[0]
    assert is_on_grid(moved)
    assert {**moved, "x": 0, "y": 0} == {**rover, "x": 0, "y": 0}
    them.press(Qt.Key_Delete)
    qtbot.waitUntil(lambda: them.tops() == [], timeout=WAIT_MS)
    view.undo()
    qtbot.waitUntil(lambda: them.tops() == [moved], timeout=WAIT_MS)


def test_unknown_block_is_enabled_when_its_definition_arrives(qtbot, view, person):
    rover = {"type": "robot_rover_do_wave", "id": "r", "x": 140, "y": 140, "fields": {"TIMES": 2}}
    them = person(rover)
    more = copy.deepcopy(DEFINITIONS)
    times = {"type": "field_number", "name": "TIMES"}
    wave = {"type": "robot_rover_do_wave", "message0": "wave %1 times", "args0": [times], "style": "robot"}
    more["blocks"].append({**wave, "previousStatement": None, "nextStatement": None})
    view.set_definitions(more)
    them.wait_for("document.querySelector('[data-id=r]').classList.contains('robot_rover_do_wave')")
    them.wait_for("document.querySelector('[data-id=r]').classList.contains('nepAbsent')", False)
    assert them.tops() == [rover]


KNOWN = {
    "control_wait": (("SECONDS",), {}),
    "control_repeat": (("TIMES", "DO"), {}),
    "values_compare": (("A", "B"), {"OP": ">"}),
    "values_number": ((), {"NUMBER": 4.5}),
    "robot_pepper_do_say": (("TEXT",), {"ROBOT": "Somebody"}),
    "events_message": ((), {"TOPIC": "/any"}),
}


class Maker:
    """Generator of random workspaces: known and unknown blocks, valid or not, shadows, stacks and nesting."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._count = 0

    def block(self, depth: int) -> dict:
        self._count += 1
        made: dict = {"id": f"n{self._count}"}
        if self._random.random() < 0.5:
            made["type"] = self._random.choice(list(KNOWN))
            names, fields = KNOWN[made["type"]]
        else:
            made["type"] = self._random.choice(
                ["rover_wave", "robot_rover_get_x", "robot_rover_when_y", "new"]
            )
            names, fields = (
                ("A", "DO", "TIMES"),
                {"F": self._random.choice([1, "text", None, [1], {"id": "v"}])},
            )
            extras = {"extraState": {"items": 2}, "data": "d", "collapsed": True, "inline": False}
            chosen = self._random.sample(list(extras), self._random.randint(0, 2))
            made.update({name: extras[name] for name in chosen})
        if fields:
            made["fields"] = fields
        inputs = {
            name: self.connected(depth + 1) for name in names if depth < 3 and self._random.random() < 0.5
        }
        if inputs:
            made["inputs"] = inputs
        if depth < 4 and self._random.random() < 0.4:
            made["next"] = {"block": self.block(depth + 1)}
        return made

    def connected(self, depth: int) -> dict:
        kind = self._random.random()
        made = {"block": self.block(depth)} if kind < 0.7 else {}
        if kind > 0.5:
            made["shadow"] = self.block(4)
        return made

    def program(self) -> dict:
        tops = [{**self.block(0), "x": 28 + 280 * column, "y": 28} for column in range(3)]
        return workspace(*tops)


def test_random_workspaces_round_trip(view, person):
    them = person()
    for seed in range(25):
        program = Maker(seed).program()
        view.load(program)
        assert them.newest() == program, f"seed {seed}"


def test_overlay_covers_the_canvas_while_a_long_behaviour_is_loaded(view, person):
    them = person({**WAIT, "id": "old"})
    them.ask("""(seen => new MutationObserver(() => window.seen = [...(window.seen ?? []), seen()])
        .observe(document.body, {childList: true}) ?? 0)(() => [!!document.querySelector('.nepOpening'),
            !!document.querySelector('[data-id=old]'), !!document.querySelector('[data-id=w299]')])""")
    view.load(workspace(*({**WAIT, "id": f"w{number}", "y": 60 * number} for number in range(300))))
    assert len(them.tops()) == 300
    them.wait_for("window.seen.at(-1)", [False, False, True])
    assert them.ask("window.seen[0]") == [True, True, False]
