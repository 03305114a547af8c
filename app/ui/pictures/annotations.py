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

MIN_PEN_WIDTH, MAX_PEN_WIDTH = 1.0, 64.0
MIN_FONT_PX, MAX_FONT_PX = 8.0, 96.0
AREA_LABEL_SIZE_PX = 12.0
BAR_SIZE = QSizeF(12, 140)
BAR_MARGIN = 10
MIN_BAR_HEIGHT = 40


def paint_annotations(
    painter: QPainter, theme: Theme, to_view: QTransform, scale: float, annotations: Iterable[AnnotationShape]
) -> None:
    """Paint annotations over an image.

    Args:
        painter: Painter in view coordinates.
        theme: Theme, for the fonts.
        to_view: Transform from image fractions to the view.
        scale: Width of an image pixel in the view.
        annotations: Annotations.
    """
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    for annotation in annotations:
        points = [to_view.map(QPointF(x, y)) for x, y in annotation.points]
        painter.setPen(_pen(annotation.outline, annotation.thickness * scale))
        painter.setBrush(_brush(annotation.fill))
        _paint_annotation(painter, theme, to_view, scale, annotation, points)
    painter.restore()


def _paint_annotation(
    painter: QPainter,
    theme: Theme,
    to_view: QTransform,
    scale: float,
    annotation: AnnotationShape,
    points: list[QPointF],
) -> None:
    if annotation.kind == "points":
        radius = max(1.5, annotation.thickness * scale)
        painter.setBrush(_brush(annotation.outline or annotation.fill))
        painter.setPen(Qt.PenStyle.NoPen)
        for point in points:
            painter.drawEllipse(point, radius, radius)
    elif annotation.kind == "circle":
        bounds = QRectF(0, 0, annotation.size[0] * 2, annotation.size[1] * 2)
        bounds.moveCenter(QPointF(*annotation.points[0]))
        painter.drawEllipse(to_view.mapRect(bounds))
    elif annotation.kind == "area":
        painter.drawPolygon(QPolygonF(points))
        if annotation.text:
            corner = QPolygonF(points).boundingRect().topLeft()
            _paint_text(painter, theme, corner, AREA_LABEL_SIZE_PX, annotation)
    elif annotation.kind == "line":
        painter.drawPolyline(QPolygonF(points))
    else:
        text_height = to_view.mapRect(QRectF(0, 0, annotation.size[1], annotation.size[1])).height()
        _paint_text(painter, theme, points[0], text_height, annotation)


def _paint_text(
    painter: QPainter, theme: Theme, position: QPointF, height: float, annotation: AnnotationShape
) -> None:
    # The lower left corner of the text is at `position`; the text is upright for any rotation of the image.
    font, text = theme.font("small"), annotation.text
    font.setPixelSize(round(min(max(height, MIN_FONT_PX), MAX_FONT_PX)))
    metrics = QFontMetricsF(font)
    text_rect = QRectF(
        position.x(), position.y() - metrics.height(), metrics.horizontalAdvance(text) + 4, metrics.height()
    )
    if annotation.fill is not None:
        painter.fillRect(text_rect, _to_qcolor(annotation.fill))
    colour = _to_qcolor(annotation.outline) if annotation.outline is not None else QColor("white")
    paint.text_line(painter, text_rect.adjusted(2, 0, 2, 0), text, font, colour)


def _pen(colour: Colour | None, width: float) -> QPen:
    if colour is None:
        return QPen(Qt.PenStyle.NoPen)
    pen = QPen(_to_qcolor(colour), min(max(width, MIN_PEN_WIDTH), MAX_PEN_WIDTH))
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
    line_height = paint.height_of(font)
    height = min(BAR_SIZE.height(), view.height() - 2 * BAR_MARGIN - 2 * line_height - 40)
    if height < MIN_BAR_HEIGHT:
        return
    labels = (bar_label(scale.high), bar_label(scale.low / 2 + scale.high / 2), bar_label(scale.low))
    width = max(paint.width_of(font, text) for text in labels)
    background = QRectF(0, 0, BAR_SIZE.width() + width + 22, height + line_height + 8)
    background.moveTopRight(QPointF(view.right() - BAR_MARGIN, view.top() + BAR_MARGIN))
    paint.box(painter, background, 4, QColor(0, 0, 0, 190))
    bar = QRectF(
        background.right() - BAR_SIZE.width() - 7,
        background.top() + line_height / 2 + 4,
        BAR_SIZE.width(),
        height,
    )
    painter.drawImage(bar, bar_image(scale))
    for text, y in zip(labels, (bar.top(), bar.center().y(), bar.bottom()), strict=True):
        text_rect = QRectF(background.left() + 7, y - line_height / 2, width, line_height)
        paint.text_line(painter, text_rect, text, font, QColor("white"), paint.RIGHT)


def bar_image(scale: ColourScale) -> QImage:
    """Return the 256 colours of a scale as an image one pixel wide, with the last colour at the top."""
    colours = scale.colours[::-1].copy()
    return QImage(colours.data, 1, 256, 3, QImage.Format.Format_RGB888).copy()
