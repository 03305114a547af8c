"""Tests of the problems reported for unknown blocks and for variables without a name."""

from __future__ import annotations

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.compiler.foreign import EQUIVALENT_BLOCKS
from app.blocks.model.program import Program
from app.blocks.model.workspace import parse_workspace
from app.blocks.toolbox.catalogue import categories
from app.intents import PointAtBlock, RenameVariable
from tests.blocks.samples import block, robot, started, workspace


def compiled(*blocks: dict[str, object], **others: object) -> Program:
    return compile_behaviour(workspace(started(*blocks)) | others, [robot()])


def test_unknown_blocks_including_nested_ones_are_named_as_on_the_canvas() -> None:
    inner = block("logic_boolean", "z", BOOL="TRUE")
    foreign = block("controls_if", "q") | {"inputs": {"IF0": {"block": inner}}}
    program = compiled(
        foreign,
        block("lamp_toggle_now", "p", COLOUR="red"),
        block("control_wait", "w", SECONDS=block("lamp_level", "v")),
        block("robot_nao_do_wave", "r", ROBOT="Pepper"),
        block("control_levitate", "n"),
    )
    told = {problem.block_id: problem for problem in program.problems}
    assert {id: told[id].subject for id in ("q", "z", "p", "v", "r", "n")} == {
        "q": "controls if",
        "z": "logic boolean TRUE",
        "p": "lamp toggle now red",
        "v": "lamp level",
        "r": "wave",
        "n": "control levitate",
    }
    assert all(problem.subject in problem.message for problem in told.values())
    assert "no connected robot" in told["r"].message
    assert not any("robot" in told[id].message for id in "qzpv")
    assert "version" in told["n"].message
    assert (told["q"].fix_action, told["p"].fix_action) == (PointAtBlock("control_if"), None)


def test_disabled_unknown_blocks_are_not_reported() -> None:
    program = compiled(block("lamp_toggle_now", "p") | {"enabled": False})
    assert program.problems == ()


def test_suggested_replacements_exist_and_replace_only_unknown_blocks() -> None:
    ours = {each.type for category in categories() for each in category.blocks}
    assert set(EQUIVALENT_BLOCKS.values()) <= ours
    assert not ours & EQUIVALENT_BLOCKS.keys()


def test_variable_without_name_is_reported_with_rename_fix() -> None:
    program = compiled(
        block("variables_set", "s") | {"fields": {"VAR": {"id": "gone"}}},
        block("variables_change", "c") | {"fields": {"VAR": {"id": "gone"}}},
        block("variables_set", "t") | {"fields": {"VAR": {"id": "told", "name": "speed"}}},
        block("variables_set", "u") | {"fields": {"VAR": {"id": "listed"}}},
        variables=[{"id": "listed", "name": "count"}],
    )
    (problem,) = (each for each in program.problems if each.severity == "warning")
    assert (problem.block_id, problem.fix_action) == ("s", RenameVariable("gone"))
    assert {each.id for each in program.variables} == {"gone", "told", "listed"}
    assert "count" not in program.readings["s"]
    assert "speed" in program.readings["t"]


def test_variable_without_name_is_parsed_with_a_substitute_name() -> None:
    saved = workspace(started(block("variables_set", "s") | {"fields": {"VAR": {"id": "gone"}}}))
    parsed = parse_workspace(saved)
    assert parsed.nameless_variables == {"gone"}
    assert parsed.variables["gone"]
