"""Programs that say that they are somebody's robot: the first one is, whatever the others say."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator, Mapping
from typing import cast

import pytest

import nep
from app.core.network.mailbox import Batch
from app.core.network.watches import Watches
from app.core.robots.announcements import MOST_ROBOTS, Announcements
from app.core.robots.robot_link import RobotLink
from app.core.session import Session
from app.robots.identity import DESCRIPTION_TYPE, Senders
from nep.masters.master import Master
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo
from tests.blocks.samples import block, number, robot, started, workspace
from tests.blocks.wire_robot import WireRobot
from tests.core.waiting import tick_until


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


class Clock:
    """Stands still until somebody moves it."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def description(name: str = "Pepper", **topics: str) -> dict[str, object]:
    made = copy.deepcopy(dict(robot(name).source))
    made["rb:topics"] = {**cast("Mapping[str, object]", made.get("rb:topics") or {}), **topics}
    return made


def announce(node: nep.Node, topic: str, described: Mapping[str, object]) -> nep.Publisher:
    publisher = node.new_pub(topic, DESCRIPTION_TYPE, latched=True)
    publisher.publish(dict(described))
    return publisher


def claimed(session: Session, id: str) -> str:
    """The words of the alert about a claim, as soon as it is there."""
    tick_until(session, lambda: session.alerts.has(f"claim:{id}"))
    (alert,) = (each for each in session.alerts.active if each.id == f"claim:{id}")
    assert alert.severity == "error"
    return f"{alert.title} {alert.detail}"


def stop_is_proven(session: Session) -> None:
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state in {"proven", "unanswered"})
    assert session.runs.view().state == "proven", session.runs.view().title


def test_a_description_on_another_topic_does_not_replace_the_robot(
    session: Session, pepper: WireRobot, evil: nep.Node
) -> None:
    link = the_link(session)
    known, identity = link.robot, link.identity
    topics = {"command": "/Evil/command", "answer": "/Evil/answer"}
    announce(evil, "/Evil/description", description("Pepper", **topics))
    said = claimed(session, "/Evil/description")
    assert "/Evil/description says that it is Pepper" in said
    assert session.fleet.link("Pepper") is link
    assert (link.robot, link.identity) == (known, identity)
    stop_is_proven(session)
    assert len(pepper.heard("stop")) == 1


def test_a_stop_reaches_the_robot_whoever_describes_it_as_well(
    session: Session, pepper: WireRobot, evil: nep.Node
) -> None:
    the_link(session)
    diverted: list[object] = []
    evil.new_sub("/Evil/command", "robot/command", sink=diverted.extend)
    topics = {"command": "/Evil/command", "answer": "/Evil/answer"}
    announce(evil, "/Evil/description", description("Pepper", **topics))

    def is_seen() -> bool:
        link = session.fleet.link("Pepper")
        claimed = session.alerts.has("claim:/Evil/description")
        return claimed or (link is not None and link.robot.topics.command == "/Evil/command")

    tick_until(session, is_seen)
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state in {"proven", "unanswered"})
    assert (len(pepper.heard("stop")), diverted) == (1, [])


def test_a_twin_that_does_not_answer_leaves_a_stop_without_proof(
    session: Session, pepper: WireRobot, evil: nep.Node
) -> None:
    the_link(session)
    announce(evil, "/Pepper/description", description())
    evil.new_pub("/Pepper/answer", "robot/answer")
    evil.new_sub("/Pepper/command", "robot/command")  # hears, and says nothing
    tick_until(session, lambda: _subscribers(session, "/Pepper/command") == 2)
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state in {"proven", "unanswered"})
    assert session.runs.view().state == "unanswered"
    assert len(pepper.heard("stop")) == 1


def test_a_robot_whose_description_is_huge_is_refused_with_an_alert(session: Session, evil: nep.Node) -> None:
    announce(evil, "/Big/description", {**description("Big"), "note": "x" * 1_100_000})
    tick_until(session, lambda: session.fleet.link("Big") is not None or bool(session.alerts.active))
    assert session.fleet.link("Big") is None
    assert any("Big" in f"{alert.title} {alert.detail}" for alert in session.alerts.active)


def test_a_second_program_of_the_name_changes_nothing_and_both_are_named(
    session: Session, pepper: WireRobot, evil: nep.Node
) -> None:
    link = the_link(session)
    announcement = announce(evil, "/Pepper/description", description("Pepper", command="/Evil/command"))
    said = claimed(session, "/Pepper/description")
    assert "2 programs say that they are Pepper." in said
    assert "“Pepper” on " in said
    assert "“evil” on " in said
    assert link.robot.topics.command == "/Pepper/command"
    announcement.close()
    tick_until(session, lambda: not session.alerts.has("claim:/Pepper/description"))
    assert link.connected


def test_an_answer_of_a_stranger_ends_no_try(session: Session, pepper: WireRobot, evil: nep.Node) -> None:
    link = the_link(session)
    pepper.slow = {"say"}
    tried = session.fleet.invoke("Pepper", "say", {"text": "Hi"})
    tick_until(session, lambda: tried.state == "accepted")
    forged = evil.new_pub("/Pepper/answer", "robot/answer")
    told = {"id": tried.id, "op": "invoke", "action": "say", "state": "succeeded", "output": {}}
    forged.publish({**told, "feedback": {}, "error": None})
    forged.publish({"op": "alive", "id": "", "state": "running", "not_ended": ["say"], "error": "forged"})
    graph = session.graph
    tick_until(session, lambda: session.graph is not graph)  # its publisher is known now
    pepper._say(pepper.heard("invoke")[0], "running")
    tick_until(session, lambda: tried.state == "running")
    assert (tried.running, link.goes_on) == (True, "")
    pepper._say(pepper.heard("invoke")[0], "succeeded")
    tick_until(session, lambda: tried.state == "succeeded")


def test_a_value_of_a_stranger_is_not_the_robots(session: Session, pepper: WireRobot, evil: nep.Node) -> None:
    link = the_link(session)
    with session.fleet.look_at("Pepper"):
        forged = evil.new_pub("/Pepper/battery", "json")
        tick_until(session, lambda: forged.subscribers)

        def told() -> bool:
            pepper.tell("battery", {"value": 84})
            forged.publish({"value": 7})
            return "battery" in link.values

        tick_until(session, told)
        assert link.values["battery"] == 84


def test_an_answer_from_a_publisher_that_the_graph_does_not_show_yet_is_kept(session: Session) -> None:
    with nep.node("late") as node:
        announce(node, "/Pepper/description", description())
        heard: list[Mapping[str, object]] = []
        node.new_sub("/Pepper/command", sink=lambda messages: heard.extend(_payloads(messages)))
        the_link(session)
        tick_until(session, lambda: _subscribers(session, "/Pepper/answer") == 2)  # also the stop's
        tried = session.fleet.invoke("Pepper", "say", {"text": "Hi"})
        tick_until(session, lambda: any(command["op"] == "invoke" for command in heard))
        answers = node.new_pub("/Pepper/answer", "robot/answer")
        answers.publish({"id": tried.id, "op": "invoke", "state": "succeeded", "output": {}})
        tick_until(session, lambda: not tried.running)
        assert tried.state == "succeeded"


def _subscribers(session: Session, topic: str) -> int:
    info = session.graph.topics.get(topic) if session.graph is not None else None
    return len(info.subscribers) if info is not None else 0


def _payloads(messages: object) -> list[Mapping[str, object]]:
    assert isinstance(messages, list | tuple)
    return [message.payload for message in messages]


def test_a_robot_that_is_started_anew_is_taken_over_from(session: Session, master: Master) -> None:
    first = WireRobot(master.address)
    link = the_link(session)
    before = link.identity
    second = WireRobot(master.address)
    try:
        claimed(session, "/Pepper/description")
        first.close()
        tick_until(session, lambda: link.connected and link.identity != before)
        assert any("Pepper was started anew" in record.text for record in session.console.records)
        stop_is_proven(session)
        assert len(second.heard("stop")) == 1
    finally:
        second.close()


def test_who_takes_the_name_of_a_robot_in_motion_does_not_prove_its_stop(
    session: Session, master: Master, pepper: WireRobot
) -> None:
    """It is frozen, so the master unlists it; the new one answers, and the old one may still move."""
    link = the_link(session)
    session.document.edited(workspace(started(block("control_wait", SECONDS=number(600)))))
    session.runs.run()
    session.runs.kept = frozenset({"Pepper"})  # as if the program had used it
    before = link.identity
    pepper._node.close()
    thief = WireRobot(master.address)
    try:
        tick_until(session, lambda: link.connected and link.identity != before)
        tick_until(session, lambda: session.stopper is not None and session.stopper.robots)
        # the second that it has for its answer is not to go by while the new connection is made
        tick_until(session, lambda: thief._answer.subscribers)
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "unanswered")
        assert session.runs.view().title == "Pepper (“Pepper”) did not answer"
        assert thief.heard("stop")
        session.runs.confirm_still()
        session.tick()  # 33 ms later nobody waits for the old one any more
        stop_is_proven(session)
    finally:
        thief.close()


def test_nor_of_one_that_a_person_moved(session: Session, master: Master, pepper: WireRobot) -> None:
    link = the_link(session)
    pepper.slow = {"say"}
    tried = session.fleet.invoke("Pepper", "say", {"text": "Hi"})
    tick_until(session, lambda: tried.state == "accepted")
    before = link.identity
    pepper._node.close()
    tick_until(session, lambda: not link.connected)
    thief = WireRobot(master.address)
    try:
        tick_until(session, lambda: link.connected and link.identity != before)
        tick_until(session, lambda: session.stopper is not None and session.stopper.robots)
        # the second that it has for its answer is not to go by while the new connection is made
        tick_until(session, lambda: thief._answer.subscribers)
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "unanswered")
        session.runs.confirm_still()
        session.tick()
        stop_is_proven(session)
    finally:
        thief.close()


@pytest.mark.parametrize("leaf", ["command", "answer", "world"])
def test_a_robot_may_not_name_the_topics_of_another_its_own(
    session: Session, pepper: WireRobot, evil: nep.Node, leaf: str
) -> None:
    the_link(session)
    announce(evil, "/Evil/description", description("Evil", **{leaf: f"/Pepper/{leaf}"}))
    assert "which belongs to Pepper" in claimed(session, "/Evil/description")
    assert session.fleet.link("Evil") is None


def test_nor_before_the_other_is_there(session: Session, master: Master, evil: nep.Node) -> None:
    announce(evil, "/Evil/description", description("Evil", command="/Pepper/command"))
    evil_link = the_link(session, "Evil")
    pepper = WireRobot(master.address)
    try:
        link = the_link(session)
        tick_until(session, lambda: not evil_link.connected)
        assert "which belongs to Pepper" in claimed(session, "/Evil/description")
        assert link.connected
    finally:
        pepper.close()


def test_a_changed_description_moves_what_is_sent_to_the_new_topic(session: Session, evil: nep.Node) -> None:
    announcement = announce(evil, "/Pepper/description", description())
    link = the_link(session)
    old, new = [], []
    evil.new_sub("/Pepper/command", sink=lambda messages: old.extend(_payloads(messages)))
    evil.new_sub("/Pepper/orders", sink=lambda messages: new.extend(_payloads(messages)))
    tick_until(session, lambda: link.publisher is not None and link.publisher.subscribers)
    announcement.publish(description("Pepper", command="/Pepper/orders"))
    tick_until(session, lambda: link.publisher is not None and link.publisher.topic == "/Pepper/orders")
    session.fleet.invoke("Pepper", "say", {"text": "Hi"})
    tick_until(session, lambda: any(command["op"] == "invoke" for command in new))
    assert not any(command["op"] == "invoke" for command in old)
    tick_until(session, lambda: session.stopper is not None and session.stopper.robots)
    session.runs.stop()  # goes to both
    tick_until(session, lambda: any(command["op"] == "stop" for command in old))
    tick_until(session, lambda: any(command["op"] == "stop" for command in new))
    tick_until(session, lambda: session.runs.view().state == "unanswered")


# ---- the tables have bounds ----------------------------------------------------------------------------


def _view(topics: Mapping[str, int]) -> GraphView:
    node = NodeInfo("n", "many", "here", 1, "python", "native", 0)

    def publisher(id: int) -> PublisherInfo:
        return PublisherInfo(id, "n", ("tcp://127.0.0.1:1",), True, 0, 0, 0, None, None, None)

    infos = {
        topic: TopicInfo(topic, DESCRIPTION_TYPE, "json", (publisher(id),)) for topic, id in topics.items()
    }
    return GraphView(1, 1, {"n": node}, infos)


def test_a_flood_of_robots_is_bounded_and_told() -> None:
    opened: list[str] = []
    announcements = Announcements(Watches(opened.append, opened.remove), Senders())
    announcements.update(_view({f"/r{number}/description": number + 1 for number in range(1000)}))
    assert len(opened) == MOST_ROBOTS
    assert announcements.claims["robots"].title.startswith("800 more robots")
    announcements.update(_view({"/new/description": 5000}))
    assert opened == ["/new/description"]
    assert announcements.is_announced("/new/description")
    assert not announcements.claims


def _two_programs(*announcing: str) -> GraphView:
    """A graph in which these of the nodes "first" and "second" announce Pepper, in this order."""
    ids = {"first": 1, "second": 2, **{f"crowd {number}": number for number in range(10, 30)}}
    nodes = {name: NodeInfo(name, name, "here", ids[name], "python", "native", 0) for name in announcing}
    publishers = tuple(
        PublisherInfo(ids[name], name, ("tcp://127.0.0.1:1",), True, 0, 0, 0, None, None, None)
        for name in announcing
    )
    topic = "/Pepper/description"
    return GraphView(1, 1, nodes, {topic: TopicInfo(topic, DESCRIPTION_TYPE, "json", publishers)})


def _said_by(publisher: int) -> Batch:
    payload = json.dumps(description()).encode()
    topic = "/Pepper/description"
    return Batch([nep.Message(topic, payload, "json", DESCRIPTION_TYPE, publisher=publisher)])


@pytest.mark.parametrize("crowd", [0, 20])
def test_a_robot_that_slept_while_another_had_its_name_is_there_again(crowd: int) -> None:
    """Its latched description came once, over a connection that lasts; nobody sends it again."""
    opened: list[str] = []
    announcements = Announcements(Watches(opened.append, opened.remove), Senders())
    announcements.update(_two_programs("first"))
    announcements.add({"/Pepper/description": _said_by(1)})
    assert [identity.node_id for _, _, identity in announcements.robots] == ["first"]
    others = [f"crowd {number}" for number in range(10, 10 + crowd)]
    announcements.update(_two_programs("first", "second", *others))
    announcements.update(_two_programs("second", *others))
    for publisher in (2, *range(10, 10 + crowd)):
        announcements.add({"/Pepper/description": _said_by(publisher)})
    assert [identity.node_id for _, _, identity in announcements.robots] == ["second"]
    announcements.update(_two_programs("second", "first"))
    announcements.update(_two_programs("first"))
    assert [identity.node_id for _, _, identity in announcements.robots] == ["first"]


def test_what_one_program_said_wrongly_is_not_held_against_the_next() -> None:
    opened: list[str] = []
    announcements = Announcements(Watches(opened.append, opened.remove), Senders())
    announcements.update(_two_programs("first"))
    payload = json.dumps(description("Turtle")).encode()  # on the topic of Pepper
    wrong = nep.Message("/Pepper/description", payload, "json", DESCRIPTION_TYPE, publisher=1)
    announcements.add({"/Pepper/description": Batch([wrong])})
    assert "/Pepper/description" in announcements.claims
    announcements.update(_two_programs("second"))  # it has said nothing yet
    assert not announcements.claims


def test_a_robot_that_slept_is_there_again_though_somebody_else_kept_its_topic_subscribed() -> None:
    opened: list[str] = []
    watches = Watches(opened.append, opened.remove)
    announcements = Announcements(watches, Senders())
    announcements.update(_two_programs("first"))
    announcements.add({"/Pepper/description": _said_by(1)})
    watches.open(["/Pepper/description"])  # a panel that shows the topic
    announcements.update(GraphView(1, 2))
    assert list(announcements.robots) == []
    announcements.update(_two_programs("first"))
    assert [identity.node_id for _, _, identity in announcements.robots] == ["first"]


def test_a_description_that_cant_be_used_is_told_and_what_was_said_before_counts(
    session: Session, pepper: WireRobot, evil: nep.Node
) -> None:
    the_link(session)
    wrong = description("Rover")
    wrong["actions"] = {"do it": {}}
    described = announce(evil, "/Rover/description", wrong)
    said = claimed(session, "/Rover/description")
    assert "The description of 'Rover' can't be used: actions" in said
    assert "It comes from “evil” on" in said
    assert "before" not in said
    described.publish(description("Rover"))
    tick_until(session, lambda: not session.alerts.has("claim:/Rover/description"))
    the_link(session, "Rover")
    described.publish(wrong)
    assert "What it said before still counts." in claimed(session, "/Rover/description")
    assert session.fleet.link("Rover").connected


def test_descriptions_that_come_again_and_again_take_a_fifth_of_the_window_at_most() -> None:
    """And whoever has just come is read before those who repeat themselves."""
    clock = Clock()
    announcements = Announcements(Watches(len, len), Senders(), clock)
    topics = {"/Pepper/description": 1, "/Again/description": 2}
    announcements.update(_view(topics))
    reads: list[str] = []

    def parse(topic: str, newest: nep.Message) -> None:
        reads.append(topic)
        announcements._topics[topic].parsed = newest
        clock.now += 0.5

    announcements._parse = parse  # the real one takes as long as the machine likes
    for tick in range(1000):
        again = nep.Message("/Again/description", b"x", "json", DESCRIPTION_TYPE, publisher=2)
        announcements.add({"/Again/description": Batch([again])})
        if tick == 500:
            announcements.add({"/Pepper/description": _said_by(1)})
        clock.now += 0.033
    assert "/Pepper/description" in reads
    assert 0.1 < 0.5 * len(reads) / clock.now < 0.25


def test_senders_do_not_believe_who_takes_a_publishers_id() -> None:
    senders, view = Senders(), _view({"/Pepper/answer": 7})
    senders.learn(view, ["/Pepper/answer"])
    thief = NodeInfo("thief", "thief", "there", 2, "python", "native", 0)
    taken = PublisherInfo(7, "thief", (), False, 0, 0, 0, None, None, None)
    info = TopicInfo("/Pepper/answer", "robot/answer", "json", (taken,))
    message = nep.Message("/Pepper/answer", b"{}", "json", "robot/answer", publisher=7)
    senders.learn(
        GraphView(1, 2, {**view.nodes, "thief": thief}, {"/Pepper/answer": info}), ["/Pepper/answer"]
    )
    assert senders.node_of(message) == "n"
    senders.learn(GraphView(1, 3, {"thief": thief}, {"/Pepper/answer": info}), ["/Pepper/answer"])
    assert senders.node_of(message) == "thief"  # it is the only one that there is
    assert senders.node_of(nep.Message("/x", b"{}", "json", "json")) is None
