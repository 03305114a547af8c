"""Tests of the console lines about nodes and topics that were added or removed."""

from __future__ import annotations

from app.core.network.graph_changes import MAX_LINES, change_messages
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo


def graph(**nodes: list[str]) -> GraphView:
    infos = {name: NodeInfo(name, name, "here", 1, "python", "native", 0) for name in nodes}
    topics: dict[str, TopicInfo] = {}
    for number, (name, published) in enumerate(nodes.items()):
        for topic in published:
            old = topics.get(topic, TopicInfo(topic, "json", "json"))
            publisher = PublisherInfo(number, name, (), False, 0, 0, 0, None, None, None)
            topics[topic] = TopicInfo(topic, "json", "json", (*old.publishers, publisher))
    return GraphView(1, 1, infos, topics)


def test_joining_robot_is_reported_in_one_line_with_topic_count() -> None:
    assert change_messages(graph(), graph(Pepper=["/a", "/b", "/c"])) == ["Pepper joined with 3 topics"]


def test_single_new_topic_is_named_with_publisher_count() -> None:
    assert change_messages(graph(one=[]), graph(one=["/a"])) == ["new topic /a (1 publisher)"]
    assert change_messages(graph(one=[], two=[]), graph(one=["/a"], two=["/a"])) == [
        "new topic /a (2 publishers)"
    ]


def test_joined_and_left_nodes_are_reported() -> None:
    assert change_messages(graph(one=["/a"]), graph(two=["/a"])) == ["two joined", "one left"]


def test_unchanged_graph_is_not_reported() -> None:
    assert change_messages(graph(one=["/a"]), graph(one=["/a"])) == []


def test_topic_without_publisher_is_not_reported_as_new() -> None:
    after = GraphView(1, 1, {}, {"/a": TopicInfo("/a", "json", "json")})
    assert change_messages(graph(), after) == []


def test_gateway_and_behaviour_programs_are_not_reported() -> None:
    assert change_messages(graph(), graph(**{"program Greeting": []})) == []
    gateway = NodeInfo("g", "gateway", "here", 1, "python", "gateway", 0)
    assert change_messages(graph(), GraphView(1, 1, {"g": gateway}, {})) == []


def test_internal_topics_and_master_log_node_are_not_reported() -> None:
    assert change_messages(graph(one=[]), graph(one=["/nep/log"])) == []
    assert change_messages(graph(), graph(master=["/nep/log"])) == []
    assert change_messages(graph(master=["/nep/log"]), graph()) == []
    assert change_messages(graph(), graph(one=["/nep/log"])) == ["one joined"]


def test_many_simultaneous_changes_are_reported_in_one_line_with_count() -> None:
    thousand = [f"/t{number:04}" for number in range(1000)]
    assert change_messages(graph(one=[]), graph(one=thousand)) == [
        "1000 new topics: /t0000, /t0001, /t0002 and 997 more"
    ]
    crowd: dict[str, list[str]] = {f"n{number}": [] for number in range(200)}
    assert change_messages(graph(), graph(**crowd)) == ["200 nodes joined: n0, n1, n2 and 197 more"]
    assert change_messages(graph(**crowd), graph()) == ["200 nodes left: n0, n1, n2 and 197 more"]


def test_few_simultaneous_changes_are_named_individually() -> None:
    few = [f"/t{number}" for number in range(MAX_LINES)]
    assert len(change_messages(graph(one=[]), graph(one=few))) == MAX_LINES
