"""Painting of the objects in the room: ball, table, shelf, cards, and marks for positions of people.

All lengths are in stage units (`app.ui.robot_drawing.room`).
"""

from __future__ import annotations

from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QFont, QPainter, QPainterPath, QPen, QPolygonF

from app.ui.robot_drawing.room import HORIZON, UNIT_SCALE_DEPTH, Spot
from app.ui.robot_drawing.state import Thing

BALL_M, CARD_M = 0.14, 0.30
UNITS_PER_M = 150.0
SHELF_UNITS_PER_M = 66.0
BOOK_COLOURS = (("#3F7CB3", "#C9523F", "#E2A94F", "#4E8C7A"), ("#4E8C7A", "#7A5BA8", "#3F7CB3"))
TABLE_SPOT = Spot(315.0, 239.0, (239.0 - HORIZON) / UNIT_SCALE_DEPTH)


def _paint_table(p: QPainter, spot: Spot) -> None:
    # Painted with the coordinates of `TABLE_SPOT`, and transformed from there to `spot`.
    p.save()
    p.translate(spot.u, spot.v)
    p.scale(spot.scale / TABLE_SPOT.scale, spot.scale / TABLE_SPOT.scale)
    p.translate(-TABLE_SPOT.u, -TABLE_SPOT.v)
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


def _paint_shelf(p: QPainter, area: QRectF) -> None:
    # Lower than a real table, so that the window stays visible.
    p.fillRect(area, QColor("#8B6644"))
    frame_width = area.width() * 0.07
    inner = area.adjusted(frame_width, frame_width, -frame_width, -frame_width * 0.6)
    p.fillRect(inner, QColor("#6B4A2F"))
    board = inner.height() / 2
    for row in range(2):
        bottom = inner.top() + board * (row + 1)
        p.fillRect(
            QRectF(inner.left(), bottom - frame_width * 0.7, inner.width(), frame_width * 0.7),
            QColor("#9E7654"),
        )
        x = inner.left() + frame_width * 0.6
        for index, colour in enumerate(BOOK_COLOURS[row]):
            width, height = frame_width * (1.5 + index % 2 * 0.5), board * (0.62 + 0.09 * (index * 2 % 3))
            p.fillRect(QRectF(x, bottom - frame_width * 0.7 - height, width, height), QColor(colour))
            x += width + frame_width * 0.25


def thing_area(thing: Thing, spot: Spot) -> QRectF:
    """Return the bounding rectangle of an object in stage units.

    Args:
        thing: Object.
        spot: Position of the object on the stage.
    """
    if thing.kind == "place":
        return QRectF(spot.u - 30 * spot.scale, spot.v - 8 * spot.scale, 60 * spot.scale, 16 * spot.scale)
    if thing.kind == "shelf":
        height = (thing.height_m or 1.2) * SHELF_UNITS_PER_M * spot.scale
        return QRectF(spot.u - 27 * spot.scale, spot.v - height, 54 * spot.scale, height)
    if thing.kind == "ball":
        r = max(4.0, (thing.size_m or BALL_M) * 110.0 * spot.scale)
        return QRectF(spot.u - r, spot.v - 2 * r + r * 0.08, 2 * r, 2 * r)
    if thing.kind == "table":
        relative_scale = spot.scale / TABLE_SPOT.scale
        return QRectF(
            spot.u - 53 * relative_scale,
            spot.v - 61 * relative_scale,
            106 * relative_scale,
            61 * relative_scale,
        )
    width = max(10.0, min(thing.size_m or CARD_M, CARD_M * 0.8) * UNITS_PER_M * spot.scale)
    return QRectF(spot.u - width / 2, spot.v - 78 * spot.scale - width * 0.6, width, width * 1.2)


def paint_thing(p: QPainter, thing: Thing, spot: Spot, font: QFont) -> None:
    """Paint an object: a ball, a table, a shelf, a mark with a name, or a card on a stand (face or marker).

    Args:
        p: Painter in stage units.
        thing: Object.
        spot: Position of the object on the stage.
        font: Font of the name.
    """
    area = thing_area(thing, spot)
    p.setPen(Qt.PenStyle.NoPen)
    if thing.kind == "table":
        _paint_table(p, spot)
        return
    if thing.kind == "shelf":
        _paint_shelf(p, area)
        return
    if thing.kind == "ball":
        _paint_ball(p, area, QColor(thing.colour or "#D8403F"))
        return
    if thing.kind == "place":
        _paint_position(p, area, thing.name, font)
        return
    p.setBrush(QColor(60, 40, 20, 70))
    p.drawEllipse(QPointF(spot.u, spot.v), area.width() * 0.34, area.width() * 0.08)
    p.setPen(QPen(QColor("#6B6F7A"), 2.2 * spot.scale, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    p.drawLine(QLineF(spot.u, spot.v, spot.u, area.bottom()))
    p.setPen(QPen(QColor("#C9CCD4"), 0.8))
    p.setBrush(QColor("#FBFAF7"))
    p.drawRoundedRect(area, 2.5 * spot.scale, 2.5 * spot.scale)
    if thing.kind in {"face", "person"}:
        _paint_face_card(p, area)
    elif thing.kind == "marker":
        _paint_marker_card(p, area)


def _paint_ball(p: QPainter, area: QRectF, colour: QColor) -> None:
    r = area.width() / 2
    p.setBrush(QColor(60, 40, 20, 92))
    p.drawEllipse(QPointF(area.center().x(), area.bottom() + r * 0.05), r, r * 0.24)
    p.setBrush(QBrush(colour))
    p.drawEllipse(area)
    p.setBrush(Qt.BrushStyle.NoBrush)
    highlight_pen = QPen(QColor(255, 255, 255, 190), max(1.0, r * 0.16))
    highlight_pen.setCapStyle(Qt.PenCapStyle.RoundCap)
    p.setPen(highlight_pen)
    inner = area.adjusted(r * 0.18, r * 0.18, -r * 0.18, -r * 0.18)
    p.drawArc(inner, 50 * 16, 92 * 16)


def _paint_position(p: QPainter, area: QRectF, name: str, font: QFont) -> None:
    # A person between the robot and the viewer is only a mark on the floor.
    p.setPen(QPen(QColor(63, 124, 179, 210), 1.4))
    p.setBrush(QColor(63, 124, 179, 70))
    p.drawEllipse(area)
    name_font = QFont(font)
    name_font.setPixelSize(10)
    name_font.setWeight(QFont.Weight.DemiBold)
    p.setFont(name_font)
    p.setPen(QColor("#1F4468"))
    p.drawText(area, int(Qt.AlignmentFlag.AlignCenter), name)


def _paint_face_card(p: QPainter, area: QRectF) -> None:
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


def _paint_marker_card(p: QPainter, area: QRectF) -> None:
    w = area.width() * 0.76
    left, top = area.center().x() - w / 2, area.center().y() - w / 2
    p.setPen(Qt.PenStyle.NoPen)
    p.fillRect(QRectF(left, top, w, w), QColor("#1D1E22"))
    cell = w / 6
    for row, bits in enumerate((0b1010, 0b0110, 0b1001, 0b1110)):
        for column in range(4):
            if bits >> column & 1:
                cell_rect = QRectF(left + cell * (column + 1), top + cell * (row + 1), cell, cell)
                p.fillRect(cell_rect, QColor("#FBFAF7"))
