"""Object detection of virtual robots: colours, balls, markers, faces.

The position of faces is computed from the room instead of the image, because a cascade classifier needs a
third of a CPU core. A face is detected only if most of it is in the image and nothing hides it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from app.robots.virtual.camera import right_vector
from app.robots.virtual.canvas import Picture
from app.robots.virtual.lens import NEAR_PLANE_M, Lens
from app.robots.virtual.room import Person, Room

_MIN_BALL_AREA_PX = 24  # pixels of area
_MIN_FACE_WIDTH_PX = 8  # pixels across
_MIN_VISIBLE_FACE_FRACTION = 0.6

MIN_AREA_FRACTION = 0.004
_HUE_RANGES: dict[str, tuple[tuple[int, int], ...]] = {
    "red": ((0, 8), (172, 180)),
    "green": ((45, 85),),
    "blue": ((98, 125),),
}
_MIN_SATURATION, _MIN_VALUE = 95, 60


@dataclass(frozen=True)
class Detection:
    """Detected object.

    Attributes:
        name: Name of the object.
        confidence: Confidence from 0 to 1.
        box: x, y, width and height in pixels.
    """

    name: str
    confidence: float
    box: tuple[int, int, int, int]

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the box in pixels."""
        x, y, width, height = self.box
        return x + width / 2, y + height / 2


def message(detections: Iterable[Detection], lens: Lens) -> dict[str, object]:
    """Return the payload of a detection sensor; its ``name`` is the name of the largest object, or null.

    Args:
        detections: Detected objects.
        lens: Camera model, for the size of the image.
    """
    largest_first = sorted(detections, key=lambda one: -one.box[2] * one.box[3])
    return {
        "count": len(largest_first),
        "name": largest_first[0].name if largest_first else None,
        "width": lens.width,
        "height": lens.height,
        "items": [
            {"name": detection.name, "confidence": round(detection.confidence, 2), "box": list(detection.box)}
            for detection in largest_first
        ],
    }


class ObjectDetector:
    """Detector of balls, markers and faces."""

    def __init__(self) -> None:
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        self._markers = cv2.aruco.ArucoDetector(dictionary)

    def balls(self, picture: Picture) -> list[Detection]:
        """Detect red balls: round red regions of an image."""
        hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
        low, high = (
            cv2.inRange(hsv, (0, 135, 60), (7, 255, 255)),
            cv2.inRange(hsv, (171, 135, 60), (180, 255, 255)),
        )
        red = cv2.bitwise_or(low, high)
        red = cv2.morphologyEx(red, cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8))
        count, _, stats, _ = cv2.connectedComponentsWithStats(red)
        detections = []
        for x, y, width, height, area in stats[1:count].tolist():
            roundness = area / (np.pi / 4 * max(width, height) ** 2)
            if area >= _MIN_BALL_AREA_PX and roundness > 0.72:
                detections.append(Detection("ball", min(0.99, roundness), (x, y, width, height)))
        return detections

    def markers(self, picture: Picture) -> list[Detection]:
        """Detect ArUco cards (dictionary 4x4, 50) in an image."""
        corners, ids, _ = self._markers.detectMarkers(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
        # OpenCV returns None for no markers, contrary to its annotations.
        numbers = [int(marker_id) for marker_id in np.asarray(ids).ravel()] if len(corners) else []
        return [
            Detection(f"marker {number}", 1.0, _box_of(outline[0]))
            for outline, number in zip(corners, numbers, strict=True)
        ]

    def faces(self, room: Room, lens: Lens) -> list[Detection]:
        """Return the visible faces of the people in a room, the largest first."""
        detections = [_face(room, person, lens) for person in room.people]
        return sorted(
            (each for each in detections if each is not None), key=lambda one: -one.box[2] * one.box[3]
        )


def _face(room: Room, person: Person, lens: Lens) -> Detection | None:
    middle = np.array([person.x, person.y, person.face_z])
    half_across = right_vector(lens, person.x, person.y) * person.face_width / 2
    half_down = np.array([0.0, 0.0, person.face_height / 2])
    corners = np.array([middle + a * half_across + d * half_down for a in (-1, 1) for d in (-1, 1)])
    camera_points = lens.to_camera(corners)
    if camera_points[:, 2].min() < NEAR_PLANE_M or room.is_hidden(
        lens.position, (person.x, person.y, person.face_z)
    ):
        return None
    pixels = lens.to_pixels(camera_points)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    inside_low = np.maximum(low, 0.0)
    inside_high = np.minimum(high, (lens.width, lens.height))
    if (inside_high <= inside_low).any() or high[0] - low[0] < _MIN_FACE_WIDTH_PX:
        return None
    visible_fraction = float(np.prod(inside_high - inside_low) / np.prod(high - low))
    if visible_fraction < _MIN_VISIBLE_FACE_FRACTION:
        return None
    confidence = visible_fraction * min(1.0, 0.7 + 0.009 * float(high[0] - low[0]))
    return Detection(person.name, min(0.99, confidence), _box_of(np.stack([inside_low, inside_high])))


def _box_of(points: ArrayLike) -> tuple[int, int, int, int]:
    array = np.asarray(points, dtype=np.float64)
    low, high = array.min(axis=0), array.max(axis=0)
    x, y = int(low[0]), int(low[1])
    return x, y, int(np.ceil(high[0])) - x, int(np.ceil(high[1])) - y


def angles_to(lens: Lens, pixel: tuple[float, float]) -> tuple[float, float]:
    """Return the head movement that centres a pixel, in degrees to the left and degrees down."""
    left = -np.degrees(np.arctan2(pixel[0] - lens.width / 2, lens.focal))
    down = np.degrees(np.arctan2(pixel[1] - lens.height / 2, lens.focal))
    return float(left), float(down)


@dataclass(frozen=True)
class ColourPatch:
    """Largest region of a colour in an image.

    Attributes:
        name: Name of the colour.
        x: Horizontal position of the centre from -1 (left) to 1 (right).
        area: Fraction of the image.
    """

    name: str
    x: float
    area: float


def colours_in(picture: Picture) -> dict[str, ColourPatch]:
    """Return the largest region of each colour by name, if it fills at least 0.4 % of a BGR image."""
    height, width = picture.shape[:2]
    hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
    patches = {}
    for name, ranges in _HUE_RANGES.items():
        mask = np.zeros((height, width), np.uint8)
        for low, high in ranges:
            lower_bound = np.array([low, _MIN_SATURATION, _MIN_VALUE], np.uint8)
            cv2.bitwise_or(
                mask, cv2.inRange(hsv, lower_bound, np.array([high, 255, 255], np.uint8)), dst=mask
            )
        count, _, stats, centroids = cv2.connectedComponentsWithStats(mask)
        if count < 2:
            continue
        largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
        area = float(stats[largest, cv2.CC_STAT_AREA]) / (width * height)
        if area >= MIN_AREA_FRACTION:
            x = float(centroids[largest][0]) / width * 2 - 1
            patches[name] = ColourPatch(name, round(x, 3), round(area, 4))
    return patches
