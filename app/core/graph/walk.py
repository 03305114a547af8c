"""Navigation in the graph with arrow keys: left and right along the lines, up and down between neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from app.core.graph.layout import GraphLayout, Position
from app.core.graph.node_graph import GraphLine, NodeGraph

Arrow = Literal["left", "right", "up", "down"]


@dataclass(frozen=True, slots=True)
class GraphSelection:
    """Selected node or topic of the graph.

    Attributes:
        key: Key of the node or topic.
        origin: Key of the node from which a topic was selected.
        is_outward: True if the line of the topic leads away from `origin`.
    """

    kind: Literal["node", "topic"]
    key: str
    origin: str = ""
    is_outward: bool = True


def move_selection(
    graph: NodeGraph, layout: GraphLayout, selection: GraphSelection | None, arrow: Arrow
) -> GraphSelection | None:
    """Return the selection after an arrow key was pressed.

    Right moves from a node to an outgoing line and on to its target; left moves against the direction
    of the lines. Up and down move to the next line of the same node, or to the node above or below. The
    selection is unchanged if there is nothing in that direction. Without a selection, or if the
    selected object no longer exists, the leftmost node is selected; None in an empty graph.
    """
    if selection is None or not _exists(graph, layout, selection):
        first = min(layout.positions, key=lambda key: (layout.positions[key], key), default=None)
        return GraphSelection("node", first) if first is not None else None
    if selection.kind == "node":
        return _step_from_node(graph, layout, selection, arrow)
    return _step_from_line(graph, layout, selection, arrow)


def _exists(graph: NodeGraph, layout: GraphLayout, selection: GraphSelection) -> bool:
    if selection.kind == "node":
        return selection.key in layout.positions
    return graph.line_of(selection.key) is not None


def _step_from_node(
    graph: NodeGraph, layout: GraphLayout, selection: GraphSelection, arrow: Arrow
) -> GraphSelection:
    if arrow in {"up", "down"}:
        return GraphSelection("node", _next_in_column(layout, selection.key, arrow))
    lines = _lines_at(graph, layout, selection.key, is_outward=arrow == "right")
    if not lines:
        return selection
    return GraphSelection("topic", lines[0].topics[0], selection.key, arrow == "right")


def _step_from_line(
    graph: NodeGraph, layout: GraphLayout, selection: GraphSelection, arrow: Arrow
) -> GraphSelection:
    line = graph.line_of(selection.key)
    if line is None:
        return selection
    if arrow in {"left", "right"}:
        end_keys = line.targets if arrow == "right" else line.sources
        origin_position = layout.positions.get(selection.origin)
        is_forward = selection.is_outward is (arrow == "right")
        if not is_forward and selection.origin in end_keys:
            return GraphSelection("node", selection.origin)
        reachable = [key for key in end_keys if key in layout.positions and key != selection.origin]
        return (
            GraphSelection("node", _nearest(layout, reachable, origin_position)) if reachable else selection
        )
    end_keys = line.sources if selection.is_outward else line.targets
    origin = selection.origin if selection.origin in end_keys else end_keys[0]
    lines = _lines_at(graph, layout, origin, is_outward=selection.is_outward)
    topics = [topic for each in lines for topic in each.topics]
    index = topics.index(selection.key) + (1 if arrow == "down" else -1)
    index = min(max(index, 0), len(topics) - 1)
    return GraphSelection("topic", topics[index], origin, selection.is_outward)


def _lines_at(graph: NodeGraph, layout: GraphLayout, key: str, *, is_outward: bool) -> list[GraphLine]:
    # Outgoing or incoming lines of a node, uppermost first.
    def sort_key(line: GraphLine) -> tuple[float, tuple[str, ...]]:
        end_keys = line.targets if is_outward else line.sources
        y_positions = [layout.positions[each][1] for each in end_keys if each in layout.positions]
        return (sum(y_positions) / len(y_positions) if y_positions else 0.0), line.topics

    lines = [line for line in graph.lines if key in (line.sources if is_outward else line.targets)]
    return sorted(lines, key=sort_key)


def _nearest(layout: GraphLayout, keys: list[str], reference: Position | None) -> str:
    x, y = reference if reference is not None else layout.positions[keys[0]]
    return min(
        keys, key=lambda key: (abs(layout.positions[key][0] - x) + abs(layout.positions[key][1] - y), key)
    )


def _next_in_column(layout: GraphLayout, key: str, arrow: Arrow) -> str:
    # Prefers the same column to a small distance; itself when there is none.
    x, y = layout.positions[key]
    direction = 1 if arrow == "down" else -1
    distances = {
        other: (abs(position[0] - x) * 3 + (position[1] - y) * direction)
        for other, position in layout.positions.items()
        if (position[1] - y) * direction > 1
    }
    return min(distances, key=lambda other: (distances[other], other), default=key)
