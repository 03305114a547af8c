"""The graph measured and painted: the same on the screen and in a saved picture.

Lengths are those of the layout; who paints scales the painter. What a figure changes is told as areas, so
that nothing else is painted anew.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen, QPolygonF

from app.core.graph.layout import MOST_LED, GraphLayout, LayoutSizes, Place
from app.core.graph.node_graph import DrawnNode, GraphGroup, GraphLine, NodeGraph
from app.core.graph.walk import GraphChoice
from app.ui.panels.graph.words import (
    LineFigures,
    group_name,
    line_name,
    node_icon,
    node_line,
    node_name,
    percent_words,
    quiet_words,
)
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

CORNER = 10.0
ARROW_LONG, ARROW_WIDE = 9.0, 8.0
ROUND = 14.0
"""How far arrows and thick lines reach beyond their ways."""
CHOSEN_WIDTH = 2.25
DIM = 0.3
CELL = (160.0, 48.0)
LABEL_ROOM = 7
"""Letters that a label keeps for its figure."""
LEAST_TEXT_PX, LEAST_SMALL_PX = 6.0, 7.0
"""Smaller letters are not painted: nobody could read them."""
TINY = 0.2
"""In smaller sizes thousands of lines are in sight, of which no figure can be read or thickness be seen."""
REACH = 6.0
"""How near to a line a press of the mouse means it, in px of the screen."""
JOIN = 48.0
"""Width of the part of a bridge that names the other network."""


FiguresOf = Callable[[GraphLine], LineFigures]


@dataclass(slots=True)
class NodeItem:
    """A box that is painted: its place, and its words as they were painted last."""

    node: DrawnNode
    rect: QRectF
    name: str
    said: str = ""
    line: str = ""
    """The same, as much of it as there is room for."""
    is_dim: bool = False


@dataclass(slots=True)
class LineItem:
    """A line that is painted: its ways, and where its words stand once they are placed, if there is room."""

    line: GraphLine
    ways: dict[tuple[str, str], Sequence[Place]]
    bounds: QRectF
    label: QRectF | None = None
    is_placed: bool = False
    figures: LineFigures = field(default_factory=lambda: LineFigures("", 1.25))
    is_dim: bool = False
    _drawn: tuple[QPainterPath, list[QPolygonF]] | None = None

    def drawn(self) -> tuple[QPainterPath, list[QPolygonF]]:
        """The ways with round corners, and their arrows; made when they are first painted."""
        if self._drawn is None:
            path = QPainterPath()
            for points in self.ways.values():
                _add_rounded(path, points)
            self._drawn = path, [_arrow(points) for points in self.ways.values()]
        return self._drawn


@dataclass(slots=True)
class GroupItem:
    """A group that is painted; ``quiet`` is where the number of its hidden nodes stands."""

    group: GraphGroup
    rect: QRectF
    name: str
    quiet: QRectF | None


class GraphScene:
    """What is painted of one graph, measured once; `renew` takes over its figures."""

    def __init__(
        self, theme: Theme, graph: NodeGraph, layout: GraphLayout, sizes: LayoutSizes, host: str
    ) -> None:
        """``host`` is this computer's name."""
        self.theme = theme
        self.graph, self.layout, self.sizes, self._host = graph, layout, sizes, host
        self._fonts()
        wide, high = sizes.node
        self.nodes = {
            node.key: NodeItem(
                node,
                QRectF(x - wide / 2, y - high / 2, wide, high),
                self._elided(self.name_font, node_name(node, host), self._words_width(node)),
            )
            for node in graph.nodes
            if (place := layout.places.get(node.key)) is not None
            for x, y in (place,)
        }
        self.groups = [self._group_item(group) for group in graph.groups if group.key in layout.groups]
        ways: dict[object, dict[tuple[str, str], Sequence[Place]]] = {}
        for (key, source, target), points in layout.routes.items():
            ways.setdefault(key, {})[source, target] = points
        self.lines = [_line_item(line, ways[line.key]) for line in graph.lines if line.key in ways]
        left, top, width, height = layout.bounds(sizes)
        self.bounds = QRectF(left, top, width, height)
        heads = (
            QRectF(item.rect.topLeft(), QSizeF(item.rect.width(), sizes.head - 8)) for item in self.groups
        )
        led = self.lines if len(layout.routes) <= MOST_LED else []
        self._crossed = _TakenRoom(_thin(*part) for item in led for part in _parts(item))
        self._taken = _TakenRoom([*(item.rect for item in self.nodes.values()), *heads])

    def _fonts(self) -> None:
        theme = self.theme
        self.name_font, self.small_font = theme.font("body"), theme.font("caption")
        self.small_font.setWeight(QFont.Weight.Normal)
        self.name_font.setWeight(QFont.Weight.Medium)
        self.label_font, self.title_font = theme.font("code"), theme.font("title")
        self.letter = QFontMetricsF(self.label_font).horizontalAdvance("0")

    def _words_width(self, node: DrawnNode) -> float:
        return self.sizes.node[0] - 46 - (JOIN if node.joins else 0)

    @staticmethod
    def _elided(font: QFont, text: str, width: float) -> str:
        return QFontMetricsF(font).elidedText(text, Qt.TextElideMode.ElideMiddle, width)

    def _group_item(self, group: GraphGroup) -> GroupItem:
        rect = QRectF(*self.layout.groups[group.key])
        chip = None
        if group.quiet:
            words = paint.width_of(self.small_font, quiet_words(group)) + 24
            high = self.sizes.foot * 0.7
            width = min(words, rect.width() - 16)
            chip = QRectF(rect.right() - 10 - width, rect.bottom() - 8 - high, width, high)
        room = rect.width() - 48
        return GroupItem(
            group, rect, self._elided(self.title_font, group_name(group.key, self._host), room), chip
        )

    # -- figures ---------------------------------------------------------------------------------------------

    def seen(self, area: QRectF) -> list[NodeItem | LineItem]:
        """The nodes and lines in an area."""
        nodes = [item for item in self.nodes.values() if item.rect.intersects(area)]
        return [*nodes, *(item for item in self.lines if item.bounds.intersects(area))]

    def renew(self, item: NodeItem | LineItem, figures: FiguresOf, *, with_words: bool) -> QRectF | None:
        """Take over the figures of one node or line; the area that looks otherwise than before, or None.

        The words of a line find their room when they are first asked for (``with_words``).
        """
        if isinstance(item, NodeItem):
            said = node_line(item.node) if with_words else item.said
            if said == item.said:
                return None
            item.said = said
            item.line = self._elided(self.small_font, said, self._words_width(item.node))
            return item.rect
        now, before = figures(item.line), item.figures
        item.figures = now
        if now.width != before.width or now.lost != before.lost:
            area: QRectF | None = item.bounds
        else:
            area = item.label if now.words != before.words else None
        if with_words and not item.is_placed:
            item.is_placed = True
            item.label = self._room_for(item)
            area = area or item.label
        return area

    def complete(self, figures: FiguresOf) -> None:
        """Take over everything at once, as a saved picture needs it."""
        every: list[NodeItem | LineItem] = [*self.nodes.values(), *self.lines]
        for item in every:
            self.renew(item, figures, with_words=True)

    def _room_for(self, item: LineItem) -> QRectF | None:
        """Room for the words of a line that nothing else has: along its longest level part, or beside it."""
        letters = len(line_name(item.line.topics)) + LABEL_ROOM
        wide, high = letters * self.letter + 4, QFontMetricsF(self.label_font).height()
        rooms = [rect for rect in _rooms(item, wide, high) if self._taken.is_free(rect)]
        found = next((rect for rect in rooms if self._crossed.is_free(rect)), rooms[0] if rooms else None)
        if found is not None:
            self._taken.add(found)
        return found

    def dim(self, words: Sequence[str]) -> None:
        """Let what has not all of these words fade; who talks with what has them does not."""
        bright = {
            key for key, item in self.nodes.items() if all(word in _haystack(item.node) for word in words)
        }
        named = [
            item
            for item in self.lines
            if all(word in " ".join(item.line.topics).casefold() for word in words)
        ]
        ends = {key for item in named for key in (*item.line.sources, *item.line.targets)}
        found = {id(item) for item in named}
        for item in self.lines:
            at = {*item.line.sources, *item.line.targets}
            item.is_dim = bool(words) and id(item) not in found and not (at & bright)
        for key, box in self.nodes.items():
            box.is_dim = bool(words) and key not in bright and key not in ends

    @property
    def dimmed(self) -> int:
        """How many nodes the filter lets fade."""
        return sum(item.is_dim for item in self.nodes.values())

    @staticmethod
    def has_figures(scale: float) -> bool:
        """Whether figures change anything in this size; else lines are of one pixel, without arrows."""
        return scale >= TINY

    def has_words(self, scale: float) -> bool:
        """Whether the smaller words can be read in this size, and are painted."""
        return scale * self.small_font.pixelSize() >= LEAST_SMALL_PX

    # -- what is under the mouse -----------------------------------------------------------------------------

    def node_at(self, at: QPointF) -> DrawnNode | None:
        """The node there."""
        return next((item.node for item in self.nodes.values() if item.rect.contains(at)), None)

    def group_at(self, at: QPointF) -> tuple[GraphGroup, bool] | None:
        """The group whose head is there (True), or whose number of quiet nodes (False)."""
        for item in self.groups:
            if item.quiet is not None and item.quiet.contains(at):
                return item.group, False
            head = QRectF(item.rect.left(), item.rect.top(), item.rect.width(), self.sizes.head - 4)
            if head.contains(at):
                return item.group, True
        return None

    def line_at(self, at: QPointF, scale: float) -> LineItem | None:
        """The line nearest to there, if it is near enough on the screen, or whose words are there."""
        labelled = (item for item in self.lines if item.label is not None and item.label.contains(at))
        found = next(labelled, None)
        if found is not None:
            return found
        reach = REACH / scale
        near = [
            (_distance(at, points), number)
            for number, item in enumerate(self.lines)
            if item.bounds.adjusted(-reach, -reach, reach, reach).contains(at)
            for points in item.ways.values()
        ]
        distance, number = min(near, default=(math.inf, 0))
        return self.lines[number] if distance <= reach else None

    # -- painting --------------------------------------------------------------------------------------------

    def paint(
        self,
        painter: QPainter,
        clip: QRectF,
        scale: float,
        chosen: GraphChoice | None = None,
        *,
        rings: bool = False,
    ) -> None:
        """Paint what is in ``clip``, as large as ``scale`` says; ``rings`` show what the keys chose."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        _Painting(self, painter, clip, scale, chosen, rings=rings).paint()


def _line_item(line: GraphLine, ways: dict[tuple[str, str], Sequence[Place]]) -> LineItem:
    xs = [x for points in ways.values() for x, _y in points]
    ys = [y for points in ways.values() for _x, y in points]
    left, top = min(xs) - ROUND, min(ys) - ROUND
    return LineItem(line, ways, QRectF(left, top, max(xs) + ROUND - left, max(ys) + ROUND - top))


def _add_rounded(path: QPainterPath, points: Sequence[Place]) -> None:
    """A way with round corners."""
    path.moveTo(*points[0])
    for before, at, after in zip(points, points[1:], points[2:], strict=False):
        radius = min(CORNER, math.dist(before, at) / 2, math.dist(at, after) / 2)
        into, out = _towards(at, before, radius), _towards(at, after, radius)
        path.lineTo(*into)
        path.quadTo(*at, *out)
    path.lineTo(*points[-1])


def _towards(at: Place, other: Place, length: float) -> Place:
    whole = math.dist(at, other) or 1.0
    return at[0] + (other[0] - at[0]) * length / whole, at[1] + (other[1] - at[1]) * length / whole


def _arrow(points: Sequence[Place]) -> QPolygonF:
    tip = points[-1]
    before = next((each for each in reversed(points[:-1]) if each != tip), (tip[0] - 1, tip[1]))
    base = _towards(tip, before, ARROW_LONG)
    across = (
        (tip[1] - base[1]) * ARROW_WIDE / ARROW_LONG / 2,
        (base[0] - tip[0]) * ARROW_WIDE / ARROW_LONG / 2,
    )
    return QPolygonF(
        [
            QPointF(*tip),
            QPointF(base[0] + across[0], base[1] + across[1]),
            QPointF(base[0] - across[0], base[1] - across[1]),
        ]
    )


def _rooms(item: LineItem, wide: float, high: float) -> Iterator[QRectF]:
    """Where words of this width could stand, the best place first: at level parts, then at upright ones."""
    parts = _parts(item)
    level = [each for each in parts if abs(each[1][1] - each[0][1]) < 1]
    for begin, end in sorted(level, key=_length, reverse=True)[:6]:
        left, room = min(begin[0], end[0]), abs(end[0] - begin[0]) - wide
        for share in (0.5, 0.25, 0.75) if room >= 0 else ():
            yield QRectF(left + room * share, begin[1] - high - 2, wide, high)
            yield QRectF(left + room * share, begin[1] + 3, wide, high)
    upright = [each for each in parts if abs(each[1][0] - each[0][0]) < 1]
    for begin, end in sorted(upright, key=_length, reverse=True)[:4]:
        top, room = min(begin[1], end[1]), abs(end[1] - begin[1]) - high
        for share in (0.5, 0.2, 0.8) if room >= 0 else ():
            yield QRectF(begin[0] + 5, top + room * share, wide, high)
            yield QRectF(begin[0] - 5 - wide, top + room * share, wide, high)


def _parts(item: LineItem) -> list[tuple[Place, Place]]:
    """The straight parts of all its ways."""
    return [part for points in item.ways.values() for part in itertools.pairwise(points)]


def _thin(begin: Place, end: Place) -> QRectF:
    """The room that a straight part takes, if it is level or upright."""
    left, top = min(begin[0], end[0]), min(begin[1], end[1])
    return QRectF(left, top, abs(end[0] - begin[0]) + 0.5, abs(end[1] - begin[1]) + 0.5)


def _length(part: tuple[Place, Place]) -> float:
    return math.dist(*part)


def _distance(at: QPointF, points: Sequence[Place]) -> float:
    """How far a point is from a way."""
    return min(_distance_to_part((at.x(), at.y()), begin, end) for begin, end in itertools.pairwise(points))


def _distance_to_part(at: Place, begin: Place, end: Place) -> float:
    wide, high = end[0] - begin[0], end[1] - begin[1]
    square = wide * wide + high * high
    share = ((at[0] - begin[0]) * wide + (at[1] - begin[1]) * high) / square if square else 0.0
    share = min(1.0, max(0.0, share))
    return math.dist(at, (begin[0] + wide * share, begin[1] + high * share))


def _haystack(node: DrawnNode) -> str:
    entry = node.entry
    if entry is None:
        return node.name.casefold()
    topics = " ".join((*entry.publishes, *entry.subscribes))
    return f"{node.name} {entry.host} {entry.language} {entry.generation} {topics}".casefold()


class _TakenRoom:
    """Which room is taken, by cells: thousands of words are placed at once."""

    def __init__(self, rects: Iterable[QRectF]) -> None:
        self._cells: dict[tuple[int, int], list[QRectF]] = {}
        for rect in rects:
            self.add(rect)

    def is_free(self, rect: QRectF) -> bool:
        """Whether nobody has taken any of this room."""
        return not any(other.intersects(rect) for cell in _cells(rect) for other in self._cells.get(cell, ()))

    def add(self, rect: QRectF) -> None:
        """Take this room."""
        for cell in _cells(rect):
            self._cells.setdefault(cell, []).append(rect)


def _cells(rect: QRectF) -> Iterator[tuple[int, int]]:
    wide, high = CELL
    for column in range(math.floor(rect.left() / wide), math.floor(rect.right() / wide) + 1):
        for row in range(math.floor(rect.top() / high), math.floor(rect.bottom() / high) + 1):
            yield column, row


class _Painting:
    """One painting of a scene: the colours of the moment, and who is at the chosen line."""

    def __init__(
        self,
        scene: GraphScene,
        painter: QPainter,
        clip: QRectF,
        scale: float,
        chosen: GraphChoice | None,
        *,
        rings: bool,
    ) -> None:
        self.scene, self.theme, self.painter = scene, scene.theme, painter
        self.clip, self.scale, self.rings = clip, scale, rings
        self.has_text = scale * scene.name_font.pixelSize() >= LEAST_TEXT_PX
        self.has_small = scene.has_words(scale)
        self.is_tiny = not scene.has_figures(scale)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, not self.is_tiny)
        line = scene.graph.line_of(chosen.key) if chosen is not None and chosen.kind == "topic" else None
        self.line = line
        self.chosen = chosen.key if chosen is not None and chosen.kind == "node" else ""
        self.ends = {*line.sources, *line.targets} if line is not None else set[str]()

    def paint(self) -> None:
        """Groups, lines, their words, then nodes: each may lie on what is before it."""
        painter, clip = self.painter, self.clip
        for group in self.scene.groups:
            if group.rect.intersects(clip):
                self._group(group)
        shown = [item for item in self.scene.lines if item.bounds.intersects(clip)]
        above = [item for item in shown if item.line is self.line]
        for item in [*(each for each in shown if each.line is not self.line), *above]:
            painter.setOpacity(DIM if item.is_dim else 1.0)
            self._line(item)
        if self.has_small:
            for item in self.scene.lines:
                if item.label is not None and item.label.intersects(clip):
                    painter.setOpacity(DIM if item.is_dim else 1.0)
                    self._label(item, item.label)
        for box in self.scene.nodes.values():
            if box.rect.adjusted(-6, -6, 6, 6).intersects(clip):
                painter.setOpacity(DIM if box.is_dim else 1.0)
                self._node(box)
        painter.setOpacity(1.0)
        for item in above:
            self._losses(item)

    def _group(self, item: GroupItem) -> None:
        theme, painter, group = self.theme, self.painter, item.group
        paint.box(painter, item.rect, theme.radius("card"), theme.colour("window"), theme.colour("border"))
        if not self.has_text:
            return
        head = self.scene.sizes.head
        side = theme.scaled(16)
        left = item.rect.left() + 14
        middle = item.rect.top() + head / 2
        paint_icon(
            painter, QRectF(left, middle - side / 2, side, side), group.icon, theme.colour("textSecondary")
        )
        left += side + 8
        area = QRectF(left, item.rect.top(), item.rect.right() - 10 - left, head)
        _text(painter, area, item.name, self.scene.title_font, theme.colour("text"))
        used = paint.width_of(self.scene.title_font, item.name) + 8
        if area.width() - used > 40:
            area.setLeft(left + used)
            paint.words(painter, area, group.address, self.scene.small_font, theme.colour("textTertiary"))
        if item.quiet is not None:
            pen = QPen(theme.colour("controlBorder"), 1, Qt.PenStyle.DashLine)
            painter.setPen(pen)
            painter.setBrush(theme.colour("panel"))
            round_end = item.quiet.height() / 2
            painter.drawRoundedRect(item.quiet, round_end, round_end)
            paint.words(
                painter,
                item.quiet,
                quiet_words(group),
                self.scene.small_font,
                theme.colour("textSecondary"),
                paint.CENTRE,
            )

    def _line(self, item: LineItem) -> None:
        is_chosen = item.line is self.line
        colour = self.theme.colour("accent" if is_chosen else "controlBorder")
        width = 1.0 if self.is_tiny else CHOSEN_WIDTH if is_chosen else item.figures.width
        pen = QPen(colour, width)
        pen.setCosmetic(self.is_tiny)
        if item.line.kind == "service":
            pen.setDashPattern([5 / width, 4 / width])
        self.painter.setPen(pen)
        self.painter.setBrush(Qt.BrushStyle.NoBrush)
        path, arrows = item.drawn()
        self.painter.drawPath(path)
        if self.is_tiny:
            return
        self.painter.setPen(Qt.PenStyle.NoPen)
        self.painter.setBrush(colour)
        for arrow in arrows:
            self.painter.drawPolygon(arrow)

    def _label(self, item: LineItem, rect: QRectF) -> None:
        """The names in the colour of text, the figure behind them quieter; on a chip when chosen."""
        theme, painter = self.theme, self.painter
        names, _space, figure = item.figures.words.rpartition(" ")
        if not names or not figure.endswith(("/s", "/min")):
            names, figure = item.figures.words, ""
        is_chosen = item.line is self.line
        if is_chosen:
            paint.box(
                painter,
                rect.adjusted(-5, -1, 5, 1),
                theme.radius("chip"),
                theme.colour("accentTint"),
                theme.colour("accent"),
            )
        ink = theme.colour("accentText" if is_chosen else "text")
        _text(painter, rect, names, self.scene.label_font, ink)
        if figure:
            used = (len(names) + 1) * self.scene.letter
            area = rect.adjusted(used, 0, 20, 0)
            quiet = theme.colour("accentText" if is_chosen else "textSecondary")
            _text(painter, area, figure, self.scene.label_font, quiet)

    def _losses(self, item: LineItem) -> None:
        """What is lost, at the ends of the chosen line where it is."""
        if not self.has_small:
            return
        theme, painter, font = self.theme, self.painter, self.scene.small_font
        for box, share in item.figures.lost:
            tip = next((points[-1] for ends, points in item.ways.items() if ends[1] == box), None)
            if tip is None:
                continue
            words = percent_words(share)
            side = theme.scaled(12)
            wide, high = paint.width_of(font, words) + side + 18, theme.scaled(20)
            chip = QRectF(tip[0] - wide - 12, tip[1] + 6, wide, high)
            paint.box(painter, chip, high / 2, theme.colour("warnTint"), theme.colour("warnBorder"))
            square = QRectF(chip.left() + 7, chip.center().y() - side / 2, side, side)
            paint_icon(painter, square, "triangle-alert", theme.colour("warn"))
            _text(painter, chip.adjusted(side + 11, 0, 0, 0), words, font, theme.colour("warn"))

    def _node(self, item: NodeItem) -> None:
        theme, painter, node = self.theme, self.painter, item.node
        is_chosen = node.key == self.chosen
        at_line = node.key in self.ends
        is_source = self.line is not None and node.key in self.line.sources
        fill = theme.colour("selected" if is_chosen or is_source else "panel")
        edge = theme.colour("accent" if is_chosen or at_line else "controlBorder")
        radius = theme.radius("panel")
        faint = node.is_gone or node.is_quiet
        if faint:
            painter.setPen(QPen(edge, 1, Qt.PenStyle.DashLine))
            painter.setBrush(fill)
            painter.drawRoundedRect(item.rect.adjusted(0.5, 0.5, -0.5, -0.5), radius, radius)
        else:
            paint.box(painter, item.rect, radius, fill, edge, 1.5 if is_chosen or at_line else 1.0)
        if node.joins:
            self._other_side(item.rect, node.joins, edge)
        if is_chosen and self.rings:
            ring = item.rect.adjusted(-3, -3, 3, 3)
            paint.box(painter, ring, radius + 3, None, theme.colour("focus"), 2.0)
        if self.has_text:
            self._words(item, "textDisabled" if node.is_gone else "textSecondary" if faint else "text")

    def _other_side(self, rect: QRectF, joins: str, edge: QColor) -> None:
        """The part of a bridge that belongs to the other network."""
        theme, painter = self.theme, self.painter
        part = QRectF(rect.right() - JOIN, rect.top() + 1, JOIN - 1, rect.height() - 2)
        paint.box(painter, part, theme.radius("small"), theme.colour("sunken"))
        painter.setPen(QPen(edge, 1))
        painter.drawLine(part.topLeft(), part.bottomLeft())
        if self.has_small:
            font = QFont(self.scene.small_font)
            font.setWeight(QFont.Weight.DemiBold)
            paint.words(painter, part, joins, font, theme.colour("textSecondary"), paint.CENTRE)

    def _words(self, item: NodeItem, role: str) -> None:
        theme, painter, rect = self.theme, self.painter, item.rect
        side = theme.scaled(16)
        square = QRectF(rect.left() + 12, rect.center().y() - side / 2, side, side)
        quiet = theme.colour("textDisabled" if item.node.is_gone else "textSecondary")
        paint_icon(painter, square, node_icon(item.node), quiet)
        left = rect.left() + 12 + side + 10
        area = QRectF(left, rect.top() + 5, rect.right() - 4 - left, rect.height() / 2 - 4)
        font = self.scene.name_font
        if item.node.is_gone:
            font = QFont(font)
            font.setStrikeOut(True)
        _text(painter, area, item.name, font, theme.colour(role))
        if self.has_small and item.line:
            area.translate(0, rect.height() / 2 - 4)
            _text(painter, area, item.line, self.scene.small_font, theme.colour("textTertiary"))


def _text(painter: QPainter, rect: QRectF, text: str, font: QFont, colour: QColor) -> None:
    """One line of text that fits: `paint.words` without measuring it again."""
    painter.setFont(font)
    painter.setPen(colour)
    painter.drawText(rect, int(paint.LEFT), text)
