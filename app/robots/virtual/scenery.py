"""What the room looks like: its walls, floor, furniture and people as pictures, painted once at the start."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import cv2
import numpy as np

from app.robots.virtual.canvas import Picture, Texture
from app.robots.virtual.room import Opening, Room, Wall

PER_M = 110  # pixels of a wall's picture per metre
Colour = tuple[int, int, int]


def bgr(colour: str) -> Colour:
    """The colour "#rrggbb" in OpenCV's order."""
    return int(colour[5:7], 16), int(colour[3:5], 16), int(colour[1:3], 16)


def gradient(height: int, width: int, top: str, bottom: str) -> Picture:
    """A picture that fades from one colour to another, downwards."""
    part = np.linspace(0.0, 1.0, height)[:, None, None]
    rows = np.array(bgr(top)) * (1 - part) + np.array(bgr(bottom)) * part
    return np.repeat(rows, width, axis=1).astype(np.uint8)


def _rect(picture: Picture, left: float, top: float, right: float, bottom: float, colour: str) -> None:
    cv2.rectangle(picture, (round(left), round(top)), (round(right), round(bottom)), bgr(colour), cv2.FILLED)


# ---- walls ----------------------------------------------------------------------------------------


def wall(room: Room, side: Wall) -> Texture:
    """One wall with its openings, seen from inside: its left end is the left edge."""
    length = room.y_max - room.y_min if side in {"east", "west"} else room.x_max - room.x_min
    width, height = round(length * PER_M), round(room.height * PER_M)
    picture = gradient(height, width, "#b9bdc0", "#d5d6d4")
    shade = {"east": 1.0, "west": 1.03, "north": 0.94, "south": 0.95}[side]
    light = shade * (0.9 + 0.1 * np.sin(np.linspace(0.15, np.pi - 0.15, width)))[None, :, None]
    picture = np.clip(picture * light, 0, 255).astype(np.uint8)
    _rect(picture, 0, height - 0.09 * PER_M, width, height, "#eceae5")
    _rect(picture, 0, height - 0.095 * PER_M, width, height - 0.088 * PER_M, "#b3b0a9")
    for opening in room.openings:
        if opening.wall == side:
            _open(picture, room, opening)
    return Texture(picture)


def _open(picture: Picture, room: Room, opening: Opening) -> None:
    # Seen from inside, north and west walls grow to the right with x and y, the others run the other way.
    along = {
        "east": room.y_max - opening.at,
        "west": opening.at - room.y_min,
        "north": opening.at - room.x_min,
        "south": room.x_max - opening.at,
    }[opening.wall]
    left = (along - opening.width / 2) * PER_M
    top = (room.height - opening.bottom - opening.height) * PER_M
    right, bottom = left + opening.width * PER_M, top + opening.height * PER_M
    painters: dict[str, Callable[[Picture, float, float, float, float], None]] = {
        "door": _door,
        "board": _board,
        "window": _window,
        "picture": _painting,
    }
    painters[opening.kind](picture, left, top, right, bottom)


def _door(picture: Picture, left: float, top: float, right: float, bottom: float) -> None:
    _rect(picture, left - 9, top - 9, right + 9, bottom, "#7d6044")
    _rect(picture, left, top, right, bottom, "#8d6e50")
    for upper, lower in ((0.07, 0.46), (0.54, 0.94)):
        y0, y1 = top + (bottom - top) * upper, top + (bottom - top) * lower
        _rect(picture, left + 13, y0, right - 13, y1, "#7b5d42")
        _rect(picture, left + 16, y0 + 3, right - 15, y1 - 2, "#86684b")
    middle = (round(left + 10), round((top + bottom) / 2 + 6))
    cv2.circle(picture, middle, 5, bgr("#d9c48c"), cv2.FILLED, cv2.LINE_AA)


def _board(picture: Picture, left: float, top: float, right: float, bottom: float) -> None:
    _rect(picture, left - 4, top - 4, right + 4, bottom + 4, "#9aa0a5")
    _rect(picture, left, top, right, bottom, "#f6f7f7")
    for row, length in enumerate((0.36, 0.6, 0.48)):
        y = top + (bottom - top) * (0.25 + 0.2 * row)
        _rect(picture, left + 16, y, left + 16 + (right - left - 32) * length, y + 5, "#4e79b8")
    chart = [(0.70, 0.72), (0.78, 0.50), (0.86, 0.60), (0.93, 0.32)]
    points = [(round(left + (right - left) * x), round(top + (bottom - top) * y)) for x, y in chart]
    for start, end in itertools.pairwise(points):
        cv2.line(picture, start, end, bgr("#3a9a62"), 3, cv2.LINE_AA)
    _rect(picture, left + 10, bottom + 1, right - 10, bottom + 8, "#a9aeb2")


def _window(picture: Picture, left: float, top: float, right: float, bottom: float) -> None:
    _rect(picture, left - 9, top - 9, right + 9, bottom + 9, "#fbfaf7")
    x0, y0, x1, y1 = round(left), round(top), round(right), round(bottom)
    view = gradient(y1 - y0, x1 - x0, "#a9cdec", "#e6f1f6")
    height, width = view.shape[:2]
    for x, y, size, colour in ((0.25, 1.02, 0.36, "#8fae86"), (0.75, 1.08, 0.46, "#7d9d75")):
        middle, radii = (
            (round(width * x), round(height * y)),
            (round(width * size), round(height * size * 0.8)),
        )
        cv2.ellipse(view, middle, radii, 0, 0, 360, bgr(colour), cv2.FILLED, cv2.LINE_AA)
    picture[y0:y1, x0:x1] = view
    _rect(picture, (left + right) / 2 - 4, top, (left + right) / 2 + 4, bottom, "#fbfaf7")
    _rect(picture, left, (top + bottom) / 2 - 4, right, (top + bottom) / 2 + 4, "#fbfaf7")
    _rect(picture, left - 14, bottom + 9, right + 14, bottom + 16, "#e3e1da")


def _painting(picture: Picture, left: float, top: float, right: float, bottom: float) -> None:
    _rect(picture, left, top, right, bottom, "#2f3742")
    _rect(picture, left + 7, top + 7, right - 7, bottom - 7, "#3d4754")
    base = bottom - 14
    for x, peak in ((0.36, 0.35), (0.66, 0.5)):
        tip = (left + (right - left) * x, top + (bottom - top) * peak)
        wide = (right - left) * 0.25
        corners = np.array([tip, (tip[0] + wide, base), (tip[0] - wide, base)]).round().astype(np.int32)
        cv2.fillConvexPoly(picture, corners, bgr("#e6a94b"), cv2.LINE_AA)


# ---- floor, ceiling -------------------------------------------------------------------------------


def floor(room: Room) -> Texture:
    """Wooden boards that run east, darker towards the walls."""
    width, depth = round((room.x_max - room.x_min) * PER_M), round((room.y_max - room.y_min) * PER_M)
    shades = np.random.default_rng(5)  # always the same boards
    picture = np.zeros((depth, width, 3), dtype=np.uint8)
    board = round(0.16 * PER_M)
    for row in range(0, depth, board):
        start = -int(shades.integers(0, 200))
        while start < width:
            length = int(shades.integers(170, 300))
            shade = float(shades.uniform(0.95, 1.04))
            colour = tuple(min(255.0, part * shade) for part in bgr("#a68763"))
            cv2.rectangle(picture, (start, row), (start + length, row + board - 1), colour, cv2.FILLED)
            cv2.line(picture, (start, row), (start, row + board - 1), bgr("#957757"), 1)
            start += length
        cv2.line(picture, (0, row), (width, row), bgr("#8f7152"), 2)
    x = np.minimum(np.arange(width), np.arange(width)[::-1])[None, :] / PER_M
    y = np.minimum(np.arange(depth), np.arange(depth)[::-1])[:, None] / PER_M
    light = 1.04 - 0.24 * np.exp(-np.minimum(x, y) / 0.35)
    return Texture(np.clip(picture * light[:, :, None], 0, 255).astype(np.uint8))


def ceiling() -> Texture:
    """Plain and bright."""
    return Texture(gradient(64, 64, "#dfe1e1", "#d3d5d5"))


def shadow() -> Texture:
    """A soft round shadow for the floor."""
    y, x = np.mgrid[-1:1:64j, -1:1:64j]
    alpha = np.clip(1.0 - np.hypot(x, y), 0.0, 1.0) ** 1.2 * 150
    picture = np.zeros((64, 64, 4), dtype=np.uint8)
    picture[:, :, :3] = bgr("#2b2117")
    picture[:, :, 3] = alpha.astype(np.uint8)
    return Texture(picture)


def marker(number: int) -> Texture:
    """An ArUco card: the printed square and a white rim of one module each."""
    square = cv2.aruco.generateImageMarker(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), number, 6 * 24
    )
    square = np.maximum(square, 26)  # printed black is not quite black
    rimmed = cv2.copyMakeBorder(square, 24, 24, 24, 24, cv2.BORDER_CONSTANT, value=(250,))
    return Texture(np.asarray(cv2.cvtColor(rimmed, cv2.COLOR_GRAY2BGR), dtype=np.uint8))


MARKER_RIM = 8 / 6  # the card is this much wider than its printed square
