from __future__ import annotations

from dataclasses import replace as with_changes

import pytest
from msgspec.structs import replace

from app.core.graph.node_graph import (
    WEB_GROUP,
    GraphInput,
    GraphOptions,
    GroupBy,
    NodeGraph,
    node_graph,
)
from app.core.network.nodes import Nodes
from app.core.network.topics import Topics
from app.core.network.web_texts import PageNode
from nep.protocol.graph_view import (
    BRIDGES_TOPIC,
    ClientInfo,
    GraphView,
    NodeInfo,
    PatternInfo,
    PublisherInfo,
    ServerInfo,
    ServiceInfo,
    SubscriberInfo,
    TopicInfo,
)

HERE, THERE = "lab-pc", "pepper"


def node(id: str, name: str, host: str = HERE, generation: str = "native") -> NodeInfo:
    return NodeInfo(id, name, host, 1, "Python", generation, int(id, 16))


def topic(name: str, by: str, to: str = "", codec: str = "json", endpoint: str = "") -> TopicInfo:
    ends = (endpoint,) if endpoint else ()
    return TopicInfo(
        name,
        codec,
        codec,
        tuple(PublisherInfo(n, id, ends, False, 5, 50, 5, None, 2.0, 40.0) for n, id in enumerate(by)),
        tuple(SubscriberInfo(n, id, 5, 0) for n, id in enumerate(to)),
        rate_hz=2.0,
        bandwidth_Bps=40.0,
    )


NODES = (
    node("1", "pepper_driver", THERE),
    node("2", "blackboard"),
    node("3", "program greeting"),
    node("4", "studio"),
    node("5", "RIZE", HERE, "B"),
    node("6", "bridge-lab-to-ros2"),
)
TOPICS = (
    topic("/Pepper/touch", "1", "2", endpoint="tcp://192.168.1.24:40001"),
    topic("/Pepper/odom", "1", "2"),
    topic("/blackboard", "2", "346"),
    topic("robot_action", "35", "1"),
    topic("/nep/log", "123456", "4"),
    topic(BRIDGES_TOPIC, "6"),
    topic("/alone", "2"),
    topic("/echo", "2", "2"),
)
SERVICES = (
    ServiceInfo("remember_face", "", (ServerInfo(1, "2", (), 3, 0, 9),), (ClientInfo(1, "4", 3, 0),), 3, 0),
    ServiceInfo("/nep/parameters/1", "", (ServerInfo(2, "1", (), 3, 0, 9),), (ClientInfo(2, "4", 3, 0),)),
)


def facts(
    nodes: tuple[NodeInfo, ...] = NODES,
    topics: tuple[TopicInfo, ...] = TOPICS,
    patterns: tuple[PatternInfo, ...] = (),
) -> GraphInput:
    view = GraphView(
        1,
        1,
        {each.id: each for each in nodes},
        {each.name: each for each in topics},
        services={each.name: each for each in SERVICES},
        patterns={each.name: each for each in patterns},
    )
    known, heard = Nodes(), Topics(own_process=("nobody", 0))
    known.update(view, 0.0)
    heard.update(view, 0.0)
    return GraphInput([*known], [*heard], view.services, ["Pepper"], HERE)


def lines(graph: NodeGraph) -> dict[tuple[str, ...], tuple[str, str]]:
    names = {each.key: each.name for each in graph.nodes}
    return {
        line.topics: (
            "+".join(names[key] for key in line.sources),
            "+".join(names[key] for key in line.targets),
        )
        for line in graph.lines
    }


def test_lines_connect_publishers_with_subscribers_and_clients_with_servers() -> None:
    graph = node_graph(facts(), GraphOptions())
    assert lines(graph) == {
        ("/Pepper/odom", "/Pepper/touch"): ("pepper_driver", "blackboard"),
        ("/blackboard",): ("blackboard", "bridge-lab-to-ros2+greeting+studio"),
        ("robot_action",): ("RIZE+greeting", "pepper_driver"),
        ("remember_face",): ("studio", "blackboard"),
    }
    assert (graph.node_count, graph.topic_count, graph.service_count) == (6, 4, 1)


def test_node_kinds_and_names_are_determined() -> None:
    graph = node_graph(facts(), GraphOptions())
    assert {each.name: (each.kind, each.bridged_network) for each in graph.nodes} == {
        "pepper_driver": ("program", ""),
        "blackboard": ("program", ""),
        "greeting": ("behaviour", ""),
        "studio": ("studio", ""),
        "RIZE": ("original", ""),
        "bridge-lab-to-ros2": ("bridge", "ROS 2"),
    }


def test_nodes_are_grouped_by_computer_with_address_or_by_robot_or_left_ungrouped() -> None:
    found = facts()
    by_computer = node_graph(found, GraphOptions()).groups
    assert [(each.key, each.address, each.member_count) for each in by_computer] == [
        ("host:lab-pc", "", 5),
        ("host:pepper", "192.168.1.24", 1),
    ]
    by_robot = node_graph(found, GraphOptions(group_by="robot"))
    assert [(each.key, each.icon, each.member_count) for each in by_robot.groups] == [
        ("robot:", "box", 5),
        ("robot:Pepper", "bot", 1),
    ]
    assert node_graph(found, GraphOptions(group_by="nothing")).groups == ()


@pytest.mark.parametrize(
    "endpoint",
    ["", "tcp://127.0.0.1:4", "ipc:///tmp/x", "tcp://[::1", "rubbish", "tcp://0.0.0.0:1", "tcp://:1"],
)
def test_local_wildcard_or_invalid_endpoint_is_not_shown_as_address(endpoint: str) -> None:
    graph = node_graph(facts(topics=(topic("/a", "1", "2", endpoint=endpoint),)), GraphOptions())
    assert {each.address for each in graph.groups} == {""}


def test_internal_topics_and_services_are_drawn_on_request() -> None:
    choices = GraphOptions(shows_internal=True)
    found = lines(node_graph(facts(), choices))
    assert ("/nep/log",) in found
    assert ("/nep/parameters/1",) in found
    assert ("remember_face",) not in lines(node_graph(facts(), with_changes(choices, shows_services=False)))


def test_collapsed_group_is_one_box_with_all_lines_of_its_nodes() -> None:
    graph = node_graph(facts(), GraphOptions(toggled_groups=frozenset({"host:lab-pc"})))
    assert {(each.kind, each.key, each.member_count) for each in graph.nodes} == {
        ("group", "host:lab-pc", 5),
        ("program", "|pepper|pepper_driver", 1),
    }
    assert {line.topics for line in graph.lines} == {("/Pepper/odom", "/Pepper/touch"), ("robot_action",)}
    again = node_graph(
        facts(), GraphOptions(starts_collapsed=True, toggled_groups=frozenset({"host:pepper"}))
    )
    assert again == graph


def test_quiet_nodes_are_hidden_and_counted_until_their_group_shows_them() -> None:
    choices = GraphOptions(quiet_nodes=frozenset({"4", "5"}))
    graph = node_graph(facts(), choices)
    assert {each.name for each in graph.nodes} == {
        "pepper_driver", "blackboard", "greeting", "bridge-lab-to-ros2",
    }  # fmt: skip
    assert graph.hidden_quiet_count == 2
    assert [each.quiet_count for each in graph.groups] == [2, 0]
    shown = node_graph(
        facts(), with_changes(choices, groups_with_visible_quiet_nodes=frozenset({"host:lab-pc"}))
    )
    assert {each.name for each in shown.nodes if each.is_quiet} == {"studio", "RIZE"}
    assert node_graph(facts(), with_changes(choices, hides_quiet=False)).hidden_quiet_count == 0


def test_group_of_only_quiet_nodes_stays_visible() -> None:
    graph = node_graph(facts(), GraphOptions(quiet_nodes=frozenset({"1"})))
    box = graph.node("host:pepper")
    assert box is not None
    assert (box.kind, box.member_count, box.quiet_count) == ("group", 1, 1)


def test_restarted_node_keeps_its_key_and_duplicate_name_gets_another_key() -> None:
    first = node_graph(facts(), GraphOptions())
    restarted = tuple(replace(each, id="99") if each.name == "blackboard" else each for each in NODES)
    second = node_graph(facts(restarted, ()), GraphOptions())
    assert {each.key for each in first.nodes} == {each.key for each in second.nodes}
    twins = node_graph(facts((*NODES, node("77", "blackboard")), ()), GraphOptions())
    keys = [each.key for each in twins.nodes if each.name == "blackboard"]
    assert sorted(keys) == ["|lab-pc|blackboard", "|lab-pc|blackboard|2"]


def test_wildcard_subscriber_is_connected_to_all_matching_topics() -> None:
    wide = PatternInfo("/Pepper/*", "json", (SubscriberInfo(9, "5", 1, 0),))
    found = lines(node_graph(facts(patterns=(wide,)), GraphOptions()))
    assert found["/Pepper/odom", "/Pepper/touch"] == ("pepper_driver", "RIZE+blackboard")


@pytest.mark.parametrize("group_by", ["computer", "robot"])
def test_web_pages_are_grouped_and_titled_by_the_web_server(group_by: GroupBy) -> None:
    pages = (
        replace(node("7", "web_lab:8080_50001"), language="web"),
        replace(node("8", "web_lab:8080_50002"), language="web"),
    )
    known = {"web_lab:8080_50001": PageNode("buttons.html", "192.168.1.52, Safari", "tablet")}
    graph = node_graph(with_changes(facts((*NODES, *pages)), pages=known), GraphOptions(group_by=group_by))
    drawn = [(each.name, each.page) for each in graph.nodes if each.kind == "page"]
    assert drawn == [("buttons.html", known["web_lab:8080_50001"]), ("lab:8080_50002", None)]
    (group,) = [each for each in graph.groups if each.key == WEB_GROUP]
    assert (group.icon, group.member_count, graph.page_count) == ("globe", 2, 2)


def test_empty_network_data_gives_an_empty_graph() -> None:
    assert node_graph(GraphInput(), GraphOptions()) == NodeGraph()


def test_topic_of_unknown_node_has_no_line() -> None:
    graph = node_graph(facts(topics=(topic("/ghost", "89", "2"),)), GraphOptions())
    assert graph.topic_count == 0
