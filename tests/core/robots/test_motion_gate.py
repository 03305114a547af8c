"""Tests of the permission that is requested before a message moves a real robot.

Sources of messages: the message shelf, keys, clicks and replays.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

import nep
from app.core.robots.motion.gate import MotionGate
from app.core.robots.motion.permission import MotionPermission
from app.core.run.acting.sending import SendOrder
from app.core.run.acting.shelf import SavedMessage
from app.core.session import Session
from app.robots.description.description import Robot, parse, thing_description
from app.robots.identity import controls_of
from app.robots.turtle import ROBOT
from nep.programs.robots import MovingTopics, RobotControls
from tests.core.waiting import tick_until

TOPIC = "/Rover/drive"
ORDER = SavedMessage("a", "Go", TOPIC, "json", '{"op": "invoke"}')


def description(*, virtual: bool) -> dict[str, object]:
    """Return the description of a robot with a custom command topic."""
    text = json.dumps(thing_description(ROBOT.thing_model, "Rover")).replace("/Rover/command", TOPIC)
    made = json.loads(text)
    made["rb:robot"]["virtual"] = virtual
    return made


class Robots:
    """Fake fleet whose robots a test connects."""

    def __init__(self) -> None:
        self.movable_robots: tuple[Robot, ...] = ()
        self.moving_topics = MovingTopics()
        self.described_topics: frozenset[str] = frozenset()

    def come(self, *robots: Robot, others: tuple[RobotControls, ...] = ()) -> None:
        self.movable_robots = robots
        self.moving_topics = MovingTopics((*map(controls_of, robots), *others))


@pytest.fixture
def rover() -> Robot:
    return parse(description(virtual=False))


@contextmanager
def real_robot(session: Session, master: str) -> Iterator[list[object]]:
    """Payloads received by a real robot that the session's fleet has connected."""
    told: list[object] = []
    with nep.node("rover", master=master) as node:
        announced = node.new_pub("/Rover/description", "robot/description", latched=True)
        announced.publish(description(virtual=False))
        node.new_sub(TOPIC, sink=lambda messages: told.extend(each.payload for each in messages))
        tick_until(session, lambda: session.fleet.link("Rover") is not None)
        yield told


def test_message_that_moves_a_real_robot_waits_for_permission(rover) -> None:
    robots, done = Robots(), []
    permission = MotionPermission()
    gate = MotionGate(permission, robots)
    assert gate.request_permission(TOPIC, pytest.fail)
    robots.come(rover)
    assert not gate.request_permission(TOPIC, lambda: done.append(1))
    assert "Rover" in gate.rejection_reason(TOPIC)
    assert "Rover" in gate.rejection_reason("robot_action")
    assert gate.rejection_reason("/Rover/answer") == ""
    permission.answer(is_allowed=True)
    assert done == [1]
    assert gate.request_permission(TOPIC, pytest.fail)
    assert gate.rejection_reason(TOPIC) == ""
    robots.come(replace(rover, name="Fido"))
    gate.update()
    assert "Fido" in gate.rejection_reason(TOPIC)
    robots.come(replace(rover, virtual=True))
    assert gate.is_permitted(TOPIC)
    permission.revoke_all()
    robots.come(rover)
    assert not gate.is_permitted(TOPIC)


def test_robots_without_readable_description_need_permission(rover) -> None:
    robots, permission = Robots(), MotionPermission()
    robots.come(others=(RobotControls("Rover", frozenset({TOPIC})),))
    gate = MotionGate(permission, robots)
    assert not gate.request_permission(TOPIC, lambda: None)
    assert permission.question is not None
    assert permission.question.title == "Allow Rover to move?"
    permission.answer(is_allowed=True)
    assert gate.is_permitted(TOPIC)
    robots.come(rover)  # now described: it needs a permission of its own
    assert not gate.is_permitted(TOPIC)
    robots.come()
    assert not gate.request_permission("/Fido/go", lambda: None, "robot/command")
    assert permission.question is not None
    assert permission.question.names == ("the robot on /Fido/go",)


@pytest.mark.usefixtures("patient")
def test_saved_message_needs_permission_and_repetition_ends_when_a_real_robot_connects(
    session: Session, master
) -> None:
    acting, permission = session.acting, session.fleet.permission
    moved: list[tuple[object, str]] = []
    acting.on_moved = lambda robots, by: moved.append((robots, by))
    acting.saved_messages.set_message(ORDER)
    assert acting.send(ORDER, rate_hz=20.0) == ""
    tick_until(session, lambda: acting.outbox.repeated_messages)
    with real_robot(session, master.address) as told:
        tick_until(session, lambda: not acting.outbox.repeated_messages)
        if acting.question is None:  # the sender's thread saw the robot before the window did
            assert acting.send(ORDER) == ""
        acting.answer(is_allowed=True)
        assert acting.send(ORDER) == ""
        assert permission.question is not None
        session.tick()
        assert moved == []
        before = len(told)
        assert before <= 1  # a message in flight when the robot subscribed
        permission.answer(is_allowed=True)
        tick_until(session, lambda: len(told) == before + 1)
        assert moved == [(("Rover",), "shelf")]
        permission.revoke_all()
        acting.outbox.send(
            SendOrder("a", "Go", TOPIC, "json", lambda: {"op": "invoke"})
        )  # as if queued before the permission was revoked
        tick_until(session, lambda: acting.last_results["a"].kind == "failed")
        assert "which isn't allowed" in acting.last_results["a"].message
        assert len(told) == before + 1


def test_another_program_of_the_same_name_needs_permission_again(session: Session, master) -> None:
    permission, gate = session.fleet.permission, session.fleet.gate
    with real_robot(session, master.address):
        assert not gate.request_permission(TOPIC, lambda: None)
        permission.answer(is_allowed=True)
        assert gate.is_permitted(TOPIC)
    tick_until(session, lambda: not session.fleet.connected)
    link = session.fleet.link("Rover")
    assert link is not None
    before = link.identity
    with real_robot(session, master.address):
        tick_until(session, lambda: link.identity != before)
        assert "Rover" in gate.rejection_reason(TOPIC)
