"""A running program believes its robots' own programs; strangers and twins change nothing."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import cast

import pytest

import nep
from app.blocks.runtime.find_robots import find_robots
from app.blocks.runtime.network import Network
from app.robots.identity import DESCRIPTION_TYPE
from nep.masters.master import Master
from tests.blocks.fakes import until
from tests.blocks.samples import robot
from tests.blocks.wire_robot import WireRobot

pytestmark = pytest.mark.usefixtures("patient")
SHORT_S = 0.3


@pytest.fixture
def pepper(master: Master) -> Iterator[WireRobot]:
    made = WireRobot(master.address)
    yield made
    made.close()


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("program", master=master.address) as made:
        yield made


@pytest.fixture
def evil(master: Master) -> Iterator[nep.Node]:
    with nep.node("evil", master=master.address) as made:
        yield made


@pytest.fixture
def network(node: nep.Node, pepper: WireRobot) -> Iterator[Network]:
    made = Network(node, "program-1", [pepper.described], owners={"Pepper": pepper._node.id})
    yield made
    made.close()


def answer(id: object, state: str, op: str = "invoke", **more: object) -> dict[str, object]:
    return {"id": id, "op": op, "state": state, "output": {}, "feedback": {}, "error": None, **more}


def test_a_stranger_ends_no_action(network: Network, pepper: WireRobot, evil: nep.Node) -> None:
    pepper.slow = {"say"}
    call = network.invoke("Pepper", "say", {"text": "Hi"})
    until(lambda: call.state == "accepted")
    forged = evil.new_pub("/Pepper/answer", "robot/answer")
    forged.publish(answer(call.id, "succeeded"))
    until(lambda: network._senders.node_of(_of(forged)) == evil.id)  # the master has been asked
    pepper._say(pepper.heard("invoke")[0], "running")
    until(lambda: call.state == "running")
    assert not call.done
    pepper._say(pepper.heard("invoke")[0], "succeeded")
    until(lambda: call.done)


def _of(publisher: nep.Publisher) -> nep.Message:
    return nep.Message("/Pepper/answer", b"", "json", "robot/answer", publisher=publisher._spec.id)


def test_a_stranger_proves_no_stop_and_says_no_stop_of_others(
    network: Network, pepper: WireRobot, evil: nep.Node
) -> None:
    outside: list[str] = []
    network.listen(lambda: None, outside.append)
    forged = evil.new_pub("/Pepper/answer", "robot/answer")
    forged.publish(answer("somebody's", "succeeded", "stop"))
    until(lambda: network._senders.node_of(_of(forged)) == evil.id)
    pepper.silent = {"stop"}

    def forge(messages: object) -> None:
        for message in cast("list[nep.Message]", messages):
            command = cast("dict[str, object]", message.payload)
            if command["op"] == "stop":
                forged.publish(answer(command["id"], "succeeded", "stop"))

    # It only publishes its answers from another node, so that it serves nothing and is a stranger.
    with nep.node("spy", master=evil._master) as spy:
        spy.new_sub("/Pepper/command", "robot/command", sink=forge)
        assert network.stop_robots(SHORT_S) == ("Pepper",)
    assert network.stop_words("Pepper") == "Pepper did not answer"
    assert outside == []


def test_a_refusal_is_told_in_the_robots_words(network: Network, pepper: WireRobot) -> None:
    say_ = pepper._say
    pepper._say = lambda command, state, error="": say_(command, "failed", "the brake is stuck")  # type: ignore[method-assign]
    assert network.stop_robots(30.0) == ("Pepper",)
    assert network.stop_words("Pepper") == "Pepper may still move: the brake is stuck"


def test_a_twin_must_answer_too(network: Network, pepper: WireRobot, master: Master) -> None:
    twin = WireRobot(master.address)
    try:
        assert network.stop_robots(30.0) == ()
        twin.silent = {"stop"}
        assert network.stop_robots(SHORT_S) == ("Pepper",)
    finally:
        twin.close()


def test_a_stranger_starts_no_script_but_another_program_may_be_a_robots_eye(
    network: Network, pepper: WireRobot, evil: nep.Node
) -> None:
    told: list[object] = []
    network.on_event("Pepper", "touched", told.append)
    forged = evil.new_pub("/Pepper/touched", "json")
    until(lambda: forged.subscribers > 0)
    forged.publish({"place": "forged"})

    def touched() -> bool:
        pepper.tell("touched", {"place": "head"})
        return bool(told)

    until(touched)
    assert {"place": "forged"} not in told
    pepper._sensors["battery"].close()
    seen = evil.new_pub("/Pepper/battery", "json")
    network.sensor("Pepper", "battery")
    network._look()

    def told_by_another() -> bool:
        seen.publish({"value": 42})
        return network.sensor("Pepper", "battery") == 42

    until(told_by_another)


def test_an_answer_of_a_publisher_that_is_not_known_yet_waits_for_the_master(
    node: nep.Node, evil: nep.Node
) -> None:
    """The robot makes its answer topic only when it has something to say."""
    network = Network(node, "program-1", [robot()], owners={"Pepper": evil.id})
    try:
        call = network.invoke("Pepper", "say", {"text": "Hi"})
        answers = evil.new_pub("/Pepper/answer", "robot/answer")
        for state in ("accepted", "running", "succeeded"):
            answers.publish(answer(call.id, state))
        until(lambda: call.done)
        assert (call.state, call.began) == ("succeeded", True)
    finally:
        network.close()


def test_a_robot_that_is_started_anew_is_believed_when_the_runner_says_so(
    network: Network, pepper: WireRobot, master: Master
) -> None:
    pepper.close()
    new = WireRobot(master.address)
    try:
        call = network.invoke("Pepper", "say", {"text": "Hi"})
        until(lambda: bool(new.heard("invoke")))
        network._look()
        assert call.state == "sent"
        network.know({"Pepper": new._node.id})
        second = network.invoke("Pepper", "say", {"text": "Hi"})
        until(lambda: second.done)
    finally:
        new.close()


# ---- who is found --------------------------------------------------------------------------------------


def announce(node: nep.Node, topic: str, name: str, **topics: str) -> nep.Publisher:
    described = copy.deepcopy(dict(robot(name).source))
    described["rb:topics"] = {**cast("dict[str, str]", described.get("rb:topics") or {}), **topics}
    publisher = node.new_pub(topic, DESCRIPTION_TYPE, latched=True)
    publisher.publish(described)
    return publisher


def test_a_description_on_another_topic_is_left_out(
    node: nep.Node, pepper: WireRobot, evil: nep.Node
) -> None:
    announce(evil, "/Evil/description", "Pepper", command="/Evil/command")
    found = find_robots(node, 30.0)
    assert [each.topics.command for each in found.robots] == ["/Pepper/command"]
    assert found.owners["Pepper"].node_id == pepper._node.id
    assert "/Evil/description says that it is Pepper" in found.claims[0]


def test_the_first_program_of_a_name_is_found(node: nep.Node, pepper: WireRobot, evil: nep.Node) -> None:
    announce(evil, "/Pepper/description", "Pepper", command="/Evil/command")
    found = find_robots(node, 30.0, wanted=["Pepper"])
    assert found.robots[0].topics.command == "/Pepper/command"
    assert found.claims[0].startswith("2 programs say that they are Pepper: “Pepper”")
    assert "“evil”" in found.claims[0]


def test_a_robot_with_the_topics_of_another_is_left_out(
    node: nep.Node, pepper: WireRobot, evil: nep.Node
) -> None:
    announce(evil, "/Evil/description", "Evil", command="/Pepper/command")
    found = find_robots(node, 30.0)
    assert [each.name for each in found.robots] == ["Pepper"]
    assert found.claims == (
        "Evil says that /Pepper/command is its own, which belongs to Pepper; Evil is left out.",
    )
