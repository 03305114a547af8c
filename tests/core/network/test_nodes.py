"""Tests of the list of nodes: their topics, and marks for new and vanished nodes."""

from __future__ import annotations

from msgspec.structs import replace

from app.core.network.nodes import GONE_DISPLAY_S, Nodes
from nep.protocol.graph_view import (
    GraphView,
    NodeInfo,
    PatternInfo,
    PublisherInfo,
    SubscriberInfo,
    TopicInfo,
)


def node(id: str, name: str = "", generation: str = "native", cpu: float | None = None) -> NodeInfo:
    return NodeInfo(id, name or f"{id}_driver", "lab", 7, "Python", generation, 5, cpu)


def topic(name: str, publishers: str = "", subscribers: str = "") -> TopicInfo:
    return TopicInfo(
        name, "json", "json",
        tuple(PublisherInfo(n, id, (), False, 0, 0, 0, None, None, None) for n, id in enumerate(publishers)),
        tuple(SubscriberInfo(n, id, 0, 0) for n, id in enumerate(subscribers)),
    )  # fmt: skip


def view(revision: int, nodes: list[NodeInfo], topics: list[TopicInfo] = []) -> GraphView:  # noqa: B006
    return GraphView(1, revision, {n.id: n for n in nodes}, {t.name: t for t in topics})


def test_node_lists_each_published_and_subscribed_topic_once() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a"), node("b")], [topic("/z", "a", "bb"), topic("/c", "a", "a")]), 0)
    a, b = nodes.get("a"), nodes.get("b")
    assert a is not None
    assert b is not None
    assert (a.published_topics, a.subscribed_topics) == (("/c", "/z"), ("/c",))
    assert (b.published_topics, b.subscribed_topics) == ((), ("/z",))
    assert (a.host, a.pid, a.language, a.generation, a.since_ns) == ("lab", 7, "Python", "native", 5)


def test_wildcard_subscriptions_are_listed_with_topics_of_the_node() -> None:
    nodes = Nodes()
    seen = view(1, [node("a")], [topic("/z", subscribers="a")])
    wide = PatternInfo(
        "/robot/*/camera", "image", (SubscriberInfo(7, "a", 0, 0), SubscriberInfo(8, "b", 0, 0))
    )
    nodes.update(replace(seen, patterns={wide.name: wide}), 0)
    found = nodes.get("a")
    assert found is not None
    assert found.subscribed_topics == ("/robot/*/camera", "/z")


def test_nodes_added_after_the_first_graph_are_marked_new_until_seen() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a")]), 0)
    nodes.update(view(2, [node("a"), node("b")]), 1)
    assert [each.is_new for each in nodes] == [False, True]
    before = nodes.revision
    nodes.mark_seen("b")
    nodes.mark_seen("b")
    assert [each.is_new for each in nodes] == [False, False]
    assert nodes.revision == before + 1


def test_cpu_load_update_keeps_the_revision_of_the_node_list() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a")]), 0)
    before = nodes.revision
    nodes.update(view(1, [node("a", cpu=0.5)]), 1)
    assert [each.cpu_ratio for each in nodes] == [0.5]
    assert nodes.revision == before


def test_removed_node_stays_listed_for_ten_seconds_with_its_topics() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a", cpu=0.2)], [topic("/x", "a")]), 0)
    nodes.update(view(2, []), 5)
    nodes.update_ages(9)
    (gone,) = nodes
    assert (gone.gone_s, gone.published_topics, gone.cpu_ratio) == (4, ("/x",), None)
    nodes.update_ages(5 + GONE_DISPLAY_S)
    assert len(nodes) == 0


def test_restarted_program_replaces_its_removed_node() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a", "arm"), node("b", "arm2")]), 0)
    nodes.update(view(2, []), 1)
    nodes.update(view(3, [node("c", "arm")]), 2)
    assert [(each.id, each.gone_s is not None) for each in nodes] == [("b", True), ("c", False)]


def test_reappearing_node_is_live_again() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a")]), 0)
    nodes.update(view(2, []), 1)
    nodes.update(view(3, [node("a")]), 2)
    nodes.update_ages(30)
    (back,) = nodes
    assert (back.gone_s, back.is_new) == (None, False)


def test_gateway_is_hidden_and_original_nodes_are_marked() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("g", generation="gateway"), node("o", generation="A"), node("n")]), 0)
    assert [(each.id, each.is_original) for each in nodes] == [("o", True), ("n", False)]
