"""Tests of the motion guard of programs without a window: they move only robots that a person allowed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

import pytest

import nep
from nep.programs.robots import MotionGuard
from tests.nep.programs import eventually

_names = count()


@pytest.fixture
def network() -> str:
    return f"guard-{next(_names)}"


@pytest.fixture
def node(network: str) -> Iterator[nep.Node]:
    with nep.node("asker", "memory", master=network) as node:
        yield node


def describe(robot: nep.Node, name: str, command: str) -> None:
    publisher = robot.new_pub(f"/{name}/description", "robot/description", latched=True)
    publisher.publish({"title": name, "rb:robot": {"virtual": True}, "rb:topics": {"command": command}})


def test_later_robot_is_protected_on_every_topic_of_its_description(network: str, node: nep.Node) -> None:
    guard = MotionGuard(node)
    assert guard.wait_for_descriptions(30.0)
    assert guard.denial_reason("/orders") == ""
    with nep.node("robot", "memory", master=network) as robot:
        describe(robot, "Rover", "/orders")
        guard.wait_for_descriptions(30.0)
        said = guard.denial_reason("/orders")
        assert "Rover" in said
        assert "--allow-moving Rover" in said  # its claim to be virtual is not trusted
        assert "--allow-moving Rover" in guard.denial_reason("robot_action")
        assert guard.denial_reason("/weather") == ""
        describe(robot, "Rover", "/others")
        eventually(lambda: (guard.poll(), guard.denial_reason("/others"))[1])
    guard.poll()
    assert guard.denial_reason("/orders")  # the robot may only be disconnected
    guard.close()


def test_allowed_robots_and_topics_are_not_denied(network: str, node: nep.Node) -> None:
    with nep.node("robot", "memory", master=network) as robot:
        describe(robot, "Rover", "/orders")
        describe(robot, "Fido", "/orders")
        guard = MotionGuard(node, ["Rover"])
        assert guard.wait_for_descriptions(30.0)
        assert guard.denial_reason("/orders").count("--allow-moving") == 1
        assert "--allow-moving Fido" in guard.denial_reason("/orders")
        assert MotionGuard(node, ["/new"]).denial_reason("/new", "robot/command") == ""
        guard.close()


def test_unreadable_description_protects_all_topics_its_program_subscribes_to(
    network: str, node: nep.Node
) -> None:
    with nep.node("robot", "memory", master=network) as robot:
        robot.new_pub("/Rover/description", "robot/description", latched=True).publish("broken")
        robot.new_sub("/orders")
        guard = MotionGuard(node)
        assert not guard.wait_for_descriptions(0.2)
        assert "--allow-moving Rover" in guard.denial_reason("/orders")
        assert guard.denial_reason("/weather") == ""
        guard.close()


HOSTILE = [
    None, 2**63, float("nan"), "text", [[]], {"title": "\x1b[2J"}, {"title": {"a": [1]}}, {"rb:topics": [1]},
    {"rb:topics": {"command": "a b", "world": "x" * 500}}, {"rb:topics": {"command": "/**"}},
    {"title": "R" * 5000, "rb:topics": {"command": "/long"}},
    {"actions": {"a": {"forms": [None, {"href": 1}]}, "b": 1}},
    {"actions": {str(n): {"forms": [{"href": f"nep:/{n}/*"}]} for n in range(5000)}},
]  # fmt: skip


def test_hostile_descriptions_do_not_stop_the_guard_or_reduce_protection(
    network: str, node: nep.Node
) -> None:
    with nep.node("robot", "memory", master=network) as robot, nep.node("x", "memory", master=network) as x:
        describe(robot, "Rover", "/orders")
        guard = MotionGuard(node)
        assert guard.wait_for_descriptions(30.0)
        strange = x.new_pub("/Rover/description", "robot/description", latched=True)
        for payload in HOSTILE:
            strange.publish(payload)
            guard.poll()
            assert "Rover" in guard.denial_reason("/orders")
            guard.denial_reason("/a/b").encode()
        for data in (b"[" * 100_000, b" " * 1_000_001, b'{"title":"\\ud800"}', b"\xff"):
            strange.publish_bytes(data)
            guard.poll()
            assert "Rover" in guard.denial_reason("/orders")
        guard.close()
