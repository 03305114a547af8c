"""Tests of the permission question when a block from the toolbox is tried on a real robot."""

from __future__ import annotations

import pytest

from app.blocks.model.stack import Stack
from app.robots.description.description import parse, thing_description
from app.robots.turtle import ROBOT
from tests.blocks.samples import block, number
from tests.core.waiting import tick_until
from tests.ui import fakes

TURN = Stack("toolbox", "stack", block("robot_diffdrive_do_turn", ROBOT="Rover", ANGLE=number(20)))
LIGHT = Stack("toolbox", "stack", block("robot_diffdrive_do_light", ROBOT="Rover"))
ROVER = parse(thing_description(ROBOT.thing_model, "Rover"))


@pytest.fixture
def session() -> fakes.Session:
    return fakes.Session()


def tried(session: fakes.Session, stack: Stack) -> str:
    """Try a stack and return the title of the permission question, or "" if the stack ran without one."""
    session.tick()  # registers the joined robots
    session.runs.try_stack(stack)
    question = session.fleet.permission.question
    if question is None:
        ends(session)
    return question.title if question is not None else ""


def ends(session: fakes.Session) -> None:
    assert session.runs.active
    assert session.runner is not None
    session.runner.ends()
    tick_until(session, lambda: session.runs.view().state == "unanswered")
    session.runs.confirm_stopped()  # the fake robot doesn't reply to a stop


def test_permission_is_requested_once_before_a_tried_block_moves_a_real_robot(session: fakes.Session) -> None:
    session.join(ROVER, virtual=False)
    assert tried(session, LIGHT) == "", "what does not move needs no answer"
    assert tried(session, TURN) == "Allow Rover to move?"
    assert not session.runs.active
    session.fleet.permission.answer(is_allowed=True)
    ends(session)  # the answer started the pending try
    assert tried(session, TURN) == ""


def test_denied_permission_prevents_motion_and_is_requested_again_at_the_next_try(
    session: fakes.Session,
) -> None:
    session.join(ROVER, virtual=False)
    assert tried(session, TURN) == "Allow Rover to move?"
    session.fleet.permission.answer(is_allowed=False)
    assert not session.runs.active
    assert tried(session, TURN) == "Allow Rover to move?"


def test_virtual_robot_requires_no_motion_permission(session: fakes.Session) -> None:
    session.join(ROVER, virtual=True)
    assert tried(session, TURN) == ""
