from __future__ import annotations

import threading
from dataclasses import replace

import graphlay
import pytest

from app.core.graph import layout as layout_module
from app.core.graph.layout import MAX_ROUTES, GraphLayout, LayoutSizes, arrange
from app.core.graph.layout_thread import LayoutThread
from app.core.graph.node_graph import DrawnNode, GraphGroup, GraphLine, NodeGraph
from tests.nep.programs import eventually


def graph(groups: dict[str, str], pairs: str = "", *, quiet: int = 0) -> NodeGraph:
    """Return a graph of one-letter nodes.

    Args:
        groups: The letters of the nodes by group.
        pairs: Connections as pairs of letters, publisher first: ``ab cd``.
        quiet: Number of quiet nodes in each group.
    """
    nodes = [DrawnNode(key, key, group, "program") for group, keys in groups.items() for key in keys]
    made = [
        GraphGroup(group, group, "", "monitor", len(keys), quiet, False)
        for group, keys in groups.items()
        if group
    ]
    lines = [GraphLine("topic", (a,), (b,), (f"/{a}{b}",)) for a, b in pairs.split()]
    return NodeGraph(tuple(nodes), tuple(lines), tuple(made), len(nodes))


def overlapping(found: GraphLayout) -> list[tuple[str, str]]:
    boxes = [*found.groups.items()]
    return [
        (one, other)
        for number, (one, a) in enumerate(boxes)
        for other, b in boxes[number + 1 :]
        if a[0] < b[0] + b[2] and b[0] < a[0] + a[2] and a[1] < b[1] + b[3] and b[1] < a[1] + a[3]
    ]


LAB = graph({"g": "abcd", "h": "ef", "i": "x"}, "ab bc cd de ef fa xa ax")


def test_all_nodes_are_placed_inside_their_groups_without_overlap() -> None:
    found = arrange(LAB)
    assert found.positions.keys() == set("abcdefx")
    assert overlapping(found) == []
    for node in LAB.nodes:
        x, y = found.positions[node.key]
        left, top, wide, high = found.groups[node.group]
        assert left + 76 < x < left + wide - 76
        assert top + 24 + 30 < y < top + high - 24
    assert not found.is_fallback
    assert len({*found.positions.values()}) == 7


def test_lines_start_and_end_at_node_edges() -> None:
    found = arrange(LAB)
    assert found.routes.keys() == {(line.key, *line.key[1], *line.key[2]) for line in LAB.lines}
    for (_line, source, target), points in found.routes.items():
        for (x, y), key in ((points[0], source), (points[-1], target)):
            across, down = abs(x - found.positions[key][0]), abs(y - found.positions[key][1])
            assert across == pytest.approx(76, abs=1) or down == pytest.approx(24, abs=1)


def test_layout_is_deterministic() -> None:
    assert arrange(LAB) == arrange(LAB)


def test_node_positions_are_stable_when_nodes_join_and_leave() -> None:
    first = arrange(LAB)
    more = graph({"g": "abcdkm", "h": "ef", "i": "x", "j": "n"}, "ab bc cd de ef fa xa ax ak km na")
    second = arrange(more, first)
    assert all(second.positions[key] == first.positions[key] for key in "abcd")
    assert overlapping(second) == []
    assert "h" in second.groups
    fewer = arrange(graph({"g": "abkm", "h": "e", "j": "n"}, "ab ak"), second)
    assert all(fewer.positions[key] == second.positions[key] for key in "abkmen")
    back = arrange(more, fewer)
    assert all(back.positions[key] == second.positions[key] for key in "abcdefx")


def test_nodes_that_join_one_by_one_do_not_overlap() -> None:
    names = "abcdefghijklmnop"
    found = None
    for count in range(1, len(names) + 1):
        found = arrange(graph({"g": names[:count], "h": names[:count].upper()}, ""), found)
        assert overlapping(found) == []
    assert found is not None
    places = [*found.positions.values()]
    assert all(
        abs(a[0] - b[0]) >= 152 or abs(a[1] - b[1]) >= 48
        for number, a in enumerate(places)
        for b in places[number + 1 :]
    )


def test_mostly_new_graph_gets_a_new_layout() -> None:
    first = arrange(graph({"g": "a"}))
    second = arrange(graph({"g": "abcdef"}, "ab bc cd de ef"), first)
    xs = [second.positions[key][0] for key in "abcdef"]
    assert xs == sorted(xs)
    assert len({*xs}) == 6


def test_group_with_quiet_nodes_has_a_footer() -> None:
    plain, told = arrange(graph({"g": "a"})), arrange(graph({"g": "a"}, quiet=2))
    assert told.groups["g"][3] == plain.groups["g"][3] + LayoutSizes().footer


def test_empty_graph_and_single_node_have_a_layout() -> None:
    assert arrange(NodeGraph()) == GraphLayout()
    assert arrange(NodeGraph()).bounds(LayoutSizes()) == (0.0, 0.0, 0.0, 0.0)
    assert arrange(graph({"": "a"})).positions.keys() == {"a"}


def test_excess_lines_are_omitted_and_counted() -> None:
    keys = [f"n{number}" for number in range(120)]
    nodes = tuple(DrawnNode(key, key, "", "program") for key in keys)
    all_to_all = GraphLine("topic", tuple(keys), tuple(keys), ("/clock",))
    one = GraphLine("topic", ("n0",), ("n1",), ("/one",))
    found = arrange(NodeGraph(nodes, (all_to_all, one), (), 120))
    assert found.omitted_routes == 120 * 119
    assert found.omitted_routes > MAX_ROUTES
    assert [key[1:] for key in found.routes] == [("n0", "n1")]


@pytest.mark.parametrize("error", [graphlay.GraphlayError("no"), BaseException("a panic")])
def test_failed_layout_falls_back_to_rows_and_straight_lines(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, error: BaseException
) -> None:
    def fails(*_arguments: object, **_options: object) -> None:
        raise error

    monkeypatch.setattr(layout_module.graphlay, "layout", fails)
    found = arrange(LAB)
    assert found.is_fallback
    assert found.positions.keys() == set("abcdefx")
    assert overlapping(found) == []
    assert all(len(points) == 2 for points in found.routes.values())
    assert "layout library failed" in caplog.text
    monkeypatch.undo()
    placed = arrange(LAB)
    monkeypatch.setattr(layout_module.graphlay, "reroute", fails)
    straight = arrange(LAB, placed)
    assert straight.positions == placed.positions
    assert straight.routes.keys() == placed.routes.keys()


def test_larger_text_enlarges_the_layout() -> None:
    large = arrange(LAB, None, LayoutSizes().scaled(2.0))
    assert large.groups["i"][2] == pytest.approx(2 * arrange(LAB).groups["i"][2])
    assert overlapping(large) == []


# -- layout thread -------------------------------------------------------------------------------------------


def test_layout_thread_processes_only_the_newest_graph() -> None:
    began, go_on = threading.Event(), threading.Event()
    asked: list[int] = []

    def slow(wanted: NodeGraph, before: GraphLayout | None, sizes: LayoutSizes) -> GraphLayout:
        asked.append(wanted.node_count)
        began.set()
        assert go_on.wait(20)
        return arrange(wanted, before, sizes)

    thread = LayoutThread(slow)
    try:
        thread.submit(LAB, None, LayoutSizes())
        assert began.wait(20)
        for count in (8, 9):
            thread.submit(replace(LAB, node_count=count), None, LayoutSizes())
        assert thread.is_busy
        assert thread.pop_result() is None
        go_on.set()
        eventually(lambda: not thread.is_busy)
        made = thread.pop_result()
        assert made is not None
        assert made[0].node_count == 9
        assert asked == [7, 9]
        assert thread.pop_result() is None
    finally:
        thread.close()


def test_layout_thread_continues_after_error_and_closes_at_once(caplog: pytest.LogCaptureFixture) -> None:
    def fails(wanted: NodeGraph, before: GraphLayout | None, sizes: LayoutSizes) -> GraphLayout:
        if not wanted.nodes:
            raise ValueError("nothing")
        return arrange(wanted, before, sizes)

    thread = LayoutThread(fails)
    thread.submit(NodeGraph(), None, LayoutSizes())
    eventually(lambda: not thread.is_busy)
    thread.submit(LAB, None, LayoutSizes())
    eventually(lambda: thread.pop_result() is not None)
    thread.close()
    thread.submit(LAB, None, LayoutSizes())
    assert not thread.is_busy
    LayoutThread().close()
    assert "nothing" in caplog.text
