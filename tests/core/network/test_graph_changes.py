"""The console's lines about who came and who left."""

from __future__ import annotations

from app.core.network.graph_changes import MAX_LINES, arrivals
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


def test_a_robot_is_one_line_not_one_for_each_topic() -> None:
    assert arrivals(graph(), graph(Pepper=["/a", "/b", "/c"])) == ["Pepper joined with 3 topics"]


def test_a_single_topic_is_named_with_its_publishers() -> None:
    assert arrivals(graph(one=[]), graph(one=["/a"])) == ["/a is new, 1 publisher"]
    assert arrivals(graph(one=[], two=[]), graph(one=["/a"], two=["/a"])) == ["/a is new, 2 publishers"]


def test_a_node_without_new_topics_and_one_that_left() -> None:
    assert arrivals(graph(one=["/a"]), graph(two=["/a"])) == ["two joined", "one left"]


def test_nothing_new_is_no_line() -> None:
    assert arrivals(graph(one=["/a"]), graph(one=["/a"])) == []


def test_a_topic_that_nobody_publishes_is_not_new() -> None:
    after = GraphView(1, 1, {}, {"/a": TopicInfo("/a", "json", "json")})
    assert arrivals(graph(), after) == []


def test_the_gateway_and_a_behaviours_program_are_told_elsewhere() -> None:
    assert arrivals(graph(), graph(**{"program Greeting": []})) == []
    gateway = NodeInfo("g", "gateway", "here", 1, "python", "gateway", 0)
    assert arrivals(graph(), GraphView(1, 1, {"g": gateway}, {})) == []


def test_what_nep_itself_publishes_and_who_logs_for_the_master_are_not_told() -> None:
    assert arrivals(graph(one=[]), graph(one=["/nep/log"])) == []
    assert arrivals(graph(), graph(master=["/nep/log"])) == []
    assert arrivals(graph(master=["/nep/log"]), graph()) == []
    assert arrivals(graph(), graph(one=["/nep/log"])) == ["one joined"]


def test_many_at_once_are_one_line_with_their_number() -> None:
    thousand = [f"/t{number:04}" for number in range(1000)]
    assert arrivals(graph(one=[]), graph(one=thousand)) == [
        "1000 new topics: /t0000, /t0001, /t0002 and 997 more"
    ]
    crowd: dict[str, list[str]] = {f"n{number}": [] for number in range(200)}
    assert arrivals(graph(), graph(**crowd)) == ["200 nodes joined: n0, n1, n2 and 197 more"]
    assert arrivals(graph(**crowd), graph()) == ["200 nodes left: n0, n1, n2 and 197 more"]


def test_a_few_at_once_are_named_each() -> None:
    few = [f"/t{number}" for number in range(MAX_LINES)]
    assert len(arrivals(graph(one=[]), graph(one=few))) == MAX_LINES
