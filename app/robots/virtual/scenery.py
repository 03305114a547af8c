"""Textures of the room's walls, floor, ceiling and objects, created once at the start."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping

import cv2
import numpy as np

from app.robots.virtual.canvas import Picture, Texture
from app.robots.virtual.room import Opening, Room, Wall

PIXELS_PER_M = 110  # pixels of a wall's picture per metre
Colour = tuple[int, int, int]

_SUPERSAMPLING = 2
FIGURE_SIZE_PX = (340, 720)  # width, height of the person's image; the head touches its upper edge
FACE_ROWS = (0.0, 0.21)  # face from hair to chin, as fractions of the figure's height
FIGURE_ASPECT_RATIO = FIGURE_SIZE_PX[0] / FIGURE_SIZE_PX[1]  # width / height


def to_bgr(colour: str) -> Colour:
    """Convert a colour "#rrggbb" to a BGR tuple."""
    return int(colour[5:7], 16), int(colour[3:5], 16), int(colour[1:3], 16)


def gradient(height: int, width: int, top: str, bottom: str) -> Picture:
    """Return an image with a vertical gradient between two colours ("#rrggbb")."""
    fraction = np.linspace(0.0, 1.0, height)[:, None, None]
    rows = np.array(to_bgr(top)) * (1 - fraction) + np.array(to_bgr(bottom)) * fraction
    return np.repeat(rows, width, axis=1).astype(np.uint8)


def _paint_rect(picture: Picture, left: float, top: float, right: float, bottom: float, colour: str) -> None:
    cv2.rectangle(
        picture, (round(left), round(top)), (round(right), round(bottom)), to_bgr(colour), cv2.FILLED
    )


# ---- walls ----------------------------------------------------------------------------------------


def wall(room: Room, side: Wall) -> Texture:
    """Return the texture of a wall with its openings, as seen from inside."""
    length = room.y_max - room.y_min if side in {"east", "west"} else room.x_max - room.x_min
    width, height = round(length * PIXELS_PER_M), round(room.height * PIXELS_PER_M)
    picture = gradient(height, width, "#b9bdc0", "#d5d6d4")
    shade = {"east": 1.0, "west": 1.03, "north": 0.94, "south": 0.95}[side]
    light = shade * (0.9 + 0.1 * np.sin(np.linspace(0.15, np.pi - 0.15, width)))[None, :, None]
    picture = np.clip(picture * light, 0, 255).astype(np.uint8)
    _paint_rect(picture, 0, height - 0.09 * PIXELS_PER_M, width, height, "#eceae5")
    _paint_rect(picture, 0, height - 0.095 * PIXELS_PER_M, width, height - 0.088 * PIXELS_PER_M, "#b3b0a9")
    for opening in room.openings:
        if opening.wall == side:
            _paint_opening(picture, room, opening)
    return Texture(picture)


def _paint_opening(picture: Picture, room: Room, opening: Opening) -> None:
    # Seen from inside, x and y grow to the right on north and west walls, to the left on the others.
    along = {
        "east": room.y_max - opening.at,
        "west": opening.at - room.y_min,
        "north": opening.at - room.x_min,
        "south": room.x_max - opening.at,
    }[opening.wall]
    left = (along - opening.width / 2) * PIXELS_PER_M
    top = (room.height - opening.bottom - opening.height) * PIXELS_PER_M
    right, bottom = left + opening.width * PIXELS_PER_M, top + opening.height * PIXELS_PER_M
    painters: dict[str, Callable[[Picture, float, float, float, float], None]] = {
        "door": _paint_door,
        "board": _paint_board,
        "window": _paint_window,
        "picture": _paint_picture,
    }
    painters[opening.kind](picture, left, top, right, bottom)


def _paint_door(picture: Picture, left: float, top: float, right: float, bottom: float) -> None:
    _paint_rect(picture, left - 9, top - 9, right + 9, bottom, "#7d6044")
    _paint_rect(picture, left, top, right, bottom, "#8d6e50")
    for upper, lower in ((0.07, 0.46), (0.54, 0.94)):
        y0, y1 = top + (bottom - top) * upper, top + (bottom - top) * lower
        _paint_rect(picture, left + 13, y0, right - 13, y1, "#7b5d42")
        _paint_rect(picture, left + 16, y0 + 3, right - 15, y1 - 2, "#86684b")
    middle = (round(left + 10), round((top + bottom) / 2 + 6))
    cv2.circle(picture, middle, 5, to_bgr("#d9c48c"), cv2.FILLED, cv2.LINE_AA)


def _paint_board(picture: Picture, left: float, top: float, right: float, bottom: float) -> None:
    _paint_rect(picture, left - 4, top - 4, right + 4, bottom + 4, "#9aa0a5")
    _paint_rect(picture, left, top, right, bottom, "#f6f7f7")
    for row, length in enumerate((0.36, 0.6, 0.48)):
        y = top + (bottom - top) * (0.25 + 0.2 * row)
        _paint_rect(picture, left + 16, y, left + 16 + (right - left - 32) * length, y + 5, "#4e79b8")
    chart = [(0.70, 0.72), (0.78, 0.50), (0.86, 0.60), (0.93, 0.32)]
    points = [(round(left + (right - left) * x), round(top + (bottom - top) * y)) for x, y in chart]
    for start, end in itertools.pairwise(points):
        cv2.line(picture, start, end, to_bgr("#3a9a62"), 3, cv2.LINE_AA)
    _paint_rect(picture, left + 10, bottom + 1, right - 10, bottom + 8, "#a9aeb2")


def _paint_window(picture: Picture, left: float, top: float, right: float, bottom: float) -> None:
    _paint_rect(picture, left - 9, top - 9, right + 9, bottom + 9, "#fbfaf7")
    x0, y0, x1, y1 = round(left), round(top), round(right), round(bottom)
    view = gradient(y1 - y0, x1 - x0, "#a9cdec", "#e6f1f6")
    height, width = view.shape[:2]
    for x, y, size, colour in ((0.25, 1.02, 0.36, "#8fae86"), (0.75, 1.08, 0.46, "#7d9d75")):
        middle, radii = (
            (round(width * x), round(height * y)),
            (round(width * size), round(height * size * 0.8)),
        )
        cv2.ellipse(view, middle, radii, 0, 0, 360, to_bgr(colour), cv2.FILLED, cv2.LINE_AA)
    picture[y0:y1, x0:x1] = view
    _paint_rect(picture, (left + right) / 2 - 4, top, (left + right) / 2 + 4, bottom, "#fbfaf7")
    _paint_rect(picture, left, (top + bottom) / 2 - 4, right, (top + bottom) / 2 + 4, "#fbfaf7")
    _paint_rect(picture, left - 14, bottom + 9, right + 14, bottom + 16, "#e3e1da")


def _paint_picture(picture: Picture, left: float, top: float, right: float, bottom: float) -> None:
    _paint_rect(picture, left, top, right, bottom, "#2f3742")
    _paint_rect(picture, left + 7, top + 7, right - 7, bottom - 7, "#3d4754")
    base = bottom - 14
    for x, peak in ((0.36, 0.35), (0.66, 0.5)):
        tip = (left + (right - left) * x, top + (bottom - top) * peak)
        half_width = (right - left) * 0.25
        corners = (
            np.array([tip, (tip[0] + half_width, base), (tip[0] - half_width, base)]).round().astype(np.int32)
        )
        cv2.fillConvexPoly(picture, corners, to_bgr("#e6a94b"), cv2.LINE_AA)


# ---- floor, ceiling -------------------------------------------------------------------------------


def floor(room: Room) -> Texture:
    """Return the texture of a floor with wooden boards along the x axis, darker near the walls."""
    width, depth = (
        round((room.x_max - room.x_min) * PIXELS_PER_M),
        round((room.y_max - room.y_min) * PIXELS_PER_M),
    )
    generator = np.random.default_rng(5)  # the same boards at every start
    picture = np.zeros((depth, width, 3), dtype=np.uint8)
    board_width = round(0.16 * PIXELS_PER_M)
    for row in range(0, depth, board_width):
        start = -int(generator.integers(0, 200))
        while start < width:
            length = int(generator.integers(170, 300))
            shade = float(generator.uniform(0.95, 1.04))
            colour = tuple(min(255.0, part * shade) for part in to_bgr("#a68763"))
            cv2.rectangle(picture, (start, row), (start + length, row + board_width - 1), colour, cv2.FILLED)
            cv2.line(picture, (start, row), (start, row + board_width - 1), to_bgr("#957757"), 1)
            start += length
        cv2.line(picture, (0, row), (width, row), to_bgr("#8f7152"), 2)
    x = np.minimum(np.arange(width), np.arange(width)[::-1])[None, :] / PIXELS_PER_M
    y = np.minimum(np.arange(depth), np.arange(depth)[::-1])[:, None] / PIXELS_PER_M
    light = 1.04 - 0.24 * np.exp(-np.minimum(x, y) / 0.35)
    return Texture(np.clip(picture * light[:, :, None], 0, 255).astype(np.uint8))


def ceiling() -> Texture:
    """Return the texture of a bright ceiling."""
    return Texture(gradient(64, 64, "#dfe1e1", "#d3d5d5"))


def shadow() -> Texture:
    """Return the texture of a soft round shadow on the floor."""
    y, x = np.mgrid[-1:1:64j, -1:1:64j]
    alpha = np.clip(1.0 - np.hypot(x, y), 0.0, 1.0) ** 1.2 * 150
    picture = np.zeros((64, 64, 4), dtype=np.uint8)
    picture[:, :, :3] = to_bgr("#2b2117")
    picture[:, :, 3] = alpha.astype(np.uint8)
    return Texture(picture)


def marker(number: int) -> Texture:
    """Return the texture of an ArUco card: the printed square and a white border of one module.

    Args:
        number: Id of the marker.
    """
    square = cv2.aruco.generateImageMarker(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), number, 6 * 24
    )
    square = np.maximum(square, 26)  # printed black is not quite black
    bordered = cv2.copyMakeBorder(square, 24, 24, 24, 24, cv2.BORDER_CONSTANT, value=(250,))
    return Texture(np.asarray(cv2.cvtColor(bordered, cv2.COLOR_GRAY2BGR), dtype=np.uint8))


MARKER_CARD_SCALE = 8 / 6  # the card is this much wider than its printed square


class _Painter:
    """Painter of shapes on a transparent image; positions are fractions of the image's width and height."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width * _SUPERSAMPLING, height * _SUPERSAMPLING
        self.colour = np.zeros((self.height, self.width, 3), dtype=np.uint8)
        self.alpha = np.zeros((self.height, self.width), dtype=np.uint8)

    def _point(self, x: float, y: float) -> tuple[int, int]:
        return round(x * self.width), round(y * self.height)

    def paint_oval(
        self,
        middle: tuple[float, float],
        size: tuple[float, float],
        colour: str,
        arc_deg: tuple[int, int] = (0, 360),
    ) -> None:
        radii = (round(size[0] * self.width), round(size[1] * self.height))
        for target, value in ((self.colour, to_bgr(colour)), (self.alpha, (255,))):
            cv2.ellipse(target, self._point(*middle), radii, 0, *arc_deg, value, cv2.FILLED, cv2.LINE_AA)

    def paint_arc(
        self, middle: tuple[float, float], radii: tuple[float, float], colour: str, arc_deg: tuple[int, int]
    ) -> None:
        thickness = round(0.014 * self.width)
        radius_x, radius_y = round(radii[0] * self.width), round(radii[1] * self.height)
        cv2.ellipse(
            self.colour,
            self._point(*middle),
            (radius_x, radius_y),
            0,
            *arc_deg,
            to_bgr(colour),
            thickness,
            cv2.LINE_AA,
        )

    def paint_polygon(self, points: list[tuple[float, float]], colour: str) -> None:
        corners = np.array([self._point(x, y) for x, y in points], dtype=np.int32)
        for target, value in ((self.colour, to_bgr(colour)), (self.alpha, (255,))):
            cv2.fillPoly(target, [corners], value, cv2.LINE_AA)

    def render(self) -> Picture:
        bgra = np.dstack([self.colour, self.alpha])
        size = (self.width // _SUPERSAMPLING, self.height // _SUPERSAMPLING)
        return np.asarray(cv2.resize(bgra, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def person() -> Texture:
    """Return the texture of a person from head to feet."""
    painter = _Painter(*FIGURE_SIZE_PX)
    for x in (0.40, 0.60):  # legs and shoes
        painter.paint_polygon(
            [(x - 0.1, 0.62), (x + 0.1, 0.62), (x + 0.075, 0.97), (x - 0.075, 0.97)], "#3b4658"
        )
        painter.paint_oval((x, 0.975), (0.1, 0.022), "#e8e6e1")
    for side in (-1, 1):  # arms and hands behind the body
        shoulder, hand = 0.5 + side * 0.27, 0.5 + side * 0.36
        painter.paint_polygon(
            [(shoulder - 0.07, 0.322), (shoulder + 0.05, 0.322), (hand + 0.06, 0.55), (hand - 0.06, 0.55)],
            "#3972a8",
        )
        painter.paint_oval((shoulder + 0.008 * side, 0.322), (0.06, 0.03), "#3972a8")
        painter.paint_oval((hand, 0.565), (0.055, 0.03), "#e0ab85")
    painter.paint_oval((0.5, 0.33), (0.325, 0.09), "#3f7db8")
    painter.paint_polygon([(0.175, 0.33), (0.825, 0.33), (0.76, 0.66), (0.24, 0.66)], "#3f7db8")
    painter.paint_polygon([(0.42, 0.18), (0.58, 0.18), (0.6, 0.255), (0.4, 0.255)], "#d99f78")
    painter.paint_oval((0.5, 0.247), (0.125, 0.024), "#d99f78")
    _paint_head(painter)
    return Texture(painter.render())


def _paint_head(painter: _Painter) -> None:
    for x in (0.315, 0.685):
        painter.paint_oval((x, 0.125), (0.035, 0.022), "#dca27b")
    painter.paint_oval((0.5, 0.085), (0.205, 0.085), "#4b2f24")
    painter.paint_oval((0.5, 0.118), (0.185, 0.092), "#e9b690")
    painter.paint_oval((0.5, 0.075), (0.2, 0.07), "#4b2f24", (180, 360))
    painter.paint_polygon([(0.302, 0.074), (0.31, 0.118), (0.335, 0.085), (0.42, 0.07)], "#4b2f24")
    painter.paint_polygon([(0.698, 0.074), (0.69, 0.118), (0.665, 0.085), (0.58, 0.07)], "#4b2f24")
    for x in (0.425, 0.575):
        painter.paint_oval((x, 0.116), (0.03, 0.0095), "#fdfbf8")
        painter.paint_oval((x, 0.1165), (0.019, 0.0095), "#33241d")
        painter.paint_oval((x + 0.006, 0.1135), (0.006, 0.003), "#ffffff")
        painter.paint_arc((x, 0.106), (0.042, 0.012), "#4b2f24", (205, 335))
    painter.paint_arc((0.5, 0.139), (0.022, 0.009), "#c98c67", (20, 160))
    for x in (0.37, 0.63):
        painter.paint_oval((x, 0.15), (0.036, 0.013), "#e6a688")
    painter.paint_arc((0.5, 0.154), (0.085, 0.024), "#a8493f", (18, 162))


def robot(figure: str, *, is_front: bool) -> Texture:
    """Return the texture of another robot.

    Args:
        figure: Key of `ROBOT_FIGURES`, or `NEUTRAL_FIGURE`.
        is_front: True for the view from the front, False from behind.
    """
    size_px, paint = ROBOT_FIGURES.get(figure, (FIGURE_SIZE_PX, _paint_neutral_robot))
    painter = _Painter(*size_px)
    paint(painter, is_front=is_front)
    return Texture(painter.render())


def _paint_neutral_robot(painter: _Painter, *, is_front: bool) -> None:
    painter.paint_polygon([(0.12, 0.05), (0.88, 0.05), (0.88, 0.95), (0.12, 0.95)], "#9aa3b2")
    painter.paint_oval((0.5, 0.95), (0.38, 0.04), "#9aa3b2")
    painter.paint_oval((0.5, 0.05), (0.38, 0.04), "#b9c0cc")
    if is_front:
        painter.paint_polygon([(0.3, 0.12), (0.7, 0.12), (0.7, 0.2), (0.3, 0.2)], "#3a4150")


def _paint_large_robot(painter: _Painter, *, is_front: bool) -> None:
    painter.paint_polygon([(0.3, 0.55), (0.7, 0.55), (0.86, 0.97), (0.14, 0.97)], "#e9edf4")
    painter.paint_oval((0.5, 0.965), (0.36, 0.03), "#c8ccd8")
    for side in (-1, 1):
        shoulder, hand = 0.5 + side * 0.33, 0.5 + side * 0.4
        painter.paint_polygon(
            [(shoulder - 0.06, 0.33), (shoulder + 0.06, 0.33), (hand + 0.05, 0.6), (hand - 0.05, 0.6)],
            "#dfe4ee",
        )
        painter.paint_oval((hand, 0.61), (0.065, 0.032), "#f3f5fa")
    painter.paint_oval((0.5, 0.43), (0.31, 0.15), "#f7f8fb")
    painter.paint_oval((0.5, 0.155), (0.36, 0.155), "#f4f6fa")
    if not is_front:
        painter.paint_polygon([(0.36, 0.36), (0.64, 0.36), (0.64, 0.5), (0.36, 0.5)], "#d9dee8")
        return
    painter.paint_polygon([(0.33, 0.36), (0.67, 0.36), (0.67, 0.48), (0.33, 0.48)], "#20232e")
    for x in (0.37, 0.63):
        painter.paint_oval((x, 0.16), (0.1, 0.045), "#1b1e2a")
        painter.paint_oval((x, 0.16), (0.07, 0.032), "#8fc3e6")
        painter.paint_oval((x, 0.16), (0.035, 0.016), "#1b1e2a")
    painter.paint_arc((0.5, 0.21), (0.1, 0.03), "#4e5566", (20, 160))


def _paint_small_robot(painter: _Painter, *, is_front: bool) -> None:
    for x in (0.1, 0.9):
        painter.paint_oval((x, 0.78), (0.07, 0.2), "#2b2d33")
    painter.paint_polygon([(0.1, 0.5), (0.9, 0.5), (0.9, 0.88), (0.1, 0.88)], "#5a7f76")
    painter.paint_oval((0.5, 0.88), (0.4, 0.1), "#5a7f76")
    painter.paint_oval((0.5, 0.5), (0.4, 0.13), "#7d9f95")
    painter.paint_polygon([(0.46, 0.2), (0.54, 0.2), (0.54, 0.5), (0.46, 0.5)], "#c8ccd8")
    painter.paint_polygon([(0.34, 0.06), (0.66, 0.06), (0.66, 0.28), (0.34, 0.28)], "#e9edf4")
    if is_front:
        painter.paint_oval((0.5, 0.17), (0.08, 0.09), "#1b1e2a")


ROBOT_FIGURES: Mapping[str, tuple[tuple[int, int], Callable[..., None]]] = {
    "pepper": (FIGURE_SIZE_PX, _paint_large_robot),
    "turtle": ((400, 300), _paint_small_robot),
}
"""Size of the image in pixels and painter of each known figure of a robot."""
NEUTRAL_FIGURE = ""
"""Figure of all other robots: an upright cylinder, as which they block the room."""


def ball(colour: str) -> Texture:
    """Return the texture of a shiny ball that fills the image.

    Args:
        colour: Colour in the form "#rrggbb".
    """
    side = 128
    y, x = np.mgrid[-1:1:128j, -1:1:128j]
    radius = np.hypot(x, y)
    light = np.clip(1.18 - 0.4 * np.hypot(x + 0.35, y + 0.42), 0.5, 1.15)
    shine = np.exp(-((x + 0.36) ** 2 + (y + 0.44) ** 2) / 0.035) * 130
    picture = np.zeros((side, side, 4), dtype=np.uint8)
    shaded_colour = np.array(to_bgr(colour))[None, None, :] * light[:, :, None] + shine[:, :, None]
    picture[:, :, :3] = np.clip(shaded_colour, 0, 255).astype(np.uint8)
    picture[:, :, 3] = np.clip((1.0 - radius) * side / 2, 0, 1) * 255
    return Texture(picture)
