"""Styles of curves. Dash patterns and marks also distinguish curves for colour-blind users."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import lazy

LINE_WIDTH = 1.75
COLOUR_NAMES = (lazy("Blue"), lazy("Orange"), lazy("Green"), lazy("Pink"), lazy("Yellow"), lazy("Violet"))
"""Displayed names of the theme's curve colours, in the order of the theme."""
DASH_PATTERNS: tuple[tuple[float, ...], ...] = ((), (6, 4), (2, 4), (12, 4))
"""Dash patterns in px; the first one is solid."""
LANE_FILL_ALPHA, LANE_EDGE_ALPHA = 0.20, 0.55


@dataclass(frozen=True, slots=True)
class CurveStyle:
    """Style of a curve.

    Attributes:
        colour: Index of a curve colour of the theme.
        pattern: Index of a dash pattern and a mark.
    """

    colour: int
    pattern: int

    def line_colour(self, theme: Theme) -> QColor:
        """Return the colour of the line."""
        return theme.series(self.colour)

    def pen(self, theme: Theme, *, is_dense: bool = False) -> QPen:
        """Return the pen of the line.

        Args:
            theme: Theme with the colours.
            is_dense: True for a line with many points, which is painted thin and solid because that is
                faster.
        """
        pen = QPen(self.line_colour(theme), 1.0 if is_dense else LINE_WIDTH)
        pen.setCosmetic(True)
        dash = DASH_PATTERNS[self.pattern % len(DASH_PATTERNS)]
        if dash and not is_dense:
            pen.setDashPattern([pixels / LINE_WIDTH for pixels in dash])
            pen.setCapStyle(Qt.PenCapStyle.FlatCap)
        return pen

    def paint_mark(self, painter: QPainter, theme: Theme, centre: QPointF, size: float = 8.0) -> None:
        """Paint the mark of the style: a disc, square, triangle or diamond with an outline.

        Args:
            painter: Painter to use.
            theme: Theme with the colours.
            centre: Centre of the mark.
            size: Width of the mark in px.
        """
        half = size / 2
        painter.setPen(QPen(theme.colour("panel"), 1))
        painter.setBrush(self.line_colour(theme))
        match self.pattern % 4:
            case 0:
                painter.drawEllipse(centre, half, half)
            case 1:
                painter.drawRect(QRectF(centre.x() - half, centre.y() - half, size, size))
            case 2:
                extent = half + 0.5
                offsets = [(0.0, -extent), (extent, half), (-extent, half)]
                painter.drawPolygon(QPolygonF([centre + QPointF(x, y) for x, y in offsets]))
            case _:
                extent = half + 1
                offsets = [(0.0, -extent), (extent, 0.0), (0.0, extent), (-extent, 0.0)]
                painter.drawPolygon(QPolygonF([centre + QPointF(x, y) for x, y in offsets]))


@dataclass(frozen=True, slots=True)
class Stroke:
    """Sample of a curve's style in a table cell.

    Attributes:
        style: Style of the curve.
        is_state: True for a curve of states, whose sample is a box instead of a line with a mark.
        is_hidden: True for a hidden curve, whose sample is faded.
    """

    style: CurveStyle
    is_state: bool
    is_hidden: bool

    def paint(self, painter: QPainter, box: QRectF, theme: Theme) -> None:
        """Paint the sample, vertically centred in the cell."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setOpacity(0.35 if self.is_hidden else 1.0)
        middle = box.center().y()
        width = min(box.width(), 34.0)
        if self.is_state:
            paint_state(painter, theme, QRectF(box.left(), middle - 7, width, 14), self.style)
        else:
            painter.setPen(self.style.pen(theme))
            painter.drawLine(QPointF(box.left(), middle), QPointF(box.left() + width, middle))
            self.style.paint_mark(painter, theme, QPointF(box.left() + width / 2, middle))
        painter.setOpacity(1.0)


def paint_state(painter: QPainter, theme: Theme, box: QRectF, style: CurveStyle) -> None:
    """Paint the box of a state.

    Args:
        painter: Painter to use.
        theme: Theme with the colours.
        box: Rectangle of the state.
        style: Style of the curve.
    """
    fill, edge = style.line_colour(theme), style.line_colour(theme)
    fill.setAlphaF(LANE_FILL_ALPHA)
    edge.setAlphaF(1.0 if theme.is_high_contrast else LANE_EDGE_ALPHA)
    paint.box(painter, box, theme.radius("key"), fill, edge)
