"""The nodes as the window shows them: who is there, what they do, who is new, who vanished."""

from __future__ import annotations

from dataclasses import replace

from app.core.network.nodes import GONE_SHOWN_S, Nodes
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


def test_a_node_has_what_it_publishes_and_subscribes_each_topic_once() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a"), node("b")], [topic("/z", "a", "bb"), topic("/c", "a", "a")]), 0)
    a, b = nodes.get("a"), nodes.get("b")
    assert a is not None
    assert b is not None
    assert (a.publishes, a.subscribes) == (("/c", "/z"), ("/c",))
    assert (b.publishes, b.subscribes) == ((), ("/z",))
    assert (a.host, a.pid, a.language, a.generation, a.since_ns) == ("lab", 7, "Python", "native", 5)


def test_what_a_node_subscribes_by_wildcards_stands_with_its_topics() -> None:
    nodes = Nodes()
    seen = view(1, [node("a")], [topic("/z", subscribers="a")])
    wide = PatternInfo(
        "/robot/*/camera", "image", (SubscriberInfo(7, "a", 0, 0), SubscriberInfo(8, "b", 0, 0))
    )
    nodes.update(replace(seen, patterns={wide.name: wide}), 0)
    found = nodes.get("a")
    assert found is not None
    assert found.subscribes == ("/robot/*/camera", "/z")


def test_nodes_of_the_first_graph_are_not_new_later_ones_are_until_looked_at() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a")]), 0)
    nodes.update(view(2, [node("a"), node("b")]), 1)
    assert [each.new for each in nodes] == [False, True]
    before = nodes.revision
    nodes.mark_seen("b")
    nodes.mark_seen("b")
    assert [each.new for each in nodes] == [False, False]
    assert nodes.revision == before + 1


def test_the_load_moves_without_a_new_revision_of_the_graph() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a")]), 0)
    before = nodes.revision
    nodes.update(view(1, [node("a", cpu=0.5)]), 1)
    assert [each.cpu_ratio for each in nodes] == [0.5]
    assert nodes.revision == before


def test_a_vanished_node_stays_ten_seconds_with_what_it_did() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a", cpu=0.2)], [topic("/x", "a")]), 0)
    nodes.update(view(2, []), 5)
    nodes.age(9)
    (gone,) = nodes
    assert (gone.gone_s, gone.publishes, gone.cpu_ratio) == (4, ("/x",), None)
    nodes.age(5 + GONE_SHOWN_S)
    assert len(nodes) == 0


def test_a_program_that_was_started_again_takes_the_place_of_its_gone_self() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a", "arm"), node("b", "arm2")]), 0)
    nodes.update(view(2, []), 1)
    nodes.update(view(3, [node("c", "arm")]), 2)
    assert [(each.id, each.gone_s is not None) for each in nodes] == [("b", True), ("c", False)]


def test_a_node_that_was_only_silent_is_there_again() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("a")]), 0)
    nodes.update(view(2, []), 1)
    nodes.update(view(3, [node("a")]), 2)
    nodes.age(30)
    (back,) = nodes
    assert (back.gone_s, back.new) == (None, False)


def test_the_gateway_is_left_out_and_originals_are_known_as_such() -> None:
    nodes = Nodes()
    nodes.update(view(1, [node("g", generation="gateway"), node("o", generation="A"), node("n")]), 0)
    assert [(each.id, each.is_original) for each in nodes] == [("o", True), ("n", False)]
