"""Camera of the virtual robot: renders the room as seen from its head, with 320 x 240 pixels."""

from __future__ import annotations

import math
from functools import cache
from typing import TypeAlias

import cv2
import numpy as np

from app.robots.virtual import scenery
from app.robots.virtual.body import EYE_HEIGHT, Body
from app.robots.virtual.canvas import Canvas, Picture
from app.robots.virtual.lens import Lens, Matrix
from app.robots.virtual.room import WALLS, Ball, Box, Marker, Other, Person, Room

EYE_FORWARD = 0.09
_BOOKS = ("#b5594e", "#4e79b8", "#d7a94a", "#5f8f63", "#8a6aa8", "#d4d0c8")


def lens_of(body: Body) -> Lens:
    """Return the camera's current position and orientation."""
    yaw = body.theta_deg + body.head_yaw.angle
    x = body.x + EYE_FORWARD * math.cos(math.radians(yaw))
    y = body.y + EYE_FORWARD * math.sin(math.radians(yaw))
    return Lens((x, y, EYE_HEIGHT), yaw, body.head_pitch.angle)


class Camera:
    """Renderer for one room. Parts that never move are rendered once."""

    def __init__(self, room: Room) -> None:
        self._floor = scenery.floor(room)
        self._ceiling = scenery.ceiling()
        self._walls = {side: scenery.wall(room, side) for side in WALLS}
        self._shadow = scenery.shadow()
        self._marker, self._ball = cache(scenery.marker), cache(scenery.ball)
        self._person = scenery.person()
        self._robot = cache(scenery.robot)
        self._light = _vignette(320, 240)

    def picture(self, room: Room, lens: Lens) -> Picture:
        """Render the view: uint8 (240, 320, 3), BGR."""
        canvas = Canvas(lens)
        self._shell(canvas, room)
        self._shadows(canvas, room)
        ahead = [thing for thing in _things(room) if _ahead(thing, lens)]
        for thing in sorted(ahead, key=lambda one: -_away(one, lens)):
            if isinstance(thing, Box):
                _furniture(canvas, thing)
            elif isinstance(thing, Ball):
                self._roll(canvas, thing)
            elif isinstance(thing, Marker):
                self._stand_marker(canvas, thing)
            else:
                self._stand(canvas, thing)
        if canvas.picture.shape == self._light.shape:
            cv2.multiply(canvas.picture, self._light, dst=canvas.picture, scale=1 / 255)
        return canvas.picture

    def _shell(self, canvas: Canvas, room: Room) -> None:
        x0, x1, y0, y1, top = room.x_min, room.x_max, room.y_min, room.y_max, room.height
        wide, deep = x1 - x0, y1 - y0
        canvas.put(self._ceiling, (x0, y0, top), (wide, 0, 0), (0, deep, 0))
        canvas.put(self._floor, (x0, y0, 0), (wide, 0, 0), (0, deep, 0))
        canvas.put(self._walls["north"], (x0, y1, top), (wide, 0, 0), (0, 0, -top))
        canvas.put(self._walls["south"], (x1, y0, top), (-wide, 0, 0), (0, 0, -top))
        canvas.put(self._walls["east"], (x1, y1, top), (0, -deep, 0), (0, 0, -top))
        canvas.put(self._walls["west"], (x0, y0, top), (0, deep, 0), (0, 0, -top))
        for card in room.markers:
            if card.facing_deg is not None:
                facing = math.radians(card.facing_deg)
                self._card(canvas, card, np.array([-math.sin(facing), math.cos(facing), 0.0]))

    def _card(self, canvas: Canvas, card: Marker, across: Matrix) -> None:
        half = card.size * scenery.MARKER_RIM / 2
        corner = np.array([card.x, card.y, card.z + half]) - across * half
        canvas.put(self._marker(card.id), corner.tolist(), (across * 2 * half).tolist(), (0, 0, -2 * half))

    def _stand_marker(self, canvas: Canvas, card: Marker) -> None:
        _block(canvas, (card.x, card.y, 0.0), (0.03, 0.03, card.z), "#6b6f7a")
        self._card(canvas, card, looking_across(canvas.lens, card.x, card.y))

    def _shadows(self, canvas: Canvas, room: Room) -> None:
        spots = [(ball.x, ball.y, ball.radius * 1.5, ball.radius * 1.5) for ball in room.balls]
        spots += [(person.x, person.y, 0.34, 0.34) for person in room.people]
        spots += [(other.x, other.y, other.radius * 1.4, other.radius * 1.4) for other in room.others]
        spots += [(box.x, box.y, box.width * 0.72, box.depth * 0.72) for box in room.boxes]
        for x, y, wide, deep in spots:
            canvas.put(self._shadow, (x - wide, y - deep, 0), (2 * wide, 0, 0), (0, 2 * deep, 0))

    def _stand(self, canvas: Canvas, one: Person | Other) -> None:
        across = looking_across(canvas.lens, one.x, one.y)
        if isinstance(one, Person):
            picture, wide = self._person, one.height * scenery.FIGURE_WIDTH
        else:
            picture, wide = (
                self._robot(one.figure == "turtle", faces=_faces(one, canvas.lens)),
                one.radius * 2.6,
            )
        corner = np.array([one.x, one.y, one.height]) - across * wide / 2
        canvas.put(picture, corner.tolist(), (across * wide).tolist(), (0, 0, -one.height))

    def _roll(self, canvas: Canvas, ball: Ball) -> None:
        middle = np.array([ball.x, ball.y, ball.z])
        sight = middle - np.asarray(canvas.lens.place)
        sight /= np.linalg.norm(sight)
        across = looking_across(canvas.lens, ball.x, ball.y)
        down = np.cross(sight, across)
        corner = middle - (across + down) * ball.radius
        canvas.put(
            self._ball(ball.colour),
            corner.tolist(),
            (across * 2 * ball.radius).tolist(),
            (down * 2 * ball.radius).tolist(),
        )


_Upright: TypeAlias = Box | Person | Ball | Marker | Other


def _things(room: Room) -> list[_Upright]:
    stands = [card for card in room.markers if card.facing_deg is None]
    return [*room.boxes, *room.people, *room.balls, *stands, *room.others]


def _faces(other: Other, lens: Lens) -> bool:
    to_x, to_y = lens.place[0] - other.x, lens.place[1] - other.y
    theta = math.radians(other.theta_deg)
    return to_x * math.cos(theta) + to_y * math.sin(theta) > 0


def _ahead(thing: _Upright, lens: Lens) -> bool:
    half = math.hypot(thing.width, thing.depth) / 2 if isinstance(thing, Box) else 0.5
    forward = lens.rotation[2]
    flat = math.hypot(float(forward[0]), float(forward[1]))
    along = (thing.x - lens.place[0]) * forward[0] + (thing.y - lens.place[1]) * forward[1]
    return bool(along > -half * flat - abs(float(forward[2])) * 2.0)


def _away(thing: _Upright, lens: Lens) -> float:
    return math.hypot(thing.x - lens.place[0], thing.y - lens.place[1])


def looking_across(lens: Lens, x: float, y: float) -> Matrix:
    """Return the horizontal unit vector to the right of the line from the camera to a place."""
    dx, dy = x - lens.place[0], y - lens.place[1]
    length = math.hypot(dx, dy) or 1.0
    return np.array([dy / length, -dx / length, 0.0])


# ---- furniture ------------------------------------------------------------------------------------


def _furniture(canvas: Canvas, box: Box) -> None:
    (_table if box.kind == "table" else _shelf)(canvas, box)


def _table(canvas: Canvas, box: Box) -> None:
    legs = [
        (box.x + sx * (box.width / 2 - 0.05), box.y + sy * (box.depth / 2 - 0.05))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    eye = canvas.lens.place
    for x, y in sorted(legs, key=lambda leg: -math.hypot(leg[0] - eye[0], leg[1] - eye[1])):
        _block(canvas, (x, y, 0.0), (0.06, 0.06, box.height - 0.06), "#6d4c34")
    _block(canvas, (box.x, box.y, box.height - 0.06), (box.width, box.depth, 0.06), "#8a6244")
    _block(canvas, (box.x, box.y + 0.2, box.height), (0.16, 0.16, 0.18), "#3f8a75")
    for turn in range(7):
        lean = math.radians(turn * 360 / 7)
        _leaf(canvas, (box.x, box.y + 0.2, box.height + 0.18), lean, 0.13, 0.3)


def _leaf(canvas: Canvas, foot: tuple[float, float, float], lean: float, out: float, up: float) -> None:
    start = np.array(foot)
    tip = np.array([foot[0] + out * math.cos(lean), foot[1] + out * math.sin(lean), foot[2] + up])
    middle = (start + tip) / 2
    side = looking_across(canvas.lens, foot[0], foot[1]) * 0.045
    shade = "#4f9a5f" if math.sin(lean) > 0 else "#5fae6e"
    canvas.fill(np.array([start, middle + side, tip, middle - side]), scenery.bgr(shade))


def _shelf(canvas: Canvas, box: Box) -> None:
    _block(canvas, (box.x, box.y, 0.0), (box.width, box.depth, box.height), "#a4835f")
    front = box.y + box.depth / 2 + 0.004
    if canvas.lens.place[1] <= front:
        return
    levels = 3
    for level in range(levels):
        low = 0.08 + level * (box.height - 0.12) / levels
        high = low + (box.height - 0.12) / levels - 0.06
        left, right = box.x - box.width / 2 + 0.05, box.x + box.width / 2 - 0.05
        _upright(canvas, front, (left, right), (low, high), "#6f563d")
        for place in range(11):
            book = left + 0.02 + place * (right - left - 0.04) / 11
            tall = high - 0.03 - 0.035 * ((place * 7 + level * 3) % 4)
            _upright(
                canvas,
                front + 0.002,
                (book, book + 0.07),
                (low, tall),
                _BOOKS[(place * 5 + level) % len(_BOOKS)],
            )


def _upright(
    canvas: Canvas, y: float, across: tuple[float, float], up: tuple[float, float], colour: str
) -> None:
    (left, right), (low, high) = across, up
    corners = [(left, y, low), (right, y, low), (right, y, high), (left, y, high)]
    canvas.fill(np.array(corners), scenery.bgr(colour))


def _block(
    canvas: Canvas, foot: tuple[float, float, float], size: tuple[float, float, float], colour: str
) -> None:
    (x, y, z), (wide, deep, high) = foot, size
    eye = canvas.lens.place
    x0, x1, y0, y1, z1 = x - wide / 2, x + wide / 2, y - deep / 2, y + deep / 2, z + high
    faces = [
        (eye[0] > x1, 0.86, [(x1, y0, z), (x1, y1, z), (x1, y1, z1), (x1, y0, z1)]),
        (eye[0] < x0, 0.92, [(x0, y0, z), (x0, y1, z), (x0, y1, z1), (x0, y0, z1)]),
        (eye[1] > y1, 0.8, [(x0, y1, z), (x1, y1, z), (x1, y1, z1), (x0, y1, z1)]),
        (eye[1] < y0, 0.74, [(x0, y0, z), (x1, y0, z), (x1, y0, z1), (x0, y0, z1)]),
        (eye[2] > z1, 1.08, [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)]),
    ]
    for seen, shade, corners in faces:
        if seen:
            b, g, r = (min(255, round(part * shade)) for part in scenery.bgr(colour))
            canvas.fill(np.array(corners), (b, g, r))


def _vignette(width: int, height: int) -> Picture:
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    light = 255 * (1.0 - 0.2 * np.clip(np.hypot(x, y) - 0.35, 0, None))
    return np.repeat(light[:, :, None], 3, axis=2).astype(np.uint8)
