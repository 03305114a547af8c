"""Tests of which replies confirm a stop: only those of the robot's own program."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest

import nep
from app.core.robots.stop.stopper import RobotStopper
from app.robots.client.stop import StopTarget
from app.robots.client.stop_report import RobotStop, StopReport, unreached_result
from app.robots.description.description import RobotTopics
from app.robots.identity import first_announcer, identity_of
from nep.errors import AddressInUseError
from nep.masters.master import Master
from tests.blocks.fakes import until
from tests.blocks.wire_robot import WireRobot

pytestmark = pytest.mark.usefixtures("patient")
LONG_S = 60.0
SHORT_S = 3.0  # long enough for the other robots to reply on a busy computer


@pytest.fixture
def pepper(master: Master) -> Iterator[WireRobot]:
    made = WireRobot(master.address)
    yield made
    made.close()


@pytest.fixture
def stopper(master: Master, pepper: WireRobot) -> Iterator[RobotStopper]:
    with nep.node("studio", master=master.address) as node:
        made = RobotStopper(node)
        made.set_robots([pepper.described])
        yield made
        made.close()


class Stranger:
    """Foreign program that replies to every stop in Pepper's name."""

    def __init__(self, address: str) -> None:
        self.node = nep.node("stranger", master=address)
        self.answers = self.node.new_pub("/Pepper/answer", "robot/answer")
        self.answered = threading.Event()
        self.node.new_sub("/Pepper/command", "robot/command", sink=self._take)

    def _take(self, messages: Sequence[nep.Message]) -> None:
        for message in messages:
            command = message.payload
            assert isinstance(command, dict)
            if command["op"] == "stop":
                self.answers.publish({"id": command["id"], "op": "stop", "state": "succeeded"})
                self.answered.set()


@pytest.fixture
def stranger(master: Master) -> Iterator[Stranger]:
    made = Stranger(master.address)
    yield made
    made.node.close()


def test_closing_ends_the_wait_for_replies(stopper: RobotStopper, pepper: WireRobot) -> None:
    pepper.silent = {"stop"}
    reports: list[StopReport] = []
    thread = threading.Thread(target=lambda: reports.append(stopper.stop_all(["Pepper"], timeout_s=600.0)))
    thread.start()
    until(lambda: bool(pepper.heard("stop")))
    stopper.close()
    thread.join(LONG_S)
    assert [report.is_confirmed for report in reports] == [False]


def test_foreign_reply_does_not_confirm_stop_of_a_frozen_robot(stopper, pepper, stranger) -> None:
    pepper.silent = {"stop"}
    report = stopper.stop_all(["Pepper"], timeout_s=SHORT_S)
    assert stranger.answered.is_set()
    assert not report.is_confirmed
    assert report.robots[0] == RobotStop("Pepper", False, None)


def test_foreign_node_that_only_replies_is_named(master, stopper, pepper) -> None:
    """The foreign node can read the id of the stop on the command topic without staying subscribed."""
    pepper.silent = {"stop"}
    with nep.node("liar", master=master.address) as liar:
        forged = liar.new_pub("/Pepper/answer", "robot/answer")
        reports: list[StopReport] = []
        asking = threading.Thread(target=lambda: reports.append(stopper.stop_all(timeout_s=SHORT_S)))
        asking.start()
        until(lambda: bool(pepper.heard("stop")))
        forged.publish({"id": pepper.heard("stop")[0]["id"], "op": "stop", "state": "succeeded"})
        asking.join()
    assert not reports[0].is_confirmed
    assert reports[0].impostors == (("Pepper", "liar"),)


def test_two_robots_of_the_same_name_must_both_reply(master, stopper, pepper) -> None:
    twin = WireRobot(master.address)
    try:
        stopper.update_graph(stopper._node.graph())
        report = stopper.stop_all(timeout_s=LONG_S)
        assert report.is_confirmed
        assert [robot.full_name for robot in report.robots] == ["Pepper", "Pepper (“Pepper”)"]
        twin.silent = {"stop"}
        told: list[RobotStop] = []
        report = stopper.stop_all(timeout_s=SHORT_S, on_answer=told.append)
        assert [(each.is_confirmed, each.is_waiting) for each in told] == [(True, True), (False, False)]
        assert (report.is_confirmed, report.unconfirmed_names) == (False, ("Pepper",))
        assert report.robots[1].message == "Pepper (“Pepper”) didn't reply. Switch it off by hand."
        twin.silent, pepper.silent = set(), {"stop"}
        report = stopper.stop_all(timeout_s=SHORT_S)
        assert [robot.is_confirmed for robot in report.robots] == [False, True]
    finally:
        twin.close()


def test_additional_subscriber_of_robot_commands_is_named_in_the_stop_report(master, stopper) -> None:
    with nep.node("motor box", master=master.address) as node:
        node.new_sub("/Pepper/command", "robot/command")
        stopper.update_graph(stopper._node.graph())
        report = stopper.stop_all(timeout_s=LONG_S)
    assert report.is_confirmed
    said = "Pepper (“motor box”) also receives the commands and can't confirm"
    assert [robot.message for robot in report.robots][1:] == [said]


def test_many_additional_subscribers_of_robot_commands_are_summarized_in_one_line(master, stopper) -> None:
    nodes = [nep.node(f"listener {number}", master=master.address) for number in range(6)]
    for node in nodes:
        node.new_sub("/Pepper/command", "robot/command")
    stopper.update_graph(stopper._node.graph())
    report = stopper.stop_all(timeout_s=LONG_S)
    for node in nodes:
        node.close()
    assert [robot.program for robot in report.robots] == ["", "6 programs"]
    assert report.is_confirmed


def test_first_program_that_announces_a_robot_counts_as_the_robot(master, stopper, pepper) -> None:
    twin = WireRobot(master.address)
    try:
        view = stopper._node.graph()
        first = first_announcer(view, "/Pepper/description")
        assert first is not None
        assert first.node_id == pepper._node.id
        assert identity_of(view, twin._node.id).display_name.startswith("“Pepper” on ")
        stopper.set_robots([StopTarget(pepper.described, identity_of(view, twin._node.id))])
        twin.silent = {"stop"}
        report = stopper.stop_all(timeout_s=SHORT_S)
        assert [(robot.program, robot.is_confirmed) for robot in report.robots] == [
            ("", False),
            ("Pepper", True),
        ]
    finally:
        twin.close()


def test_stop_is_also_sent_to_topics_of_earlier_descriptions(master, stopper, pepper) -> None:
    """A robot may announce new command topics while it still reads only the old one."""
    moved = RobotTopics("/Pepper/description", "/Pepper/other_command", "/Pepper/other_answer")
    changed = replace(pepper.described, topics=moved)
    stopper.set_robots([StopTarget(changed, earlier_topics=(pepper.described.topics,))])
    report = stopper.stop_all(timeout_s=LONG_S)
    assert report.is_confirmed
    assert pepper.heard("stop")


def test_robot_that_did_not_receive_stop_is_named() -> None:
    report = StopReport((RobotStop("Pepper", True, 3.0),), 3.0)
    whole = report.with_unreached(["Pepper", "Turtle"], "no master answers")
    assert (whole.is_confirmed, whole.unconfirmed_names) == (False, ("Turtle",))
    said = "Stop wasn't sent to Turtle: no master answers. Switch it off by hand."
    assert whole.robots[1].message == said
    assert report.with_unreached(["Pepper"]) is report
    assert unreached_result("Turtle").problem == "Stop wasn't sent to Turtle"


class Broken:
    """Node that fails to open publishers of the topics in ``full``."""

    def __init__(self, node: nep.Node) -> None:
        self._node = node
        self.id = node.id
        self.full = {"/Pepper/command"}
        self.graph = node.graph
        self.new_sub = node.new_sub
        self.tried = 0

    def new_pub(self, topic: str, msg_type: str = "json", *, batch: bool = True) -> nep.Publisher:
        if topic in self.full:
            self.tried += 1
            raise AddressInUseError("tcp://127.0.0.1:7000")
        return self._node.new_pub(topic, msg_type, batch=batch)


@pytest.fixture
def broken(master: Master) -> Iterator[Broken]:
    with nep.node("studio", master=master.address) as node:
        yield Broken(node)


def test_failed_connection_is_named_and_does_not_affect_other_robots(master, broken, pepper) -> None:
    turtle = WireRobot(master.address, "Turtle")
    stopper = RobotStopper(broken)
    try:
        stopper.set_robots([pepper.described, turtle.described])
        assert stopper.robots == ("Turtle",)
        assert list(stopper.problems) == ["Pepper"]
        report = stopper.stop_all(timeout_s=LONG_S)
        assert (report.is_confirmed, report.unconfirmed_names) == (False, ("Pepper",))
        assert report.robots[0].message.startswith("Stop can't be sent to Pepper: ")
        assert broken.tried == 2  # retried once at the stop
    finally:
        stopper.close()
        turtle.close()


def test_failed_connection_is_retried_at_stop(broken, pepper) -> None:
    stopper = RobotStopper(broken)
    try:
        stopper.set_robots([pepper.described])
        broken.full.clear()
        report = stopper.stop_all(timeout_s=LONG_S)
        assert report.is_confirmed
        assert [robot.name for robot in report.robots] == ["Pepper"]
        assert (stopper.robots, dict(stopper.problems)) == (("Pepper",), {})
    finally:
        stopper.close()


def test_late_stop_reply_is_accepted(stopper, pepper) -> None:
    pepper.silent = {"stop"}
    late: list[StopReport] = []
    report = stopper.stop_all(timeout_s=0.1, on_late=late.append)
    assert not report.is_confirmed
    until(lambda: bool(pepper.heard("stop")))
    (command,) = pepper.heard("stop")
    pepper._say(command, "failed", "the brake is stuck")
    until(lambda: len(late) == 1)
    assert late[0].robots[0].problem == "Pepper may still move: the brake is stuck"
    assert report.with_late_reply(late[0]).robots == late[0].robots
    pepper._say(command, "succeeded")
    until(lambda: len(late) == 2)
    assert report.with_late_reply(late[1]).is_confirmed
    pepper._say(command, "failed", "moves again")
    pepper._say(command, "succeeded")
    assert stopper.stop_all(timeout_s=0.1, on_late=late.append).unconfirmed_names == ("Pepper",)
    assert len(late) == 2
    assert report.with_late_reply(StopReport((RobotStop("Other", True, 1.0),), 1.0)) is report


def test_late_reply_callback_can_use_the_stopper(stopper, pepper) -> None:
    """A late reply waits until the master identifies its sender; the callback then runs without a lock."""
    pepper.silent = {"stop"}
    free: list[bool] = []

    def late(_report: StopReport) -> None:
        asking = threading.Thread(target=lambda: stopper.robots)
        asking.start()
        asking.join(LONG_S)
        free.append(not asking.is_alive())

    stopper.stop_all(timeout_s=0.1, on_late=late)
    until(lambda: bool(pepper.heard("stop")))
    (command,) = pepper.heard("stop")
    answer = {"id": command["id"], "op": "stop", "action": "stop", "state": "failed", "error": "stuck"}
    publisher = pepper._answer._spec.id
    topic, payload = pepper.described.topics.reply, json.dumps(answer).encode()
    with stopper._changed:
        stopper._inbox.hold(nep.Message(topic, payload, "json", "robot/answer", publisher=publisher))
    stopper.update_graph(stopper._node.graph())
    until(lambda: free == [True])


def test_rejection_message_of_the_robot_is_sanitized(stopper, pepper) -> None:
    say_ = pepper._say
    words = "Pepper may still move: the brake\x1b[2J\n does not answer." + "!" * 1000
    pepper._say = lambda command, state, error="": say_(command, "failed", words)
    (stopped,) = stopper.stop_all(timeout_s=LONG_S).robots
    assert stopped.problem.startswith("Pepper may still move: the brake [2J does not answer.!")
    assert len(stopped.problem) <= 200
