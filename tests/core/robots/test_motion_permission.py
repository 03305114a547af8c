"""May this robot move? Asked once for each real robot, before it moves; never for virtual ones."""

from __future__ import annotations

import ast
from dataclasses import replace

import pytest

from app.blocks.compiler.compiler import asked_actions
from app.blocks.model.program import Program
from app.core.robots.motion.permission import MayNotMoveError, MotionPermission, risky, wanted_by
from app.core.storage.settings import Settings
from app.robots.description.description import Robot, parse, td_for
from app.robots.turtle import ROBOT


@pytest.fixture
def rover() -> Robot:
    """A real robot on two wheels."""
    return replace(parse(td_for(ROBOT.thing_model, "Rover")), virtual=False)


def test_a_virtual_robot_is_never_asked_for(rover) -> None:
    moving = MotionPermission()
    assert moving.permits([(replace(rover, virtual=True), ["move"])], pytest.fail)
    assert moving.question is None


def test_the_question_names_what_moves_and_says_that_stop_is_f12(rover) -> None:
    moving = MotionPermission()
    assert not moving.permits([(rover, ["move", "light", "turn"])], lambda: None)
    question = moving.question
    assert question is not None
    assert question.title == "Allow Rover to move?"
    assert question.sentence.startswith("“move” and “turn” move Rover.")
    assert "Press F12 to stop" in question.sentence


def test_actions_without_risk_need_no_answer(rover) -> None:
    assert MotionPermission().permits([(rover, ["light", "stop"])], pytest.fail)


def test_a_yes_goes_on_once_and_counts_for_the_session(rover) -> None:
    moving, done = MotionPermission(), []
    moving.permits([(rover, ["move"])], lambda: done.append(1))
    moving.answer(let=True)
    moving.answer(let=True)  # a second press
    assert done == [1]
    assert moving.permits([(rover, ["turn"])], pytest.fail)
    other = replace(rover, name="Other")
    assert not moving.permits([(other, ["turn"])], lambda: None)  # each robot for itself
    assert not MotionPermission().permits([(rover, ["move"])], lambda: None)  # and each session


def test_not_now_moves_nothing_and_asks_again(rover) -> None:
    moving = MotionPermission()
    moving.permits([(rover, ["move"])], pytest.fail)
    moving.answer(let=False, always=True)
    assert moving.question is None
    assert not moving.permits([(rover, ["move"])], pytest.fail)
    moving.withdraw()
    assert moving.question is None
    moving.answer(let=True)  # the question has gone: this answers nothing
    assert not moving.allowed(rover)


def test_always_is_kept_for_this_robot_until_it_is_forgotten(rover, tmp_path) -> None:
    moving = MotionPermission(Settings(tmp_path))
    moving.permits([(rover, ["move"])], lambda: None)
    moving.answer(let=True, always=True)
    assert MotionPermission(Settings(tmp_path)).allowed(rover)
    assert not MotionPermission(Settings(tmp_path)).allowed(replace(rover, model="other"))
    moving.forget()
    assert not MotionPermission(Settings(tmp_path)).allowed(rover)
    assert not moving.allowed(rover)


def test_the_question_replaces_an_older_one(rover) -> None:
    moving, done = MotionPermission(), []
    moving.permits([(rover, ["move"])], lambda: done.append("old"))
    moving.permits([(rover, ["turn"])], lambda: done.append("new"))
    moving.answer(let=True)
    assert done == ["new"]


def program_of(source: str) -> Program:
    """A program whose blocks make these statements."""
    return Program("p", source, source, {}, actions=asked_actions(ast.parse(source).body))


def test_what_a_program_asks_of_robots_is_read_from_it(rover) -> None:
    source = "robot('Rover').do('move', distance=1)\nrobot('Rover').ask('look', 'w')\nrobot('P').get('b')\n"
    program = program_of(source)
    assert program.actions == {"Rover": ("move", "look")}
    assert wanted_by(program, [rover]) == [(rover, ("move", "look"))]
    assert risky(rover, ["move", "move", "light", "unknown"]) == ("“move”",)


@pytest.mark.parametrize("source", ["robot(name).do('move')", "robot('Rover').do(what)", "r.do('move')"])
def test_a_program_that_hides_what_it_does_may_do_anything(rover, source) -> None:
    program = program_of(source)
    assert program.actions is None
    ((_, actions),) = wanted_by(program, [rover])
    assert "move" in actions
    assert not MotionPermission().permits(wanted_by(program, [rover]), lambda: None)


def test_a_robot_that_a_program_moves_by_publishing_may_do_anything(rover) -> None:
    program = replace(program_of("robot('Rover').do('light')"), moves=("Rover",))
    ((_, actions),) = wanted_by(program, [rover])
    assert "move" in actions


def test_the_error_names_the_robots() -> None:
    assert "Rover and Tim may not move yet" in str(MayNotMoveError(["Rover", "Tim"]))


def test_one_yes_counts_for_all_robots_of_the_question(rover) -> None:
    moving, other = MotionPermission(), replace(rover, name="Other")
    assert not moving.permits([(rover, ["move"]), (other, ["turn"])], lambda: None)
    assert moving.question is not None
    assert moving.question.title == "Allow Rover and Other to move?"
    moving.answer(let=True)
    assert moving.permits([(rover, ["move"]), (other, ["turn"])], pytest.fail)
