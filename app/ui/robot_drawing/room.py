"""Room of the virtual robots: projection from metres to pixels, and painting of wall, window and floor.

The colours belong to the illustration, not to the theme; a dark theme dims them. Lengths are in stage units:
the stage is 382 x 286 units large, which is the size of the panel in px in a window of 1440 x 900 px.
"""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QLinearGradient, QPainter, QPainterPath, QPen, QPolygonF

from app.ui.robot_drawing.state import RoomBounds

WIDTH, HEIGHT = 382.0, 286.0
HORIZON, WALL_FOOT, FLOOR_TOP = 91.0, 157.0, 162.8
BACK, FRONT = 178.0, 280.0  # vertical positions of things at the far wall, and nearest to the viewer
UNIT_SCALE_DEPTH = 250.6 - HORIZON  # distance below the horizon at which the scale of things is 1


@dataclass(frozen=True, slots=True)
class Spot:
    """Position on the stage in stage units, with the scale of objects there.

    Attributes:
        u: Horizontal position.
        v: Vertical position.
        scale: Scale of objects at this position.
    """

    u: float
    v: float
    scale: float


@dataclass(frozen=True, slots=True)
class Stage:
    """Projection of the room into a rectangle.

    The stage is scaled uniformly and centred; wall and floor extend to the edges of the rectangle.

    Attributes:
        area: Rectangle in px.
        room: Extent of the room in m.
    """

    area: QRectF
    room: RoomBounds

    @property
    def scale(self) -> float:
        """Pixels per stage unit."""
        return max(0.05, min(self.area.width() / WIDTH, self.area.height() / HEIGHT))

    @property
    def origin(self) -> QPointF:
        """Upper left corner of the stage in pixels."""
        return QPointF(
            self.area.center().x() - WIDTH / 2 * self.scale, self.area.center().y() - HEIGHT / 2 * self.scale
        )

    def bounds(self) -> QRectF:
        """Return the rectangle in stage units; its left and top may be negative."""
        s, o = self.scale, self.origin
        a = self.area
        return QRectF((a.x() - o.x()) / s, (a.y() - o.y()) / s, a.width() / s, a.height() / s)

    def to_units(self, point: QPointF) -> QPointF:
        """Convert a point from px to stage units."""
        return (point - self.origin) / self.scale

    def spot_at(self, x: float, y: float) -> Spot:
        """Convert a floor point in m, limited to the room, to a position on the stage.

        The projection is no true perspective: distant objects appear closer, so that the robot stays large.
        """
        room = self.room
        depth = _clamp((x - room.x_min) / (room.x_max - room.x_min), 0.0, 1.0)
        v = BACK + (FRONT - BACK) * depth**0.5
        scale = (v - HORIZON) / UNIT_SCALE_DEPTH
        side = 2 * _clamp((y - room.y_min) / (room.y_max - room.y_min), 0.0, 1.0) - 1
        return Spot(WIDTH / 2 + side * _half_width(scale), v, scale)

    def floor_at(self, point: QPointF) -> tuple[float, float]:
        """Convert a point in px to a floor point in m, limited to the room."""
        unit = self.to_units(point)
        room = self.room
        depth_fraction = _clamp((unit.y() - BACK) / (FRONT - BACK), 0.0, 1.0)
        scale = (BACK + (FRONT - BACK) * depth_fraction - HORIZON) / UNIT_SCALE_DEPTH
        side = _clamp((unit.x() - WIDTH / 2) / _half_width(scale), -1.0, 1.0)
        return (
            room.x_min + depth_fraction**2 * (room.x_max - room.x_min),
            room.y_min + (side + 1) / 2 * (room.y_max - room.y_min),
        )


def _half_width(scale: float) -> float:
    # Distance of the side walls from the centre, at a scale.
    return 70.0 + 96.0 * scale


def _clamp(value: float, low: float, high: float) -> float:
    return min(high, max(low, value))


def paint_room(p: QPainter, bounds: QRectF) -> None:
    """Paint the wall with window and picture, and the floor.

    Args:
        p: Painter in stage units.
        bounds: Area to fill.
    """
    wall = QLinearGradient(0, bounds.top(), 0, WALL_FOOT)
    wall.setColorAt(0, QColor("#E8E4DA"))
    wall.setColorAt(1, QColor("#DCD4C8"))
    p.fillRect(QRectF(bounds.left(), bounds.top(), bounds.width(), WALL_FOOT - bounds.top()), wall)
    p.fillRect(QRectF(bounds.left(), WALL_FOOT, bounds.width(), FLOOR_TOP - WALL_FOOT), QColor("#F1ECE1"))
    floor = QLinearGradient(0, FLOOR_TOP, 0, HEIGHT)
    floor.setColorAt(0, QColor("#B89A76"))
    floor.setColorAt(1, QColor("#CBB08D"))
    p.fillRect(QRectF(bounds.left(), FLOOR_TOP, bounds.width(), bounds.bottom() - FLOOR_TOP), floor)
    _paint_planks(p, bounds)
    _paint_window(p)
    _paint_picture(p)


def _paint_planks(p: QPainter, bounds: QRectF) -> None:
    p.save()
    p.setClipRect(QRectF(bounds.left(), FLOOR_TOP, bounds.width(), bounds.bottom() - FLOOR_TOP))
    p.setPen(QPen(QColor(140, 108, 74, 90), 1.0))
    scale = (bounds.bottom() - HORIZON) / (HEIGHT - HORIZON)
    count = int(bounds.width() / 25.0) + 2
    for plank in range(-count, count + 1):
        along = plank * 70.6 * scale
        p.drawLine(QLineF(WIDTH / 2, HORIZON, WIDTH / 2 + along, bounds.bottom()))
    p.restore()


def _paint_window(p: QPainter) -> None:
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor("#F6F3EB"))
    p.drawRoundedRect(QRectF(27, 29, 88, 75), 2, 2)
    pane = QRectF(31.8, 34, 78.4, 65)
    sky = QLinearGradient(0, pane.top(), 0, pane.bottom())
    sky.setColorAt(0, QColor("#A9CDEE"))
    sky.setColorAt(1, QColor("#D9E8F6"))
    p.fillRect(pane, sky)
    p.save()
    p.setClipRect(pane)
    hills = QPainterPath(QPointF(31.8, 88))
    hills.cubicTo(QPointF(42, 76), QPointF(55, 78), QPointF(64, 84.5))
    hills.cubicTo(QPointF(74, 73), QPointF(92, 75), QPointF(110.4, 87))
    hills.lineTo(110.4, 100)
    hills.lineTo(31.8, 100)
    p.fillPath(hills, QColor("#8FB38F"))
    p.restore()
    p.fillRect(QRectF(69.2, 33, 3.6, 67), QColor("#F6F3EB"))
    p.fillRect(QRectF(31, 64.8, 80, 3.4), QColor("#F6F3EB"))


def _paint_picture(p: QPainter) -> None:
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor("#3B3F4A"))
    p.drawRoundedRect(QRectF(283, 38.5, 62.5, 48), 1.5, 1.5)
    p.setBrush(QColor("#E2A94F"))
    points = ((287, 83), (303, 61.5), (315, 72), (324.5, 60.5), (341.5, 83))
    p.drawPolygon(QPolygonF([QPointF(x, y) for x, y in points]))
