"""The virtual robot's room: the stage that turns metres into pixels, the wall, the floor, what stands there.

The colours are those of an illustration and belong to the drawing, not to the theme; a dark theme dims it.
All lengths are in units of a stage of 382 x 286, the panel of the design at 1440 x 900.
"""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QFont, QLinearGradient, QPainter, QPainterPath, QPen, QPolygonF

from app.ui.robot_state import Room, Thing

WIDTH, HEIGHT = 382.0, 286.0
HORIZON, WALL_FOOT, FLOOR_TOP = 91.0, 157.0, 162.8
BACK, FRONT = 178.0, 280.0  # where things stand at the far wall and nearest to the person
START = 250.6 - HORIZON  # where the robot of the design stands: scale 1
BALL_M, CARD_M = 0.14, 0.30
UNITS_PER_M = 150.0
SHELF_UNITS_PER_M = 66.0
BOOKS = (("#3F7CB3", "#C9523F", "#E2A94F", "#4E8C7A"), ("#4E8C7A", "#7A5BA8", "#3F7CB3"))


@dataclass(frozen=True, slots=True)
class Spot:
    """A place on the floor in stage units, and how large things are there."""

    u: float
    v: float
    scale: float


TABLE = Spot(315.0, 239.0, (239.0 - HORIZON) / START)


@dataclass(frozen=True, slots=True)
class Stage:
    """How a room fills a rectangle: uniform scale, centred; wall and floor go on to the edges."""

    area: QRectF
    room: Room

    @property
    def scale(self) -> float:
        """Pixels per stage unit."""
        return max(0.05, min(self.area.width() / WIDTH, self.area.height() / HEIGHT))

    @property
    def origin(self) -> QPointF:
        """The stage's upper left corner in pixels."""
        return QPointF(
            self.area.center().x() - WIDTH / 2 * self.scale, self.area.center().y() - HEIGHT / 2 * self.scale
        )

    def bounds(self) -> QRectF:
        """The whole area in stage units; it may begin above and left of 0."""
        s, o = self.scale, self.origin
        a = self.area
        return QRectF((a.x() - o.x()) / s, (a.y() - o.y()) / s, a.width() / s, a.height() / s)

    def unit(self, point: QPointF) -> QPointF:
        """A pixel in stage units."""
        return (point - self.origin) / self.scale

    def spot(self, x: float, y: float) -> Spot:
        """Where the floor point (m) is seen; points outside the room are drawn at its edge.

        No camera sees like this: what is far is drawn nearer than it would be, so the robot stays large.
        """
        room = self.room
        depth = _clamp((x - room.x_min) / (room.x_max - room.x_min), 0.0, 1.0)
        v = BACK + (FRONT - BACK) * depth**0.5
        scale = (v - HORIZON) / START
        side = 2 * _clamp((y - room.y_min) / (room.y_max - room.y_min), 0.0, 1.0) - 1
        return Spot(WIDTH / 2 + side * _reach(scale), v, scale)

    def floor(self, point: QPointF) -> tuple[float, float]:
        """The floor point (m) seen at a pixel; always inside the room."""
        unit = self.unit(point)
        room = self.room
        share = _clamp((unit.y() - BACK) / (FRONT - BACK), 0.0, 1.0)
        scale = (BACK + (FRONT - BACK) * share - HORIZON) / START
        side = _clamp((unit.x() - WIDTH / 2) / _reach(scale), -1.0, 1.0)
        return (
            room.x_min + share**2 * (room.x_max - room.x_min),
            room.y_min + (side + 1) / 2 * (room.y_max - room.y_min),
        )


def _reach(scale: float) -> float:
    """How far from the middle the side walls are, in units, where things have this scale."""
    return 70.0 + 96.0 * scale


def _clamp(value: float, low: float, high: float) -> float:
    return min(high, max(low, value))


def paint_room(p: QPainter, bounds: QRectF) -> None:
    """Wall, window, floor; ``p`` is in stage units and ``bounds`` is all that is to be filled."""
    wall = QLinearGradient(0, bounds.top(), 0, WALL_FOOT)
    wall.setColorAt(0, QColor("#E8E4DA"))
    wall.setColorAt(1, QColor("#DCD4C8"))
    p.fillRect(QRectF(bounds.left(), bounds.top(), bounds.width(), WALL_FOOT - bounds.top()), wall)
    p.fillRect(QRectF(bounds.left(), WALL_FOOT, bounds.width(), FLOOR_TOP - WALL_FOOT), QColor("#F1ECE1"))
    floor = QLinearGradient(0, FLOOR_TOP, 0, HEIGHT)
    floor.setColorAt(0, QColor("#B89A76"))
    floor.setColorAt(1, QColor("#CBB08D"))
    p.fillRect(QRectF(bounds.left(), FLOOR_TOP, bounds.width(), bounds.bottom() - FLOOR_TOP), floor)
    _planks(p, bounds)
    _window(p)
    _picture(p)


def _planks(p: QPainter, bounds: QRectF) -> None:
    p.save()
    p.setClipRect(QRectF(bounds.left(), FLOOR_TOP, bounds.width(), bounds.bottom() - FLOOR_TOP))
    p.setPen(QPen(QColor(140, 108, 74, 90), 1.0))
    reach = (bounds.bottom() - HORIZON) / (HEIGHT - HORIZON)
    count = int(bounds.width() / 25.0) + 2
    for plank in range(-count, count + 1):
        along = plank * 70.6 * reach
        p.drawLine(QLineF(WIDTH / 2, HORIZON, WIDTH / 2 + along, bounds.bottom()))
    p.restore()


def _window(p: QPainter) -> None:
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


def _picture(p: QPainter) -> None:
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor("#3B3F4A"))
    p.drawRoundedRect(QRectF(283, 38.5, 62.5, 48), 1.5, 1.5)
    p.setBrush(QColor("#E2A94F"))
    points = ((287, 83), (303, 61.5), (315, 72), (324.5, 60.5), (341.5, 83))
    p.drawPolygon(QPolygonF([QPointF(x, y) for x, y in points]))


def _table(p: QPainter, spot: Spot) -> None:
    """A table with a plant on it, drawn where the design has it and moved from there."""
    p.save()
    p.translate(spot.u, spot.v)
    p.scale(spot.scale / TABLE.scale, spot.scale / TABLE.scale)
    p.translate(-TABLE.u, -TABLE.v)
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor(60, 40, 20, 46))
    p.drawEllipse(QPointF(315, 239.5), 52, 5)
    p.fillRect(QRectF(267.5, 192, 6.8, 47), QColor("#765236"))
    p.fillRect(QRectF(356.3, 192, 6.8, 47), QColor("#765236"))
    p.setBrush(QColor("#8B6644"))
    top = ((275.5, 178.2), (355, 178.2), (368.6, 189.5), (262, 189.5))
    p.drawPolygon(QPolygonF([QPointF(x, y) for x, y in top]))
    p.fillRect(QRectF(262, 189.3, 106.6, 5), QColor("#9E7654"))
    leaves = QPainterPath(QPointF(314, 154))
    leaves.cubicTo(QPointF(311, 142), QPointF(302, 138), QPointF(295.5, 141))
    leaves.cubicTo(QPointF(298, 147), QPointF(304, 152), QPointF(314, 154))
    leaves.cubicTo(QPointF(313, 140), QPointF(319, 130), QPointF(327.5, 130.5))
    leaves.cubicTo(QPointF(329, 140), QPointF(324, 150), QPointF(314, 154))
    p.fillPath(leaves, QColor("#3E7D4C"))
    p.setBrush(QColor("#4E8C7A"))
    p.drawRoundedRect(QRectF(304, 153, 21, 25.5), 2.4, 2.4)
    p.restore()


def _shelf(p: QPainter, area: QRectF) -> None:
    """Two boards with books, lower than it is, so that the window stays in view."""
    p.fillRect(area, QColor("#8B6644"))
    edge = area.width() * 0.07
    inside = area.adjusted(edge, edge, -edge, -edge * 0.6)
    p.fillRect(inside, QColor("#6B4A2F"))
    board = inside.height() / 2
    for row in range(2):
        bottom = inside.top() + board * (row + 1)
        p.fillRect(QRectF(inside.left(), bottom - edge * 0.7, inside.width(), edge * 0.7), QColor("#9E7654"))
        x = inside.left() + edge * 0.6
        for place, colour in enumerate(BOOKS[row]):
            wide, high = edge * (1.5 + place % 2 * 0.5), board * (0.62 + 0.09 * (place * 2 % 3))
            p.fillRect(QRectF(x, bottom - edge * 0.7 - high, wide, high), QColor(colour))
            x += wide + edge * 0.25


def thing_area(thing: Thing, spot: Spot) -> QRectF:
    """Where a thing is seen, in stage units."""
    if thing.kind == "place":
        return QRectF(spot.u - 30 * spot.scale, spot.v - 8 * spot.scale, 60 * spot.scale, 16 * spot.scale)
    if thing.kind == "shelf":
        high = (thing.height_m or 1.2) * SHELF_UNITS_PER_M * spot.scale
        return QRectF(spot.u - 27 * spot.scale, spot.v - high, 54 * spot.scale, high)
    if thing.kind == "ball":
        r = max(4.0, (thing.size_m or BALL_M) * 110.0 * spot.scale)
        return QRectF(spot.u - r, spot.v - 2 * r + r * 0.08, 2 * r, 2 * r)
    if thing.kind == "table":
        share = spot.scale / TABLE.scale
        return QRectF(spot.u - 53 * share, spot.v - 61 * share, 106 * share, 61 * share)
    wide = max(10.0, min(thing.size_m or CARD_M, CARD_M * 0.8) * UNITS_PER_M * spot.scale)
    return QRectF(spot.u - wide / 2, spot.v - 78 * spot.scale - wide * 0.6, wide, wide * 1.2)


def paint_thing(p: QPainter, thing: Thing, spot: Spot, font: QFont) -> None:
    """A ball, a table, a place with its name, or a card on a stand (a face, a marker, a shelf)."""
    area = thing_area(thing, spot)
    p.setPen(Qt.PenStyle.NoPen)
    if thing.kind == "table":
        _table(p, spot)
        return
    if thing.kind == "shelf":
        _shelf(p, area)
        return
    if thing.kind == "ball":
        _ball(p, area, QColor(thing.colour or "#D8403F"))
        return
    if thing.kind == "place":
        _place(p, area, thing.name, font)
        return
    p.setBrush(QColor(60, 40, 20, 70))
    p.drawEllipse(QPointF(spot.u, spot.v), area.width() * 0.34, area.width() * 0.08)
    p.setPen(QPen(QColor("#6B6F7A"), 2.2 * spot.scale, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    p.drawLine(QLineF(spot.u, spot.v, spot.u, area.bottom()))
    p.setPen(QPen(QColor("#C9CCD4"), 0.8))
    p.setBrush(QColor("#FBFAF7"))
    p.drawRoundedRect(area, 2.5 * spot.scale, 2.5 * spot.scale)
    if thing.kind in {"face", "person"}:
        _face_card(p, area)
    elif thing.kind == "marker":
        _marker_card(p, area)


def _ball(p: QPainter, area: QRectF, colour: QColor) -> None:
    r = area.width() / 2
    p.setBrush(QColor(60, 40, 20, 92))
    p.drawEllipse(QPointF(area.center().x(), area.bottom() + r * 0.05), r, r * 0.24)
    p.setBrush(QBrush(colour))
    p.drawEllipse(area)
    p.setBrush(Qt.BrushStyle.NoBrush)
    shine = QPen(QColor(255, 255, 255, 190), max(1.0, r * 0.16))
    shine.setCapStyle(Qt.PenCapStyle.RoundCap)
    p.setPen(shine)
    inner = area.adjusted(r * 0.18, r * 0.18, -r * 0.18, -r * 0.18)
    p.drawArc(inner, 50 * 16, 92 * 16)


def _place(p: QPainter, area: QRectF, name: str, font: QFont) -> None:
    """Somebody who stands between the robot and the person at the screen: only a mark on the floor."""
    p.setPen(QPen(QColor(63, 124, 179, 210), 1.4))
    p.setBrush(QColor(63, 124, 179, 70))
    p.drawEllipse(area)
    words = QFont(font)
    words.setPixelSize(10)
    words.setWeight(QFont.Weight.DemiBold)
    p.setFont(words)
    p.setPen(QColor("#1F4468"))
    p.drawText(area, int(Qt.AlignmentFlag.AlignCenter), name)


def _face_card(p: QPainter, area: QRectF) -> None:
    w, c = area.width(), area.center()
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor("#3F7CB3"))
    p.drawChord(QRectF(c.x() - w * 0.36, c.y() + w * 0.24, w * 0.72, w * 0.7), 0, 180 * 16)
    p.setBrush(QColor("#E8B48C"))
    p.drawRect(QRectF(c.x() - w * 0.09, c.y() + w * 0.1, w * 0.18, w * 0.22))
    p.drawEllipse(QPointF(c.x(), c.y() - w * 0.06), w * 0.23, w * 0.28)
    p.setBrush(QColor("#4A3026"))
    p.drawChord(QRectF(c.x() - w * 0.25, c.y() - w * 0.38, w * 0.5, w * 0.5), 10 * 16, 160 * 16)
    for side in (-1, 1):
        p.setBrush(QColor("#26211E"))
        p.drawEllipse(QPointF(c.x() + side * w * 0.09, c.y() - w * 0.04), w * 0.028, w * 0.03)
    p.setPen(QPen(QColor("#8A4638"), max(0.8, w * 0.03)))
    p.drawArc(QRectF(c.x() - w * 0.09, c.y() - w * 0.02, w * 0.18, w * 0.12), 200 * 16, 140 * 16)


def _marker_card(p: QPainter, area: QRectF) -> None:
    w = area.width() * 0.76
    left, top = area.center().x() - w / 2, area.center().y() - w / 2
    p.setPen(Qt.PenStyle.NoPen)
    p.fillRect(QRectF(left, top, w, w), QColor("#1D1E22"))
    cell = w / 6
    for row, bits in enumerate((0b1010, 0b0110, 0b1001, 0b1110)):
        for column in range(4):
            if bits >> column & 1:
                white = QRectF(left + cell * (column + 1), top + cell * (row + 1), cell, cell)
                p.fillRect(white, QColor("#FBFAF7"))
