"""How the camera's view looks where its picture does not reach, and when no new picture comes."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

COARSE = QSize(16, 12)
DIMMED, SILENT = QColor(0, 0, 0, 110), QColor(0, 0, 0, 140)
ICON = 28.0


def paint_around(painter: QPainter, view: QRectF, image: QImage) -> None:
    """Fill the view with the picture's own colours, blurred and dark: beside it there is no black."""
    ignore, smooth = Qt.AspectRatioMode.IgnoreAspectRatio, Qt.TransformationMode.SmoothTransformation
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    painter.drawImage(view, image.scaled(COARSE, ignore, smooth))
    painter.restore()
    painter.fillRect(view, DIMMED)


def grey(image: QImage) -> QImage:
    """The same picture without colours."""
    return image.convertToFormat(QImage.Format.Format_Grayscale8)


def paint_silent(painter: QPainter, theme: Theme, view: QRectF, words: str) -> None:
    """Over a grey picture: a camera, and how old the picture is."""
    painter.fillRect(view, SILENT)
    font = theme.font("bodyLarge")
    font.setWeight(font.Weight.DemiBold)
    line = paint.height_of(font)
    with_icon = view.height() >= ICON + line + 12
    middle = view.center()
    if with_icon:
        square = QRectF(0, 0, ICON, ICON)
        square.moveCenter(QPointF(middle.x(), middle.y() - line / 2 - 2))
        paint_icon(painter, square, "camera", QColor("white"))
    top = middle.y() + ICON / 2 - line / 2 + 4 if with_icon else middle.y() - line / 2
    room = QRectF(view.left() + 8, top, view.width() - 16, line + 2)
    paint.words(painter, room, words, font, QColor("white"), paint.CENTRE)
