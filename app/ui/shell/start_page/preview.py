"""Preview of a behaviour, with its first blocks as coloured bars."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainter, QPainterPath, QPen

from app.ui.theme.theme import Theme
from app.ui.widgets import paint

ROW_HEIGHT = 27.0
GAP = 1.0
INDENT = 16.0
MAX_DEPTH = 6
MAX_ROWS = 12
STATEMENTS = frozenset({"DO", "DO0", "ELSE", "STACK", "BODY", "THEN"})
_CATEGORY_BY_WORD = {"do": "robot", "get": "sensors", "when": "events"}


@dataclass(frozen=True)
class Row:
    """Block in a preview.

    Attributes:
        depth: Nesting depth.
        category: Block category, which determines the colour.
        text_length: Length of the text in characters.
        value_count: Number of slots and fields, at most 3.
    """

    depth: int
    category: str
    text_length: int
    value_count: int


def category_of(block_type: str) -> str:
    """Return the category of a block type, such as "robot" for ``robot_pepper_do_say``."""
    parts = block_type.split("_")
    if parts[0] == "robot":
        return next((_CATEGORY_BY_WORD[part] for part in parts[1:] if part in _CATEGORY_BY_WORD), "robot")
    return parts[0]


def rows(workspace: Mapping[str, object]) -> tuple[Row, ...]:
    """Return the first blocks of the largest script in a workspace; empty if there are no blocks."""
    blocks = workspace.get("blocks")
    top_blocks = blocks.get("blocks") if isinstance(blocks, Mapping) else None
    if not isinstance(top_blocks, list):
        return ()
    scripts = [tuple(_chain(top, 0)) for top in top_blocks if isinstance(top, Mapping)]
    return max(scripts, key=len, default=())[:MAX_ROWS]


def _chain(block: Mapping[str, object], depth: int) -> Iterator[Row]:
    current: object = block
    count = 0
    while isinstance(current, Mapping) and count < MAX_ROWS:
        count += 1
        inputs = current.get("inputs")
        slots = dict(inputs) if isinstance(inputs, Mapping) else {}
        children = [_child(value) for name, value in slots.items() if _is_statement(str(name))]
        fields = current.get("fields")
        values = len(slots) - len(children) + (len(fields) if isinstance(fields, Mapping) else 0)
        block_type = str(current.get("type", ""))
        yield Row(depth, category_of(block_type), len(block_type.rsplit("_", 1)[-1]), min(values, 3))
        if depth < MAX_DEPTH:
            for child in children:
                if child is not None:
                    yield from _chain(child, depth + 1)
        current = _child(current.get("next"))


def _is_statement(name: str) -> bool:
    return name in STATEMENTS or name.startswith(("DO", "ELSE", "THEN"))


def _child(link: object) -> Mapping[str, object] | None:
    block = link.get("block") if isinstance(link, Mapping) else None
    return block if isinstance(block, Mapping) else None


def block_path(rect: QRectF, *, radius: float = 4.0, notch: float = 11.0) -> QPainterPath:
    """Return the outline of a block, with a notch at the top and a matching tab at the bottom.

    Args:
        rect: Rectangle of the block; the tab extends below it.
        radius: Radius of the corners in px.
        notch: Distance of the notch from the left edge, and its width, in px.
    """
    left, top, right, bottom = rect.left(), rect.top(), rect.right(), rect.bottom()
    notch_width, notch_depth = notch, notch * 0.36
    path = QPainterPath(QPointF(left + radius, top))
    path.lineTo(left + notch_width, top)
    path.lineTo(left + notch_width + notch_depth, top + notch_depth)
    path.lineTo(left + 2 * notch_width, top + notch_depth)
    path.lineTo(left + 2 * notch_width + notch_depth, top)
    path.lineTo(right - radius, top)
    path.quadTo(right, top, right, top + radius)
    path.lineTo(right, bottom - radius)
    path.quadTo(right, bottom, right - radius, bottom)
    path.lineTo(left + 2 * notch_width + notch_depth, bottom)
    path.lineTo(left + 2 * notch_width, bottom + notch_depth)
    path.lineTo(left + notch_width + notch_depth, bottom + notch_depth)
    path.lineTo(left + notch_width, bottom)
    path.lineTo(left + radius, bottom)
    path.quadTo(left, bottom, left, bottom - radius)
    path.lineTo(left, top + radius)
    path.quadTo(left, top, left + radius, top)
    path.closeSubpath()
    return path


def paint_rows(painter: QPainter, area: QRectF, theme: Theme, preview_rows: tuple[Row, ...]) -> None:
    """Paint blocks from the top of an area. The painter must be clipped to the area."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    top = area.top()
    for row in preview_rows:
        if top > area.bottom():
            break
        left = area.left() + row.depth * INDENT
        width = 58.0 + 8.0 * row.text_length + 38.0 * row.value_count
        rect = QRectF(left, top, min(width, area.right() - left), ROW_HEIGHT)
        painter.setPen(QPen(theme.block_colour(row.category, "tertiary"), 0.75))
        painter.setBrush(theme.block_colour(row.category))
        painter.drawPath(block_path(rect))
        _paint_content(painter, rect, theme, row)
        top += ROW_HEIGHT + GAP


def _paint_content(painter: QPainter, rect: QRectF, theme: Theme, row: Row) -> None:
    colour = theme.block_text(row.category)
    middle = rect.center().y() + 1
    paint.box(painter, QRectF(rect.left() + 9, middle - 4, 8, 8), 2, colour)
    text_bar = QRectF(rect.left() + 24, middle - 2.5, 10 + 5.0 * row.text_length, 5)
    faint = theme.block_text(row.category)
    faint.setAlphaF(0.75)
    paint.box(painter, text_bar, 2.5, faint)
    left = text_bar.right() + 7
    for _ in range(row.value_count):
        if left + 26 > rect.right() - 4:
            break
        paint.box(painter, QRectF(left, middle - 5, 26, 10), 5, colour)
        left += 32


def paint_grid(painter: QPainter, area: QRectF, theme: Theme, step: float = 24.0) -> None:
    """Paint the dot grid of the canvas, with a distance of ``step`` px between dots."""
    painter.fillRect(area, theme.colour("workspace"))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(theme.colour("grid"))
    y = area.top() + step / 2
    while y < area.bottom():
        x = area.left() + step / 2
        while x < area.right():
            painter.drawEllipse(QPointF(x, y), 1, 1)
            x += step
        y += step
