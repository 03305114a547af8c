"""Tests that a missing robot is one problem whose fixes are the suitable robots and the virtual one."""

from __future__ import annotations

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.fixes.replace_robot import block_types_by_robot, supports_blocks, with_robot_replaced
from app.blocks.model.project import Project
from app.core.projects.journal import Journal
from app.core.projects.open_project import OpenProject
from app.core.projects.problems import Fix, problem_lines
from app.intents import ConnectRobot, ReplaceRobot, StartVirtualRobot
from app.robots import simulated
from app.robots.description.description import Robot, parse, thing_description
from tests.blocks.samples import block, nao, started, text, workspace
from tests.blocks.samples import robot as sample

MODELS = {"pepper"}


def pepper(name: str) -> Robot:
    return parse(thing_description(simulated.ROBOT.thing_model, name))


def speaks(robot: str, count: int = 3) -> dict[str, object]:
    blocks = [block("robot_pepper_do_say", ROBOT=robot, TEXT=text(f"{n}")) for n in range(count)]
    return workspace(started(*blocks))


def lines(saved, missing: list[Robot], connected: list[Robot]):
    program = compile_behaviour(saved, connected, absent=missing, name="Test")
    return problem_lines(
        program.problems, Project.of_blocks("", saved).pages, missing, connected, MODELS, program.absent
    )


def test_all_blocks_of_missing_robot_are_reported_as_one_problem() -> None:
    (line,) = lines(speaks("Pepper"), [pepper("Pepper")], [])
    assert line.problem.message == "Pepper isn't connected, so 3 blocks will be skipped."
    assert line.problem.subject == "3 blocks"
    assert line.problem.block_id, "a press leads to the first"
    assert line.fixes == (Fix("Start a virtual Pepper", StartVirtualRobot("Pepper")),)


def test_missing_robot_problem_counts_nested_and_unstarted_blocks() -> None:
    asks = block("robot_pepper_get_heard_word", ROBOT="Nao 3")
    says = block("robot_pepper_do_say", ROBOT="Nao 3", TEXT=asks)
    alone = block("robot_pepper_do_wave", ROBOT="Nao 3")
    saved = workspace(started(says), alone)
    missing = [pepper("Nao 3")]
    program = compile_behaviour(saved, [], absent=missing, name="Test")
    (line,) = lines(saved, missing, [])
    assert len(program.absent) == 3
    assert line.block_count == 3
    assert line.problem.message == "Nao 3 isn't connected, so 3 blocks will be skipped."


def test_missing_robot_fix_says_whether_a_virtual_robot_starts() -> None:
    """The label must not suggest that a real robot is connected when a virtual one starts."""
    (line,) = lines(speaks("Nao 3"), [pepper("Nao 3")], [])
    assert line.fixes == (Fix("Start a virtual Nao 3", StartVirtualRobot("Nao 3")),)
    (line,) = lines(speaks("Nao 3"), [], [])
    assert line.fixes == (Fix("Show the robots", ConnectRobot("Nao 3")),)


def test_problem_with_a_single_block_names_the_block() -> None:
    (line,) = lines(speaks("Pepper", 1), [pepper("Pepper")], [])
    assert line.problem.message == "Pepper isn't connected, so say will be skipped."


def test_connected_robot_of_same_model_is_suggested_first() -> None:
    (line,) = lines(speaks("Pepper"), [pepper("Pepper")], [pepper("Pepper 2")])
    assert [fix.label for fix in line.fixes] == ["Use Pepper 2", "Start a virtual Pepper"]
    assert line.fixes[0].action == ReplaceRobot("Pepper", "Pepper 2")


def test_missing_robot_without_virtual_or_suitable_robot_has_no_replacement_suggestion() -> None:
    unsupported = workspace(started(block("robot_nao_do_sit", ROBOT="NAO")))
    (line,) = lines(unsupported, [nao()], [pepper("Pepper")])
    assert [fix.label for fix in line.fixes] == ["Show the robots"]


def test_two_missing_robots_are_reported_as_two_problems() -> None:
    both = workspace(
        started(*(block("robot_pepper_do_say", ROBOT=name, TEXT=text("x")) for name in ("A", "B", "A")))
    )
    found = lines(both, [pepper("A"), pepper("B")], [])
    assert [(line.block_count, line.fixes[0].action) for line in found] == [
        (2, StartVirtualRobot("A")),
        (1, StartVirtualRobot("B")),
    ]


def test_using_another_robot_fixes_the_problem_and_keeps_the_previous_blocks_for_undo(tmp_path) -> None:
    document = OpenProject(lambda: Journal(tmp_path))
    document.set_connected([pepper("Pepper")])
    document.apply_edit(speaks("Pepper"))
    document.set_connected([pepper("Pepper 2")])
    before, fixes = document.workspace, document.fixes
    assert document.problems()
    assert document.replace_missing_robot("Pepper", pepper("Pepper 2"))
    assert document.problems() == ()
    assert document.program().robots == ("Pepper 2",)
    assert (document.fixes, document.dirty) == (fixes + 1, True)
    assert "Pepper 2" not in str(before), "undo shows the previous blocks"
    assert not document.replace_missing_robot("Nobody", pepper("Pepper 2"))


def said_and_walks() -> list[dict[str, object]]:
    return [
        block("robot_pepper_do_say", ROBOT="Pepper", TEXT=text("x")),
        block("robot_pepper_do_walk", ROBOT="Pepper"),
    ]


def test_robot_of_another_model_is_suggested_only_if_it_supports_every_block() -> None:
    other = sample("Rosie")
    said = workspace(started(block("robot_pepper_do_say", ROBOT="Pepper", TEXT=text("x"))))
    walks = workspace(started(block("robot_pepper_do_walk", ROBOT="Pepper")))
    assert supports_blocks(block_types_by_robot(said).get("Pepper", ()), "pepper", other)
    assert not supports_blocks(block_types_by_robot(walks).get("Pepper", ()), "pepper", other)
    both = workspace(started(*said_and_walks()))
    assert not supports_blocks(block_types_by_robot(both).get("Pepper", ()), "pepper", other), (
        "one of two is not enough"
    )
    assert not supports_blocks(block_types_by_robot(said).get("Nobody", ()), "pepper", other), (
        "nothing asks it"
    )
    made = with_robot_replaced(said, "Pepper", "pepper", other)
    program = compile_behaviour(made, [other], name="Test")
    assert (program.problems, program.robots) == ((), ("Rosie",))
