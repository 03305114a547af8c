"""Logo of Studio, painted at any size: an N between two amber joints on the accent colour."""

from __future__ import annotations

from PySide6.QtCore import QPoint, QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QIcon, QIconEngine, QPainter, QPaintEvent, QPen, QPixmap, QPolygonF
from PySide6.QtWidgets import QWidget

from app.ui.overrides import guard
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

SIDE = 22
JOINT_RADIUS = 0.12


def paint_logo(painter: QPainter, rect: QRectF, theme: Theme) -> None:
    """Paint the logo into a square."""
    side = rect.width()

    def at(x: float, y: float) -> QPointF:
        return QPointF(rect.left() + x * side, rect.top() + y * side)

    paint.box(painter, rect, side * 0.27, theme.colour("accent"))
    pen = QPen(theme.colour("onAccent"), side * 0.11)
    pen.setCapStyle(Qt.PenCapStyle.RoundCap)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.setPen(pen)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPolyline(QPolygonF([at(0.3, 0.71), at(0.3, 0.29), at(0.7, 0.71), at(0.7, 0.29)]))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(theme.colour("running"))
    for joint in (at(0.3, 0.71), at(0.7, 0.29)):
        painter.drawEllipse(joint, side * JOINT_RADIUS, side * JOINT_RADIUS)


class Logo(QWidget):
    """Widget that shows the logo in the app bar."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setFixedSize(SIDE, SIDE)
        self.setAccessibleName("NEP Studio")

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        paint_logo(painter, QRectF(self.rect()), self._theme)
        painter.end()


@guard  # not a QObject
class LogoEngine(QIconEngine):
    """Icon engine that paints the logo as the window icon."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme

    def paint(self, painter: QPainter, rect: QRect, _mode: QIcon.Mode, _state: QIcon.State) -> None:
        paint_logo(painter, QRectF(rect), self._theme)

    def pixmap(self, size: QSize, mode: QIcon.Mode, state: QIcon.State) -> QPixmap:
        pixmap = QPixmap(size)
        pixmap.fill(Qt.GlobalColor.transparent)
        painter = QPainter(pixmap)
        self.paint(painter, QRect(QPoint(0, 0), size), mode, state)
        painter.end()
        return pixmap

    def clone(self) -> QIconEngine:
        return LogoEngine(self._theme)
