"""The virtual robot's face: eyes, brows and mouth for each emotion, placed on the head by its direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPen

from app.ui.robot_drawing.state import RobotState

HEAD_RX, HEAD_RY = 31.9, 32.8
EYE_AT = math.radians(24.8)
WHITE, DARK = "#FFFFFF", "#15181F"


@dataclass(frozen=True, slots=True)
class Look:
    """A face: how wide the eyes open, brows (0 none, 1 raised inside, -1 lowered inside), mouth."""

    lid: float = 0.0
    brow: float = 0.0
    eye: float = 1.0
    smile: float = 3.1
    half: float = 6.6
    open: float = 0.0
    cheeks: bool = False


_LOOKS = {
    "neutral": Look(),
    "happy": Look(smile=6.4, half=9.0, cheeks=True),
    "joy": Look(smile=6.0, half=9.0, open=6.5, cheeks=True),
    "laughing": Look(smile=6.0, half=9.0, open=6.5, cheeks=True),
    "sad": Look(smile=-4.6, half=6.4, brow=1.0, lid=0.22),
    "surprised": Look(eye=1.13, open=8.0, half=4.2, smile=0.0, brow=0.35),
    "angry": Look(smile=-2.4, half=7.0, brow=-1.0, lid=0.2),
    "afraid": Look(eye=1.08, smile=-2.0, half=7.0, brow=0.9),
    "scared": Look(eye=1.08, smile=-2.0, half=7.0, brow=0.9),
    "thinking": Look(smile=0.8, half=5.4, brow=-0.35, lid=0.12),
    "tired": Look(smile=1.0, half=5.4, lid=0.5),
    "sleepy": Look(smile=1.0, half=5.4, lid=0.62),
}
EMOTIONS = tuple(_LOOKS)


def paint_face(p: QPainter, state: RobotState, heading: float, nod: float) -> None:
    """Draw the face around the middle of the head; ``heading`` in rad, ``nod`` moves it up or down."""
    look = _LOOKS.get(state.emotion, _LOOKS["neutral"])
    dot = QPointF(HEAD_RX * 0.5 * math.sin(heading), -20.8 + nod)
    if math.cos(heading) > 0.0:
        p.setPen(Qt.PenStyle.NoPen)
        p.setBrush(QColor("#3A3F4C"))
        p.drawEllipse(dot, 2.2 * math.cos(heading), 2.2)
    for sign in (-1, 1):
        azimuth = EYE_AT * sign + heading
        if math.cos(azimuth) > 0.1:
            p.save()
            p.translate(HEAD_RX * math.sin(azimuth), 1.9 + nod)
            p.scale(math.cos(azimuth) / math.cos(EYE_AT), 1.0)
            _eye(p, QColor(state.eyes), look, sign)
            p.restore()
    if math.cos(heading) > 0.12:
        p.save()
        p.translate(HEAD_RX * 0.93 * math.sin(heading), 19.4 + nod)
        p.scale(math.cos(heading), 1.0)
        _mouth(p, look)
        p.restore()


def _eye(p: QPainter, colour: QColor, look: Look, sign: int) -> None:
    p.setPen(Qt.PenStyle.NoPen)
    for brush, radius in ((QColor(DARK), 9.7), (colour, 8.4), (QColor(DARK), 5.3)):
        p.setBrush(brush)
        p.drawEllipse(QPointF(0, 0), radius * look.eye, radius * look.eye)
    p.setBrush(QColor(WHITE))
    p.drawEllipse(QPointF(2.3, -2.3), 2.0, 2.0)
    if look.lid > 0:
        lid = QPainterPath()
        lid.addRect(QRectF(-11, -11, 22, 1.3 + 19.4 * look.lid))
        eye = QPainterPath()
        eye.addEllipse(QPointF(0, 0), 10.2 * look.eye, 10.2 * look.eye)
        p.fillPath(lid.intersected(eye), QColor("#DCE2EC"))
    if look.brow:
        p.setPen(QPen(QColor("#4E5566"), 2.0, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        # The inner end (towards the nose) goes up for a positive brow.
        tilt = 3.0 * look.brow * sign
        p.drawLine(QLineF(-7, -13.4 - tilt, 7, -13.4 + tilt))
        p.setPen(Qt.PenStyle.NoPen)


def _mouth(p: QPainter, look: Look) -> None:
    if look.cheeks:
        p.setPen(Qt.PenStyle.NoPen)
        p.setBrush(QColor(255, 150, 150, 70))
        p.drawEllipse(QPointF(-17, -5), 4.6, 3.0)
        p.drawEllipse(QPointF(17, -5), 4.6, 3.0)
    pen = QPen(QColor("#4E5566"), 1.7, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)
    p.setPen(pen)
    mouth = QPainterPath(QPointF(-look.half, 0))
    if look.open and not look.smile:
        p.setBrush(QColor("#5B3440"))
        p.drawEllipse(QPointF(0, look.open * 0.2), look.half, look.open * 0.62)
        return
    mouth.quadTo(QPointF(0, 2 * look.smile), QPointF(look.half, 0))
    if look.open:
        mouth.quadTo(QPointF(0, -1.0), QPointF(-look.half, 0))
        p.setBrush(QColor("#5B3440"))
    else:
        p.setBrush(Qt.BrushStyle.NoBrush)
    p.drawPath(mouth)
