"""Tests of the drawing of the turtle robot: heading, light and bumper contact."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QRectF
from PySide6.QtGui import QColor, QImage, QPainter

from app.ui.robot_drawing.scene import RobotDrawing
from app.ui.robot_drawing.state import RobotState

AREA = QRectF(0, 0, 382, 286)


def drawn(**changes: object) -> np.ndarray:
    state = RobotState.parse({"figure": "turtle", "x": 0.0, "y": 0.0, **changes})
    image = QImage(382, 286, QImage.Format.Format_RGB32)
    painter = QPainter(image)
    RobotDrawing().paint(painter, AREA, state)
    painter.end()
    return np.frombuffer(image.constBits(), np.uint8).reshape(286, 382, 4)[:, :, 2::-1].astype(int)


def count(picture: np.ndarray, colour: str, within: int = 12) -> int:
    wanted = QColor(colour)
    away = np.abs(picture - [wanted.red(), wanted.green(), wanted.blue()])
    return int((away.max(axis=2) <= within).sum())


def test_robot_drawing_differs_for_every_heading(qapp) -> None:
    pictures = [drawn(theta_deg=angle) for angle in range(0, 360, 45)]
    for number, one in enumerate(pictures):
        for other in pictures[:number]:
            assert (one != other).any(axis=2).sum() > 100


def test_light_has_the_colour_of_the_state(qapp) -> None:
    assert count(drawn(theta_deg=90, eyes="#ff00ff"), "#ff00ff") > 30
    assert count(drawn(theta_deg=90, eyes="#00ff00"), "#ff00ff") == 0


@pytest.mark.parametrize("side", ["left", "right", "front"])
def test_obstacle_hit_by_the_bumper_is_amber(qapp, side) -> None:
    assert count(drawn(theta_deg=0, bumped=side), "#FFB300") > count(drawn(theta_deg=0), "#FFB300") + 20


def test_body_and_ball_are_hit_testable_and_hands_are_not(qapp) -> None:
    ball = {"kind": "ball", "name": "ball", "x": 1.5, "y": -1.0}
    state = RobotState.parse({"figure": "turtle", "objects": [ball]})
    drawing = RobotDrawing()
    assert drawing.point_of("left_hand", AREA, state) is None
    body = drawing.point_of("body", AREA, state)
    place = drawing.point_of("ball", AREA, state)
    assert body is not None
    assert place is not None
    assert drawing.part_at(place, AREA, state) == "ball"
    assert drawing.part_at(body, AREA, state) == "body"
