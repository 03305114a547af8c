from __future__ import annotations

import json

import pytest

from app.errors import RobotInputError
from app.robots import rize


@pytest.fixture
def robot():
    return rize.robot("Pepper")


def test_a_robot_of_rize_is_marked(robot):
    assert (robot.name, robot.dialect, robot.virtual) == ("Pepper", "rize", False)
    assert not robot.safe_stop.confirmed
    assert robot.safe_stop.watchdog_s is None
    assert (robot.topics.command, robot.topics.answer) == ("robot_action", "action_state")
    assert all(action.topic == "robot_action" for action in robot.actions)
    assert not any(action.cancellable for action in robot.actions)


@pytest.mark.parametrize(
    ("action", "given", "primitive"),
    [
        ("say", {"text": "hello"},
         '{"primitive":"say","input":"hello","options":{"contextual":true,"pitch":50,"velocity":50}}'),
        ("wait", {"seconds": 2}, '{"primitive":"wait","input":"2","options":"none"}'),
        ("wait", {"seconds": 0.5}, '{"primitive":"wait","input":"0.5","options":"none"}'),
        ("turn", {"direction": "right", "degrees": 45},
         '{"primitive":"turn","input":"right","options":{"degrees":45}}'),
        ("walk", {"direction": "forwards"},
         '{"primitive":"walk","input":"forwards","options":{"meters":0.5}}'),
        ("open_hand", {"hand": "both"}, '{"primitive":"open_hand","input":"both","options":"none"}'),
        ("mode", {"mode": "rest"}, '{"primitive":"mode","input":"rest","options":"none"}'),
        ("track_people_with", {"part": "Head"},
         '{"primitive":"track_people_with","input":"Head","options":{"LeftArm":false,"RightArm":false}}'),
    ],
)  # fmt: skip
def test_the_command_is_the_exact_json_of_rize(robot, action, given, primitive):
    command = rize.to_command(robot, action, given, "acti20261120075304-0")
    expected = (
        '{"node":"action","primitives":' + primitive + ',"robots":"Pepper","state":"idle","times":0,'
        '"id":"acti20261120075304-0"}'
    )
    assert json.dumps(command, separators=(",", ":")) == expected


def test_bad_input_never_leaves(robot):
    with pytest.raises(RobotInputError) as caught:
        rize.to_command(robot, "walk", {"direction": "sideways"}, "1")
    assert caught.value.sentences == ("walk: direction must be forwards or backwards",)
    with pytest.raises(RobotInputError):
        rize.to_command(robot, "fly", {}, "1")


def test_the_stop_is_what_older_drivers_know(robot):
    stop = rize.to_command(robot, "stop", {}, "7")
    assert stop["node"] == "cancel"
    action = rize.to_command(robot, "say", {"text": "hi"}, "8")
    assert stop.keys() == action.keys()  # drivers that do not know a cancel read what every action has


def test_answers_are_read(robot):
    sent = rize.to_command(robot, "say", {"text": "hello"}, "1")
    good = rize.from_answer({**sent, "state": "success"})
    assert (good["id"], good["op"], good["state"], good["error"]) == ("1", "invoke", "succeeded", None)
    bad = rize.from_answer({**sent, "primitives": [sent["primitives"]], "state": "failure"})
    assert (bad["state"], bad["error"]) == ("failed", "Pepper could not say")
    assert rize.from_answer(sent) is None
    assert rize.from_answer("noise") is None
    assert rize.from_answer({"state": "success"}) is None


def test_a_ready_robot_is_heard():
    assert rize.ready({"robot": "ready", "name": "Pepper"}) == "Pepper"
    assert rize.ready({"robot": "connection_error", "name": "Pepper"}) is None
    assert rize.ready(["x"]) is None
