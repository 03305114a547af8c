"""Tests that publishing on a robot's own topics counts as moving the robot.

It is reported before the run and rejected at run time.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

import nep
from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.program import Program
from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.network import Network
from app.blocks.runtime.publishing import PublishGuard, guarded_topics, robots_moved_by
from app.robots.client import rize
from nep.masters.master import Master
from tests.blocks.samples import block, robot, started, text, workspace
from tests.blocks.wire_robot import WireRobot

PEPPER, ROVER = robot(), replace(robot("Rover"), virtual=False)


def publish(topic: str) -> dict[str, object]:
    return block("messages_publish", "p", TOPIC=topic, VALUE=text("hello"))


@pytest.mark.parametrize("topic", ["/Rover/command", "robot_action"])
@pytest.mark.parametrize("kind", ["messages_publish", "messages_publish_field"])
def test_publishing_on_robot_topic_counts_as_using_and_moving_that_robot(topic: str, kind: str) -> None:
    content = workspace(started(block(kind, "p", TOPIC=topic, VALUE=text("hello"))))
    program = compile_behaviour(content, [ROVER])
    assert (program.robots, program.moves) == (("Rover",), ("Rover",))
    (problem,) = program.problems
    assert (problem.severity, problem.block_id) == ("info", "p")
    assert f"on {topic} moves Rover" in problem.message
    assert Program.from_json(program.to_json()).moves == ("Rover",)


def test_publishing_on_topic_of_no_robot_does_not_count_as_moving_a_robot() -> None:
    program = compile_behaviour(workspace(started(publish("/weather"))), [ROVER])
    assert (program.robots, program.moves, program.problems) == ((), (), ())


def test_publishing_on_topic_of_virtual_robot_is_not_a_problem() -> None:
    virtual = replace(ROVER, virtual=True)
    program = compile_behaviour(workspace(started(publish("/Rover/command"))), [virtual])
    assert (program.moves, program.problems) == (("Rover",), ())


def test_robots_moved_by_a_command_or_world_topic_are_determined() -> None:
    far = replace(ROVER, topics=replace(ROVER.topics, command="/far", world="/far/world"))
    assert robots_moved_by("/far", [PEPPER, far]) == ("Rover",)
    assert robots_moved_by("/far/world", [PEPPER, far]) == ("Rover",)
    assert robots_moved_by(rize.COMMANDS, [PEPPER, far]) == ("Pepper", "Rover")
    assert robots_moved_by("/Rover/answer", [PEPPER, far]) == ()
    topics = guarded_topics([PEPPER, far])
    assert (topics["/Pepper/command"], topics["/far"]) == (("Pepper",), ("Rover",))


def test_publish_that_moves_a_robot_without_permission_is_rejected_at_run_time(master: Master) -> None:
    """The compiler can't check computed topics, so the program does, also for robots that joined later."""
    rover = WireRobot(master.address, "Rover")
    try:
        with nep.node("program", master=master.address) as node:
            network = Network(node, "program-1", [PEPPER])
            network.guard = PublishGuard(guarded_topics([PEPPER]), ["Pepper"])
            network.publish("/Pepper/command", {})  # allowed: Pepper has permission
            network.publish("/Rover/command", {"op": "alive"})  # allowed: the guard doesn't know Rover yet
            network.guard.set_topics(guarded_topics([PEPPER, rover.described]))
            with pytest.raises(BehaviourError, match="publish on /Rover/command: this would move Rover"):
                network.publish("/Rover/command", {"id": "1", "op": "invoke", "action": "turn", "input": {}})
            with pytest.raises(BehaviourError, match="would move Rover without permission"):
                network.publish(rize.COMMANDS, {})
            network.close()
        assert rover.heard("invoke") == []
    finally:
        rover.close()
