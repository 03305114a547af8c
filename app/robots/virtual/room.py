"""The room of the virtual robot: walls, furniture, and the things that a person can move about.

Metres; x grows east, y north, z up; angles in degrees, 0 is east, counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

Wall = Literal["north", "south", "east", "west"]
WALLS: tuple[Wall, ...] = ("north", "south", "east", "west")


@dataclass(frozen=True)
class Opening:
    """Something flat on a wall: ``at`` is the x or y of its centre, ``bottom`` its height over the floor."""

    kind: str
    wall: Wall
    at: float
    width: float
    bottom: float
    height: float


@dataclass(frozen=True)
class Box:
    """A piece of furniture that stands square to the walls; it stops the robot and hides what is behind."""

    kind: str
    x: float
    y: float
    width: float
    depth: float
    height: float

    def distance_to(self, x: float, y: float) -> float:
        """From a point on the floor to the nearest side; 0 inside."""
        dx = max(abs(x - self.x) - self.width / 2, 0.0)
        dy = max(abs(y - self.y) - self.depth / 2, 0.0)
        return math.hypot(dx, dy)


@dataclass(frozen=True)
class Ball:
    """A ball on the floor."""

    name: str
    x: float
    y: float
    radius: float
    colour: str = "#e0474c"

    @property
    def z(self) -> float:
        """The height of its centre."""
        return self.radius


@dataclass(frozen=True)
class Person:
    """A person who stands there and looks at the robot."""

    name: str
    x: float
    y: float
    height: float
    radius: float = 0.22

    @property
    def face_z(self) -> float:
        """The height of the middle of the face."""
        return self.height - 0.5 * self.face_height

    @property
    def face_height(self) -> float:
        """From chin to hair, in metres."""
        return 0.26

    @property
    def face_width(self) -> float:
        """From ear to ear, in metres."""
        return 0.21


@dataclass(frozen=True)
class Marker:
    """An ArUco card (dictionary 4x4, 50) on a wall; ``size`` is the printed square, without its white rim."""

    id: int
    x: float
    y: float
    z: float
    size: float
    facing_deg: float

    @property
    def name(self) -> str:
        """What the robot calls it."""
        return f"marker {self.id}"


@dataclass(frozen=True)
class Room:
    """Everything around the robot at one moment."""

    x_min: float = -2.5
    x_max: float = 3.0
    y_min: float = -2.5
    y_max: float = 2.5
    height: float = 2.6
    openings: tuple[Opening, ...] = (
        Opening("door", "east", 1.35, 0.92, 0.0, 2.05),
        Opening("board", "east", -1.15, 1.5, 1.12, 0.9),
        Opening("window", "north", -0.75, 1.3, 0.95, 1.15),
        Opening("window", "west", -1.45, 1.2, 0.95, 1.1),
        Opening("picture", "west", 1.45, 0.85, 1.25, 0.62),
    )
    boxes: tuple[Box, ...] = (
        Box("table", -1.45, 1.7, 0.7, 1.1, 0.72),
        Box("shelf", 0.35, -2.28, 1.1, 0.36, 1.35),
    )
    ball: Ball = field(default_factory=lambda: Ball("ball", 1.95, -0.78, 0.15))
    person: Person = field(default_factory=lambda: Person("Aiko", 0.88, 0.1, 1.24))
    marker: Marker = field(default_factory=lambda: Marker(7, 1.0, 2.49, 1.15, 0.36, -90.0))

    def free(self, x: float, y: float, radius: float) -> bool:
        """Is there place for something round on the floor? The ball does not count, it rolls away."""
        if not (
            self.x_min + radius <= x <= self.x_max - radius
            and self.y_min + radius <= y <= self.y_max - radius
        ):
            return False
        if math.hypot(x - self.person.x, y - self.person.y) < radius + self.person.radius:
            return False
        return all(box.distance_to(x, y) >= radius for box in self.boxes)

    def distance_ahead(self, x: float, y: float, theta_deg: float) -> float:
        """From a point to the nearest wall, person or piece of furniture in a direction."""
        dx, dy = math.cos(math.radians(theta_deg)), math.sin(math.radians(theta_deg))
        hits = [self._to_walls(x, y, dx, dy), _to_circle(x, y, dx, dy, self.person)]
        hits += [_to_box(x, y, dx, dy, box) for box in self.boxes]
        return min(hits)

    def hidden(self, eye: tuple[float, float, float], target: tuple[float, float, float]) -> bool:
        """True when a piece of furniture stands between two points."""
        ex, ey, ez = eye
        dx, dy, dz = target[0] - ex, target[1] - ey, target[2] - ez
        length = math.hypot(dx, dy)
        if length < 1e-6:
            return False
        for box in self.boxes:
            hit = _to_box(ex, ey, dx / length, dy / length, box)
            if hit < length and ez + dz * hit / length < box.height:
                return True
        return False

    def moved(self, name: str, x: float, y: float) -> Room:
        """The room with the ball or the person elsewhere, kept inside the walls; else the same."""
        if name in {"ball", self.ball.name}:
            place = self._inside(x, y, self.ball.radius)
            return replace(self, ball=replace(self.ball, x=place[0], y=place[1]))
        if name in {"person", "face", self.person.name}:
            place = self._inside(x, y, self.person.radius)
            return replace(self, person=replace(self.person, x=place[0], y=place[1]))
        return self

    def pushed_ball(self, x: float, y: float, radius: float) -> Room:
        """The room after something round at (x, y) pushed the ball out of its place."""
        away_x, away_y = self.ball.x - x, self.ball.y - y
        gap = math.hypot(away_x, away_y)
        reach = radius + self.ball.radius
        if gap >= reach:
            return self
        if gap < 1e-6:
            away_x, away_y, gap = 1.0, 0.0, 1.0
        return self.moved("ball", x + away_x / gap * reach, y + away_y / gap * reach)

    def _inside(self, x: float, y: float, radius: float) -> tuple[float, float]:
        return (
            min(max(x, self.x_min + radius), self.x_max - radius),
            min(max(y, self.y_min + radius), self.y_max - radius),
        )

    def _to_walls(self, x: float, y: float, dx: float, dy: float) -> float:
        hits = []
        if abs(dx) > 1e-9:
            hits.append(((self.x_max if dx > 0 else self.x_min) - x) / dx)
        if abs(dy) > 1e-9:
            hits.append(((self.y_max if dy > 0 else self.y_min) - y) / dy)
        return max(0.0, min(hits))


def _to_circle(x: float, y: float, dx: float, dy: float, person: Person) -> float:
    along = (person.x - x) * dx + (person.y - y) * dy
    aside = abs((person.x - x) * dy - (person.y - y) * dx)
    if along <= 0 or aside > person.radius:
        return math.inf
    return max(0.0, along - math.sqrt(person.radius**2 - aside**2))


def _to_box(x: float, y: float, dx: float, dy: float, box: Box) -> float:
    near, far = 0.0, math.inf
    for position, step, middle, size in ((x, dx, box.x, box.width), (y, dy, box.y, box.depth)):
        low, high = middle - size / 2, middle + size / 2
        if abs(step) < 1e-9:
            if not low <= position <= high:
                return math.inf
            continue
        first, second = sorted(((low - position) / step, (high - position) / step))
        near, far = max(near, first), min(far, second)
    return near if near <= far else math.inf
