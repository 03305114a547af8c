"""Tests of RIZE's dialect, the world and shared topics of robots in JavaScript.

They use the cases of the Python kit.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import nep
from nep.masters.master import Master
from tests.clients.node_programs import NEEDS_NODE, build_package, prepared
from tests.nep.programs import eventually
from tests.robots.conftest import Ears
from tests.robots.driver.driver_program import ProgramKind, running_driver
from tests.robots.driver.test_rize_dialect import (
    SAY,
    Speaker,
    primitive,
    test_commands_for_other_robots_are_ignored,
    test_rize_receives_its_command_back_with_the_result,
    test_several_primitives_with_numbers_as_text_and_named_inputs_are_answered_once,
    test_stop_is_reported_to_rize_and_rize_can_cancel,
    test_unsupported_or_invalid_rize_command_is_answered_with_failure,
)

__all__ = [
    "test_commands_for_other_robots_are_ignored",
    "test_rize_receives_its_command_back_with_the_result",
    "test_several_primitives_with_numbers_as_text_and_named_inputs_are_answered_once",
    "test_stop_is_reported_to_rize_and_rize_can_cancel",
    "test_unsupported_or_invalid_rize_command_is_answered_with_failure",
]
pytestmark = NEEDS_NODE
TURTLE = """\
const { Robot } = require("nep-js/robot");

let done = [];
let mayGoOn = false;
const goesOn = (call) => call.until(() => mayGoOn, { everyS: 0.005 });
const robot = new Robot({
  model: "turtle",
  title: "Turtle",
  virtual: true,
  actions: {
    move: {
      text: "move %distance m", category: "Movement", icon: "move", uses: ["base"],
      parameters: { distance: { type: "number", minimum: -2, maximum: 2, default: 0.5 } },
      async run({ distance }, call) {
        await goesOn(call);
        done.push(["move", distance]);
      },
    },
    say: {
      text: "say %text", category: "Speech", icon: "mic", uses: ["speech"], rize: "say",
      parameters: { text: { type: "string", minLength: 1, maxLength: 40 } },
      async run({ text }, call) {
        await goesOn(call);
        done.push(["say", text]);
      },
    },
    light: {
      text: "light %colour", category: "Looks", icon: "lightbulb", cancellable: false, rize: "leds",
      parameters: {
        colour: { type: "colour", default: "#ffffff" },
        bright: { type: "boolean", default: true },
      },
      run({ colour, bright }) {
        done.push(["light", colour, bright]);
      },
    },
    rest: {
      text: "rest", category: "Movement", icon: "moon", rize: "mode",
      parameters: { pose: { type: "string", choices: ["sitting", "lying"], default: "lying" } },
      fromRize(input) {
        if (input !== "rest") throw new Error(`${input} is not known`);
        return { pose: "sitting" };
      },
      run({ pose }) {
        done.push(["rest", pose]);
      },
    },
  },
  events: {
    bumped: {
      text: "when %robot bumps into something on the %side", icon: "zap",
      fields: { side: { type: "string", choices: ["left", "right"] } }, choose: ["side"],
      rize: ({ side }) => ["bumpers", { [side]: 1 }],
    },
  },
  stop: { run() {} },
});
robot.onWorld(({ go_on, bump }) => {
  if (go_on !== undefined) {
    mayGoOn = go_on;
    if (!mayGoOn) done = [];
    tell({ from: "turtle", go_on });
  }
  if (bump) robot.happen("bumped", { side: bump });
});
const tell = robot.share("/room", ({ ask }) => {
  if (ask) tell({ from: "turtle", done });
}, { latched: true });
tell({ from: "turtle", starts: true });
robot.main();
"""


class Turtle:
    """Running robot program, and subscribers to its topics."""

    def __init__(self, node: nep.node, name: str) -> None:
        self.ears = Ears(node, name)
        self.room = self.ears.listen("room", topic="/room")
        self.events = self.ears.listen("rize_event", topic="rize_event")
        self.blackboard = self.ears.listen("blackboard", topic="/blackboard")
        self._world = node.new_pub(f"/{name}/world")
        self._ask = node.new_pub("/room")

    def change(self, **world: object) -> None:
        """Publish a change of the robot's world."""
        self._world.publish(world)

    def let(self, *, go_on: bool) -> None:
        """Set whether actions end without a command, and wait until the robot has applied it."""
        self.room.clear()
        self.change(go_on=go_on)
        eventually(lambda: {"from": "turtle", "go_on": go_on} in self.room)

    def done(self) -> list[object]:
        """Query the robot for its log of executed actions and return it sorted."""
        self.room.clear()
        self._ask.publish({"ask": True})
        found: list[object] = []

        def is_told() -> bool:
            found.extend(each["done"] for each in self.room if isinstance(each, dict) and "done" in each)
            return bool(found)

        eventually(is_told)
        told = found[0]
        assert isinstance(told, list)
        return sorted(told)


@pytest.fixture(scope="module")
def turtle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Turtle]:
    build_package()
    folder = tmp_path_factory.mktemp("turtle")
    command, program = prepared(TURTLE, folder)
    kind = ProgramKind((command, str(folder / program)))
    with Master("127.0.0.1:0", learn_s=0.0) as master, nep.node("listener", master=master.address) as node:
        found = Turtle(node, "Turtle")
        with running_driver(kind, "Turtle", master.address, found.ears, real_clock=True):
            yield found


@pytest.fixture
def speaker(turtle: Turtle) -> Speaker:
    turtle.ears.command(id="reset", op="stop")
    turtle.ears.final("reset", "stop")
    turtle.let(go_on=False)
    turtle.ears.heard["answer"].clear()
    turtle.ears.heard["action_state"].clear()
    return Speaker(
        turtle.ears,
        [primitive("move", "0.75"), primitive("leds", "#112233", {"bright": "false", "strange": 1})],
        lambda: turtle.done() == [["light", "#112233", False], ["move", 0.75]],
        SAY,
        primitive("move", "99"),
        lambda: turtle.let(go_on=True),
    )


def test_action_converts_its_input_and_rejects_invalid_values(speaker: Speaker, turtle: Turtle) -> None:
    good, bad = primitive("mode", "rest"), primitive("mode", "wake_up")
    answers = [speaker.command(good, id="1"), speaker.command(bad, id="2")]
    expected = [{**answers[0], "state": "success"}, {**answers[1], "state": "failure"}]
    assert sorted(speaker.answered(2), key=str) == sorted(expected, key=str)
    assert turtle.done() == [["rest", "sitting"]]


def test_wait_primitive_runs_and_stop_receives_a_reply(speaker: Speaker) -> None:
    wait = speaker.command(primitive("wait", "0.01"), id="1")
    assert speaker.answered() == [{**wait, "state": "success"}]
    long = speaker.command([SAY, primitive("wait", "600")], id="2")
    stop = speaker.command(primitive("stop", ""), id="3")
    answers = speaker.answered(3)[1:]
    assert {**long, "state": "failure"} in answers
    assert {**stop, "state": "success"} in answers


def test_robot_is_announced_to_rize_and_updates_the_blackboard(turtle: Turtle) -> None:
    eventually(lambda: turtle.events == [{"robot": "ready", "name": "Turtle"}])
    turtle.blackboard.clear()
    turtle.change(bump="left")
    expected = {"primitive": "bumpers", "input": {"left": 1}, "robot": "Turtle"}
    eventually(lambda: turtle.blackboard == [expected])
