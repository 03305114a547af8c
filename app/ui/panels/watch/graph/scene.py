"""Geometry and texts of the graph, with hit testing.

Coordinates are in the units of the layout; the painter applies the scale. Methods that update an item
return the area that has to be repainted.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from PySide6.QtCore import QMarginsF, QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QFont, QFontMetricsF, QPainterPath, QPolygonF

from app.core.graph.layout import MAX_AVOIDING_ROUTES, GraphLayout, LayoutSizes, Position
from app.core.graph.node_graph import DrawnNode, GraphGroup, GraphLine, NodeGraph
from app.ui.panels.watch.graph.texts import (
    LineStats,
    group_name,
    line_name,
    node_detail,
    node_name,
    quiet_text,
)
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

CORNER_RADIUS = 10.0
ARROW_LENGTH, ARROW_WIDTH = 9.0, 8.0
LINE_MARGIN = 14.0
"""Margin in px around lines, to include arrows and thick pens."""
CELL_SIZE = (160.0, 48.0)
LABEL_RATE_CHARS = 7
"""Number of characters that every label reserves for the rate."""
LABEL_PADDING = 3.0
"""Margin in px left and right of a label's text."""
NODE_PADDING = 4.0
"""Minimum distance in px of a label from the boxes of nodes."""
NODE_TEXT_INSET = 46.0
"""Part in px of a node's width that is not available for its texts."""
MIN_SMALL_TEXT_PX = 7.0
"""Font height in px below which small text is not painted, because it would be illegible."""
TINY_SCALE = 0.2
"""Scale below which rates and line widths are omitted, because thousands of lines may be visible."""
HIT_TOLERANCE_PX = 6.0
"""Maximum distance of a click from a line, in px."""
BRIDGE_END_WIDTH = 48.0
"""Width in px of the right part of a bridge's box, which contains the name of the other network."""


StatsGetter = Callable[[GraphLine], LineStats]


@dataclass(slots=True)
class NodeItem:
    """Box of a node with its texts.

    Attributes:
        node: Node or collapsed group.
        rect: Rectangle in scene coordinates.
        name: First line, elided to the available width.
        detail: Second line in full length.
        is_dim: True while the filter fades the box.
    """

    node: DrawnNode
    rect: QRectF
    name: str
    detail: str = ""
    elided_detail: str = ""
    """Second line, elided to the available width."""
    is_dim: bool = False


@dataclass(slots=True)
class LineItem:
    """Line between boxes.

    Attributes:
        line: Topics or services that the line stands for.
        routes: Points of the route between each pair of source and target.
        bounds: Bounding rectangle in scene coordinates.
        label: Rectangle of the label, or None if there is no room for it.
        is_placed: True after a place for the label has been looked for.
        stats: Label, width and losses.
        is_dim: True while the filter fades the line.
    """

    line: GraphLine
    routes: dict[tuple[str, str], Sequence[Position]]
    bounds: QRectF
    label: QRectF | None = None
    is_placed: bool = False
    stats: LineStats = field(default_factory=lambda: LineStats("", 1.25))
    is_dim: bool = False
    _path: QPainterPath | None = None
    _arrows: list[QPolygonF] | None = None
    _sharp_routes: list[QPolygonF] | None = None

    # Created on first paint: creating all paths of a large graph at once would block the window.

    def path(self) -> QPainterPath:
        """Return the routes with rounded corners."""
        if self._path is None:
            self._path = QPainterPath()
            for points in self.routes.values():
                _add_rounded(self._path, points)
        return self._path

    def arrows(self) -> list[QPolygonF]:
        """Return the arrow head of each route."""
        if self._arrows is None:
            self._arrows = [_arrow(points) for points in self.routes.values()]
        return self._arrows

    def sharp_routes(self) -> list[QPolygonF]:
        """Return the routes with sharp corners, which are faster to paint at small scales."""
        if self._sharp_routes is None:
            self._sharp_routes = [
                QPolygonF([QPointF(*point) for point in points]) for points in self.routes.values()
            ]
        return self._sharp_routes


@dataclass(slots=True)
class GroupItem:
    """Frame of a group.

    Attributes:
        group: Group to show.
        rect: Rectangle in scene coordinates.
        name: Name of the group, elided to the available width.
        quiet_rect: Rectangle of the text with the number of hidden quiet nodes, or None.
    """

    group: GraphGroup
    rect: QRectF
    name: str
    quiet_rect: QRectF | None


class GraphScene:
    """Geometry of a graph. Positions are fixed; rates, counts and the filter change texts and colours.

    Args:
        theme: Theme with the fonts.
        graph: Graph to show.
        layout: Positions of nodes, groups and routes.
        sizes: Sizes that the layout was computed with.
        host: Name of this computer.
    """

    def __init__(
        self, theme: Theme, graph: NodeGraph, layout: GraphLayout, sizes: LayoutSizes, host: str
    ) -> None:
        self.theme = theme
        self.graph, self.layout, self.sizes, self._host = graph, layout, sizes, host
        self._update_fonts()
        node_width, node_height = sizes.node
        self.nodes = {
            node.key: NodeItem(
                node,
                QRectF(x - node_width / 2, y - node_height / 2, node_width, node_height),
                self._elide(self.name_font, node_name(node, host), self._text_width(node)),
            )
            for node in graph.nodes
            if (position := layout.positions.get(node.key)) is not None
            for x, y in (position,)
        }
        self.groups = [self._group_item(group) for group in graph.groups if group.key in layout.groups]
        routes_by_key: dict[object, dict[tuple[str, str], Sequence[Position]]] = {}
        for (key, source, target), points in layout.routes.items():
            routes_by_key.setdefault(key, {})[source, target] = points
        self.lines = [
            _line_item(line, routes_by_key[line.key]) for line in graph.lines if line.key in routes_by_key
        ]
        left, top, width, height = layout.bounds(sizes)
        self.bounds = QRectF(left, top, width, height)
        header_rects = (
            QRectF(item.rect.topLeft(), QSizeF(item.rect.width(), sizes.header - 8)) for item in self.groups
        )
        avoidable_lines = self.lines if len(layout.routes) <= MAX_AVOIDING_ROUTES else []
        self._line_areas = _OccupiedAreas(
            [
                *(_segment_rect(*part) for item in avoidable_lines for part in _segments(item)),
                *(border for item in self.groups for border in _border_rects(item.rect)),
            ]
        )
        margins = QMarginsF(NODE_PADDING, NODE_PADDING, NODE_PADDING, NODE_PADDING)
        self._occupied_areas = _OccupiedAreas(
            [
                *(item.rect.marginsAdded(margins) for item in self.nodes.values()),
                *header_rects,
                *(item.quiet_rect for item in self.groups if item.quiet_rect is not None),
            ]
        )

    def _update_fonts(self) -> None:
        theme = self.theme
        self.name_font, self.small_font = theme.font("body"), theme.font("caption")
        self.small_font.setWeight(QFont.Weight.Normal)
        self.name_font.setWeight(QFont.Weight.Medium)
        self.label_font, self.title_font = theme.font("code"), theme.font("title")
        self.char_width = QFontMetricsF(self.label_font).horizontalAdvance("0")

    def _text_width(self, node: DrawnNode) -> float:
        return self.sizes.node[0] - NODE_TEXT_INSET - (BRIDGE_END_WIDTH if node.bridged_network else 0)

    @staticmethod
    def _elide(
        font: QFont, text: str, width: float, mode: Qt.TextElideMode = Qt.TextElideMode.ElideMiddle
    ) -> str:
        return QFontMetricsF(font).elidedText(text, mode, width)

    def _group_item(self, group: GraphGroup) -> GroupItem:
        rect = QRectF(*self.layout.groups[group.key])
        chip = None
        if group.quiet_count:
            text_width = paint.width_of(self.small_font, quiet_text(group)) + 24
            chip_height = self.sizes.footer * 0.7
            width = min(text_width, rect.width() - 16)
            chip = QRectF(rect.right() - 10 - width, rect.bottom() - 8 - chip_height, width, chip_height)
        room = rect.width() - 48
        return GroupItem(
            group, rect, self._elide(self.title_font, group_name(group.key, self._host), room), chip
        )

    # -- rates and counts ---------------------------------------------------------------------------------

    def items_in(self, area: QRectF) -> list[NodeItem | LineItem]:
        """Return the nodes and lines that intersect an area."""
        nodes = [item for item in self.nodes.values() if item.rect.intersects(area)]
        return [*nodes, *(item for item in self.lines if item.bounds.intersects(area))]

    def update_stats(
        self, item: NodeItem | LineItem, stats_of: StatsGetter, *, with_small_text: bool
    ) -> QRectF | None:
        """Update the second line of text of a node, or the label, width and losses of a line.

        Args:
            item: Item to update.
            stats_of: Returns label, width and losses of a line.
            with_small_text: True if small text is legible; otherwise nodes aren't updated. The first call
                with True places the label of a line.

        Returns:
            The area to repaint, or None if nothing changed.
        """
        if isinstance(item, NodeItem):
            detail = node_detail(item.node) if with_small_text else item.detail
            if detail == item.detail:
                return None
            item.detail = detail
            item.elided_detail = self._elide(
                self.small_font, detail, self._text_width(item.node), Qt.TextElideMode.ElideRight
            )
            return item.rect
        current, previous = stats_of(item.line), item.stats
        item.stats = current
        if current.width != previous.width or current.losses != previous.losses:
            area: QRectF | None = item.bounds
        else:
            area = item.label if current.label != previous.label else None
        if with_small_text and not item.is_placed:
            item.is_placed = True
            item.label = self._label_rect_for(item)
            area = area or item.label
        return area

    def complete(self, stats_of: StatsGetter) -> None:
        """Update the rates and counts of all items at once, for the export of an image."""
        items: list[NodeItem | LineItem] = [*self.nodes.values(), *self.lines]
        for item in items:
            self.update_stats(item, stats_of, with_small_text=True)

    def _label_rect_for(self, item: LineItem) -> QRectF | None:
        # Prefers places that few lines and borders of groups cross; among these, the longest horizontal
        # segment. Candidates outside the bounds are moved inside, because "Show all" fits only the bounds.
        char_count = len(line_name(item.line.topics)) + LABEL_RATE_CHARS
        width = char_count * self.char_width + 2 * LABEL_PADDING
        height = QFontMetricsF(self.label_font).height()
        candidates = (_moved_inside(rect, self.bounds) for rect in _label_candidates(item, width, height))
        free_rects = [
            rect for rect in candidates if self.bounds.contains(rect) and self._occupied_areas.is_free(rect)
        ]
        label_rect = min(free_rects, key=self._line_areas.overlap_count, default=None)
        if label_rect is not None:
            self._occupied_areas.add(label_rect)
        return label_rect

    def dim_unmatched(self, keywords: Sequence[str]) -> None:
        """Fade the items that don't match a filter.

        An item matches if its texts contain all of the words. Lines at matching nodes, and nodes at
        matching lines, are not faded either.

        Args:
            keywords: Words in lower case; empty for no filter.
        """
        matching_keys = {
            key
            for key, item in self.nodes.items()
            if all(keyword in _haystack(item.node) for keyword in keywords)
        }
        matching_lines = [
            item
            for item in self.lines
            if all(keyword in " ".join(item.line.topics).casefold() for keyword in keywords)
        ]
        connected_nodes = {key for item in matching_lines for key in (*item.line.sources, *item.line.targets)}
        matching_ids = {id(item) for item in matching_lines}
        for item in self.lines:
            line_ends = {*item.line.sources, *item.line.targets}
            item.is_dim = bool(keywords) and id(item) not in matching_ids and not (line_ends & matching_keys)
        for key, box in self.nodes.items():
            box.is_dim = bool(keywords) and key not in matching_keys and key not in connected_nodes

    @property
    def dimmed_count(self) -> int:
        """Number of nodes faded by the filter."""
        return sum(item.is_dim for item in self.nodes.values())

    @staticmethod
    def has_stats(scale: float) -> bool:
        """Return True if line widths, arrows and rates are shown at a scale."""
        return scale >= TINY_SCALE

    def label_background(self, item: LineItem) -> QRectF | None:
        """Return the rectangle behind the text of a line's label, or None if no label is shown."""
        if item.label is None or not item.stats.label:
            return None
        rect = QRectF(item.label)
        rect.setWidth(len(item.stats.label) * self.char_width + 2 * LABEL_PADDING)
        return rect

    def has_small_text(self, scale: float) -> bool:
        """Return True if the small text is legible at a scale."""
        return scale * self.small_font.pixelSize() >= MIN_SMALL_TEXT_PX

    # -- hit testing --------------------------------------------------------------------------------------

    def node_at(self, point: QPointF) -> DrawnNode | None:
        """Return the node at a point in scene coordinates, or None."""
        return next((item.node for item in self.nodes.values() if item.rect.contains(point)), None)

    def group_at(self, point: QPointF) -> tuple[GraphGroup, bool] | None:
        """Return the group whose title or number of quiet nodes is at a point.

        Args:
            point: Point in scene coordinates.

        Returns:
            The group, with True for its title and False for its number of quiet nodes; None if there is
            neither.
        """
        for item in self.groups:
            if item.quiet_rect is not None and item.quiet_rect.contains(point):
                return item.group, False
            header_rect = QRectF(item.rect.left(), item.rect.top(), item.rect.width(), self.sizes.header - 4)
            if header_rect.contains(point):
                return item.group, True
        return None

    def line_at(self, point: QPointF, scale: float) -> LineItem | None:
        """Return the line at a point, or None.

        Args:
            point: Point in scene coordinates.
            scale: Scale of the view.

        Returns:
            The line whose label contains the point, else the nearest line within `HIT_TOLERANCE_PX`.
        """
        labelled = (item for item in self.lines if item.label is not None and item.label.contains(point))
        labelled_line = next(labelled, None)
        if labelled_line is not None:
            return labelled_line
        tolerance = HIT_TOLERANCE_PX / scale
        candidates = [
            (_distance(point, points), number)
            for number, item in enumerate(self.lines)
            if item.bounds.adjusted(-tolerance, -tolerance, tolerance, tolerance).contains(point)
            for points in item.routes.values()
        ]
        distance, number = min(candidates, default=(math.inf, 0))
        return self.lines[number] if distance <= tolerance else None


def _line_item(line: GraphLine, routes: dict[tuple[str, str], Sequence[Position]]) -> LineItem:
    xs = [x for points in routes.values() for x, _y in points]
    ys = [y for points in routes.values() for _x, y in points]
    left, top = min(xs) - LINE_MARGIN, min(ys) - LINE_MARGIN
    return LineItem(
        line, routes, QRectF(left, top, max(xs) + LINE_MARGIN - left, max(ys) + LINE_MARGIN - top)
    )


def _add_rounded(path: QPainterPath, points: Sequence[Position]) -> None:
    path.moveTo(*points[0])
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        radius = min(CORNER_RADIUS, math.dist(before, corner) / 2, math.dist(corner, after) / 2)
        curve_start, curve_end = _point_towards(corner, before, radius), _point_towards(corner, after, radius)
        path.lineTo(*curve_start)
        path.quadTo(*corner, *curve_end)
    path.lineTo(*points[-1])


def _point_towards(start: Position, other: Position, length: float) -> Position:
    distance = math.dist(start, other) or 1.0
    return start[0] + (other[0] - start[0]) * length / distance, start[1] + (
        other[1] - start[1]
    ) * length / distance


def _arrow(points: Sequence[Position]) -> QPolygonF:
    tip = points[-1]
    before = next((each for each in reversed(points[:-1]) if each != tip), (tip[0] - 1, tip[1]))
    base = _point_towards(tip, before, ARROW_LENGTH)
    offset = (
        (tip[1] - base[1]) * ARROW_WIDTH / ARROW_LENGTH / 2,
        (base[0] - tip[0]) * ARROW_WIDTH / ARROW_LENGTH / 2,
    )
    return QPolygonF(
        [
            QPointF(*tip),
            QPointF(base[0] + offset[0], base[1] + offset[1]),
            QPointF(base[0] - offset[0], base[1] - offset[1]),
        ]
    )


def _label_candidates(item: LineItem, width: float, height: float) -> Iterator[QRectF]:
    # Best candidates first: horizontal segments, then vertical ones.
    parts = _segments(item)
    horizontal = [each for each in parts if abs(each[1][1] - each[0][1]) < 1]
    for begin, end in sorted(horizontal, key=_segment_length, reverse=True)[:6]:
        left, room = min(begin[0], end[0]), abs(end[0] - begin[0]) - width
        for fraction in (0.5, 0.25, 0.75) if room >= 0 else ():
            yield QRectF(left + room * fraction, begin[1] - height - 2, width, height)
            yield QRectF(left + room * fraction, begin[1] + 3, width, height)
    vertical = [each for each in parts if abs(each[1][0] - each[0][0]) < 1]
    for begin, end in sorted(vertical, key=_segment_length, reverse=True)[:4]:
        top, room = min(begin[1], end[1]), abs(end[1] - begin[1]) - height
        for fraction in (0.5, 0.2, 0.8) if room >= 0 else ():
            yield QRectF(begin[0] + 5, top + room * fraction, width, height)
            yield QRectF(begin[0] - 5 - width, top + room * fraction, width, height)


def _moved_inside(rect: QRectF, area: QRectF) -> QRectF:
    left = max(area.left(), min(rect.left(), area.right() - rect.width()))
    top = max(area.top(), min(rect.top(), area.bottom() - rect.height()))
    return QRectF(QPointF(left, top), rect.size())


def _border_rects(rect: QRectF) -> tuple[QRectF, ...]:
    corners = (
        (rect.left(), rect.top()),
        (rect.right(), rect.top()),
        (rect.right(), rect.bottom()),
        (rect.left(), rect.bottom()),
    )
    return tuple(_segment_rect(*part) for part in itertools.pairwise((*corners, corners[0])))


def _segments(item: LineItem) -> list[tuple[Position, Position]]:
    return [part for points in item.routes.values() for part in itertools.pairwise(points)]


def _segment_rect(begin: Position, end: Position) -> QRectF:
    left, top = min(begin[0], end[0]), min(begin[1], end[1])
    return QRectF(left, top, abs(end[0] - begin[0]) + 0.5, abs(end[1] - begin[1]) + 0.5)


def _segment_length(part: tuple[Position, Position]) -> float:
    return math.dist(*part)


def _distance(point: QPointF, points: Sequence[Position]) -> float:
    return min(
        _distance_to_segment((point.x(), point.y()), begin, end) for begin, end in itertools.pairwise(points)
    )


def _distance_to_segment(point: Position, begin: Position, end: Position) -> float:
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    length_squared = dx * dx + dy * dy
    fraction = (
        ((point[0] - begin[0]) * dx + (point[1] - begin[1]) * dy) / length_squared if length_squared else 0.0
    )
    fraction = min(1.0, max(0.0, fraction))
    return math.dist(point, (begin[0] + dx * fraction, begin[1] + dy * fraction))


def _haystack(node: DrawnNode) -> str:
    entry = node.entry
    if entry is None:
        return node.name.casefold()
    topics = " ".join((*entry.published_topics, *entry.subscribed_topics))
    return f"{node.name} {entry.host} {entry.language} {entry.generation} {topics}".casefold()


class _OccupiedAreas:
    """Spatial index of occupied rectangles, so that thousands of labels can be placed without overlap."""

    def __init__(self, rects: Iterable[QRectF]) -> None:
        self._cells: dict[tuple[int, int], list[QRectF]] = {}
        for rect in rects:
            self.add(rect)

    def is_free(self, rect: QRectF) -> bool:
        return not any(other.intersects(rect) for cell in _cells(rect) for other in self._cells.get(cell, ()))

    def overlap_count(self, rect: QRectF) -> int:
        # Counts a rectangle once per cell, which is exact enough for a comparison.
        return sum(other.intersects(rect) for cell in _cells(rect) for other in self._cells.get(cell, ()))

    def add(self, rect: QRectF) -> None:
        for cell in _cells(rect):
            self._cells.setdefault(cell, []).append(rect)


def _cells(rect: QRectF) -> Iterator[tuple[int, int]]:
    cell_width, cell_height = CELL_SIZE
    for column in range(math.floor(rect.left() / cell_width), math.floor(rect.right() / cell_width) + 1):
        for row in range(math.floor(rect.top() / cell_height), math.floor(rect.bottom() / cell_height) + 1):
            yield column, row
