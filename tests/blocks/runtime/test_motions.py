"""Motions that outlast their command: held by a pause, taken up again, forgotten for others."""

from __future__ import annotations

import threading
from collections.abc import Mapping

import pytest

from app.blocks.runtime.link import RobotCall
from app.blocks.runtime.motions import Motions
from app.blocks.runtime.scheduler import Stopped
from app.robots.description.description import Robot, parse, td_for
from app.robots.turtle import ROBOT

TURTLE: Robot = parse(td_for(ROBOT.thing_model, "Turtle"))


class Bench:
    """What was stopped and asked for."""

    def __init__(self) -> None:
        self.stopped: list[str] = []
        self.stood: list[str] = []
        self.invoked: list[tuple[str, str, Mapping[str, object]]] = []
        self.going = Motions(
            lambda robot: self.stopped.append(robot.name),
            lambda robot: self.stood.append(robot.name),
            self.invoke,
        )
        self.count, self.answers = 0, False

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> None:
        self.invoked.append((robot, action, input))
        if self.answers:
            self.do(action, **input)

    def do(self, action: str, state: str = "succeeded", **given: object) -> None:
        self.count += 1
        call = RobotCall(f"c{self.count}", "Turtle", action)
        self.going.asked(call, TURTLE, given)
        call.state = state
        self.going.ended(call)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_pause_stops_it_and_go_on_asks_again(bench) -> None:
    bench.do("drive", speed=0.2, turn=0)
    bench.do("light")
    assert bench.going.rest() == ("Turtle",)
    assert bench.stopped == ["Turtle"]
    bench.going.go_on()
    assert bench.invoked == [("Turtle", "drive", {"speed": 0.2, "turn": 0})]
    bench.going.go_on()
    assert len(bench.invoked) == 1


@pytest.mark.parametrize("state", ["failed", "canceled"])
def test_what_did_not_begin_does_not_go_on(bench, state) -> None:
    bench.do("drive", state, speed=0.2)
    assert bench.going.rest() == ()


def test_what_something_else_uses_now_is_forgotten(bench) -> None:
    bench.do("drive", speed=0.2)
    bench.do("move", distance=0.1)
    assert bench.going.rest() == ()
    bench.going.go_on()
    assert bench.invoked == []


def test_what_a_single_step_begins_is_held_at_once(bench) -> None:
    bench.going.rest()
    bench.do("drive", speed=0.2)
    assert bench.stopped == ["Turtle"]
    bench.going.go_on()
    assert [action for _, action, _ in bench.invoked] == ["drive"]


def test_in_slow_motion_it_stands_while_its_script_stays_and_goes_on_then(bench) -> None:
    with bench.going.slow():
        pass
    assert bench.stood == []
    bench.do("drive", speed=0.2)
    with bench.going.slow():
        assert bench.stood == ["Turtle"]
        assert bench.invoked == []
    assert bench.invoked == [("Turtle", "drive", {"speed": 0.2})]
    assert bench.stopped == []


def test_another_script_that_stays_holds_nobody_up(bench) -> None:
    bench.do("drive", speed=0.2)
    thread = threading.Thread(target=lambda: bench.going.slow().__enter__())
    thread.start()
    thread.join()
    assert bench.stood == []


@pytest.mark.parametrize("state", ["succeeded", "canceled"])
def test_what_is_answered_while_its_script_stays_stands_and_is_not_forgotten(bench, state) -> None:
    call = RobotCall("c", "Turtle", "drive")
    bench.going.asked(call, TURTLE, {"speed": 0.2})
    with bench.going.slow():
        assert bench.stood == ["Turtle"]
        call.state = state
        bench.going.ended(call)
        assert bench.stood == ["Turtle", "Turtle"]
    assert len(bench.invoked) == 1


def test_a_pause_and_go_on_while_a_script_stays_do_not_let_it_drive_before(bench) -> None:
    bench.do("drive", speed=0.2)
    with bench.going.slow():
        bench.going.rest()
        bench.going.go_on()
        assert bench.invoked == []
    assert len(bench.invoked) == 1
    with bench.going.slow():
        bench.going.rest()
    assert len(bench.invoked) == 1, "it is paused"
    bench.going.go_on()
    assert len(bench.invoked) == 2


def test_what_go_on_asked_for_again_still_belongs_to_its_script(bench) -> None:
    bench.do("drive", speed=0.2)
    bench.going.rest()
    there = threading.Thread(target=bench.going.go_on)
    bench.answers = True
    there.start()
    there.join()
    with bench.going.slow():
        assert bench.stood == ["Turtle"]


def test_nothing_drives_again_after_a_stop(bench) -> None:
    bench.do("drive", speed=0.2)
    with pytest.raises(Stopped), bench.going.slow():
        raise Stopped
    assert bench.invoked == []
