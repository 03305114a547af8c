"""Layered layout of the graph. Nodes keep their positions when other nodes appear.

The graphlay library places nodes in layers with few crossings and routes lines around nodes. Positions
are computed once; later updates compute routes only. All lengths are pixels at 100 % zoom, x to the
right and y down; positions are the centres of boxes.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import graphlay

from app.core.graph.node_graph import GraphLine, NodeGraph

_log = logging.getLogger(__name__)

Position = tuple[float, float]
Box = tuple[float, float, float, float]
"""Rectangle: left, top, width, height."""
RouteKey = tuple[tuple[str, tuple[str, ...], tuple[str, ...]], str, str]
"""Key of a route: (line, source node, target node)."""

MAX_ROUTES = 6000
"""Maximum number of routes drawn. If there are more, the lines with the most ends are omitted and counted."""
MAX_SAVED_POSITIONS = 4000
"""Maximum number of stored positions of nodes that left and may return."""
LAYER_GAP, NODE_GAP, GROUP_GAP, DUMMY_GAP = 150.0, 36.0, 40.0, 10.0
ISOLATED_COLUMNS = 4
"""Number of columns for the nodes of a group that have no lines."""
MAX_BALANCED_LAYOUT_NODES = 60
"""Number of boxes above which graphlay runs in its fast mode."""
MAX_AVOIDING_ROUTES = 400
"""Maximum number of routes that avoid nodes.

With more routes, all routes are straight lines, because routing would take many seconds.
"""
MAX_ASPECT_RATIO, TARGET_ASPECT_RATIO = 3.0, 1.6
"""Maximum ratio of width to height of a row of groups, and the ratio to which a wider row is broken."""


@dataclass(frozen=True, slots=True)
class LayoutSizes:
    """Sizes used by the layout, in pixels.

    Attributes:
        node: Width and height of a node.
        header: Height of a group's header.
        side_margin: Margin between a group's border and its nodes.
        footer: Height of the text about hidden quiet nodes at the bottom of a group.
        char_width: Average width of a character.
    """

    node: Position = (152.0, 48.0)
    header: float = 36.0
    side_margin: float = 18.0
    footer: float = 30.0
    char_width: float = 8.0

    def scaled(self, factor: float) -> LayoutSizes:
        """Return the sizes multiplied by ``factor``, for another text size."""
        width, height = self.node
        return LayoutSizes(
            (width * factor, height * factor),
            self.header * factor,
            self.side_margin * factor,
            self.footer * factor,
            self.char_width * factor,
        )


@dataclass(frozen=True, slots=True)
class GraphLayout:
    """Positions of boxes and groups, and routes of lines.

    Attributes:
        positions: Centre of each box, by key.
        groups: Rectangle of each group, by key.
        routes: Points of each route, from the edge of the source box to the edge of the target box.
        saved_positions: Last positions of nodes that left, by key, oldest first.
        omitted_routes: Number of omitted routes.
        is_fallback: True if graphlay failed and the boxes are arranged in rows.
    """

    positions: Mapping[str, Position] = field(default_factory=dict)
    groups: Mapping[str, Box] = field(default_factory=dict)
    routes: Mapping[RouteKey, tuple[Position, ...]] = field(default_factory=dict)
    saved_positions: Mapping[str, Position] = field(default_factory=dict)
    omitted_routes: int = 0
    is_fallback: bool = False

    def bounds(self, sizes: LayoutSizes) -> Box:
        """Return the bounding rectangle of the layout; its size is 0 if the layout is empty."""
        boxes = [
            *self.groups.values(),
            *(_box_at(position, sizes.node) for position in self.positions.values()),
        ]
        boxes += [(x, y, 0.0, 0.0) for points in self.routes.values() for x, y in points]
        return _bounding_box(boxes)


def arrange(
    graph: NodeGraph, previous: GraphLayout | None = None, sizes: LayoutSizes | None = None
) -> GraphLayout:
    """Compute the layout of a graph.

    Takes seconds for hundreds of nodes; use `LayoutThread`.

    Args:
        graph: Drawing to lay out.
        previous: Previous layout. Its nodes keep their positions, unless more nodes appeared than
            remained.
        sizes: Sizes of boxes and margins.
    """
    sizes = sizes if sizes is not None else LayoutSizes()
    route_keys, omitted_count = _routes_to_draw(graph)
    previous_positions = {} if previous is None else {**previous.saved_positions, **previous.positions}
    current_keys = {node.key for node in graph.nodes}
    kept_count = len(current_keys & previous_positions.keys())
    is_fallback = False
    if not kept_count or kept_count < len(current_keys) - kept_count:
        positions, is_fallback = _place_all(graph, route_keys, sizes)
        previous_positions = {}
    else:
        positions = _place_new(
            graph, {key: previous_positions[key] for key in current_keys & previous_positions.keys()}, sizes
        )
    routes = {} if is_fallback else _route_lines(positions, route_keys, sizes)
    saved_positions = {
        key: position for key, position in previous_positions.items() if key not in current_keys
    }
    for key in [*saved_positions][: max(0, len(saved_positions) - MAX_SAVED_POSITIONS)]:
        del saved_positions[key]
    straight_routes = {
        route_key: _straight_route(positions[route_key[1]], positions[route_key[2]], sizes)
        for route_key in route_keys
    }
    groups = _group_boxes(graph, positions, sizes)
    return GraphLayout(
        positions, groups, {**straight_routes, **routes}, saved_positions, omitted_count, is_fallback
    )


def arrange_in_rows(graph: NodeGraph, sizes: LayoutSizes) -> GraphLayout:
    """Arrange all boxes in rows without graphlay, for the case that graphlay failed or took too long."""
    positions = _row_positions(graph, sizes)
    route_keys, omitted_count = _routes_to_draw(graph)
    return GraphLayout(
        positions,
        _group_boxes(graph, positions, sizes),
        {
            route_key: _straight_route(positions[route_key[1]], positions[route_key[2]], sizes)
            for route_key in route_keys
        },
        {},
        omitted_count,
        is_fallback=True,
    )


def _routes_to_draw(graph: NodeGraph) -> tuple[list[RouteKey], int]:
    # Routes of lines with few ends first; and the number of omitted ones.
    routes: list[RouteKey] = []
    omitted_count = 0
    for line in sorted(graph.lines, key=_drawing_order):
        line_routes = [(line.key, source, target) for source, target in line.pairs()]
        if len(routes) + len(line_routes) <= MAX_ROUTES:
            routes += line_routes
        else:
            omitted_count += len(line_routes)
    return routes, omitted_count


def _drawing_order(line: GraphLine) -> tuple[int, tuple[str, ...]]:
    return len(line.sources) * len(line.targets), line.topics


# -- with the library ----------------------------------------------------------------------------------------


def _graphlay_options(effort: str, gap: float = NODE_GAP) -> dict[str, Any]:
    return {
        "direction": "leftright",
        "spacing": {
            "layer_gap": LAYER_GAP,
            "node_gap": gap,
            "dummy_gap": DUMMY_GAP,
            "isolated_gap": gap,
            "isolated_max_columns": ISOLATED_COLUMNS,
        },
        "routing": {"style": "orthogonal"},
        "cycles": {"strategy": "follow_flow"},
        "effort": effort,
    }


def _place_all(
    graph: NodeGraph, route_keys: Sequence[RouteKey], sizes: LayoutSizes
) -> tuple[dict[str, Position], bool]:
    # First the nodes within each group, then the groups. Also returns whether the library failed.
    keys_by_group: dict[str, list[str]] = {}
    for node in graph.nodes:
        keys_by_group.setdefault(node.group, []).append(node.key)
    group_by_key = {key: group_key for group_key, keys in keys_by_group.items() for key in keys}
    inner_routes: dict[str, list[RouteKey]] = {}
    route_counts: dict[tuple[str, str], int] = {}
    effort = "balanced" if len(group_by_key) < MAX_BALANCED_LAYOUT_NODES else "fast"
    for route_key in route_keys:
        source_group, target_group = group_by_key[route_key[1]], group_by_key[route_key[2]]
        if source_group == target_group:
            inner_routes.setdefault(source_group, []).append(route_key)
        else:
            route_counts[source_group, target_group] = route_counts.get((source_group, target_group), 0) + 1
    try:
        positions_by_group = {
            group_key: _place_group(keys, inner_routes.get(group_key, ()), sizes, effort)
            for group_key, keys in keys_by_group.items()
        }
        boxes = {
            group_key: _group_bounds(graph, group_key, positions, sizes)
            for group_key, positions in positions_by_group.items()
        }
        centres = _place_boxes(boxes, route_counts)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        _log.exception("layout library failed; nodes are placed in rows")
        return _row_positions(graph, sizes), True
    positions = {}
    for group_key, (left, top, width, height) in boxes.items():
        dx, dy = centres[group_key][0] - left - width / 2, centres[group_key][1] - top - height / 2
        for key, (x, y) in positions_by_group[group_key].items():
            positions[key] = x + dx, y + dy
    return positions, False


def _place_group(
    keys: Sequence[str], route_keys: Sequence[RouteKey], sizes: LayoutSizes, effort: str
) -> dict[str, Position]:
    if len(keys) == 1:
        return {keys[0]: (0.0, 0.0)}
    index = {key: number for number, key in enumerate(keys)}
    layout = graphlay.layout(
        {
            "nodes": [_request_box(key, sizes.node) for key in keys],
            "edges": _request_edges(route_keys, index),
        },
        options=_graphlay_options(effort),
    )
    return {key: _parse_point(node["center"]) for key, node in zip(keys, layout.nodes, strict=True)}


def _group_bounds(
    graph: NodeGraph, group_key: str, positions: Mapping[str, Position], sizes: LayoutSizes
) -> Box:
    # Bounding box of a group; of a node without a group the node itself.
    group = next((each for each in graph.groups if each.key == group_key and not each.is_collapsed), None)
    box = _bounding_box(_box_at(position, sizes.node) for position in positions.values())
    if group is None:
        return box
    left, top, width, height = _with_margins(box, group_key, sizes)
    return left, top, width, height + (sizes.footer if group.quiet_count else 0.0)


def _place_boxes(
    boxes: Mapping[str, Box], route_counts: Mapping[tuple[str, str], int]
) -> dict[str, Position]:
    # Returns centres; boxes may have different sizes.
    if len(boxes) == 1:
        return dict.fromkeys(boxes, (0.0, 0.0))
    index = {group_key: number for number, group_key in enumerate(boxes)}
    edges = [
        {"source": index[source_group], "target": index[target_group], "weight": float(count)}
        for (source_group, target_group), count in route_counts.items()
    ]
    nodes = [_request_box(group_key, (box[2], box[3])) for group_key, box in boxes.items()]
    layout = graphlay.layout(
        {"nodes": nodes, "edges": edges}, options=_graphlay_options("balanced", GROUP_GAP)
    )
    centres = {
        group_key: _parse_point(node["center"]) for group_key, node in zip(boxes, layout.nodes, strict=True)
    }
    width = layout.bounds["max"]["x"] - layout.bounds["min"]["x"]
    height = layout.bounds["max"]["y"] - layout.bounds["min"]["y"]
    return (
        centres if width <= MAX_ASPECT_RATIO * height or len(boxes) < 4 else _shelf_positions(boxes, centres)
    )


def _shelf_positions(boxes: Mapping[str, Box], centres: Mapping[str, Position]) -> dict[str, Position]:
    # Breaks one long row of groups into several, in the same order.
    area = sum((box[2] + LAYER_GAP) * (box[3] + GROUP_GAP) for box in boxes.values())
    row_width = max(math.sqrt(area * TARGET_ASPECT_RATIO), *(box[2] for box in boxes.values()))
    positions: dict[str, Position] = {}
    left = top = row_height = 0.0
    for group_key in sorted(boxes, key=lambda each: (centres[each], each)):
        _left, _top, width, height = boxes[group_key]
        if left and left + width > row_width:
            left, top, row_height = 0.0, top + row_height + GROUP_GAP, 0.0
        positions[group_key] = left + width / 2, top + height / 2
        left, row_height = left + width + LAYER_GAP, max(row_height, height)
    return positions


def _route_lines(
    positions: Mapping[str, Position], route_keys: Sequence[RouteKey], sizes: LayoutSizes
) -> dict[RouteKey, tuple[Position, ...]]:
    # Routes around the boxes; {} when the library fails: then they are straight.
    if not route_keys or len(route_keys) > MAX_AVOIDING_ROUTES:
        return {}
    index = {key: number for number, key in enumerate(positions)}
    request = [
        {**_request_box(key, sizes.node), "position": {"x": x, "y": y}} for key, (x, y) in positions.items()
    ]
    try:
        layout = graphlay.reroute(
            {"nodes": request, "edges": _request_edges(route_keys, index)}, options=_graphlay_options("fast")
        )
        return {
            route_key: tuple(_parse_point(each) for each in edge["points"])
            for route_key, edge in zip(route_keys, layout.edges, strict=True)
            if len(edge["points"]) > 1
        }
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        _log.exception("line routing failed; lines are straight")
        return {}


def _request_box(key: str, size: Position) -> dict[str, Any]:
    width, height = size
    return {"size": {"width": width, "height": height}, "shape": "box", "key": key}


def _request_edges(route_keys: Sequence[RouteKey], index: Mapping[str, int]) -> list[dict[str, Any]]:
    return [
        {"source": index[source], "target": index[target], "weight": 1.0}
        for _line, source, target in route_keys
    ]


def _parse_point(point: Mapping[str, float]) -> Position:
    return float(point["x"]), float(point["y"])


# -- without the library ---------------------------------------------------------------------------------


def _row_positions(graph: NodeGraph, sizes: LayoutSizes) -> dict[str, Position]:
    # Each group is a column.
    width, height = sizes.node
    columns: dict[str, list[str]] = {}
    for node in graph.nodes:
        columns.setdefault(node.group, []).append(node.key)
    step = width + 2 * sizes.side_margin + LAYER_GAP
    return {
        key: (column * step, row * (height + NODE_GAP))
        for column, keys in enumerate(columns.values())
        for row, key in enumerate(keys)
    }


def _place_new(graph: NodeGraph, positions: dict[str, Position], sizes: LayoutSizes) -> dict[str, Position]:
    # Existing nodes keep their positions; new ones are placed next to them.
    neighbours = _neighbours(graph)
    for node in graph.nodes:
        if node.key in positions:
            continue
        group_mates = [each.key for each in graph.nodes if each.group == node.group and each.key in positions]
        neighbour_positions = [positions[key] for key in neighbours.get(node.key, ()) if key in positions]
        if group_mates:
            positions[node.key] = _free_position(
                [positions[key] for key in group_mates], neighbour_positions, positions.values(), sizes
            )
        else:
            left, top, width, _height = _bounding_box(
                _box_at(position, sizes.node) for position in positions.values()
            )
            step = sizes.node[0] + 2 * sizes.side_margin + LAYER_GAP
            positions[node.key] = (left + width + step - sizes.node[0] / 2, top + sizes.node[1] / 2)
        _push_apart(graph, positions, node.group, sizes)
    return positions


def _free_position(
    group_positions: Sequence[Position],
    neighbour_positions: Sequence[Position],
    occupied: Iterable[Position],
    sizes: LayoutSizes,
) -> Position:
    # In the columns of the group, nearest to the connected nodes.
    row_height = sizes.node[1] + NODE_GAP
    node_width = sizes.node[0]
    occupied_positions = list(occupied)
    x_near = (
        sum(x for x, _y in neighbour_positions) / len(neighbour_positions)
        if neighbour_positions
        else group_positions[0][0]
    )
    y_near = (
        sum(y for _x, y in neighbour_positions) / len(neighbour_positions)
        if neighbour_positions
        else max(y for _x, y in group_positions)
    )
    tops = [y for _x, y in group_positions]
    rows = [min(tops) + row_height * step for step in range(int((max(tops) - min(tops)) / row_height) + 2)]
    columns = sorted({x for x, _y in group_positions})
    free = [
        (x, y)
        for x in columns
        for y in rows
        if all(
            abs(x - other_x) >= node_width or abs(y - other_y) >= row_height - 1
            for other_x, other_y in occupied_positions
        )
    ]
    if not free:
        return columns[0], max(tops) + row_height
    return min(free, key=lambda position: (abs(position[0] - x_near) + abs(position[1] - y_near), position))


def _push_apart(
    graph: NodeGraph, positions: dict[str, Position], grown_group: str, sizes: LayoutSizes
) -> None:
    # Moves whole groups down until none overlaps one that has grown.
    keys_by_group: dict[str, list[str]] = {}
    for node in graph.nodes:
        if node.key in positions:
            keys_by_group.setdefault(node.group or node.key, []).append(node.key)
    boxes = {
        key: _bounding_box(
            _with_margins(_box_at(positions[member_key], sizes.node), key, sizes) for member_key in keys
        )
        for key, keys in keys_by_group.items()
    }
    pending_keys = [grown_group] if grown_group in boxes else []
    for _turn in range(len(boxes) ** 2):
        if not pending_keys:
            return
        upper_key = pending_keys.pop()
        for key, box in boxes.items():
            if key == upper_key or not _overlaps(boxes[upper_key], box):
                continue
            dy = boxes[upper_key][1] + boxes[upper_key][3] + GROUP_GAP - box[1]
            boxes[key] = (box[0], box[1] + dy, box[2], box[3])
            for member_key in keys_by_group[key]:
                positions[member_key] = (positions[member_key][0], positions[member_key][1] + dy)
            pending_keys.append(key)


def _neighbours(graph: NodeGraph) -> dict[str, set[str]]:
    neighbours: dict[str, set[str]] = {}
    for line in graph.lines:
        if len(line.sources) * len(line.targets) > MAX_ROUTES:
            continue
        for source, target in line.pairs():
            neighbours.setdefault(source, set()).add(target)
            neighbours.setdefault(target, set()).add(source)
    return neighbours


def _group_boxes(graph: NodeGraph, positions: Mapping[str, Position], sizes: LayoutSizes) -> dict[str, Box]:
    # Around the nodes of each expanded group, at least as wide as its name.
    boxes_by_group: dict[str, list[Box]] = {}
    for node in graph.nodes:
        boxes_by_group.setdefault(node.group, []).append(_box_at(positions[node.key], sizes.node))
    rectangles = {}
    for group in graph.groups:
        if group.is_collapsed or group.key not in boxes_by_group:
            continue
        left, top, width, height = _bounding_box(
            _with_margins(box, group.key, sizes) for box in boxes_by_group[group.key]
        )
        if group.quiet_count:
            height += sizes.footer
        rectangles[group.key] = (left, top, width, height)
    return rectangles


def _with_margins(box: Box, group: str, sizes: LayoutSizes) -> Box:
    # With the margins of its group; unchanged without a group.
    if not group:
        return box
    left, top, width, height = box
    return (
        left - sizes.side_margin,
        top - sizes.header,
        width + 2 * sizes.side_margin,
        height + sizes.header + sizes.side_margin,
    )


def _box_at(position: Position, size: Position) -> Box:
    return position[0] - size[0] / 2, position[1] - size[1] / 2, size[0], size[1]


def _bounding_box(boxes: Iterable[Box]) -> Box:
    rectangles = list(boxes)
    if not rectangles:
        return 0.0, 0.0, 0.0, 0.0
    left, top = min(box[0] for box in rectangles), min(box[1] for box in rectangles)
    right, bottom = max(box[0] + box[2] for box in rectangles), max(box[1] + box[3] for box in rectangles)
    return left, top, right - left, bottom - top


def _overlaps(one: Box, other: Box) -> bool:
    return (
        one[0] < other[0] + other[2]
        and other[0] < one[0] + one[2]
        and one[1] < other[1] + other[3]
        and other[1] < one[1] + one[3]
    )


def _straight_route(source: Position, target: Position, sizes: LayoutSizes) -> tuple[Position, ...]:
    # From the right edge to the left edge; reversed when the target is to the left.
    half = sizes.node[0] / 2
    offset = half if source[0] <= target[0] else -half
    return (source[0] + offset, source[1]), (target[0] - offset, target[1])
