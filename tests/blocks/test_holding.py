"""What is left of an action that a pause took back."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.blocks.holding import measured_by, rest_of
from app.blocks.link import Call
from app.robots import simulated
from app.robots.description import parse, td_for

PEPPER = parse(td_for(simulated.ROBOT.thing_model, "Pepper"))


def action(name: str):
    found = PEPPER.action(name)
    assert found is not None
    return found


def held(name: str, **feedback: object) -> Call:
    return Call("1", "Pepper", name, state="canceled", began=True, held=True, feedback=feedback)


@pytest.mark.parametrize(
    ("name", "given", "feedback", "rest"),
    [
        ("walk", {"distance": 1.0, "speed": 0.3}, {"to_go": 0.4}, {"distance": 0.4, "speed": 0.3}),
        ("walk", {"distance": -1.0, "speed": 0.3}, {"to_go": 0.4}, {"distance": -0.4, "speed": 0.3}),
        ("walk", {"distance": 1.0, "speed": 0.3}, {"to_go": 7}, {"distance": 1.0, "speed": 0.3}),
        ("walk", {"distance": 1.0, "speed": 0.3}, {"to_go": 0.0}, None),
        ("walk", {"distance": 1.0, "speed": 0.3}, {}, None),
        ("walk", {"distance": 1.0, "speed": 0.3}, {"to_go": "far"}, None),
        ("turn", {"angle": 90, "direction": "left"}, {"to_go": 30}, {"angle": 30, "direction": "left"}),
        ("wave", {"hand": "left"}, {}, {"hand": "left"}),
        ("say", {"text": "hello"}, {"word": "hello"}, {"text": "hello"}),
    ],
)
def test_the_rest_is_done_and_never_more(name, given, feedback, rest) -> None:
    assert rest_of(action(name), given, held(name, **feedback)) == rest


def test_what_had_not_begun_is_done_as_a_whole() -> None:
    call = replace(held("walk"), began=False)
    assert rest_of(action("walk"), {"distance": 1.0}, call) == {"distance": 1.0}


def test_driving_without_telling_what_is_left_is_left_out() -> None:
    drives = replace(action("walk"), feedback=())
    assert measured_by(drives, {"distance": 1.0}) is None
    assert rest_of(drives, {"distance": 1.0}, held("walk", to_go=0.5)) is None


def test_the_unit_says_which_value_is_meant() -> None:
    assert measured_by(action("walk"), {"distance": 1.0, "speed": 0.3}) == "distance"
    assert measured_by(action("turn"), {"angle": 90, "speed": 40}) == "angle"
    assert measured_by(action("say"), {"text": "hello"}) is None
