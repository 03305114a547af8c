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
WIDEST, ASPECT = 3.0, 1.6
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

    def scaled(self, share: float) -> LayoutSizes:
        """Return the sizes multiplied by ``share``, for another text size."""
        wide, high = self.node
        return LayoutSizes(
            (wide * share, high * share),
            self.header * share,
            self.side_margin * share,
            self.footer * share,
            self.char_width * share,
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
        boxes = [*self.groups.values(), *(_box_at(place, sizes.node) for place in self.positions.values())]
        boxes += [(x, y, 0.0, 0.0) for way in self.routes.values() for x, y in way]
        return _bounding_box(boxes)


def arrange(
    graph: NodeGraph, before: GraphLayout | None = None, sizes: LayoutSizes | None = None
) -> GraphLayout:
    """Compute the layout of a graph.

    Takes seconds for hundreds of nodes; use `LayoutThread`.

    Args:
        graph: Drawing to lay out.
        before: Previous layout. Its nodes keep their positions, unless more nodes appeared than
            remained.
        sizes: Sizes of boxes and margins.
    """
    sizes = sizes if sizes is not None else LayoutSizes()
    ways, left_out = _routes_to_draw(graph)
    known = {} if before is None else {**before.saved_positions, **before.positions}
    here = {node.key for node in graph.nodes}
    stay = len(here & known.keys())
    is_plain = False
    if not stay or stay < len(here) - stay:
        places, is_plain = _place_all(graph, ways, sizes)
        known = {}
    else:
        places = _place_new(graph, {key: known[key] for key in here & known.keys()}, sizes)
    routes = {} if is_plain else _route_lines(places, ways, sizes)
    kept = {key: place for key, place in known.items() if key not in here}
    for key in [*kept][: max(0, len(kept) - MAX_SAVED_POSITIONS)]:
        del kept[key]
    straight = {way: _straight_route(places[way[1]], places[way[2]], sizes) for way in ways}
    groups = _group_boxes(graph, places, sizes)
    return GraphLayout(places, groups, {**straight, **routes}, kept, left_out, is_plain)


def arrange_in_rows(graph: NodeGraph, sizes: LayoutSizes) -> GraphLayout:
    """Arrange all boxes in rows without graphlay, for the case that graphlay failed or took too long."""
    places = _row_positions(graph, sizes)
    ways, left_out = _routes_to_draw(graph)
    return GraphLayout(
        places,
        _group_boxes(graph, places, sizes),
        {way: _straight_route(places[way[1]], places[way[2]], sizes) for way in ways},
        {},
        left_out,
        is_fallback=True,
    )


def _routes_to_draw(graph: NodeGraph) -> tuple[list[RouteKey], int]:
    # Routes of lines with few ends first; and the number of omitted ones.
    found: list[RouteKey] = []
    left_out = 0
    for line in sorted(graph.lines, key=_drawing_order):
        ways = [(line.key, source, target) for source, target in line.pairs()]
        if len(found) + len(ways) <= MAX_ROUTES:
            found += ways
        else:
            left_out += len(ways)
    return found, left_out


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
    graph: NodeGraph, ways: Sequence[RouteKey], sizes: LayoutSizes
) -> tuple[dict[str, Position], bool]:
    # First the nodes within each group, then the groups. Also returns whether the library failed.
    inside: dict[str, list[str]] = {}
    for node in graph.nodes:
        inside.setdefault(node.group, []).append(node.key)
    home = {key: block for block, keys in inside.items() for key in keys}
    within: dict[str, list[RouteKey]] = {}
    between: dict[tuple[str, str], int] = {}
    effort = "balanced" if len(home) < MAX_BALANCED_LAYOUT_NODES else "fast"
    for way in ways:
        begin, end = home[way[1]], home[way[2]]
        if begin == end:
            within.setdefault(begin, []).append(way)
        else:
            between[begin, end] = between.get((begin, end), 0) + 1
    try:
        blocks = {
            block: _place_block(keys, within.get(block, ()), sizes, effort) for block, keys in inside.items()
        }
        boxes = {block: _block_box(graph, block, places, sizes) for block, places in blocks.items()}
        middles = _place_boxes(boxes, between)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        _log.exception("layout library failed; nodes are placed in rows")
        return _row_positions(graph, sizes), True
    places = {}
    for block, (left, top, wide, high) in boxes.items():
        across, down = middles[block][0] - left - wide / 2, middles[block][1] - top - high / 2
        for key, (x, y) in blocks[block].items():
            places[key] = x + across, y + down
    return places, False


def _place_block(
    keys: Sequence[str], ways: Sequence[RouteKey], sizes: LayoutSizes, effort: str
) -> dict[str, Position]:
    if len(keys) == 1:
        return {keys[0]: (0.0, 0.0)}
    index = {key: number for number, key in enumerate(keys)}
    layout = graphlay.layout(
        {"nodes": [_request_box(key, sizes.node) for key in keys], "edges": _request_edges(ways, index)},
        options=_graphlay_options(effort),
    )
    return {key: _parse_point(node["center"]) for key, node in zip(keys, layout.nodes, strict=True)}


def _block_box(graph: NodeGraph, block: str, places: Mapping[str, Position], sizes: LayoutSizes) -> Box:
    # Bounding box of a group; of a node without a group the node itself.
    group = next((each for each in graph.groups if each.key == block and not each.is_collapsed), None)
    box = _bounding_box(_box_at(place, sizes.node) for place in places.values())
    if group is None:
        return box
    left, top, wide, high = _with_margins(box, block, sizes)
    return left, top, wide, high + (sizes.footer if group.quiet_count else 0.0)


def _place_boxes(boxes: Mapping[str, Box], between: Mapping[tuple[str, str], int]) -> dict[str, Position]:
    # Returns centres; boxes may have different sizes.
    if len(boxes) == 1:
        return dict.fromkeys(boxes, (0.0, 0.0))
    index = {block: number for number, block in enumerate(boxes)}
    edges = [
        {"source": index[begin], "target": index[end], "weight": float(count)}
        for (begin, end), count in between.items()
    ]
    nodes = [_request_box(block, (box[2], box[3])) for block, box in boxes.items()]
    layout = graphlay.layout(
        {"nodes": nodes, "edges": edges}, options=_graphlay_options("balanced", GROUP_GAP)
    )
    middles = {block: _parse_point(node["center"]) for block, node in zip(boxes, layout.nodes, strict=True)}
    wide = layout.bounds["max"]["x"] - layout.bounds["min"]["x"]
    high = layout.bounds["max"]["y"] - layout.bounds["min"]["y"]
    return middles if wide <= WIDEST * high or len(boxes) < 4 else _shelf_positions(boxes, middles)


def _shelf_positions(boxes: Mapping[str, Box], middles: Mapping[str, Position]) -> dict[str, Position]:
    # Breaks one long row of groups into several, in the same order.
    area = sum((box[2] + LAYER_GAP) * (box[3] + GROUP_GAP) for box in boxes.values())
    room = max(math.sqrt(area * ASPECT), *(box[2] for box in boxes.values()))
    found: dict[str, Position] = {}
    left = top = high = 0.0
    for block in sorted(boxes, key=lambda each: (middles[each], each)):
        _left, _top, wide, tall = boxes[block]
        if left and left + wide > room:
            left, top, high = 0.0, top + high + GROUP_GAP, 0.0
        found[block] = left + wide / 2, top + tall / 2
        left, high = left + wide + LAYER_GAP, max(high, tall)
    return found


def _route_lines(
    places: Mapping[str, Position], ways: Sequence[RouteKey], sizes: LayoutSizes
) -> dict[RouteKey, tuple[Position, ...]]:
    # Routes around the boxes; {} when the library fails: then they are straight.
    if not ways or len(ways) > MAX_AVOIDING_ROUTES:
        return {}
    index = {key: number for number, key in enumerate(places)}
    request = [
        {**_request_box(key, sizes.node), "position": {"x": x, "y": y}} for key, (x, y) in places.items()
    ]
    try:
        layout = graphlay.reroute(
            {"nodes": request, "edges": _request_edges(ways, index)}, options=_graphlay_options("fast")
        )
        return {
            way: tuple(_parse_point(each) for each in edge["points"])
            for way, edge in zip(ways, layout.edges, strict=True)
            if len(edge["points"]) > 1
        }
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        _log.exception("line routing failed; lines are straight")
        return {}


def _request_box(key: str, size: Position) -> dict[str, Any]:
    wide, high = size
    return {"size": {"width": wide, "height": high}, "shape": "box", "key": key}


def _request_edges(ways: Sequence[RouteKey], index: Mapping[str, int]) -> list[dict[str, Any]]:
    return [
        {"source": index[source], "target": index[target], "weight": 1.0} for _line, source, target in ways
    ]


def _parse_point(told: Mapping[str, float]) -> Position:
    return float(told["x"]), float(told["y"])


# -- without the library ---------------------------------------------------------------------------------


def _row_positions(graph: NodeGraph, sizes: LayoutSizes) -> dict[str, Position]:
    # Each group is a column.
    wide, high = sizes.node
    columns: dict[str, list[str]] = {}
    for node in graph.nodes:
        columns.setdefault(node.group, []).append(node.key)
    step = wide + 2 * sizes.side_margin + LAYER_GAP
    return {
        key: (column * step, row * (high + NODE_GAP))
        for column, keys in enumerate(columns.values())
        for row, key in enumerate(keys)
    }


def _place_new(graph: NodeGraph, places: dict[str, Position], sizes: LayoutSizes) -> dict[str, Position]:
    # Existing nodes keep their positions; new ones are placed next to them.
    neighbours = _neighbours(graph)
    for node in graph.nodes:
        if node.key in places:
            continue
        mates = [each.key for each in graph.nodes if each.group == node.group and each.key in places]
        near = [places[key] for key in neighbours.get(node.key, ()) if key in places]
        if mates:
            places[node.key] = _free_position([places[key] for key in mates], near, places.values(), sizes)
        else:
            left, top, wide, _high = _bounding_box(_box_at(place, sizes.node) for place in places.values())
            step = sizes.node[0] + 2 * sizes.side_margin + LAYER_GAP
            places[node.key] = (left + wide + step - sizes.node[0] / 2, top + sizes.node[1] / 2)
        _push_apart(graph, places, node.group, sizes)
    return places


def _free_position(
    mates: Sequence[Position], near: Sequence[Position], taken: Iterable[Position], sizes: LayoutSizes
) -> Position:
    # In the columns of the group, nearest to the connected nodes.
    high = sizes.node[1] + NODE_GAP
    wide = sizes.node[0]
    there = list(taken)
    x_near = sum(x for x, _y in near) / len(near) if near else mates[0][0]
    y_near = sum(y for _x, y in near) / len(near) if near else max(y for _x, y in mates)
    tops = [y for _x, y in mates]
    rows = [min(tops) + high * step for step in range(int((max(tops) - min(tops)) / high) + 2)]
    columns = sorted({x for x, _y in mates})
    free = [
        (x, y)
        for x in columns
        for y in rows
        if all(abs(x - other) >= wide or abs(y - level) >= high - 1 for other, level in there)
    ]
    if not free:
        return columns[0], max(tops) + high
    return min(free, key=lambda at: (abs(at[0] - x_near) + abs(at[1] - y_near), at))


def _push_apart(graph: NodeGraph, places: dict[str, Position], grown: str, sizes: LayoutSizes) -> None:
    # Moves whole groups down until none overlaps one that has grown.
    members: dict[str, list[str]] = {}
    for node in graph.nodes:
        if node.key in places:
            members.setdefault(node.group or node.key, []).append(node.key)
    boxes = {
        key: _bounding_box(_with_margins(_box_at(places[each], sizes.node), key, sizes) for each in keys)
        for key, keys in members.items()
    }
    moving = [grown] if grown in boxes else []
    for _turn in range(len(boxes) ** 2):
        if not moving:
            return
        upper = moving.pop()
        for key, box in boxes.items():
            if key == upper or not _overlaps(boxes[upper], box):
                continue
            down = boxes[upper][1] + boxes[upper][3] + GROUP_GAP - box[1]
            boxes[key] = (box[0], box[1] + down, box[2], box[3])
            for each in members[key]:
                places[each] = (places[each][0], places[each][1] + down)
            moving.append(key)


def _neighbours(graph: NodeGraph) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for line in graph.lines:
        if len(line.sources) * len(line.targets) > MAX_ROUTES:
            continue
        for source, target in line.pairs():
            found.setdefault(source, set()).add(target)
            found.setdefault(target, set()).add(source)
    return found


def _group_boxes(graph: NodeGraph, places: Mapping[str, Position], sizes: LayoutSizes) -> dict[str, Box]:
    # Around the nodes of each expanded group, at least as wide as its name.
    inside: dict[str, list[Box]] = {}
    for node in graph.nodes:
        inside.setdefault(node.group, []).append(_box_at(places[node.key], sizes.node))
    rectangles = {}
    for group in graph.groups:
        if group.is_collapsed or group.key not in inside:
            continue
        left, top, wide, high = _bounding_box(
            _with_margins(box, group.key, sizes) for box in inside[group.key]
        )
        if group.quiet_count:
            high += sizes.footer
        rectangles[group.key] = (left, top, wide, high)
    return rectangles


def _with_margins(box: Box, group: str, sizes: LayoutSizes) -> Box:
    # With the margins of its group; unchanged without a group.
    if not group:
        return box
    left, top, wide, high = box
    return (
        left - sizes.side_margin,
        top - sizes.header,
        wide + 2 * sizes.side_margin,
        high + sizes.header + sizes.side_margin,
    )


def _box_at(place: Position, size: Position) -> Box:
    return place[0] - size[0] / 2, place[1] - size[1] / 2, size[0], size[1]


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
    way = half if source[0] <= target[0] else -half
    return (source[0] + way, source[1]), (target[0] - way, target[1])
