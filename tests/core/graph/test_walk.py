from __future__ import annotations

import pytest

from app.core.graph.layout import GraphLayout
from app.core.graph.node_graph import DrawnNode, GraphLine, NodeGraph
from app.core.graph.walk import Arrow, GraphSelection, move_selection

GRAPH = NodeGraph(
    tuple(DrawnNode(key, key, "", "program") for key in "abcd"),
    (
        GraphLine("topic", ("a",), ("b", "c"), ("/two", "/with")),
        GraphLine("topic", ("a",), ("d",), ("/three",)),
        GraphLine("topic", ("a", "d"), ("a", "d"), ("/both",)),
        GraphLine("service", ("c",), ("a",), ("ask",)),
    ),
)
PLACES = GraphLayout({"a": (0, 0), "b": (200, -100), "c": (200, 0), "d": (200, 100)})


def walked(begin: GraphSelection | None, *arrows: Arrow) -> list[str]:
    found = []
    for arrow in arrows:
        begin = move_selection(GRAPH, PLACES, begin, arrow)
        assert begin is not None
        found.append(begin.key)
    return found


def test_first_arrow_key_selects_the_leftmost_node() -> None:
    assert walked(None, "down") == ["a"]
    assert walked(GraphSelection("node", "gone"), "right") == ["a"]
    assert walked(GraphSelection("topic", "/gone", "a"), "right") == ["a"]
    assert move_selection(NodeGraph(), GraphLayout(), None, "right") is None


def test_right_key_follows_a_line_and_left_key_returns() -> None:
    assert walked(GraphSelection("node", "a"), "right", "right") == ["/two", "c"]
    assert walked(GraphSelection("node", "a"), "right", "left") == ["/two", "a"]
    assert walked(GraphSelection("node", "b"), "left", "left") == ["/two", "a"]
    assert walked(GraphSelection("node", "b"), "left", "right") == ["/two", "b"]
    assert walked(GraphSelection("node", "c"), "right", "right") == ["ask", "a"]


def test_up_and_down_keys_select_each_topic_of_a_node_once() -> None:
    at = GraphSelection("topic", "/two", "a")
    assert walked(at, "down", "down", "down", "down") == ["/with", "/both", "/three", "/three"]
    assert walked(at, "up") == ["/two"]


def test_up_and_down_keys_move_between_nodes() -> None:
    assert walked(GraphSelection("node", "b"), "down", "down", "down", "up") == ["c", "d", "d", "c"]


def test_node_without_lines_stays_selected() -> None:
    assert walked(GraphSelection("node", "b"), "right") == ["b"]


def test_bidirectional_line_leads_to_the_other_node() -> None:
    at = GraphSelection("topic", "/both", "a")
    assert walked(at, "right") == ["d"]
    assert walked(at, "left") == ["a"]


@pytest.mark.parametrize("arrow", ["left", "right", "up", "down"])
def test_arrow_keys_always_select_an_existing_element(arrow: Arrow) -> None:
    choices = [GraphSelection("node", key) for key in "abcd"]
    choices += [
        GraphSelection("topic", topic, origin, outward)
        for topic in ("/two", "/with", "/three", "/both", "ask")
        for origin in ("", "a", "b", "gone")
        for outward in (True, False)
    ]
    for choice in choices:
        found = move_selection(GRAPH, PLACES, choice, arrow)
        assert found is not None
        assert found.key in PLACES.positions or GRAPH.line_of(found.key) is not None
