"""Tests of who is a robot: owners of announcements, limits of the tables, and publishers of nodes."""

from __future__ import annotations

import json
from collections.abc import Mapping

import pytest

import nep
from app.core.network.mailbox import Batch
from app.core.network.watches import Watches
from app.robots.client.announcements import Announcements, RizeNames
from app.robots.client.inbox import Senders
from app.robots.client.limits import MAX_ROBOTS
from app.robots.identity import DESCRIPTION_TYPE
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo
from tests.robots.message_senders import described


class Clock:
    """Fake clock that advances only when a test sets it."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def _view(topics: Mapping[str, int]) -> GraphView:
    node = NodeInfo("n", "many", "here", 1, "python", "native", 0)

    def publisher(id: int) -> PublisherInfo:
        return PublisherInfo(id, "n", ("tcp://127.0.0.1:1",), True, 0, 0, 0, None, None, None)

    infos = {
        topic: TopicInfo(topic, DESCRIPTION_TYPE, "json", (publisher(id),)) for topic, id in topics.items()
    }
    return GraphView(1, 1, {"n": node}, infos)


def test_number_of_announced_robots_is_limited_and_reported() -> None:
    opened: list[str] = []
    announcements = Announcements(Watches(opened.append, opened.remove), Senders())
    announcements.update(_view({f"/r{number}/description": number + 1 for number in range(1000)}))
    assert len(opened) == MAX_ROBOTS
    assert announcements.claims["robots"].title.startswith("800 more robots")
    announcements.update(_view({"/new/description": 5000}))
    assert opened == ["/new/description"]
    assert announcements.is_announced("/new/description")
    assert not announcements.claims


def _two_programs(*announcing: str) -> GraphView:
    """Return a graph in which these nodes announce Pepper, in this order."""
    ids = {"first": 1, "second": 2, **{f"crowd {number}": number for number in range(10, 30)}}
    nodes = {name: NodeInfo(name, name, "here", ids[name], "python", "native", 0) for name in announcing}
    publishers = tuple(
        PublisherInfo(ids[name], name, ("tcp://127.0.0.1:1",), True, 0, 0, 0, None, None, None)
        for name in announcing
    )
    topic = "/Pepper/description"
    return GraphView(1, 1, nodes, {topic: TopicInfo(topic, DESCRIPTION_TYPE, "json", publishers)})


def _said_by(publisher: int) -> Batch:
    payload = json.dumps(described()).encode()
    topic = "/Pepper/description"
    return Batch([nep.Message(topic, payload, "json", DESCRIPTION_TYPE, publisher=publisher)])


@pytest.mark.parametrize("crowd", [0, 20])
def test_robot_returns_after_another_program_used_its_name(crowd: int) -> None:
    """The latched description was sent once, on a connection that still exists; it isn't sent again."""
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


def test_invalid_description_of_one_program_does_not_block_the_next() -> None:
    opened: list[str] = []
    announcements = Announcements(Watches(opened.append, opened.remove), Senders())
    announcements.update(_two_programs("first"))
    payload = json.dumps(described("Turtle")).encode()  # another robot, on the topic of Pepper
    wrong = nep.Message("/Pepper/description", payload, "json", DESCRIPTION_TYPE, publisher=1)
    announcements.add({"/Pepper/description": Batch([wrong])})
    assert "/Pepper/description" in announcements.claims
    announcements.update(_two_programs("second"))  # the second program has published nothing yet
    assert not announcements.claims


def test_robot_that_left_the_graph_returns_although_its_topic_stayed_subscribed() -> None:
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


def test_parsing_repeated_descriptions_uses_less_than_a_quarter_of_main_thread_time() -> None:
    """Descriptions of new publishers are parsed before repeated ones."""
    clock = Clock()
    announcements = Announcements(Watches(len, len), Senders(), clock)
    topics = {"/Pepper/description": 1, "/Again/description": 2}
    announcements.update(_view(topics))
    reads: list[str] = []

    def parse(topic: str, newest: nep.Message) -> None:
        reads.append(topic)
        announcements._topics[topic].parsed_message = newest
        clock.now += 0.5

    announcements._parse = parse  # with a fixed duration, unlike the real parser
    for tick in range(1000):
        again = nep.Message("/Again/description", b"x", "json", DESCRIPTION_TYPE, publisher=2)
        announcements.add({"/Again/description": Batch([again])})
        if tick == 500:
            announcements.add({"/Pepper/description": _said_by(1)})
        clock.now += 0.033
    assert "/Pepper/description" in reads
    assert 0.1 < 0.5 * len(reads) / clock.now < 0.25


def test_reused_publisher_id_is_not_trusted_while_its_first_node_exists() -> None:
    senders, view = Senders(), _view({"/Pepper/answer": 7})
    senders.update(view, ["/Pepper/answer"])
    thief = NodeInfo("thief", "thief", "there", 2, "python", "native", 0)
    taken = PublisherInfo(7, "thief", (), False, 0, 0, 0, None, None, None)
    info = TopicInfo("/Pepper/answer", "robot/answer", "json", (taken,))
    message = nep.Message("/Pepper/answer", b"{}", "json", "robot/answer", publisher=7)
    senders.update(
        GraphView(1, 2, {**view.nodes, "thief": thief}, {"/Pepper/answer": info}), ["/Pepper/answer"]
    )
    assert senders.node_of(message) == "n"
    senders.update(GraphView(1, 3, {"thief": thief}, {"/Pepper/answer": info}), ["/Pepper/answer"])
    assert senders.node_of(message) == "thief"  # the only program left
    assert senders.node_of(nep.Message("/x", b"{}", "json", "json")) is None


def test_number_of_rize_robot_names_is_limited() -> None:
    names = RizeNames()
    for number in range(1000):
        names.add(f"Robot{number}")
    assert len(names._announced_names) <= MAX_ROBOTS
