"""Navigation with arrow keys: along the lines from node to node, and up and down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from app.core.graph.layout import GraphLayout, Place
from app.core.graph.node_graph import GraphLine, NodeGraph

Arrow = Literal["left", "right", "up", "down"]


@dataclass(frozen=True, slots=True)
class GraphChoice:
    """Selection in the graph: the node or topic with this ``key``.

    Attributes:
        origin: Node from which a topic was selected.
        is_outward: True if the topic leads away from `origin`.
    """

    kind: Literal["node", "topic"]
    key: str
    origin: str = ""
    is_outward: bool = True


def step(
    graph: NodeGraph, layout: GraphLayout, chosen: GraphChoice | None, arrow: Arrow
) -> GraphChoice | None:
    """Return the selection after an arrow key was pressed.

    Right goes from a node to an outgoing line and on to its target; left goes against the direction of the
    lines. Up and down go to the next line of the same node, or to the next node above or below. The selection
    is unchanged if nothing follows, and None in an empty graph.
    """
    if chosen is None or not _exists(graph, layout, chosen):
        first = min(layout.places, key=lambda key: (layout.places[key], key), default=None)
        return GraphChoice("node", first) if first is not None else None
    if chosen.kind == "node":
        return _from_node(graph, layout, chosen, arrow)
    return _from_line(graph, layout, chosen, arrow)


def _exists(graph: NodeGraph, layout: GraphLayout, chosen: GraphChoice) -> bool:
    if chosen.kind == "node":
        return chosen.key in layout.places
    return graph.line_of(chosen.key) is not None


def _from_node(graph: NodeGraph, layout: GraphLayout, chosen: GraphChoice, arrow: Arrow) -> GraphChoice:
    if arrow in {"up", "down"}:
        return GraphChoice("node", _beside(layout, chosen.key, arrow))
    lines = _lines_at(graph, layout, chosen.key, outward=arrow == "right")
    if not lines:
        return chosen
    return GraphChoice("topic", lines[0].topics[0], chosen.key, arrow == "right")


def _from_line(graph: NodeGraph, layout: GraphLayout, chosen: GraphChoice, arrow: Arrow) -> GraphChoice:
    line = graph.line_of(chosen.key)
    if line is None:
        return chosen
    if arrow in {"left", "right"}:
        ends = line.targets if arrow == "right" else line.sources
        near = layout.places.get(chosen.origin)
        goes_on = chosen.is_outward is (arrow == "right")
        if not goes_on and chosen.origin in ends:
            return GraphChoice("node", chosen.origin)
        there = [key for key in ends if key in layout.places and key != chosen.origin]
        return GraphChoice("node", _nearest(layout, there, near)) if there else chosen
    ends = line.sources if chosen.is_outward else line.targets
    origin = chosen.origin if chosen.origin in ends else ends[0]
    lines = _lines_at(graph, layout, origin, outward=chosen.is_outward)
    topics = [topic for each in lines for topic in each.topics]
    at = topics.index(chosen.key) + (1 if arrow == "down" else -1)
    at = min(max(at, 0), len(topics) - 1)
    return GraphChoice("topic", topics[at], origin, chosen.is_outward)


def _lines_at(graph: NodeGraph, layout: GraphLayout, key: str, *, outward: bool) -> list[GraphLine]:
    # Outgoing or incoming lines of a node, uppermost first.
    def height(line: GraphLine) -> tuple[float, tuple[str, ...]]:
        others = line.targets if outward else line.sources
        levels = [layout.places[each][1] for each in others if each in layout.places]
        return (sum(levels) / len(levels) if levels else 0.0), line.topics

    lines = [line for line in graph.lines if key in (line.sources if outward else line.targets)]
    return sorted(lines, key=height)


def _nearest(layout: GraphLayout, keys: list[str], near: Place | None) -> str:
    x, y = near if near is not None else layout.places[keys[0]]
    return min(keys, key=lambda key: (abs(layout.places[key][0] - x) + abs(layout.places[key][1] - y), key))


def _beside(layout: GraphLayout, key: str, arrow: Arrow) -> str:
    # Prefers the same column to a small distance; itself when there is none.
    x, y = layout.places[key]
    way = 1 if arrow == "down" else -1
    others = {
        other: (abs(at[0] - x) * 3 + (at[1] - y) * way)
        for other, at in layout.places.items()
        if (at[1] - y) * way > 1
    }
    return min(others, key=lambda other: (others[other], other), default=key)
