"""The person and the ball as pictures with a clear background, painted large and smoothed."""

from __future__ import annotations

import cv2
import numpy as np

from app.robots.virtual.canvas import Picture, Texture
from app.robots.virtual.scenery import bgr

_FINE = 2  # painted this much larger, then reduced: smooth edges
FIGURE = (340, 720)  # width, height of the person's picture; the head's top is its upper edge
FACE_ROWS = (0.0, 0.21)  # the face in parts of the figure's height, hair to chin
FIGURE_WIDTH = FIGURE[0] / FIGURE[1]  # of its height


class _Paint:
    """Shapes on a clear picture, in parts of the figure's width and height."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width * _FINE, height * _FINE
        self.colour = np.zeros((self.height, self.width, 3), dtype=np.uint8)
        self.alpha = np.zeros((self.height, self.width), dtype=np.uint8)

    def _point(self, x: float, y: float) -> tuple[int, int]:
        return round(x * self.width), round(y * self.height)

    def oval(
        self,
        middle: tuple[float, float],
        size: tuple[float, float],
        colour: str,
        part: tuple[int, int] = (0, 360),
    ) -> None:
        """An ellipse or the part of it between two angles; `size` is its two radii."""
        radii = (round(size[0] * self.width), round(size[1] * self.height))
        for target, value in ((self.colour, bgr(colour)), (self.alpha, (255,))):
            cv2.ellipse(target, self._point(*middle), radii, 0, *part, value, cv2.FILLED, cv2.LINE_AA)

    def arc(
        self, middle: tuple[float, float], radii: tuple[float, float], colour: str, part: tuple[int, int]
    ) -> None:
        """A curved line between two angles of an ellipse."""
        thick = round(0.014 * self.width)
        across, down = round(radii[0] * self.width), round(radii[1] * self.height)
        cv2.ellipse(
            self.colour, self._point(*middle), (across, down), 0, *part, bgr(colour), thick, cv2.LINE_AA
        )

    def shape(self, points: list[tuple[float, float]], colour: str) -> None:
        """A filled polygon."""
        corners = np.array([self._point(x, y) for x, y in points], dtype=np.int32)
        for target, value in ((self.colour, bgr(colour)), (self.alpha, (255,))):
            cv2.fillPoly(target, [corners], value, cv2.LINE_AA)

    def done(self) -> Picture:
        """The picture in its final size, with alpha."""
        both = np.dstack([self.colour, self.alpha])
        size = (self.width // _FINE, self.height // _FINE)
        return np.asarray(cv2.resize(both, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def person() -> Texture:
    """A friendly person from head to feet."""
    paint = _Paint(*FIGURE)
    for x in (0.40, 0.60):  # legs and shoes
        paint.shape([(x - 0.1, 0.62), (x + 0.1, 0.62), (x + 0.075, 0.97), (x - 0.075, 0.97)], "#3b4658")
        paint.oval((x, 0.975), (0.1, 0.022), "#e8e6e1")
    for side in (-1, 1):  # arms and hands behind the body
        shoulder, hand = 0.5 + side * 0.27, 0.5 + side * 0.36
        paint.shape(
            [(shoulder - 0.07, 0.322), (shoulder + 0.05, 0.322), (hand + 0.06, 0.55), (hand - 0.06, 0.55)],
            "#3972a8",
        )
        paint.oval((shoulder + 0.008 * side, 0.322), (0.06, 0.03), "#3972a8")
        paint.oval((hand, 0.565), (0.055, 0.03), "#e0ab85")
    paint.oval((0.5, 0.33), (0.325, 0.09), "#3f7db8")
    paint.shape([(0.175, 0.33), (0.825, 0.33), (0.76, 0.66), (0.24, 0.66)], "#3f7db8")
    paint.shape([(0.42, 0.18), (0.58, 0.18), (0.6, 0.255), (0.4, 0.255)], "#d99f78")
    paint.oval((0.5, 0.247), (0.125, 0.024), "#d99f78")
    _head(paint)
    return Texture(paint.done())


def _head(paint: _Paint) -> None:
    for x in (0.315, 0.685):
        paint.oval((x, 0.125), (0.035, 0.022), "#dca27b")
    paint.oval((0.5, 0.085), (0.205, 0.085), "#4b2f24")
    paint.oval((0.5, 0.118), (0.185, 0.092), "#e9b690")
    paint.oval((0.5, 0.075), (0.2, 0.07), "#4b2f24", (180, 360))
    paint.shape([(0.302, 0.074), (0.31, 0.118), (0.335, 0.085), (0.42, 0.07)], "#4b2f24")
    paint.shape([(0.698, 0.074), (0.69, 0.118), (0.665, 0.085), (0.58, 0.07)], "#4b2f24")
    for x in (0.425, 0.575):
        paint.oval((x, 0.116), (0.03, 0.0095), "#fdfbf8")
        paint.oval((x, 0.1165), (0.019, 0.0095), "#33241d")
        paint.oval((x + 0.006, 0.1135), (0.006, 0.003), "#ffffff")
        paint.arc((x, 0.106), (0.042, 0.012), "#4b2f24", (205, 335))
    paint.arc((0.5, 0.139), (0.022, 0.009), "#c98c67", (20, 160))
    for x in (0.37, 0.63):
        paint.oval((x, 0.15), (0.036, 0.013), "#e6a688")
    paint.arc((0.5, 0.154), (0.085, 0.024), "#a8493f", (18, 162))


def ball(colour: str) -> Texture:
    """A shining ball; its edge is the picture's."""
    side = 128
    y, x = np.mgrid[-1:1:128j, -1:1:128j]
    radius = np.hypot(x, y)
    light = np.clip(1.18 - 0.4 * np.hypot(x + 0.35, y + 0.42), 0.5, 1.15)
    shine = np.exp(-((x + 0.36) ** 2 + (y + 0.44) ** 2) / 0.035) * 130
    picture = np.zeros((side, side, 4), dtype=np.uint8)
    shaded = np.array(bgr(colour))[None, None, :] * light[:, :, None] + shine[:, :, None]
    picture[:, :, :3] = np.clip(shaded, 0, 255).astype(np.uint8)
    picture[:, :, 3] = np.clip((1.0 - radius) * side / 2, 0, 1) * 255
    return Texture(picture)
