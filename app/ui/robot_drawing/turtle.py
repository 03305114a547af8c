"""Painter of the virtual Turtle, a small wheeled robot, at any heading, seen slightly from above.

Each part of the round body has an azimuth, as in `app.ui.robot_drawing.pepper`: 0 faces the viewer, the
robot's left is at +90°. Lengths are in stage units; (0, 0) is the centre of the robot on the floor.
"""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QLinearGradient, QPainter, QPainterPath, QPen, QRadialGradient

from app.ui.robot_drawing.figure import RobotFigure
from app.ui.robot_drawing.state import RobotState

RADIUS, FLAT = 37.0, 0.36  # radius of the body, and ratio of height to width of a circle on the floor
LOW, HIGH = -9.0, -31.0  # heights of the lower and upper deck
MAST_TOP = -52.0  # height of the top of the camera's mast
WHEEL_RADIUS = 14.0
TOP_CENTRE = QPointF(0.0, -36.0)
TOP_TOUCH_FRACTION = 0.6  # fraction of the radius that counts as a touch from above
FRONT_DEG, BACK_DEG = 40.0, 130.0

SHELL, SHELL_DARK, DECK, RUBBER, METAL = "#4E8C7A", "#376B5C", "#6FB3A0", "#2B2D33", "#C8CCD8"


def paint_turtle(p: QPainter, state: RobotState) -> None:
    """Paint the robot; the origin of the painter is the robot's centre on the floor."""
    heading = math.radians(state.theta_deg)
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor(50, 42, 40, 110))
    p.drawEllipse(QPointF(0, 0), RADIUS * 1.1, RADIUS * FLAT * 1.1)
    wheels = [(sign, heading + sign * math.pi / 2) for sign in (-1, 1)]
    for _, azimuth in wheels:
        if math.cos(azimuth) < 0:
            _paint_wheel(p, azimuth)
    _paint_body(p, state)
    for _, azimuth in wheels:
        if math.cos(azimuth) >= 0:
            _paint_wheel(p, azimuth)
    _paint_bumper(p, heading, state.pressed_bumper)
    _paint_deck(p, heading, state.eyes)
    _paint_mast(p, heading)


def point_on_body(azimuth: float, radius_fraction: float = 1.0, height: float = 0.0) -> QPointF:
    """Return the position of a point on the body.

    Args:
        azimuth: Azimuth in rad; 0 faces the viewer.
        radius_fraction: Distance from the axis as a fraction of the radius.
        height: Vertical position; negative is up.
    """
    return QPointF(
        RADIUS * radius_fraction * math.sin(azimuth),
        RADIUS * radius_fraction * FLAT * math.cos(azimuth) + height,
    )


def bumper_side_at(point: QPointF, theta_deg: float) -> str:
    """Return the side of the bumper that a click presses: "left", "right", "front" or "back".

    A click on the top presses the front.

    Args:
        point: Position of the click in the coordinates of the figure.
        theta_deg: Heading of the robot.
    """
    across, along = point.x() / RADIUS, (point.y() - HIGH) / (RADIUS * FLAT)
    if math.hypot(across, along) < TOP_TOUCH_FRACTION or along < -1.0:
        return "front"
    if along > 0:  # near edge of the deck and drum below it: counts as the side that faces the viewer
        along = math.sqrt(max(0.0, 1.0 - across * across))
    angle_deg = math.degrees(math.atan2(across, along)) - theta_deg
    angle_deg = (angle_deg + 180.0) % 360.0 - 180.0
    if abs(angle_deg) <= FRONT_DEG:
        return "front"
    return "back" if abs(angle_deg) > BACK_DEG else "left" if angle_deg > 0 else "right"


def _paint_wheel(p: QPainter, azimuth: float) -> None:
    # Painted on the body's side, facing in the direction of the azimuth.
    half_width = max(2.6, WHEEL_RADIUS * abs(math.cos(azimuth)))
    middle = point_on_body(azimuth, 0.98, -WHEEL_RADIUS + 1.5)
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor(RUBBER))
    thickness = 5.0 * abs(math.sin(azimuth)) + 1.0
    box = QRectF(
        middle.x() - half_width - thickness / 2,
        middle.y() - WHEEL_RADIUS,
        2 * half_width + thickness,
        2 * WHEEL_RADIUS,
    )
    p.drawRoundedRect(box, min(box.width() / 2, WHEEL_RADIUS), WHEEL_RADIUS)
    if math.cos(azimuth) > 0.15:
        p.setBrush(QColor(METAL))
        p.drawEllipse(middle, half_width * 0.5, WHEEL_RADIUS * 0.5)


def _paint_body(p: QPainter, state: RobotState) -> None:
    flat = RADIUS * FLAT
    drum = QPainterPath(QPointF(-RADIUS, HIGH))
    drum.lineTo(-RADIUS, LOW)
    drum.arcTo(QRectF(-RADIUS, LOW - flat, 2 * RADIUS, 2 * flat), 180, 180)
    drum.lineTo(RADIUS, HIGH)
    drum.closeSubpath()
    gradient = QLinearGradient(-RADIUS, 0, RADIUS, 0)
    gradient.setColorAt(0.0, QColor(SHELL_DARK))
    gradient.setColorAt(0.32, QColor(SHELL))
    gradient.setColorAt(1.0, QColor(SHELL_DARK).darker(115))
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QBrush(gradient))
    p.drawPath(drum)
    ring_colour = QColor(state.eyes)
    ring_colour.setAlpha(235)
    p.setBrush(Qt.BrushStyle.NoBrush)
    p.setPen(QPen(ring_colour, 2.6, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
    p.drawArc(QRectF(-RADIUS, LOW - 4 - flat, 2 * RADIUS, 2 * flat), 180 * 16, 180 * 16)


def _paint_bumper(p: QPainter, heading: float, pressed_bumper: str) -> None:
    # An arc around the visible front. The pressed side is amber; all sides are if the front is pressed.
    sides = {"left": (18.0, 70.0), "front": (-18.0, 18.0), "right": (-70.0, -18.0)}
    for side, (first, last) in sides.items():
        shape = QPainterPath()
        is_drawing = False
        for step in range(9):
            azimuth = heading + math.radians(first + (last - first) * step / 8)
            if math.cos(azimuth) < -0.05:
                is_drawing = False
                continue
            point = point_on_body(azimuth, 1.05, LOW + 2)
            if is_drawing:
                shape.lineTo(point)
            else:
                shape.moveTo(point)
            is_drawing = True
        is_pressed = pressed_bumper in {side, "front"} if side != "front" else pressed_bumper == "front"
        p.setBrush(Qt.BrushStyle.NoBrush)
        colour = QColor("#FFB300") if is_pressed else QColor(RUBBER)
        p.setPen(QPen(colour, 4.6, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        p.drawPath(shape)


def _paint_deck(p: QPainter, heading: float, light: str) -> None:
    flat = RADIUS * FLAT
    p.setPen(QPen(QColor(SHELL_DARK), 1.0))
    p.setBrush(QColor(DECK))
    p.drawEllipse(QPointF(0, HIGH), RADIUS, flat)
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor(255, 255, 255, 46))
    p.drawEllipse(QPointF(-6, HIGH - 2), RADIUS * 0.72, flat * 0.66)
    arrow = QPainterPath(point_on_body(heading, 0.9, HIGH))
    arrow.lineTo(point_on_body(heading + 0.42, 0.62, HIGH))
    arrow.lineTo(point_on_body(heading - 0.42, 0.62, HIGH))
    arrow.closeSubpath()
    p.setBrush(QColor(255, 255, 255, 215))
    p.drawPath(arrow)
    glow = QRadialGradient(QPointF(0, HIGH), 13)
    shine = QColor(light)
    glow.setColorAt(0.0, shine)
    shine.setAlpha(0)
    glow.setColorAt(1.0, shine)
    p.setBrush(QBrush(glow))
    p.drawEllipse(point_on_body(heading + math.pi, 0.45, HIGH), 13, 13 * FLAT + 2)
    p.setBrush(QColor(light))
    p.drawEllipse(point_on_body(heading + math.pi, 0.45, HIGH), 5.0, 3.2)


def _paint_mast(p: QPainter, heading: float) -> None:
    # The lens is visible if it faces the viewer.
    base, top = QPointF(0, HIGH - 1), QPointF(0, MAST_TOP + 6)
    p.setPen(QPen(QColor(METAL), 5.0, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    p.drawLine(base, top)
    half_width = 10.5 - 2.5 * abs(math.sin(heading))
    p.setPen(QPen(QColor("#9AA2B4"), 0.8))
    p.setBrush(QColor("#E9EDF4"))
    p.drawRoundedRect(QRectF(-half_width, MAST_TOP - 7, 2 * half_width, 14), 4.5, 4.5)
    facing = math.cos(heading)
    if facing > -0.2:
        eye = QPointF(half_width * 0.85 * math.sin(heading), MAST_TOP)
        radius_x = max(1.4, 5.0 * max(0.0, facing))
        p.setPen(Qt.PenStyle.NoPen)
        p.setBrush(QColor("#1B1E2A"))
        p.drawEllipse(eye, radius_x, 5.0)
        p.setBrush(QColor("#5FA8E8"))
        p.drawEllipse(eye, radius_x * 0.5, 2.5)
        p.setBrush(QColor(255, 255, 255, 220))
        p.drawEllipse(eye + QPointF(-radius_x * 0.25, -1.6), radius_x * 0.22, 1.1)


FIGURE = RobotFigure(
    "turtle",
    paint_turtle,
    QRectF(-42, -62, 84, 78),
    bubble_at=TOP_CENTRE,
    body_at=TOP_CENTRE,
    radius_m=0.17,
    bumper_side_at=bumper_side_at,
)
