"""Tests that a running program accepts messages only from its robots' own nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import ClassVar

import pytest

import nep
from app.blocks.runtime.link import RobotCall
from app.blocks.runtime.network import Network
from app.robots.client.discovery import find_robots
from app.robots.description.description import Robot
from app.robots.identity import subscriber_nodes
from nep.masters.master import Master
from tests.blocks.fakes import until
from tests.blocks.wire_robot import WireRobot
from tests.robots.message_senders import MessageSenderContract, answer

pytestmark = pytest.mark.usefixtures("patient")


class Program:
    """Program under test: finds the robots, then opens a network for them."""

    told: ClassVar = {
        "another topic": r".*/Evil/description announces Pepper.*",
        "two programs": "2 programs announce themselves as Pepper\\..*“Pepper”.*“evil”.*",
        "foreign topic": "Evil claims /Pepper/LEAF, which belongs to Pepper\\. Evil is ignored.*",
    }

    def __init__(self, node: nep.Node) -> None:
        self._node = node
        self._network: Network | None = None

    @property
    def network(self) -> Network:
        assert self._network is not None
        return self._network

    def close(self) -> None:
        if self._network is not None:
            self._network.close()

    def until(self, true: Callable[[], object]) -> None:
        until(lambda: bool(true()))

    def meet(self, described: Robot, node_id: str) -> None:
        self._network = Network(self._node, "program-1", [described], owners={described.name: node_id})

    def invoke(self, action: str, input: Mapping[str, object]) -> RobotCall:
        return self.network.invoke("Pepper", action, input)

    def runs(self, call: RobotCall) -> bool:
        return not call.done

    def check_ended(self, call: RobotCall, states: Sequence[str]) -> None:
        assert (call.done, call.state, call.has_started) == (True, states[-1], "running" in states)

    def knows(self, publisher: nep.Publisher) -> bool:
        message = nep.Message("/Pepper/answer", b"", "json", "robot/answer", publisher=publisher._spec.id)
        return self.network._senders.node_of(message) is not None

    def hearing_commands(self) -> int:
        self.network._resolve_senders()
        return len(subscriber_nodes(self.network._view, "/Pepper/command"))

    def watch(self, sensor: str) -> AbstractContextManager[object]:
        return nullcontext(self.network.sensor("Pepper", sensor))

    def value(self, sensor: str) -> object:
        return self.network.sensor("Pepper", sensor)

    def stop(self, patience_s: float = 30.0) -> bool:
        missing = self.network.stop_robots(patience_s)
        assert missing in {(), ("Pepper",)}
        return not missing

    def stop_says(self) -> str:
        return self.network.stop_error("Pepper")

    def robots(self) -> Mapping[str, tuple[str, str]]:
        found = find_robots(self._node, 30.0)
        return {
            robot.name: (robot.topics.command, found.owners[robot.name].node_id) for robot in found.robots
        }

    def claim(self, topic: str) -> str:
        (claim,) = find_robots(self._node, 30.0).rejected_claims
        return claim

    def claims_nothing(self) -> bool:
        return not find_robots(self._node, 30.0).rejected_claims


class TestProgramSenders(MessageSenderContract):
    """Sender checks of every participant, run for a program."""

    @pytest.fixture
    def side(self, node: nep.Node) -> Iterator[Program]:
        made = Program(node)
        yield made
        made.close()


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


def test_forged_stop_reply_from_foreign_node_is_ignored(
    network: Network, pepper: WireRobot, evil: nep.Node
) -> None:
    outside: list[str] = []
    network.set_callbacks(lambda: None, outside.append)
    forged = evil.new_pub("/Pepper/answer", "robot/answer")
    forged.publish(answer("somebody's", "succeeded", "stop"))
    told = nep.Message("/Pepper/answer", b"", "json", "robot/answer", publisher=forged._spec.id)
    until(lambda: network._senders.node_of(told) == evil.id)  # wait for the master's reply
    pepper.slow = {"say"}
    call = network.invoke("Pepper", "say", {"text": "Hi"})
    until(lambda: call.state == "accepted")
    assert outside == []


def test_failed_stop_is_reported_with_robot_message(network: Network, pepper: WireRobot) -> None:
    say_ = pepper._say
    pepper._say = lambda command, state, error="": say_(command, "failed", "the brake is stuck")  # type: ignore[method-assign]
    assert network.stop_robots(30.0) == ("Pepper",)
    assert network.stop_error("Pepper") == "Pepper may still move: the brake is stuck"


def test_events_from_foreign_nodes_are_ignored_but_sensor_values_are_accepted(
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
    network._resolve_senders()

    def told_by_another() -> bool:
        seen.publish({"value": 42})
        return network.sensor("Pepper", "battery") == 42

    until(told_by_another)


def test_restarted_robot_is_trusted_after_confirmation_by_the_runner(
    network: Network, pepper: WireRobot, master: Master
) -> None:
    pepper.close()
    new = WireRobot(master.address)
    try:
        call = network.invoke("Pepper", "say", {"text": "Hi"})
        until(lambda: bool(new.heard("invoke")))
        network._resolve_senders()
        assert call.state == "sent"
        network.update_owners({"Pepper": new._node.id})
        second = network.invoke("Pepper", "say", {"text": "Hi"})
        until(lambda: second.done)
    finally:
        new.close()
