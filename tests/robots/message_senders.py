"""Contract tests of programs that command robots: they trust only the programs of these robots.

The tests run for a running program and for Studio. Each has an adapter (`Side`) next to its own tests,
in `tests/blocks/runtime/test_message_senders.py` and `tests/core/robots/test_claims.py`.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Protocol, cast

import pytest

import nep
from app.robots.description.description import Robot
from app.robots.identity import DESCRIPTION_TYPE
from nep.masters.master import Master
from tests.blocks.samples import robot
from tests.blocks.wire_robot import WireRobot

SHORT_S = 3.0
"""Waiting time in seconds for a robot that does not reply."""


class Invoked(Protocol):
    """State that a side stores for a command it sent."""

    id: str
    state: str


class Side(Protocol):
    """Interface to a program that commands robots."""

    told: Mapping[str, str]
    """Messages for "another topic", "two programs" and "foreign topic", as complete regular expressions."""

    def until(self, true: Callable[[], object]) -> None:
        """Process events until a condition is true; fail after a timeout."""

    def meet(self, described: Robot, node_id: str) -> None:
        """Prepare to command this robot, which is the node with this id."""

    def invoke(self, action: str, input: Mapping[str, object]) -> Invoked:
        """Start an action of Pepper and return its state."""

    def runs(self, call: Invoked) -> bool:
        """Return whether the side waits for the end of this command and for no other command of the robot."""

    def check_ended(self, call: Invoked, states: Sequence[str]) -> None:
        """Fail unless the stored state of a command agrees with replies of these states."""

    def knows(self, publisher: nep.Publisher) -> bool:
        """Return whether the side knows from the master which node has this publisher of Pepper's replies."""

    def hearing_commands(self) -> int:
        """Return the number of programs that subscribe to Pepper's commands."""

    def watch(self, sensor: str) -> AbstractContextManager[object]:
        """Return a context manager that subscribes to a sensor of Pepper."""

    def value(self, sensor: str) -> object:
        """Return the newest value of a sensor of Pepper, or None before the first."""

    def stop(self, patience_s: float = 30.0) -> bool:
        """Stop the robots; return whether all stops were confirmed."""

    def stop_says(self) -> str:
        """Return the message about Pepper after a stop that was not confirmed."""

    def robots(self) -> Mapping[str, tuple[str, str]]:
        """Return the trusted robots as name: (command topic, node id)."""

    def claim(self, topic: str) -> str:
        """Return the message about an untrusted announcement on this topic."""

    def claims_nothing(self) -> bool:
        """Return whether there is no untrusted announcement."""


def described(name: str = "Pepper", **topics: str) -> dict[str, object]:
    """Return the description of a robot, with `topics` in place of some of its default topics."""
    made = copy.deepcopy(dict(robot(name).source))
    made["rb:topics"] = {**cast("Mapping[str, object]", made.get("rb:topics") or {}), **topics}
    return made


def announce(node: nep.Node, topic: str, description: Mapping[str, object]) -> nep.Publisher:
    """Publish a description of a robot from a node and return the publisher."""
    publisher = node.new_pub(topic, DESCRIPTION_TYPE, latched=True)
    publisher.publish(dict(description))
    return publisher


def answer(id: object, state: str, op: str = "invoke", **more: object) -> dict[str, object]:
    """Return the payload of a robot's reply."""
    told = {"id": id, "op": op, "action": "say", "state": state, "output": {}, "feedback": {}, "error": None}
    return {**told, **more}


class MessageSenderContract:
    """Test cases; a subclass provides the fixture `side`."""

    @pytest.fixture
    def pepper(self, master: Master) -> Iterator[WireRobot]:
        made = WireRobot(master.address)
        yield made
        made.close()

    @pytest.fixture
    def evil(self, master: Master) -> Iterator[nep.Node]:
        with nep.node("evil", master=master.address) as made:
            yield made

    def test_reply_of_another_publisher_does_not_end_an_action(
        self, pepper: WireRobot, evil: nep.Node, side: Side
    ) -> None:
        side.meet(pepper.described, pepper._node.id)
        pepper.slow = {"say"}
        call = side.invoke("say", {"text": "Hi"})
        side.until(lambda: call.state == "accepted")
        forged = evil.new_pub("/Pepper/answer", "robot/answer")
        forged.publish(answer(call.id, "succeeded"))
        forged.publish({"op": "alive", "id": "", "state": "running", "not_ended": ["say"], "error": "forged"})
        side.until(lambda: side.knows(forged))
        pepper._say(pepper.heard("invoke")[0], "running")
        side.until(lambda: call.state == "running")
        assert side.runs(call)
        pepper._say(pepper.heard("invoke")[0], "succeeded")
        side.until(lambda: call.state == "succeeded")

    def test_sensor_value_of_another_publisher_is_ignored(
        self, pepper: WireRobot, evil: nep.Node, side: Side
    ) -> None:
        side.meet(pepper.described, pepper._node.id)
        with side.watch("battery"):
            forged = evil.new_pub("/Pepper/battery", "json")
            side.until(lambda: forged.subscribers)

            def told() -> bool:
                pepper.tell("battery", {"value": 84})
                forged.publish({"value": 7})
                return side.value("battery") is not None

            side.until(told)
            assert side.value("battery") == 84

    def test_reply_of_another_publisher_does_not_confirm_a_stop(
        self, pepper: WireRobot, evil: nep.Node, side: Side
    ) -> None:
        side.meet(pepper.described, pepper._node.id)
        pepper.silent = {"stop"}
        forged = evil.new_pub("/Pepper/answer", "robot/answer")
        forged.publish(answer("somebody's", "succeeded", "stop"))
        side.until(lambda: side.knows(forged))

        def forge(messages: Sequence[nep.Message]) -> None:
            for message in messages:
                command = cast("dict[str, object]", message.payload)
                if command["op"] == "stop":
                    forged.publish(answer(command["id"], "succeeded", "stop"))

        # Another node publishes the forged answers; it serves nothing and so isn't the robot's node.
        with nep.node("spy", master=evil._master) as spy:
            spy.new_sub("/Pepper/command", "robot/command", sink=forge)
            assert not side.stop(SHORT_S)
        assert side.stop_says() == "Pepper didn't reply"

    @pytest.mark.parametrize("silent", [False, True])
    def test_stop_requires_a_reply_of_every_program_with_the_robot_name(
        self, pepper: WireRobot, master: Master, side: Side, silent: bool
    ) -> None:
        side.meet(pepper.described, pepper._node.id)
        twin = WireRobot(master.address)
        try:
            twin.silent = {"stop"} if silent else set()
            assert side.claim("/Pepper/description")
            side.until(lambda: side.hearing_commands() == 2)
            assert side.stop(SHORT_S if silent else 30.0) is not silent
            side.until(lambda: pepper.heard("stop") and twin.heard("stop"))
            assert (len(pepper.heard("stop")), len(twin.heard("stop"))) == (1, 1)
        finally:
            twin.close()

    @pytest.mark.parametrize("states", [("succeeded",), ("accepted", "running", "succeeded")], ids=len)
    def test_reply_of_an_unlisted_publisher_is_queued_until_the_master_lists_the_publisher(
        self, master: Master, side: Side, states: tuple[str, ...]
    ) -> None:
        """A robot creates its reply topic only when it sends the first reply."""
        with nep.node("late", master=master.address) as late:
            announce(late, "/Pepper/description", described())
            heard: list[object] = []
            late.new_sub("/Pepper/command", sink=lambda messages: heard.extend(m.payload for m in messages))
            side.meet(robot(), late.id)
            call = side.invoke("say", {"text": "Hi"})
            side.until(lambda: any(cast("dict[str, object]", each)["op"] == "invoke" for each in heard))
            answers = late.new_pub("/Pepper/answer", "robot/answer")
            for state in states:
                answers.publish(answer(call.id, state))
            side.until(lambda: call.state == "succeeded")
            side.check_ended(call, states)

    def test_description_on_another_topic_does_not_replace_the_robot(
        self, pepper: WireRobot, evil: nep.Node, side: Side
    ) -> None:
        side.meet(pepper.described, pepper._node.id)
        topics = {"command": "/Evil/command", "answer": "/Evil/answer"}
        announce(evil, "/Evil/description", described("Pepper", **topics))
        assert re.fullmatch(side.told["another topic"], side.claim("/Evil/description"))
        assert side.robots() == {"Pepper": ("/Pepper/command", pepper._node.id)}
        assert side.stop()
        assert len(pepper.heard("stop")) == 1

    def test_first_program_with_a_robot_name_is_used_and_the_conflict_is_reported(
        self, pepper: WireRobot, evil: nep.Node, side: Side
    ) -> None:
        side.meet(pepper.described, pepper._node.id)
        second = announce(evil, "/Pepper/description", described("Pepper", command="/Evil/command"))
        assert re.fullmatch(side.told["two programs"], side.claim("/Pepper/description"))
        assert side.robots() == {"Pepper": ("/Pepper/command", pepper._node.id)}
        second.close()
        side.until(side.claims_nothing)
        assert side.robots() == {"Pepper": ("/Pepper/command", pepper._node.id)}

    @pytest.mark.parametrize("leaf", ["command", "answer", "world"])
    def test_robot_cannot_claim_topics_of_another_robot(
        self, pepper: WireRobot, evil: nep.Node, side: Side, leaf: str
    ) -> None:
        side.meet(pepper.described, pepper._node.id)
        announce(evil, "/Evil/description", described("Evil", **{leaf: f"/Pepper/{leaf}"}))
        said = side.claim("/Evil/description")
        assert re.fullmatch(side.told["foreign topic"].replace("LEAF", leaf), said)
        assert side.robots() == {"Pepper": ("/Pepper/command", pepper._node.id)}
