"""Motions that outlast their command: held by a pause, taken up again, forgotten for others."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from app.blocks.going import Going
from app.blocks.link import Call
from app.robots.description import Robot, parse, td_for
from app.robots.turtle import ROBOT

TURTLE: Robot = parse(td_for(ROBOT.thing_model, "Turtle"))


class Bench:
    """What was stopped and asked for."""

    def __init__(self) -> None:
        self.stopped: list[str] = []
        self.invoked: list[tuple[str, str, Mapping[str, object]]] = []
        self.going = Going(lambda robot: self.stopped.append(robot.name), self.invoke)
        self.count = 0

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> None:
        self.invoked.append((robot, action, input))

    def do(self, action: str, state: str = "succeeded", **given: object) -> None:
        self.count += 1
        call = Call(f"c{self.count}", "Turtle", action)
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
