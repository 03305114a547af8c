"""Painter of the virtual Pepper at any heading.

Each part of the body has an azimuth: its horizontal position is ``sin(azimuth + heading)`` times the radius,
its width is scaled by the cosine, and parts at the back are hidden. The figure therefore turns smoothly
without separate views. Lengths are in stage units; (0, 0) is the centre of the foot, y points down, and the
figure is 187 units high.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QLinearGradient, QPainter, QPainterPath, QPen, QPolygonF

from app.ui.robot_drawing.figure import RobotFigure
from app.ui.robot_drawing.state import RobotState

HEAD_CENTRE = QPointF(0.0, -152.2)
SHOULDER_X, SHOULDER_Y = 26.2, -102.5
ARM_LENGTH, ARM_WIDTH, HAND_RADIUS = 46.5, 14.4, 7.7
REST_DEG, UP_DEG = 20.0, 160.0  # limits that keep the arms beside body and head
ARM_PLANE_RAD = math.radians(25.0)
WHITE, LIMB, LIMB_EDGE, HAND_WHITE = "#FFFFFF", "#E2E7F0", "#CFD6E3", "#F3F5FA"
JOINT, NECK, BAND = "#D3DAE7", "#C5CAD7", "#C8CCD8"
HEAD_RX, HEAD_RY = 31.9, 32.8
EYE_AZIMUTH_RAD = math.radians(24.8)
DARK_COLOUR = "#15181F"


@dataclass(frozen=True, slots=True)
class ProjectedArm:
    """Arm as seen by the viewer.

    Attributes:
        side: "left" or "right".
        shoulder: Position of the shoulder.
        hand: Position of the hand.
        depth: Depth of the shoulder from -1 (back) to 1 (front).
    """

    side: str
    shoulder: QPointF
    hand: QPointF
    depth: float


@dataclass(frozen=True, slots=True)
class Expression:
    """Facial expression.

    Attributes:
        lid: Fraction of the eye that the lid covers.
        brow: Shape of the eyebrows: 0 for none, 1 with the inner ends up, -1 with the inner ends down.
        eye: Relative size of the eyes.
        smile: Curvature of the mouth; negative for a sad mouth.
        mouth_half_width: Half of the width of the mouth.
        mouth_opening: Height of the open mouth; 0 if it is closed.
        has_cheeks: True if the cheeks are painted.
    """

    lid: float = 0.0
    brow: float = 0.0
    eye: float = 1.0
    smile: float = 3.1
    mouth_half_width: float = 6.6
    mouth_opening: float = 0.0
    has_cheeks: bool = False


_EXPRESSIONS = {
    "neutral": Expression(),
    "happy": Expression(smile=6.4, mouth_half_width=9.0, has_cheeks=True),
    "joy": Expression(smile=6.0, mouth_half_width=9.0, mouth_opening=6.5, has_cheeks=True),
    "laughing": Expression(smile=6.0, mouth_half_width=9.0, mouth_opening=6.5, has_cheeks=True),
    "sad": Expression(smile=-4.6, mouth_half_width=6.4, brow=1.0, lid=0.22),
    "surprised": Expression(eye=1.13, mouth_opening=8.0, mouth_half_width=4.2, smile=0.0, brow=0.35),
    "angry": Expression(smile=-2.4, mouth_half_width=7.0, brow=-1.0, lid=0.2),
    "afraid": Expression(eye=1.08, smile=-2.0, mouth_half_width=7.0, brow=0.9),
    "scared": Expression(eye=1.08, smile=-2.0, mouth_half_width=7.0, brow=0.9),
    "thinking": Expression(smile=0.8, mouth_half_width=5.4, brow=-0.35, lid=0.12),
    "tired": Expression(smile=1.0, mouth_half_width=5.4, lid=0.5),
    "sleepy": Expression(smile=1.0, mouth_half_width=5.4, lid=0.62),
}


EMOTIONS = tuple(_EXPRESSIONS)


def project_arms(state: RobotState) -> tuple[ProjectedArm, ProjectedArm]:
    """Return the left and the right arm of the robot."""
    heading = math.radians(state.theta_deg)
    return (
        _project_arm("left", 1, state.arm_left_deg, heading),
        _project_arm("right", -1, state.arm_right_deg, heading),
    )


def _project_arm(side: str, sign: int, raised_deg: float, heading: float) -> ProjectedArm:
    azimuth = sign * math.pi / 2 + heading
    angle = math.radians(REST_DEG + max(-20.0, min(180.0, raised_deg)) * (UP_DEG - REST_DEG) / 180.0)
    shoulder = QPointF(SHOULDER_X * math.sin(azimuth), SHOULDER_Y)
    projection = math.cos(ARM_PLANE_RAD) * math.sin(azimuth) + math.sin(ARM_PLANE_RAD) * math.sin(heading)
    hand = shoulder + QPointF(ARM_LENGTH * math.sin(angle) * projection, ARM_LENGTH * math.cos(angle))
    return ProjectedArm(side, shoulder, hand, math.cos(azimuth))


def paint_pepper(p: QPainter, state: RobotState) -> None:
    """Paint the robot; the origin of the painter is the centre of the foot."""
    heading = math.radians(state.theta_deg)
    arms = project_arms(state)
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor(50, 42, 40, 118))
    p.drawEllipse(QPointF(0, 0), 52, 10.8)
    for arm in arms:
        if arm.depth < -0.08:
            _paint_arm(p, arm, state)
    _paint_base(p)
    _paint_torso(p, heading)
    if math.cos(heading) > 0.08:
        _paint_tablet(p, heading)
    elif math.cos(heading) < -0.08:
        _paint_back(p, heading)
    p.fillRect(QRectF(-6, -122, 12, 10), QColor(NECK))
    _paint_head(p, state, heading + math.radians(state.head_yaw_deg))
    for arm in arms:
        if arm.depth >= -0.08:
            _paint_arm(p, arm, state)


def _shading_brush(half_width: float) -> QBrush:
    gradient = QLinearGradient(-half_width, 0, half_width, 0)
    gradient.setColorAt(0.0, QColor("#E9EDF4"))
    gradient.setColorAt(0.34, QColor(WHITE))
    gradient.setColorAt(0.55, QColor("#F4F6FA"))
    gradient.setColorAt(1.0, QColor("#D3DAE7"))
    return QBrush(gradient)


def _paint_base(p: QPainter) -> None:
    skirt = QPainterPath(QPointF(-18.5, -64))
    skirt.cubicTo(QPointF(-22, -46), QPointF(-31, -36), QPointF(-30.8, -13))
    skirt.lineTo(-29, -1.5)
    skirt.quadTo(QPointF(0, 6.2), QPointF(29, -1.5))
    skirt.lineTo(30.8, -13)
    skirt.cubicTo(QPointF(31, -36), QPointF(22, -46), QPointF(18.5, -64))
    p.fillPath(skirt, _shading_brush(31))
    band = QPainterPath(QPointF(-28.4, -18))
    band.quadTo(QPointF(0, -9.6), QPointF(30.2, -18))
    band.lineTo(31.5, 8)
    band.lineTo(-31.5, 8)
    p.save()
    p.setClipPath(skirt, Qt.ClipOperation.IntersectClip)
    p.fillPath(band, QColor(BAND))
    p.restore()


def _paint_torso(p: QPainter, heading: float) -> None:
    half_width = math.hypot(27.5 * math.cos(heading), 23.0 * math.sin(heading))
    body = QPainterPath(QPointF(0, -115.6))
    body.cubicTo(QPointF(half_width * 0.55, -115.6), QPointF(half_width, -106), QPointF(half_width, -86))
    body.cubicTo(QPointF(half_width, -78), QPointF(half_width * 0.98, -72), QPointF(half_width * 0.94, -65.2))
    body.cubicTo(
        QPointF(half_width * 0.6, -60.5),
        QPointF(-half_width * 0.6, -60.5),
        QPointF(-half_width * 0.94, -65.2),
    )
    body.cubicTo(QPointF(-half_width * 0.98, -72), QPointF(-half_width, -78), QPointF(-half_width, -86))
    body.cubicTo(QPointF(-half_width, -106), QPointF(-half_width * 0.55, -115.6), QPointF(0, -115.6))
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor(120, 130, 155, 40))
    p.drawEllipse(QPointF(0, -61.8), half_width * 0.72, 3.0)
    p.fillPath(body, _shading_brush(half_width))


def _paint_tablet(p: QPainter, heading: float) -> None:
    x_scale = math.cos(heading)
    p.save()
    p.translate(21.5 * math.sin(heading), -88.1)
    p.scale(x_scale, 1.0)
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor("#1B1E2A"))
    p.drawRoundedRect(QRectF(-17.5, -12.5, 35, 25), 2.6, 2.6)
    p.setBrush(QColor("#2F4FD0"))
    p.drawRoundedRect(QRectF(-15.4, -10.4, 30.8, 20.8), 1.2, 1.2)
    logo_pen = QPen(QColor(WHITE), 2.1, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)
    logo_pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    p.setPen(logo_pen)
    points = ((-7, 3.8), (-7, -3.8), (7, 3.8), (7, -3.8))
    p.drawPolyline(QPolygonF([QPointF(x, y) for x, y in points]))
    p.restore()


def _paint_back(p: QPainter, heading: float) -> None:
    p.save()
    p.translate(-20.0 * math.sin(heading), 0)
    p.scale(-math.cos(heading), 1.0)
    p.setPen(QPen(QColor("#C3CAD8"), 0.9))
    p.setBrush(QColor(233, 237, 244, 160))
    p.drawRoundedRect(QRectF(-13, -104, 26, 32), 7, 7)
    p.setPen(QPen(QColor("#B3BBCB"), 1.4, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    for line in range(4):
        p.drawLine(QLineF(-6, -96 + 4.2 * line, 6, -96 + 4.2 * line))
    p.restore()


def _paint_arm(p: QPainter, arm: ProjectedArm, state: RobotState) -> None:
    outline_pen = QPen(QColor(LIMB_EDGE), ARM_WIDTH + 0.9, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)
    p.setPen(outline_pen)
    p.drawLine(QLineF(arm.shoulder, arm.hand))
    p.setPen(QPen(QColor(LIMB), ARM_WIDTH, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    p.drawLine(QLineF(arm.shoulder, arm.hand))
    p.setPen(QPen(QColor(LIMB_EDGE), 0.7))
    p.setBrush(QColor(HAND_WHITE))
    p.drawEllipse(arm.hand, HAND_RADIUS, HAND_RADIUS)
    p.setPen(Qt.PenStyle.NoPen)
    if arm.depth > -0.5:
        p.setBrush(QColor(JOINT))
        p.drawEllipse(arm.shoulder, 8.4, 8.4)
        # Seen from the front, the light is where the shoulder faces the viewer, so that it is never hidden.
        p.setBrush(QColor(state.shoulders))
        p.drawEllipse(arm.shoulder, 4.0, 4.0)
    if f"{arm.side}_hand" in state.touched_parts:
        _paint_halo(p, arm.hand, HAND_RADIUS + 3)


def _paint_halo(p: QPainter, centre: QPointF, radius: float) -> None:
    p.setPen(QPen(QColor("#FFB300"), 2.2))
    p.setBrush(Qt.BrushStyle.NoBrush)
    p.drawEllipse(centre, radius, radius)
    p.setPen(Qt.PenStyle.NoPen)


def _paint_head(p: QPainter, state: RobotState, heading: float) -> None:
    p.save()
    p.translate(HEAD_CENTRE)
    ears = [(sign, sign * math.pi / 2 + heading) for sign in (-1, 1)]
    for _, azimuth in ears:
        if math.cos(azimuth) <= 0.1:
            _paint_ear(p, azimuth)
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(_shading_brush(HEAD_RX))
    p.drawEllipse(QPointF(0, 0), HEAD_RX, HEAD_RY)
    nod = HEAD_RY * 0.6 * math.sin(math.radians(max(-45.0, min(45.0, state.head_pitch_deg))))
    p.save()
    round_head = QPainterPath()
    round_head.addEllipse(QPointF(0, 0), HEAD_RX, HEAD_RY)
    p.setClipPath(round_head, Qt.ClipOperation.IntersectClip)
    paint_face(p, state, heading, nod)
    p.restore()
    for _, azimuth in ears:
        if math.cos(azimuth) > 0.1:
            _paint_ear(p, azimuth)
    if "head" in state.touched_parts:
        _paint_halo(p, QPointF(0, 0), HEAD_RY + 4)
    p.restore()


def _paint_ear(p: QPainter, azimuth: float) -> None:
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor("#D5DAE6"))
    centre = QPointF((HEAD_RX + 0.8) * math.sin(azimuth), 2.2)
    p.drawEllipse(centre, 5.0 + 5.0 * abs(math.cos(azimuth)), 10.0)


def paint_face(p: QPainter, state: RobotState, heading: float, nod: float) -> None:
    """Paint the face; the origin of the painter is the centre of the head.

    Args:
        p: Painter in stage units.
        state: State of the robot.
        heading: Direction of the head in rad.
        nod: Vertical shift of the face because of the head's pitch.
    """
    expression = _EXPRESSIONS.get(state.emotion, _EXPRESSIONS["neutral"])
    dot = QPointF(HEAD_RX * 0.5 * math.sin(heading), -20.8 + nod)
    if math.cos(heading) > 0.0:
        p.setPen(Qt.PenStyle.NoPen)
        p.setBrush(QColor("#3A3F4C"))
        p.drawEllipse(dot, 2.2 * math.cos(heading), 2.2)
    for sign in (-1, 1):
        azimuth = EYE_AZIMUTH_RAD * sign + heading
        if math.cos(azimuth) > 0.1:
            p.save()
            p.translate(HEAD_RX * math.sin(azimuth), 1.9 + nod)
            p.scale(math.cos(azimuth) / math.cos(EYE_AZIMUTH_RAD), 1.0)
            _paint_eye(p, QColor(state.eyes), expression, sign)
            p.restore()
    if math.cos(heading) > 0.12:
        p.save()
        p.translate(HEAD_RX * 0.93 * math.sin(heading), 19.4 + nod)
        p.scale(math.cos(heading), 1.0)
        _paint_mouth(p, expression)
        p.restore()


def _paint_eye(p: QPainter, colour: QColor, expression: Expression, sign: int) -> None:
    p.setPen(Qt.PenStyle.NoPen)
    for brush, radius in ((QColor(DARK_COLOUR), 9.7), (colour, 8.4), (QColor(DARK_COLOUR), 5.3)):
        p.setBrush(brush)
        p.drawEllipse(QPointF(0, 0), radius * expression.eye, radius * expression.eye)
    p.setBrush(QColor(WHITE))
    p.drawEllipse(QPointF(2.3, -2.3), 2.0, 2.0)
    if expression.lid > 0:
        lid = QPainterPath()
        lid.addRect(QRectF(-11, -11, 22, 1.3 + 19.4 * expression.lid))
        eye = QPainterPath()
        eye.addEllipse(QPointF(0, 0), 10.2 * expression.eye, 10.2 * expression.eye)
        p.fillPath(lid.intersected(eye), QColor("#DCE2EC"))
    if expression.brow:
        p.setPen(QPen(QColor("#4E5566"), 2.0, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        # For a positive brow the inner end (towards the nose) is up.
        tilt = 3.0 * expression.brow * sign
        p.drawLine(QLineF(-7, -13.4 - tilt, 7, -13.4 + tilt))
        p.setPen(Qt.PenStyle.NoPen)


def _paint_mouth(p: QPainter, expression: Expression) -> None:
    if expression.has_cheeks:
        p.setPen(Qt.PenStyle.NoPen)
        p.setBrush(QColor(255, 150, 150, 70))
        p.drawEllipse(QPointF(-17, -5), 4.6, 3.0)
        p.drawEllipse(QPointF(17, -5), 4.6, 3.0)
    pen = QPen(QColor("#4E5566"), 1.7, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)
    p.setPen(pen)
    mouth = QPainterPath(QPointF(-expression.mouth_half_width, 0))
    if expression.mouth_opening and not expression.smile:
        p.setBrush(QColor("#5B3440"))
        p.drawEllipse(
            QPointF(0, expression.mouth_opening * 0.2),
            expression.mouth_half_width,
            expression.mouth_opening * 0.62,
        )
        return
    mouth.quadTo(QPointF(0, 2 * expression.smile), QPointF(expression.mouth_half_width, 0))
    if expression.mouth_opening:
        mouth.quadTo(QPointF(0, -1.0), QPointF(-expression.mouth_half_width, 0))
        p.setBrush(QColor("#5B3440"))
    else:
        p.setBrush(Qt.BrushStyle.NoBrush)
    p.drawPath(mouth)


def _touchable_parts(state: RobotState) -> Mapping[str, tuple[QPointF, float]]:
    hands = {f"{limb.side}_hand": (limb.hand, 11.0) for limb in project_arms(state)}
    return {**hands, "head": (HEAD_CENTRE, 36.0)}


FIGURE = RobotFigure(
    "pepper",
    paint_pepper,
    QRectF(-42, -187, 84, 195),
    bubble_at=HEAD_CENTRE,
    body_at=QPointF(0, -50),
    radius_m=0.27,
    touchable_parts=_touchable_parts,
)
