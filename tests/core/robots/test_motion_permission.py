"""Tests of the motion permission: requested once per real robot, never for virtual robots."""

from __future__ import annotations

import ast
from dataclasses import replace

import pytest

from app.blocks.compiler.page_compiler import invoked_actions
from app.blocks.model.program import Program
from app.core.robots.motion.permission import (
    MayNotMoveError,
    MotionPermission,
    actions_by_robot,
    risky_action_titles,
)
from app.core.storage.settings import Settings
from app.robots.description.description import Robot, parse, thing_description
from app.robots.turtle import ROBOT


@pytest.fixture
def rover() -> Robot:
    """Return a real robot with two wheels."""
    return replace(parse(thing_description(ROBOT.thing_model, "Rover")), virtual=False)


def test_virtual_robot_needs_no_permission(rover) -> None:
    moving = MotionPermission()
    assert moving.request_permission([(replace(rover, virtual=True), ["move"])], pytest.fail)
    assert moving.question is None


def test_question_names_moving_actions_and_the_f12_stop_key(rover) -> None:
    moving = MotionPermission()
    assert not moving.request_permission([(rover, ["move", "light", "turn"])], lambda: None)
    question = moving.question
    assert question is not None
    assert question.title == "Allow Rover to move?"
    assert question.message.startswith("“move” and “turn” move Rover.")
    assert "Press F12 to stop" in question.message


def test_actions_without_risk_need_no_permission(rover) -> None:
    assert MotionPermission().request_permission([(rover, ["light", "stop"])], pytest.fail)


def test_granted_permission_continues_once_and_lasts_for_the_session(rover) -> None:
    moving, done = MotionPermission(), []
    moving.request_permission([(rover, ["move"])], lambda: done.append(1))
    moving.answer(is_allowed=True)
    moving.answer(is_allowed=True)  # a second click
    assert done == [1]
    assert moving.request_permission([(rover, ["turn"])], pytest.fail)
    other = replace(rover, name="Other")
    assert not moving.request_permission([(other, ["turn"])], lambda: None)  # permission is per robot
    assert not MotionPermission().request_permission([(rover, ["move"])], lambda: None)  # and per session


def test_denied_permission_prevents_motion_and_is_requested_again(rover) -> None:
    moving = MotionPermission()
    moving.request_permission([(rover, ["move"])], pytest.fail)
    moving.answer(is_allowed=False, is_permanent=True)
    assert moving.question is None
    assert not moving.request_permission([(rover, ["move"])], pytest.fail)
    moving.withdraw()
    assert moving.question is None
    moving.answer(is_allowed=True)  # no question is open, so the answer is ignored
    assert not moving.is_allowed(rover)


def test_permanent_permission_is_saved_for_this_robot_until_reset(rover, tmp_path) -> None:
    moving = MotionPermission(Settings(tmp_path))
    moving.request_permission([(rover, ["move"])], lambda: None)
    moving.answer(is_allowed=True, is_permanent=True)
    assert MotionPermission(Settings(tmp_path)).is_allowed(rover)
    assert not MotionPermission(Settings(tmp_path)).is_allowed(replace(rover, model="other"))
    moving.revoke_all()
    assert not MotionPermission(Settings(tmp_path)).is_allowed(rover)
    assert not moving.is_allowed(rover)


def test_new_question_replaces_the_previous_one(rover) -> None:
    moving, done = MotionPermission(), []
    moving.request_permission([(rover, ["move"])], lambda: done.append("old"))
    moving.request_permission([(rover, ["turn"])], lambda: done.append("new"))
    moving.answer(is_allowed=True)
    assert done == ["new"]


def program_of(source: str) -> Program:
    """Return a program with this source and the robot actions that it calls."""
    return Program("p", source, source, {}, actions=invoked_actions(ast.parse(source).body))


def test_robot_actions_of_a_program_are_read_from_its_source(rover) -> None:
    source = "robot('Rover').do('move', distance=1)\nrobot('Rover').ask('look', 'w')\nrobot('P').get('b')\n"
    program = program_of(source)
    assert program.actions == {"Rover": ("move", "look")}
    assert actions_by_robot(program, [rover]) == [(rover, ("move", "look"))]
    assert risky_action_titles(rover, ["move", "move", "light", "unknown"]) == ("“move”",)


@pytest.mark.parametrize("source", ["robot(name).do('move')", "robot('Rover').do(what)", "r.do('move')"])
def test_program_with_undetectable_actions_needs_permission_for_all(rover, source) -> None:
    program = program_of(source)
    assert program.actions is None
    ((_, actions),) = actions_by_robot(program, [rover])
    assert "move" in actions
    assert not MotionPermission().request_permission(actions_by_robot(program, [rover]), lambda: None)


def test_robot_moved_by_publishing_needs_permission_for_all_actions(rover) -> None:
    program = replace(program_of("robot('Rover').do('light')"), moves=("Rover",))
    ((_, actions),) = actions_by_robot(program, [rover])
    assert "move" in actions


def test_permission_error_names_the_robots() -> None:
    assert "Rover and Tim can't move yet" in str(MayNotMoveError(["Rover", "Tim"]))


def test_one_answer_permits_all_robots_of_the_question(rover) -> None:
    moving, other = MotionPermission(), replace(rover, name="Other")
    assert not moving.request_permission([(rover, ["move"]), (other, ["turn"])], lambda: None)
    assert moving.question is not None
    assert moving.question.title == "Allow Rover and Other to move?"
    moving.answer(is_allowed=True)
    assert moving.request_permission([(rover, ["move"]), (other, ["turn"])], pytest.fail)
