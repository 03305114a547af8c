"""Tests of how the remainder of an action is executed after a pause canceled it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.link import RobotCall
from app.blocks.runtime.robot_handle import is_remainder_unknown, remainder_parameter, remaining_input
from app.robots import simulated
from app.robots.description.description import parse, thing_description
from tests.blocks.fakes import FakeLink, Play, until
from tests.blocks.samples import block, number, started, text, workspace, write

PEPPER = parse(thing_description(simulated.ROBOT.thing_model, "Pepper"))


def action(name: str):
    found = PEPPER.action(name)
    assert found is not None
    return found


def held(name: str, **feedback: object) -> RobotCall:
    return RobotCall(
        "1", "Pepper", name, state="canceled", has_started=True, is_canceled_by_pause=True, feedback=feedback
    )


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
def test_resumed_action_executes_only_the_remainder(name, given, feedback, rest) -> None:
    assert remaining_input(action(name), given, held(name, **feedback)) == rest


def test_action_not_started_before_pause_is_executed_in_full() -> None:
    call = replace(held("walk"), has_started=False)
    assert remaining_input(action("walk"), {"distance": 1.0}, call) == {"distance": 1.0}


def test_driving_action_without_progress_feedback_is_not_resumed() -> None:
    drives = replace(action("walk"), feedback=())
    assert remainder_parameter(drives, {"distance": 1.0}) is None
    assert remaining_input(drives, {"distance": 1.0}, held("walk", to_go=0.5)) is None


@pytest.mark.parametrize(
    ("name", "given", "feedback", "unknown"),
    [
        ("walk", {"distance": 1.0}, {"to_go": 0.4}, False),
        ("walk", {"distance": 1.0}, {"to_go": 0.0}, False),  # already completed
        ("walk", {"distance": 1.0}, {}, True),
        ("walk", {"distance": 1.0}, {"to_go": True}, True),
        ("wave", {"hand": "left"}, {}, False),  # restarts from the beginning
    ],
)
def test_unknown_remainder_of_paused_action_is_detected(name, given, feedback, unknown) -> None:
    call = held(name, **feedback)
    assert is_remainder_unknown(action(name), given, call) is unknown
    assert not is_remainder_unknown(action(name), given, replace(call, has_started=False))


class Blind(FakeLink):
    """Fake link whose robots cancel actions immediately and never report progress."""

    def invoke(self, robot, action, input):
        call = super().invoke(robot, action, input)
        call.has_started = True
        return call

    def cancel(self, call) -> None:
        super().cancel(call)
        self.answer(call, "canceled")


def test_skipping_unknown_remainder_warns_before_and_reports_after_resume() -> None:
    walk = block("robot_pepper_do_walk", "w", ROBOT="Pepper", DISTANCE=number(1))
    blocks = workspace(started(walk | {"next": {"block": write(text("after"))}}))
    link = Blind()
    link.held = {"walk"}
    run = Play(compile_behaviour(blocks, [PEPPER]), (PEPPER,), link).start()
    until(lambda: bool(link.calls))
    assert run.runtime.status_text.warning(("w",)) == ""
    run.runtime.scheduler.pause()
    said = "Pepper doesn't report how much of “walk” is left"
    until(lambda: run.runtime.status_text.warning(("w",)) == f"{said}; Resume skips it")
    run.runtime.scheduler.resume()
    assert run.end().lines == [f"{said}, so it was skipped", "after"]
    assert run.runtime.status_text.warning(("w",)) == ""
    assert len(link.calls) == 1


def test_no_message_when_remainder_is_resumed() -> None:
    walk = block("robot_pepper_do_walk", "w", ROBOT="Pepper", DISTANCE=number(1))
    link = Blind()
    link.held = {"walk"}
    run = Play(compile_behaviour(workspace(started(walk)), [PEPPER]), (PEPPER,), link).start()
    until(lambda: bool(link.calls))
    link.calls[0].feedback = {"to_go": 0.25}
    run.runtime.scheduler.pause()
    until(lambda: link.calls[0].done)
    run.runtime.scheduler.resume()
    until(lambda: len(link.calls) == 2)
    assert link.invoked[1][2]["distance"] == 0.25
    link.answer(link.calls[1], "succeeded")
    assert run.end().lines == []


def test_remainder_parameter_is_found_by_its_unit() -> None:
    assert remainder_parameter(action("walk"), {"distance": 1.0, "speed": 0.3}) == "distance"
    assert remainder_parameter(action("turn"), {"angle": 90, "speed": 40}) == "angle"
    assert remainder_parameter(action("say"), {"text": "hello"}) is None
