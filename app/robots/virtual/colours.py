"""Which plain colours a picture shows, how much of each, and where."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from app.robots.virtual.canvas import Picture

LEAST_AREA = 0.004
_HUES: dict[str, tuple[tuple[int, int], ...]] = {
    "red": ((0, 8), (172, 180)),
    "green": ((45, 85),),
    "blue": ((98, 125),),
}
_LEAST_SATURATION, _LEAST_VALUE = 95, 60


@dataclass(frozen=True)
class Seen:
    """The largest patch of a colour: ``x`` from -1 (left) to 1, ``area`` as a share of the picture."""

    name: str
    x: float
    area: float


def colours_in(picture: Picture) -> dict[str, Seen]:
    """The colours of a BGR picture that fill at least 0.4 % of it in one piece."""
    height, width = picture.shape[:2]
    hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
    found = {}
    for name, ranges in _HUES.items():
        mask = np.zeros((height, width), np.uint8)
        for low, high in ranges:
            least = np.array([low, _LEAST_SATURATION, _LEAST_VALUE], np.uint8)
            cv2.bitwise_or(mask, cv2.inRange(hsv, least, np.array([high, 255, 255], np.uint8)), dst=mask)
        count, _, parts, middles = cv2.connectedComponentsWithStats(mask)
        if count < 2:
            continue
        largest = 1 + int(np.argmax(parts[1:, cv2.CC_STAT_AREA]))
        area = float(parts[largest, cv2.CC_STAT_AREA]) / (width * height)
        if area >= LEAST_AREA:
            x = float(middles[largest][0]) / width * 2 - 1
            found[name] = Seen(name, round(x, 3), round(area, 4))
    return found
