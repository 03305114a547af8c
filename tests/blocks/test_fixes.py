from __future__ import annotations

import copy

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.fixes.fixes import fix
from app.blocks.fixes.replace_robot import block_types_by_robot, blocks_of, supports_blocks
from app.intents import AddStartBlock, AddTimeLimit, DefineFunction
from tests.blocks.samples import block, robot, say, started, workspace


def problems(saved):
    return compile_behaviour(saved, [robot()]).problems


def test_fix_adds_time_limit_to_wait_until():
    inner = block("control_wait_until", "w", CONDITION=block("robot_pepper_get_sees_face", ROBOT="Pepper"))
    saved = workspace(started(block("control_forever", BODY=[say("a"), inner])))
    before = copy.deepcopy(saved)
    (problem,) = problems(saved)
    assert problem.fix_action is not None
    fixed = fix(saved, problem.fix_action)
    assert fixed is not None
    assert saved == before
    assert problems(fixed) == ()
    assert "at_most_s=10" in compile_behaviour(fixed, [robot()]).source


def test_fix_adds_start_block_above_blocks_without_one():
    saved = workspace(say("Hi") | {"x": 100, "y": 50})
    fixed = fix(saved, problems(saved)[0].fix_action)
    assert fixed is not None
    assert problems(fixed) == ()
    top = fixed["blocks"]["blocks"][0]
    assert (top["type"], top["x"], top["y"]) == ("events_started", 100, 50)


def test_fix_adds_no_start_block_above_value_block():
    saved = workspace(block("robot_pepper_get_battery", ROBOT="Pepper"), say("Hi"))
    fixed = fix(saved, AddStartBlock("events_started"))
    assert fixed is not None
    assert [top["type"] for top in fixed["blocks"]["blocks"]] == [
        "robot_pepper_get_battery",
        "events_started",
    ]


def test_fix_adds_start_block_to_empty_workspace():
    fixed = fix({}, AddStartBlock("events_started"))
    assert fixed is not None
    assert compile_behaviour(fixed, []).starts == 1


def test_fix_action_without_matching_block_changes_nothing():
    assert fix(workspace(), AddTimeLimit("nobody")) is None


@pytest.mark.parametrize(
    "blocks",
    [None, 7, "x", {}, {"blocks": None}, {"blocks": 7}, {"blocks": [None, {"inputs": 3, "next": []}]}],
)
def test_fix_on_invalid_workspace_changes_nothing_and_does_not_raise(blocks):
    saved = {"blocks": blocks}
    assert fix(saved, AddTimeLimit("w")) is None
    assert fix(saved, DefineFunction("w")) is None
    assert blocks_of(saved, "Pepper") == ()
    assert not supports_blocks(block_types_by_robot(saved).get("Pepper", ()), "pepper", robot())
