"""Camera of virtual robots: renders the room in perspective, with 320 x 240 pixels."""

from __future__ import annotations

import math
from functools import cache
from typing import TypeAlias

import cv2
import numpy as np

from app.robots.virtual import scenery
from app.robots.virtual.body import EYE_HEIGHT_M, Body
from app.robots.virtual.canvas import Canvas, Picture
from app.robots.virtual.lens import Lens, Matrix
from app.robots.virtual.room import WALLS, Ball, Box, Marker, OtherRobot, Person, Room

EYE_FORWARD_M = 0.09
_BOOK_COLOURS = ("#b5594e", "#4e79b8", "#d7a94a", "#5f8f63", "#8a6aa8", "#d4d0c8")


def lens_of(body: Body) -> Lens:
    """Return the current camera model of the virtual Pepper, whose camera is in its head."""
    yaw = body.theta_deg + body.head_yaw.angle
    x = body.x + EYE_FORWARD_M * math.cos(math.radians(yaw))
    y = body.y + EYE_FORWARD_M * math.sin(math.radians(yaw))
    return Lens((x, y, EYE_HEIGHT_M), yaw, body.head_pitch.angle)


class Camera:
    """Renderer for one room. The textures of walls, floor and ceiling are created once.

    Args:
        room: Room, whose walls never change.
    """

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
        """Render the view of a camera.

        Args:
            room: Current state of the room.
            lens: Camera model.

        Returns:
            BGR image, uint8 of shape (240, 320, 3).
        """
        canvas = Canvas(lens)
        self._paint_shell(canvas, room)
        self._paint_shadows(canvas, room)
        visible = [drawable for drawable in _drawables(room) if _is_ahead(drawable, lens)]
        for drawable in sorted(visible, key=lambda one: -_distance(one, lens)):
            if isinstance(drawable, Box):
                _paint_furniture(canvas, drawable)
            elif isinstance(drawable, Ball):
                self._paint_ball(canvas, drawable)
            elif isinstance(drawable, Marker):
                self._paint_marker_stand(canvas, drawable)
            else:
                self._paint_figure(canvas, drawable)
        if canvas.picture.shape == self._light.shape:
            cv2.multiply(canvas.picture, self._light, dst=canvas.picture, scale=1 / 255)
        return canvas.picture

    def _paint_shell(self, canvas: Canvas, room: Room) -> None:
        x0, x1, y0, y1, top = room.x_min, room.x_max, room.y_min, room.y_max, room.height
        width, depth = x1 - x0, y1 - y0
        canvas.draw_texture(self._ceiling, (x0, y0, top), (width, 0, 0), (0, depth, 0))
        canvas.draw_texture(self._floor, (x0, y0, 0), (width, 0, 0), (0, depth, 0))
        canvas.draw_texture(self._walls["north"], (x0, y1, top), (width, 0, 0), (0, 0, -top))
        canvas.draw_texture(self._walls["south"], (x1, y0, top), (-width, 0, 0), (0, 0, -top))
        canvas.draw_texture(self._walls["east"], (x1, y1, top), (0, -depth, 0), (0, 0, -top))
        canvas.draw_texture(self._walls["west"], (x0, y0, top), (0, depth, 0), (0, 0, -top))
        for card in room.markers:
            if card.facing_deg is not None:
                facing = math.radians(card.facing_deg)
                self._paint_card(canvas, card, np.array([-math.sin(facing), math.cos(facing), 0.0]))

    def _paint_card(self, canvas: Canvas, card: Marker, right: Matrix) -> None:
        half = card.size * scenery.MARKER_CARD_SCALE / 2
        corner = np.array([card.x, card.y, card.z + half]) - right * half
        canvas.draw_texture(
            self._marker(card.id), corner.tolist(), (right * 2 * half).tolist(), (0, 0, -2 * half)
        )

    def _paint_marker_stand(self, canvas: Canvas, card: Marker) -> None:
        _paint_block(canvas, (card.x, card.y, 0.0), (0.03, 0.03, card.z), "#6b6f7a")
        self._paint_card(canvas, card, right_vector(canvas.lens, card.x, card.y))

    def _paint_shadows(self, canvas: Canvas, room: Room) -> None:
        spots = [(ball.x, ball.y, ball.radius * 1.5, ball.radius * 1.5) for ball in room.balls]
        spots += [(person.x, person.y, 0.34, 0.34) for person in room.people]
        spots += [(other.x, other.y, other.radius * 1.4, other.radius * 1.4) for other in room.other_robots]
        spots += [(box.x, box.y, box.width * 0.72, box.depth * 0.72) for box in room.boxes]
        for x, y, half_width, half_depth in spots:
            canvas.draw_texture(
                self._shadow,
                (x - half_width, y - half_depth, 0),
                (2 * half_width, 0, 0),
                (0, 2 * half_depth, 0),
            )

    def _paint_figure(self, canvas: Canvas, figure: Person | OtherRobot) -> None:
        right = right_vector(canvas.lens, figure.x, figure.y)
        if isinstance(figure, Person):
            picture, width = self._person, figure.height * scenery.FIGURE_ASPECT_RATIO
        else:
            # Robots can report any text; the cache has one texture for all unknown ones.
            name = figure.figure if figure.figure in scenery.ROBOT_FIGURES else scenery.NEUTRAL_FIGURE
            picture = self._robot(name, is_front=_is_facing_camera(figure, canvas.lens))
            width = figure.radius * 2.6
        corner = np.array([figure.x, figure.y, figure.height]) - right * width / 2
        canvas.draw_texture(picture, corner.tolist(), (right * width).tolist(), (0, 0, -figure.height))

    def _paint_ball(self, canvas: Canvas, ball: Ball) -> None:
        middle = np.array([ball.x, ball.y, ball.z])
        view_direction = middle - np.asarray(canvas.lens.position)
        view_direction /= np.linalg.norm(view_direction)
        right = right_vector(canvas.lens, ball.x, ball.y)
        down = np.cross(view_direction, right)
        corner = middle - (right + down) * ball.radius
        canvas.draw_texture(
            self._ball(ball.colour),
            corner.tolist(),
            (right * 2 * ball.radius).tolist(),
            (down * 2 * ball.radius).tolist(),
        )


_Drawable: TypeAlias = Box | Person | Ball | Marker | OtherRobot


def _drawables(room: Room) -> list[_Drawable]:
    standing_markers = [card for card in room.markers if card.facing_deg is None]
    return [*room.boxes, *room.people, *room.balls, *standing_markers, *room.other_robots]


def _is_facing_camera(other: OtherRobot, lens: Lens) -> bool:
    to_x, to_y = lens.position[0] - other.x, lens.position[1] - other.y
    theta = math.radians(other.theta_deg)
    return to_x * math.cos(theta) + to_y * math.sin(theta) > 0


def _is_ahead(drawable: _Drawable, lens: Lens) -> bool:
    half = math.hypot(drawable.width, drawable.depth) / 2 if isinstance(drawable, Box) else 0.5
    forward = lens.rotation[2]
    horizontal_length = math.hypot(float(forward[0]), float(forward[1]))
    forward_distance = (drawable.x - lens.position[0]) * forward[0] + (
        drawable.y - lens.position[1]
    ) * forward[1]
    return bool(forward_distance > -half * horizontal_length - abs(float(forward[2])) * 2.0)


def _distance(drawable: _Drawable, lens: Lens) -> float:
    return math.hypot(drawable.x - lens.position[0], drawable.y - lens.position[1])


def right_vector(lens: Lens, x: float, y: float) -> Matrix:
    """Return the horizontal unit vector to the right, as seen by the camera when facing a point in m."""
    dx, dy = x - lens.position[0], y - lens.position[1]
    length = math.hypot(dx, dy) or 1.0
    return np.array([dy / length, -dx / length, 0.0])


# ---- furniture ------------------------------------------------------------------------------------


def _paint_furniture(canvas: Canvas, box: Box) -> None:
    (_paint_table if box.kind == "table" else _paint_shelf)(canvas, box)


def _paint_table(canvas: Canvas, box: Box) -> None:
    legs = [
        (box.x + sx * (box.width / 2 - 0.05), box.y + sy * (box.depth / 2 - 0.05))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    eye = canvas.lens.position
    for x, y in sorted(legs, key=lambda leg: -math.hypot(leg[0] - eye[0], leg[1] - eye[1])):
        _paint_block(canvas, (x, y, 0.0), (0.06, 0.06, box.height - 0.06), "#6d4c34")
    _paint_block(canvas, (box.x, box.y, box.height - 0.06), (box.width, box.depth, 0.06), "#8a6244")
    _paint_block(canvas, (box.x, box.y + 0.2, box.height), (0.16, 0.16, 0.18), "#3f8a75")
    for index in range(7):
        direction = math.radians(index * 360 / 7)
        _paint_leaf(canvas, (box.x, box.y + 0.2, box.height + 0.18), direction, 0.13, 0.3)


def _paint_leaf(
    canvas: Canvas, base: tuple[float, float, float], direction: float, out: float, up: float
) -> None:
    start = np.array(base)
    tip = np.array([base[0] + out * math.cos(direction), base[1] + out * math.sin(direction), base[2] + up])
    middle = (start + tip) / 2
    side = right_vector(canvas.lens, base[0], base[1]) * 0.045
    shade = "#4f9a5f" if math.sin(direction) > 0 else "#5fae6e"
    canvas.fill(np.array([start, middle + side, tip, middle - side]), scenery.to_bgr(shade))


def _paint_shelf(canvas: Canvas, box: Box) -> None:
    _paint_block(canvas, (box.x, box.y, 0.0), (box.width, box.depth, box.height), "#a4835f")
    front = box.y + box.depth / 2 + 0.004
    if canvas.lens.position[1] <= front:
        return
    level_count = 3
    for level in range(level_count):
        low = 0.08 + level * (box.height - 0.12) / level_count
        high = low + (box.height - 0.12) / level_count - 0.06
        left, right = box.x - box.width / 2 + 0.05, box.x + box.width / 2 - 0.05
        _paint_vertical_rect(canvas, front, (left, right), (low, high), "#6f563d")
        for index in range(11):
            book_left = left + 0.02 + index * (right - left - 0.04) / 11
            top = high - 0.03 - 0.035 * ((index * 7 + level * 3) % 4)
            _paint_vertical_rect(
                canvas,
                front + 0.002,
                (book_left, book_left + 0.07),
                (low, top),
                _BOOK_COLOURS[(index * 5 + level) % len(_BOOK_COLOURS)],
            )


def _paint_vertical_rect(
    canvas: Canvas, y: float, x_range: tuple[float, float], z_range: tuple[float, float], colour: str
) -> None:
    (left, right), (low, high) = x_range, z_range
    corners = [(left, y, low), (right, y, low), (right, y, high), (left, y, high)]
    canvas.fill(np.array(corners), scenery.to_bgr(colour))


def _paint_block(
    canvas: Canvas, base: tuple[float, float, float], size: tuple[float, float, float], colour: str
) -> None:
    (x, y, z), (width, depth, height) = base, size
    eye = canvas.lens.position
    x0, x1, y0, y1, z1 = x - width / 2, x + width / 2, y - depth / 2, y + depth / 2, z + height
    faces = [
        (eye[0] > x1, 0.86, [(x1, y0, z), (x1, y1, z), (x1, y1, z1), (x1, y0, z1)]),
        (eye[0] < x0, 0.92, [(x0, y0, z), (x0, y1, z), (x0, y1, z1), (x0, y0, z1)]),
        (eye[1] > y1, 0.8, [(x0, y1, z), (x1, y1, z), (x1, y1, z1), (x0, y1, z1)]),
        (eye[1] < y0, 0.74, [(x0, y0, z), (x1, y0, z), (x1, y0, z1), (x0, y0, z1)]),
        (eye[2] > z1, 1.08, [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)]),
    ]
    for is_visible, shade, corners in faces:
        if is_visible:
            b, g, r = (min(255, round(part * shade)) for part in scenery.to_bgr(colour))
            canvas.fill(np.array(corners), (b, g, r))


def _vignette(width: int, height: int) -> Picture:
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    light = 255 * (1.0 - 0.2 * np.clip(np.hypot(x, y) - 0.35, 0, None))
    return np.repeat(light[:, :, None], 3, axis=2).astype(np.uint8)
