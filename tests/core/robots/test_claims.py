"""Tests of several programs that announce the same robot: only the first one is accepted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import ClassVar

import pytest

import nep
from app.core.robots.robot_link import Invocation, RobotLink
from app.core.session import Session
from app.robots.description.description import Robot
from nep.masters.master import Master
from tests.blocks.samples import block, number, started, workspace
from tests.blocks.wire_robot import WireRobot, usual_time_limits
from tests.core.waiting import stop_unanswered, tick_until
from tests.robots.message_senders import MessageSenderContract, announce, described


@pytest.fixture
def pepper(master: Master) -> Iterator[WireRobot]:
    made = WireRobot(master.address)
    yield made
    made.close()


@pytest.fixture
def evil(master: Master) -> Iterator[nep.Node]:
    with nep.node("evil", master=master.address) as node:
        yield node


def the_link(session: Session, name: str = "Pepper") -> RobotLink:
    def ready() -> bool:
        return session.stopper is not None and name in session.stopper.robots

    tick_until(session, ready)
    link = session.fleet.link(name)
    assert link is not None
    tick_until(session, lambda: link.publisher is not None)
    return link


def claimed(session: Session, id: str) -> str:
    """Wait for the alert about a claim and return its text."""
    tick_until(session, lambda: session.alerts.has(f"claim:{id}"))
    (alert,) = (each for each in session.alerts.active if each.id == f"claim:{id}")
    assert alert.severity == "error"
    return f"{alert.title} {alert.detail}"


def stop_is_proven(session: Session) -> None:
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state in {"proven", "unanswered"})
    assert session.runs.view().state == "proven", session.runs.view().title


class Studio:
    """Participant under test: a session of Studio, and what a user sees of it."""

    told: ClassVar = {
        "another topic": r".*/Evil/description announces Pepper.*",
        "two programs": "2 programs announce themselves as Pepper\\..*“Pepper” on .*“evil” on .*",
        "foreign topic": ".*Evil claims /Pepper/LEAF, which belongs to Pepper.*",
    }

    def __init__(self, session: Session) -> None:
        self.session = session
        self._link: RobotLink | None = None
        self._before: tuple[object, ...] = ()

    @property
    def link(self) -> RobotLink:
        assert self._link is not None
        return self._link

    def until(self, true: Callable[[], object]) -> None:
        tick_until(self.session, true)

    def meet(self, described: Robot, node_id: str) -> None:
        self._link = the_link(self.session, described.name)
        assert self.link.identity.node_id == node_id
        self._before = (self.link.robot, self.link.identity)
        self.until(lambda: _subscribers(self.session, "/Pepper/answer") == 2)  # also the stopper's

    def invoke(self, action: str, input: Mapping[str, object]) -> Invocation:
        self.until(lambda: self.link.publisher is not None and self.link.publisher.subscribers)
        return self.session.fleet.invoke("Pepper", action, input)

    def runs(self, call: Invocation) -> bool:
        return call.is_running and self.link.unended_actions == ""

    def check_ended(self, call: Invocation, states: Sequence[str]) -> None:
        assert (call.is_running, call.state) == (False, states[-1])

    def knows(self, publisher: nep.Publisher) -> bool:
        """Return whether Studio's graph contains the publisher."""
        graph = self.session.live.graph
        return graph is not None and publisher._spec.id in {
            each.id for each in graph.topics["/Pepper/answer"].publishers
        }

    def hearing_commands(self) -> int:
        return _subscribers(self.session, "/Pepper/command")

    def watch(self, _sensor: str) -> AbstractContextManager[object]:
        return self.session.fleet.watch_sensors("Pepper")

    def value(self, sensor: str) -> object:
        return self.link.values.get(sensor)

    def stop(self, patience_s: float = 30.0) -> bool:
        with usual_time_limits() if patience_s < 30.0 else nullcontext():
            self.session.runs.stop()
            self.until(lambda: self.session.runs.view().state in {"proven", "unanswered"})
        return self.session.runs.view().state == "proven"

    def stop_says(self) -> str:
        return self.session.runs.view().title

    def robots(self) -> Mapping[str, tuple[str, str]]:
        """Return the connected robots' command topics and node IDs by name; Pepper must be unchanged."""
        assert self.session.fleet.link("Pepper") is self.link
        assert (self.link.robot, self.link.identity) == self._before
        links = [link for link in self.session.fleet.links if link.is_connected]
        return {link.name: (link.robot.topics.command, link.identity.node_id) for link in links}

    def claim(self, topic: str) -> str:
        return claimed(self.session, topic)

    def claims_nothing(self) -> bool:
        return not any(alert.id.startswith("claim:") for alert in self.session.alerts.active)


class TestStudioSenders(MessageSenderContract):
    """Sender checks of every participant, run for Studio."""

    @pytest.fixture
    def side(self, session: Session) -> Studio:
        return Studio(session)


def _subscribers(session: Session, topic: str) -> int:
    info = session.live.graph.topics.get(topic) if session.live.graph is not None else None
    return len(info.subscribers) if info is not None else 0


def test_stop_reaches_robot_despite_a_description_by_another_program(
    session: Session, pepper: WireRobot, evil: nep.Node
) -> None:
    the_link(session)
    diverted: list[object] = []
    evil.new_sub("/Evil/command", "robot/command", sink=diverted.extend)
    topics = {"command": "/Evil/command", "answer": "/Evil/answer"}
    announce(evil, "/Evil/description", described("Pepper", **topics))

    def is_seen() -> bool:
        link = session.fleet.link("Pepper")
        claimed = session.alerts.has("claim:/Evil/description")
        return claimed or (link is not None and link.robot.topics.command == "/Evil/command")

    tick_until(session, is_seen)
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state in {"proven", "unanswered"})
    assert (len(pepper.heard("stop")), diverted) == (1, [])


def test_robot_with_huge_description_is_rejected_with_an_alert(session: Session, evil: nep.Node) -> None:
    announce(evil, "/Big/description", {**described("Big"), "note": "x" * 1_100_000})
    tick_until(session, lambda: session.fleet.link("Big") is not None or bool(session.alerts.active))
    assert session.fleet.link("Big") is None
    assert any("Big" in f"{alert.title} {alert.detail}" for alert in session.alerts.active)


def _payloads(messages: object) -> list[Mapping[str, object]]:
    assert isinstance(messages, list | tuple)
    return [message.payload for message in messages]


def test_restarted_robot_replaces_its_previous_program(session: Session, master: Master) -> None:
    first = WireRobot(master.address)
    link = the_link(session)
    before = link.identity
    second = WireRobot(master.address)
    try:
        claimed(session, "/Pepper/description")
        first.close()
        tick_until(session, lambda: link.is_connected and link.identity != before)
        assert any("Pepper was restarted" in record.text for record in session.console.records)
        stop_is_proven(session)
        assert len(second.heard("stop")) == 1
    finally:
        second.close()


def test_new_program_with_name_of_a_moving_robot_does_not_confirm_its_stop(
    session: Session, master: Master, pepper: WireRobot
) -> None:
    """The master unlists a frozen driver. A new program then replies, but the robot may still move."""
    link = the_link(session)
    session.document.apply_edit(workspace(started(block("control_wait", SECONDS=number(600)))))
    session.runs.run()
    session.fleet.moved.record_command(["Pepper"], "behaviour")  # as if the program had sent a command
    before = link.identity
    pepper._node.close()
    thief = WireRobot(master.address)
    try:
        tick_until(session, lambda: link.is_connected and link.identity != before)
        tick_until(session, lambda: session.stopper is not None and session.stopper.robots)
        # connect first, because the robot has only three seconds to reply
        tick_until(session, lambda: thief._answer.subscribers)
        stop_unanswered(session)
        assert session.runs.view().title == "Pepper (“Pepper”) didn't reply"
        assert thief.heard("stop")
        session.runs.confirm_stopped()
        session.tick()  # the next tick no longer waits for the old program
        stop_is_proven(session)
    finally:
        thief.close()


def test_new_program_does_not_confirm_stop_of_a_robot_moved_by_hand(
    session: Session, master: Master, pepper: WireRobot
) -> None:
    link = the_link(session)
    pepper.slow = {"say"}
    tick_until(session, lambda: link.publisher is not None and link.publisher.subscribers)
    tried = session.fleet.invoke("Pepper", "say", {"text": "Hi"})
    tick_until(session, lambda: tried.state == "accepted")
    before = link.identity
    pepper._node.close()
    tick_until(session, lambda: not link.is_connected)
    thief = WireRobot(master.address)
    try:
        tick_until(session, lambda: link.is_connected and link.identity != before)
        tick_until(session, lambda: session.stopper is not None and session.stopper.robots)
        # connect first, because the robot has only three seconds to reply
        tick_until(session, lambda: thief._answer.subscribers)
        stop_unanswered(session)
        session.runs.confirm_stopped()
        session.tick()
        stop_is_proven(session)
    finally:
        thief.close()


def test_robot_cannot_claim_topics_of_a_robot_that_connects_later(
    session: Session, master: Master, evil: nep.Node
) -> None:
    announce(evil, "/Evil/description", described("Evil", command="/Pepper/command"))
    evil_link = the_link(session, "Evil")
    pepper = WireRobot(master.address)
    try:
        link = the_link(session)
        tick_until(session, lambda: not evil_link.is_connected)
        assert "which belongs to Pepper" in claimed(session, "/Evil/description")
        assert link.is_connected
    finally:
        pepper.close()


def test_changed_description_redirects_commands_to_the_new_topic(session: Session, evil: nep.Node) -> None:
    announcement = announce(evil, "/Pepper/description", described())
    link = the_link(session)
    old, new = [], []
    evil.new_sub("/Pepper/command", sink=lambda messages: old.extend(_payloads(messages)))
    evil.new_sub("/Pepper/orders", sink=lambda messages: new.extend(_payloads(messages)))
    tick_until(session, lambda: link.publisher is not None and link.publisher.subscribers)
    announcement.publish(described("Pepper", command="/Pepper/orders"))
    tick_until(session, lambda: link.publisher is not None and link.publisher.topic == "/Pepper/orders")
    tick_until(session, lambda: link.publisher is not None and link.publisher.subscribers)
    session.fleet.invoke("Pepper", "say", {"text": "Hi"})
    tick_until(session, lambda: any(command["op"] == "invoke" for command in new))
    assert not any(command["op"] == "invoke" for command in old)
    tick_until(session, lambda: session.stopper is not None and session.stopper.robots)
    stop_unanswered(session)  # sent to both topics
    tick_until(session, lambda: any(command["op"] == "stop" for command in old))
    tick_until(session, lambda: any(command["op"] == "stop" for command in new))


def test_invalid_description_is_reported_and_the_previous_one_stays_valid(
    session: Session, pepper: WireRobot, evil: nep.Node
) -> None:
    the_link(session)
    wrong = described("Rover")
    wrong["actions"] = {"do it": {}}
    announcement = announce(evil, "/Rover/description", wrong)
    said = claimed(session, "/Rover/description")
    assert "The description of 'Rover' can't be used: actions" in said
    assert "“evil” on" in said
    assert "previous" not in said
    announcement.publish(described("Rover"))
    tick_until(session, lambda: not session.alerts.has("claim:/Rover/description"))
    the_link(session, "Rover")
    announcement.publish(wrong)
    assert "The previous description is used." in claimed(session, "/Rover/description")
    assert session.fleet.link("Rover").is_connected
