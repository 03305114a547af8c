"""Tests of motions that continue after their command has ended.

They are stopped by a pause, restarted by a resume, and discarded when another motion replaces them.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping

import pytest

from app.blocks.runtime.link import RobotCall
from app.blocks.runtime.motions import Motions
from app.blocks.runtime.scheduler import Scheduler, Script, ScriptGroup, StopProgram, acting_for
from app.robots.description.description import Robot, parse, thing_description
from app.robots.turtle import ROBOT

TURTLE: Robot = parse(thing_description(ROBOT.thing_model, "Turtle"))


class Bench:
    """Recorder of stopped robots and invoked actions."""

    def __init__(self) -> None:
        self.stopped: list[str] = []
        self.stood: list[str] = []
        self.invoked: list[tuple[str, str, Mapping[str, object]]] = []
        self.going = Motions(
            lambda robot: self.stopped.append(robot.name),
            self.stand,
            self.invoke,
        )
        self.is_busy = False
        self.count, self.answers = 0, False

    def stand(self, robot: Robot) -> bool:
        if not self.is_busy:
            self.stood.append(robot.name)
        return not self.is_busy

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> None:
        self.invoked.append((robot, action, input))
        if self.answers:
            self.do(action, **input)

    def do(self, action: str, state: str = "succeeded", **given: object) -> None:
        self.count += 1
        call = RobotCall(f"c{self.count}", "Turtle", action)
        self.going.record_command(call, TURTLE, given)
        call.state = state
        self.going.record_final_reply(call)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def scripts(*groups: ScriptGroup) -> tuple[Script, Script]:
    """Return two scripts, of two groups or of one."""
    first, second = groups or [Scheduler().main_group] * 2
    return Script(1, "one", first, threading.Event()), Script(2, "two", second, threading.Event())


def pages() -> tuple[ScriptGroup, ScriptGroup]:
    scheduler = Scheduler()
    return scheduler.new_group("goal"), scheduler.new_group("reaction")


def test_pause_stops_continuous_motion_and_resume_restarts_it(bench) -> None:
    bench.do("drive", speed=0.2, turn=0)
    bench.do("light")
    assert bench.going.stop_all() == ("Turtle",)
    assert bench.stopped == ["Turtle"]
    bench.going.resume_all()
    assert bench.invoked == [("Turtle", "drive", {"speed": 0.2, "turn": 0})]
    bench.going.resume_all()
    assert len(bench.invoked) == 1


@pytest.mark.parametrize("state", ["failed", "canceled"])
def test_failed_or_canceled_motion_is_not_resumed(bench, state) -> None:
    bench.do("drive", state, speed=0.2)
    assert bench.going.stop_all() == ()


def test_replaced_motion_is_not_resumed(bench) -> None:
    bench.do("drive", speed=0.2)
    bench.do("move", distance=0.1)
    assert bench.going.stop_all() == ()
    bench.going.resume_all()
    assert bench.invoked == []


def test_motion_started_by_single_step_is_paused_at_once(bench) -> None:
    bench.going.stop_all()
    bench.do("drive", speed=0.2)
    assert bench.stopped == ["Turtle"]
    bench.going.resume_all()
    assert [action for _, action, _ in bench.invoked] == ["drive"]


def test_motion_is_suspended_during_slow_motion_delay_and_then_resumed(bench) -> None:
    with bench.going.suspend():
        pass
    assert bench.stood == []
    bench.do("drive", speed=0.2)
    with bench.going.suspend():
        assert bench.stood == ["Turtle"]
        assert bench.invoked == []
    assert bench.invoked == [("Turtle", "drive", {"speed": 0.2})]
    assert bench.stopped == []


def test_slow_motion_delay_of_another_script_does_not_suspend_motion(bench) -> None:
    one, another = scripts()
    with acting_for(one):
        bench.do("drive", speed=0.2)
    with acting_for(another), bench.going.suspend():
        assert bench.stood == []


@pytest.mark.parametrize("state", ["succeeded", "canceled"])
def test_motion_accepted_during_slow_motion_delay_is_suspended_and_resumed(bench, state) -> None:
    call = RobotCall("c", "Turtle", "drive")
    bench.going.record_command(call, TURTLE, {"speed": 0.2})
    with bench.going.suspend():
        assert bench.stood == ["Turtle"]
        call.state = state
        bench.going.record_final_reply(call)
        assert bench.stood == ["Turtle", "Turtle"]
    assert len(bench.invoked) == 1


def test_resume_during_slow_motion_delay_does_not_restart_motion_early(bench) -> None:
    bench.do("drive", speed=0.2)
    with bench.going.suspend():
        bench.going.stop_all()
        bench.going.resume_all()
        assert bench.invoked == []
    assert len(bench.invoked) == 1
    with bench.going.suspend():
        bench.going.stop_all()
    assert len(bench.invoked) == 1, "it is paused"
    bench.going.resume_all()
    assert len(bench.invoked) == 2


def test_resumed_motion_still_belongs_to_its_script(bench) -> None:
    bench.do("drive", speed=0.2)
    bench.going.stop_all()
    there = threading.Thread(target=bench.going.resume_all)
    bench.answers = True
    there.start()
    there.join()
    with bench.going.suspend():
        assert bench.stood == ["Turtle"]


def test_motion_is_not_resumed_after_stop(bench) -> None:
    bench.do("drive", speed=0.2)
    with pytest.raises(StopProgram), bench.going.suspend():
        raise StopProgram
    assert bench.invoked == []


def test_motion_of_held_group_is_stopped_and_resumed(bench) -> None:
    goal, reaction = pages()
    of_goal, of_reaction = scripts(goal, reaction)
    with acting_for(of_goal):
        bench.do("drive", speed=0.2)
    bench.going.hold(reaction)
    assert bench.stood == []
    bench.going.hold(goal)
    assert bench.stood == ["Turtle"]
    with acting_for(of_reaction):
        bench.do("move", distance=0.1)
    bench.going.resume(goal)
    assert [action for _, action, _ in bench.invoked] == ["drive"], "the reaction didn't replace it"
    bench.going.resume(goal)
    assert bench.stopped == []


def test_motion_of_held_group_is_stopped_when_its_robot_ends_an_action(bench) -> None:
    goal, reaction = pages()
    of_goal, of_reaction = scripts(goal, reaction)
    with acting_for(of_goal):
        bench.do("drive", speed=0.2)
    bench.is_busy = True
    bench.going.hold(goal)
    bench.is_busy = False
    with acting_for(of_goal):
        bench.do("light", "canceled")
    assert bench.stood == ["Turtle"]
    with acting_for(of_reaction):
        bench.do("light")
    assert bench.stood == ["Turtle"], "it is stopped once"


def test_motion_of_ended_group_is_stopped_and_not_resumed(bench) -> None:
    goal, _reaction = pages()
    of_goal, _ = scripts(goal, goal)
    with acting_for(of_goal):
        bench.do("drive", speed=0.2)
    bench.going.end(goal)
    assert bench.stood == ["Turtle"]
    bench.going.resume(goal)
    assert bench.going.stop_all() == ()
    assert bench.invoked == []


def test_motion_of_held_group_stays_stopped_after_pause_and_slow_motion(bench) -> None:
    goal, _reaction = pages()
    of_goal, _ = scripts(goal, goal)
    with acting_for(of_goal):
        bench.do("drive", speed=0.2)
    bench.going.hold(goal)
    bench.going.stop_all()
    bench.going.resume_all()
    with acting_for(of_goal), bench.going.suspend():
        pass
    assert bench.invoked == []
    bench.going.resume(goal)
    assert len(bench.invoked) == 1
