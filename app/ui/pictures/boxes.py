"""Bounding boxes of detections, and the association of detections with images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import number
from nep.text import bounded_str

if TYPE_CHECKING:
    from app.core.robots.robot_link import RobotLink
    from app.core.session import Session
    from app.robots.description.description import Sensor

# Boxes are painted on images and don't depend on the theme: bright colours with dark text.
BOX_COLOURS = ("#FFC53D", "#5FD4F4", "#7BE0A0", "#F79AC0")
BOX_TEXT_COLOUR = "#1C1B19"


@dataclass(frozen=True, slots=True)
class DetectionBox:
    """Bounding box of a detected object.

    Attributes:
        label: Label of the box.
        confidence: Confidence from 0 to 1; None if unknown.
        rect: Rectangle in fractions of the image.
        sensor_index: Index of the sensor, which selects the colour.
    """

    label: str
    confidence: float | None
    rect: QRectF
    sensor_index: int = 0


def boxes_of(detections: object, sensor_index: int = 0) -> tuple[DetectionBox, ...]:
    """Return the bounding boxes in the value of a detection sensor; malformed items are skipped.

    The result is empty if the value lacks the items or the size of the image.

    Args:
        detections: Value of the sensor.
        sensor_index: Index of the sensor, which selects the colour.
    """
    if not isinstance(detections, Mapping):
        return ()
    width, height = _float_or_none(detections.get("width")), _float_or_none(detections.get("height"))
    items = detections.get("items")
    if not width or not height or not isinstance(items, Sequence) or isinstance(items, str):
        return ()
    boxes = []
    for item in items:
        bounds = item.get("box") if isinstance(item, Mapping) else None
        if isinstance(item, Mapping) and isinstance(bounds, Sequence) and len(bounds) == 4:
            x, y, w, h = (_float_or_none(part) or 0.0 for part in bounds)
            area = QRectF(x / width, y / height, w / width, h / height)
            boxes.append(
                DetectionBox(
                    bounded_str(item.get("name", "")),
                    _float_or_none(item.get("confidence")),
                    area,
                    sensor_index,
                )
            )
    return tuple(boxes)


def boxes_in_camera(link: RobotLink, topic: str) -> tuple[DetectionBox, ...]:
    """Return the bounding boxes of all detections in a camera's images, with one colour per sensor.

    Detection sensors that don't name a camera are included.

    Args:
        link: Robot.
        topic: Topic of the camera.
    """
    cameras = {sensor.name for sensor in link.robot.sensors if sensor.topic == topic}
    boxes: list[DetectionBox] = []
    detection_sensors = [sensor for sensor in link.robot.sensors if sensor.kind == "detections"]
    for index, sensor in enumerate(detection_sensors):
        if sensor.camera is None or sensor.camera in cameras:
            boxes += boxes_of(link.values.get(sensor.name), index)
    return tuple(boxes)


def camera_of(link: RobotLink) -> Sensor | None:
    """Return the first camera of a robot that publishes on a topic, or None if there is none."""
    return next((sensor for sensor in link.robot.sensors if sensor.is_image and sensor.topic), None)


def robot_of_camera(session: Session, topic: str) -> RobotLink | None:
    """Return the robot whose camera publishes on a topic, or None if there is none."""
    for link in session.fleet.links:
        if any(sensor.is_image and sensor.topic == topic for sensor in link.robot.sensors):
            return link
    return None


def paint_box(painter: QPainter, theme: Theme, rect: QRectF, box: DetectionBox) -> None:
    """Paint a bounding box with an upright label above it.

    Args:
        painter: Painter in view coordinates.
        theme: Theme, for the font.
        rect: Rectangle of the box in view coordinates.
        box: Bounding box.
    """
    colour = QColor(BOX_COLOURS[box.sensor_index % len(BOX_COLOURS)])
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(QPen(colour, 2.5))
    painter.drawRoundedRect(rect, 2, 2)
    text = box.label if box.confidence is None else f"{box.label} {number(box.confidence, '.2f')}"
    font = theme.font("caption")
    font.setWeight(font.Weight.DemiBold)
    width = paint.width_of(font, text) + 12
    height = max(18.0, paint.height_of(font) + 2)
    top = rect.top() - height - 1 if rect.top() - height - 1 >= 0 else rect.top()
    tag = QRectF(rect.left() - 1.25, top, width, height)
    paint.box(painter, tag, 2, colour)
    paint.text_line(painter, tag.adjusted(6, 0, 0, 0), text, font, QColor(BOX_TEXT_COLOUR))


def _float_or_none(value: object) -> float | None:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if is_number else None  # type: ignore[arg-type]
