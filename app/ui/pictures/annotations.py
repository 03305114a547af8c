"""Painting of image annotations (points, lines, areas, circles, texts) and of the colour bar."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QBrush, QColor, QFontMetricsF, QImage, QPainter, QPen, QPolygonF, QTransform

from app.core.messages.annotations import AnnotationShape, Colour
from app.core.messages.image_style import ColourScale
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import number

MIN_PEN, MAX_PEN = 1.0, 64.0
MIN_FONT_PX, MAX_FONT_PX = 8.0, 96.0
AREA_LABEL_SIZE_PX = 12.0
BAR_SIZE = QSizeF(12, 140)
BAR_MARGIN = 10
MIN_BAR_HEIGHT = 40


def paint_annotations(
    painter: QPainter, theme: Theme, shares: QTransform, scale: float, drawn: Iterable[AnnotationShape]
) -> None:
    """Paint annotations over an image.

    Args:
        painter: Painter in view coordinates.
        theme: Theme, for the fonts.
        shares: Transform from image fractions to the view.
        scale: Width of an image pixel in the view.
        drawn: Annotations.
    """
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    for shape in drawn:
        points = [shares.map(QPointF(x, y)) for x, y in shape.points]
        painter.setPen(_pen(shape.outline, shape.thickness * scale))
        painter.setBrush(_brush(shape.fill))
        _paint_annotation(painter, theme, shares, scale, shape, points)
    painter.restore()


def _paint_annotation(
    painter: QPainter,
    theme: Theme,
    shares: QTransform,
    scale: float,
    drawn: AnnotationShape,
    points: list[QPointF],
) -> None:
    if drawn.kind == "points":
        radius = max(1.5, drawn.thickness * scale)
        painter.setBrush(_brush(drawn.outline or drawn.fill))
        painter.setPen(Qt.PenStyle.NoPen)
        for point in points:
            painter.drawEllipse(point, radius, radius)
    elif drawn.kind == "circle":
        around = QRectF(0, 0, drawn.size[0] * 2, drawn.size[1] * 2)
        around.moveCenter(QPointF(*drawn.points[0]))
        painter.drawEllipse(shares.mapRect(around))
    elif drawn.kind == "area":
        painter.drawPolygon(QPolygonF(points))
        if drawn.text:
            corner = QPolygonF(points).boundingRect().topLeft()
            _paint_text(painter, theme, corner, AREA_LABEL_SIZE_PX, drawn)
    elif drawn.kind == "line":
        painter.drawPolyline(QPolygonF(points))
    else:
        text_height = shares.mapRect(QRectF(0, 0, drawn.size[1], drawn.size[1])).height()
        _paint_text(painter, theme, points[0], text_height, drawn)


def _paint_text(
    painter: QPainter, theme: Theme, position: QPointF, height: float, drawn: AnnotationShape
) -> None:
    # The lower left corner of the text is at `position`; the text is upright for any rotation of the image.
    font, text = theme.font("small"), drawn.text
    font.setPixelSize(round(min(max(height, MIN_FONT_PX), MAX_FONT_PX)))
    metrics = QFontMetricsF(font)
    room = QRectF(
        position.x(), position.y() - metrics.height(), metrics.horizontalAdvance(text) + 4, metrics.height()
    )
    if drawn.fill is not None:
        painter.fillRect(room, _to_qcolor(drawn.fill))
    colour = _to_qcolor(drawn.outline) if drawn.outline is not None else QColor("white")
    paint.text_line(painter, room.adjusted(2, 0, 2, 0), text, font, colour)


def _pen(colour: Colour | None, width: float) -> QPen:
    if colour is None:
        return QPen(Qt.PenStyle.NoPen)
    pen = QPen(_to_qcolor(colour), min(max(width, MIN_PEN), MAX_PEN))
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    return pen


def _brush(colour: Colour | None) -> QBrush:
    return QBrush(_to_qcolor(colour)) if colour is not None else QBrush(Qt.BrushStyle.NoBrush)


def _to_qcolor(colour: Colour) -> QColor:
    return QColor.fromRgbF(*colour)


def bar_label(value: float) -> str:
    """Format a value of the colour bar with four significant digits."""
    return number(value, ".4g")


def paint_colour_bar(painter: QPainter, theme: Theme, view: QRectF, scale: ColourScale) -> None:
    """Paint the colour bar at the upper right of the view; nothing if the view is not high enough."""
    font = theme.font("small")
    line = paint.height_of(font)
    height = min(BAR_SIZE.height(), view.height() - 2 * BAR_MARGIN - 2 * line - 40)
    if height < MIN_BAR_HEIGHT:
        return
    labels = (bar_label(scale.high), bar_label(scale.low / 2 + scale.high / 2), bar_label(scale.low))
    width = max(paint.width_of(font, text) for text in labels)
    ground = QRectF(0, 0, BAR_SIZE.width() + width + 22, height + line + 8)
    ground.moveTopRight(QPointF(view.right() - BAR_MARGIN, view.top() + BAR_MARGIN))
    paint.box(painter, ground, 4, QColor(0, 0, 0, 190))
    bar = QRectF(ground.right() - BAR_SIZE.width() - 7, ground.top() + line / 2 + 4, BAR_SIZE.width(), height)
    painter.drawImage(bar, bar_image(scale))
    for text, y in zip(labels, (bar.top(), bar.center().y(), bar.bottom()), strict=True):
        text_rect = QRectF(ground.left() + 7, y - line / 2, width, line)
        paint.text_line(painter, text_rect, text, font, QColor("white"), paint.RIGHT)


def bar_image(scale: ColourScale) -> QImage:
    """Return the 256 colours of a scale as an image one pixel wide, with the last colour at the top."""
    colours = scale.colours[::-1].copy()
    return QImage(colours.data, 1, 256, 3, QImage.Format.Format_RGB888).copy()
