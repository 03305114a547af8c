"""Tests of the RIZE dialect: messages in both directions, and the cases that every RIZE driver must pass."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

import nep
from app.blocks.runtime.network import Network
from app.errors import RobotInputError
from app.robots.client import rize
from tests.robots.conftest import Ears, eventually
from tests.robots.driver.test_process import network, start
from tests.robots.virtual.test_simulated import pepper

__all__ = ["network", "pepper"]


@pytest.fixture
def robot():
    return rize.robot("Pepper")


def test_rize_robot_has_the_rize_dialect_and_capabilities(robot):
    assert (robot.name, robot.dialect, robot.virtual) == ("Pepper", "rize", False)
    assert not robot.safe_stop.can_confirm
    assert robot.safe_stop.watchdog_s is None
    assert (robot.topics.command, robot.topics.reply) == ("robot_action", "action_state")
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
def test_command_is_the_exact_json_of_rize(robot, action, given, primitive):
    command = rize.to_command(robot, action, given, "acti20261120075304-0")
    expected = (
        '{"node":"action","primitives":' + primitive + ',"robots":"Pepper","state":"idle","times":0,'
        '"id":"acti20261120075304-0"}'
    )
    assert json.dumps(command, separators=(",", ":")) == expected


def test_invalid_input_is_rejected_before_sending(robot):
    with pytest.raises(RobotInputError) as caught:
        rize.to_command(robot, "walk", {"direction": "sideways"}, "1")
    assert caught.value.sentences == ("walk: direction must be forwards or backwards",)
    with pytest.raises(RobotInputError):
        rize.to_command(robot, "fly", {}, "1")


def test_stop_command_has_the_fields_that_older_drivers_read(robot):
    stop = rize.to_command(robot, "stop", {}, "7")
    assert stop["node"] == "cancel"
    action = rize.to_command(robot, "say", {"text": "hi"}, "8")
    assert stop.keys() == action.keys()  # older drivers expect the fields of an action in every command


def test_rize_replies_are_parsed(robot):
    sent = rize.to_command(robot, "say", {"text": "hello"}, "1")
    good = rize.from_reply({**sent, "state": "success"})
    assert (good["id"], good["op"], good["state"], good["error"]) == ("1", "invoke", "succeeded", None)
    bad = rize.from_reply({**sent, "primitives": [sent["primitives"]], "state": "failure"})
    assert (bad["state"], bad["error"]) == ("failed", "Pepper couldn't say")
    assert rize.from_reply(sent) is None
    assert rize.from_reply("noise") is None
    assert rize.from_reply({"state": "success"}) is None


def test_ready_message_of_a_robot_is_parsed():
    assert rize.announced_name({"robot": "ready", "name": "Pepper"}) == "Pepper"
    assert rize.announced_name({"robot": "connection_error", "name": "Pepper"}) is None
    assert rize.announced_name(["x"]) is None


# ---- tests of every driver -------------------------------------------------------------------------------

SAY = {"primitive": "say", "input": "hello", "options": {"contextual": True, "pitch": 50, "velocity": 50}}
FLY = {"primitive": "fly", "input": "high", "options": "none"}


def primitive(name: str, given: str, options: object = "none") -> dict[str, object]:
    return {"primitive": name, "input": given, "options": options}


@dataclass
class Speaker:
    """Running driver, its listener, and the values that differ between drivers in the shared cases."""

    ears: Ears
    several: list[dict[str, object]]  # primitives of one command ...
    did: Callable[[], object]  # ... and the check that all were executed
    long: dict[str, object]  # a primitive that runs until stopped
    beyond: dict[str, object]  # a supported primitive with an invalid argument
    let: Callable[[], None] = field(default=lambda: None)
    """Function that allows actions of limited duration to end."""

    @property
    def answers(self) -> list[object]:
        return self.ears.heard["action_state"]

    def command(self, primitives: object, **other: object) -> dict[str, object]:
        """Send a command with these primitives to the driver and return the message."""
        message = {
            "node": "action", "primitives": primitives, "robots": self.ears.name, "state": "idle", "times": 0,
            "id": "acti20261120075304-0", **other,
        }  # fmt: skip
        self.ears.rize(message)
        return message

    def answered(self, count: int = 1) -> list[object]:
        """Wait for at least `count` replies and return all of them."""
        eventually(lambda: len(self.answers) >= count)
        return list(self.answers)


@pytest.fixture(params=["kit", "virtual"])
def speaker(request: pytest.FixtureRequest) -> Speaker:
    if request.param == "kit":
        body, ears, _ = request.getfixturevalue("turtle")
        return Speaker(
            ears,
            [primitive("move", "0.75"), primitive("leds", "#112233", {"bright": "false", "strange": 1})],
            lambda: sorted(body.done) == [("light", "#112233", False), ("move", 0.75)],
            SAY,
            primitive("move", "99"),
            body.go_on.set,
        )
    ears = request.getfixturevalue("pepper")

    def did() -> bool:
        state = ears.newest("state")
        return state["theta_deg"] == -20 and state["eyes"] == "#ff0010"

    return Speaker(
        ears,
        [primitive("turn", "right", {"degrees": 20}), primitive("leds", "eyes", {"R": 255, "G": 0, "B": 16})],
        did,
        primitive("walk", "forwards", {"meters": 2}),
        primitive("walk", "sideways", {"meters": 0.1}),
    )


def test_rize_receives_its_command_back_with_the_result(speaker):
    speaker.let()
    command = speaker.command(SAY)
    (answer,) = speaker.answered()
    assert json.dumps(answer) == json.dumps({**command, "state": "success"})
    assert [each for each in speaker.ears.heard["answer"] if each["op"] != "alive"] == []


def test_several_primitives_with_numbers_as_text_and_named_inputs_are_answered_once(speaker):
    speaker.let()
    command = speaker.command(speaker.several)
    assert speaker.answered() == [{**command, "state": "success"}]
    eventually(speaker.did)


@pytest.mark.parametrize(
    "primitives",
    [
        FLY,
        primitive("wait", "soon"),
        primitive("say", ""),
        "beyond",
        [],
        None,
        [SAY, {"primitive": "fly"}],
    ],
)
def test_unsupported_or_invalid_rize_command_is_answered_with_failure(speaker, primitives):
    speaker.let()
    command = speaker.command(speaker.beyond if primitives == "beyond" else primitives)
    assert speaker.answered() == [{**command, "state": "failure"}]


def test_commands_for_other_robots_are_ignored(speaker):
    speaker.let()
    for robots in (f"{speaker.ears.name}2", ["a", "b"], None):
        speaker.command(SAY, robots=robots, id="another's")
    speaker.command(SAY, id="mine")
    assert [answer["id"] for answer in speaker.answered()] == ["mine"]


def test_stop_is_reported_to_rize_and_rize_can_cancel(speaker):
    first = speaker.command(speaker.long)
    eventually(lambda: speaker.ears.invoke("q", "say", text="x") or speaker.ears.states("q"))
    speaker.ears.command(id="s", op="stop")
    assert speaker.answered() == [{**first, "state": "failure"}]
    second = speaker.command(speaker.long, id="two")
    speaker.ears.rize({"node": "cancel", "robots": speaker.ears.name, "id": "c"})
    assert speaker.answered(2)[1] == {**second, "state": "failure"}


def test_program_and_rize_driver_exchange_commands_and_results(speaker):
    """The program treats the driver as a RIZE robot, which does not publish a description."""
    speaker.let()
    robot = rize.robot(speaker.ears.name)
    with nep.node("program", "memory") as node:
        program = Network(node, "program-1", [robot])
        try:
            said = program.invoke(robot.name, "say", {"text": "hello"})
            eventually(lambda: said.done)
            assert (said.state, said.error) == ("succeeded", "")
            refused = program.invoke(robot.name, "mode", {"mode": "rest"})
            eventually(lambda: refused.done)
            assert (refused.state, refused.error) == ("failed", f"{robot.name} couldn't mode")
        finally:
            program.close()
    assert [answer["state"] for answer in speaker.answered(2)] == ["success", "failure"]


# ---- tests of one driver ---------------------------------------------------------------------------------


def test_driver_kit_executes_only_commands_for_its_robot(turtle):
    body, ears, _ = turtle
    body.go_on.set()
    command = {"node": "action", "primitives": SAY, "state": "idle", "times": 0, "id": "1"}
    for robots in ("Turtle2", ["a", "b"], None, "Turtle"):
        ears.rize({**command, "robots": robots})
    eventually(lambda: ears.heard["action_state"])
    assert body.done == [("say", "hello")]
    assert ears.heard["answer"] == []


def test_driver_kit_runs_a_list_of_primitives_in_parallel(turtle):
    body, ears, clock = turtle
    wait = primitive("wait", "2")
    both = {"node": "action", "primitives": [SAY, wait], "robots": ["Other", "Turtle"], "id": "1"}
    ears.rize({**both, "state": "idle", "times": 0})
    body.go_on.set()
    eventually(lambda: body.done)
    assert ears.heard["action_state"] == []
    eventually(lambda: clock.advance(0.5) or ears.heard["action_state"])
    assert ears.heard["action_state"][0]["state"] == "success"
    assert ears.heard["action_state"][0]["primitives"] == [SAY, wait]


def test_rize_walk_command_moves_the_virtual_robot_backwards(pepper):
    walk = primitive("walk", "backwards", {"meters": 0.1})
    pepper.rize(
        {"node": "action", "primitives": walk, "robots": "Pepper", "state": "idle", "times": 0, "id": "2"}
    )
    eventually(lambda: pepper.heard["action_state"])
    assert pepper.heard["action_state"][0]["state"] == "success"
    eventually(lambda: pepper.newest("state")["x"] < -0.55)


def test_example_rize_driver_executes_commands(network):
    """The same 30 lines run on the original NEP; this nep supports the method names of the NEP paper."""
    process = start("examples/rize_driver.py", "Turtle", network=network)
    robot = rize.robot("Turtle")
    try:
        with nep.node("me", master=network) as node:
            answers: list[object] = []
            node.new_sub("action_state", sink=lambda batch: answers.extend(m.payload for m in batch))
            commands = node.new_pub("robot_action")
            eventually(lambda: "robot_action" in node.graph().topics and commands.subscribers)
            for other in (rize.robot("Turtle2"), robot):
                commands.publish(rize.to_command(other, "say", {"text": "hello"}, other.name))
            commands.publish(rize.to_command(robot, "turn", {"direction": "left", "degrees": 90}, "2"))
            eventually(lambda: len(answers) == 2)
    finally:
        process.kill()
        output, _ = process.communicate()
    read = [rize.from_reply(answer) for answer in answers]
    assert [(answer["id"], answer["state"]) for answer in read] == [("Turtle", "succeeded"), ("2", "failed")]
    assert output.startswith("Turtle says: hello {")
