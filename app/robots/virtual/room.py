"""Room of the virtual robots: walls, furniture and movable objects.

Lengths are in metres; x points east, y north and z up. Angles are in degrees, counter-clockwise from east.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, TypeVar

T = TypeVar("T")
_WALL_SNAP_M, _WALL_GAP_M = 0.3, 0.01
Wall = Literal["north", "south", "east", "west"]
WALLS: tuple[Wall, ...] = ("north", "south", "east", "west")


@dataclass(frozen=True)
class Opening:
    """Door, window or other flat object on a wall.

    Attributes:
        kind: "door", "window", "board" or "picture".
        wall: Wall of the object.
        at: x or y of the centre.
        width: Width in m.
        bottom: Height of the lower edge above the floor.
        height: Height of the object itself in m.
    """

    kind: str
    wall: Wall
    at: float
    width: float
    bottom: float
    height: float


@dataclass(frozen=True)
class Box:
    """Piece of furniture aligned with the walls, which blocks robots and hides objects behind it.

    Attributes:
        kind: "table" or "shelf".
        x: x of the centre.
        y: y of the centre.
        width: Size along x.
        depth: Size along y.
        height: Size along z.
        name: Unique name.
    """

    kind: str
    x: float
    y: float
    width: float
    depth: float
    height: float
    name: str = ""

    def distance_to(self, x: float, y: float) -> float:
        """Return the distance from a point on the floor to the nearest side; 0 if the point is inside."""
        dx = max(abs(x - self.x) - self.width / 2, 0.0)
        dy = max(abs(y - self.y) - self.depth / 2, 0.0)
        return math.hypot(dx, dy)


@dataclass(frozen=True)
class Ball:
    """Ball on the floor."""

    name: str
    x: float
    y: float
    radius: float
    colour: str = "#e0474c"

    @property
    def z(self) -> float:
        """Height of the centre above the floor."""
        return self.radius


@dataclass(frozen=True)
class Person:
    """Standing person who looks towards the camera."""

    name: str
    x: float
    y: float
    height: float
    radius: float = 0.22

    @property
    def face_z(self) -> float:
        """Height of the centre of the face above the floor."""
        return self.height - 0.5 * self.face_height

    @property
    def face_height(self) -> float:
        """Distance from chin to hair in metres."""
        return 0.26

    @property
    def face_width(self) -> float:
        """Distance from ear to ear in metres."""
        return 0.21


@dataclass(frozen=True)
class Marker:
    """ArUco card (dictionary 4x4, 50).

    Attributes:
        id: Id of the marker.
        size: Side length of the printed square, without its white border.
        facing_deg: Direction of a card on a wall; None for a card that stands in the room and is visible from
            everywhere.
    """

    id: int
    x: float
    y: float
    z: float
    size: float
    facing_deg: float | None

    @property
    def name(self) -> str:
        """Unique name, such as "marker 7", which detections use too."""
        return f"marker {self.id}"


@dataclass(frozen=True)
class OtherRobot:
    """Another robot in the room: an upright cylinder that blocks this robot and is visible to its camera."""

    name: str
    x: float
    y: float
    theta_deg: float
    radius: float
    height: float
    figure: str = "pepper"


Thing: TypeAlias = Ball | Person | Marker | Box
_RoundObject: TypeAlias = Person | OtherRobot


@dataclass(frozen=True)
class Room:
    """State of the room at one moment: walls, furniture, objects and other robots. Immutable."""

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
        Box("table", -1.45, 1.7, 0.7, 1.1, 0.72, "table"),
        Box("shelf", 0.35, -2.28, 1.1, 0.36, 1.35, "shelf"),
    )
    balls: tuple[Ball, ...] = (Ball("ball", 1.95, -0.78, 0.15),)
    people: tuple[Person, ...] = (Person("Aiko", 0.88, 0.1, 1.24),)
    markers: tuple[Marker, ...] = (Marker(7, 1.0, 2.49, 1.15, 0.36, -90.0),)
    other_robots: tuple[OtherRobot, ...] = ()

    @property
    def things(self) -> tuple[Thing, ...]:
        """Movable objects, all of which have unique names."""
        return (*self.balls, *self.people, *self.markers, *self.boxes)

    def thing(self, name: str) -> Thing | None:
        """Return an object by name or kind; None if there is none.

        Args:
            name: Name, such as ``ball 2``, or a kind (``ball``, ``person``, ``face`` or ``marker``) for the
                first object of this kind.
        """
        exact_match = next((thing for thing in self.things if thing.name == name), None)
        kinds: dict[str, Sequence[Thing]] = {
            "ball": self.balls,
            "person": self.people,
            "face": self.people,
            "marker": self.markers,
        }
        return exact_match or next(iter(kinds.get(name, ())), None)

    def is_free(self, x: float, y: float, radius: float, previous: tuple[float, float] | None = None) -> bool:
        """Return True if a disc is inside the room and overlaps no obstacle.

        Balls don't count because they are pushed away.

        Args:
            x: Centre of the disc.
            y: Centre of the disc.
            radius: Radius of the disc.
            previous: Previous position. If it overlaps an obstacle, positions farther from the obstacle are
                free.
        """
        if not (
            self.x_min + radius <= x <= self.x_max - radius
            and self.y_min + radius <= y <= self.y_max - radius
        ):
            return False
        round_obstacles: tuple[_RoundObject, ...] = (*self.people, *self.other_robots)
        for obstacle in round_obstacles:
            distance = math.hypot(x - obstacle.x, y - obstacle.y)
            if distance < radius + obstacle.radius and (
                previous is None or distance <= math.hypot(previous[0] - obstacle.x, previous[1] - obstacle.y)
            ):
                return False
        return all(
            box.distance_to(x, y) >= radius
            or (previous is not None and box.distance_to(x, y) > box.distance_to(*previous))
            for box in self.boxes
        )

    def nearest_free(self, x: float, y: float, radius: float) -> tuple[float, float]:
        """Return the free position of a disc nearest to a point.

        The point is limited to the room, and returned if there is no free position.
        """
        x, y = self.clamped_position(x, y, radius)
        for ring in range(60):
            for step in range(1 if ring == 0 else 16):
                angle = math.tau * step / 16
                position = self.clamped_position(
                    x + 0.08 * ring * math.cos(angle), y + 0.08 * ring * math.sin(angle), radius
                )
                if self.is_free(*position, radius):
                    return position
        return x, y

    def distance_ahead(self, x: float, y: float, theta_deg: float) -> float:
        """Return the distance from a point to the nearest wall, person, robot or furniture in a direction."""
        dx, dy = math.cos(math.radians(theta_deg)), math.sin(math.radians(theta_deg))
        round_obstacles: tuple[_RoundObject, ...] = (*self.people, *self.other_robots)
        hits = [
            self._distance_to_walls(x, y, dx, dy),
            *(_distance_to_circle(x, y, dx, dy, each) for each in round_obstacles),
        ]
        hits += [_distance_to_box(x, y, dx, dy, box) for box in self.boxes]
        return min(hits)

    def is_hidden(self, eye: tuple[float, float, float], target: tuple[float, float, float]) -> bool:
        """Return True if furniture or a robot blocks the line of sight between two points (x, y, z)."""
        ex, ey, ez = eye
        dx, dy, dz = target[0] - ex, target[1] - ey, target[2] - ez
        length = math.hypot(dx, dy)
        if length < 1e-6:
            return False
        for box in self.boxes:
            hit = _distance_to_box(ex, ey, dx / length, dy / length, box)
            if hit < length and ez + dz * hit / length < box.height:
                return True
        for other in self.other_robots:
            hit = _distance_to_circle(ex, ey, dx / length, dy / length, other)
            if hit < length and ez + dz * hit / length < other.height:
                return True
        return False

    def with_moved(self, name: str, x: float, y: float) -> Room:
        """Return the room with an object moved; unchanged if the object doesn't exist.

        The position is limited to the room. A marker near a wall is attached to the wall.

        Args:
            name: Name or kind of the object, see `Room.thing`.
            x: New x coordinate in metres.
            y: New y coordinate in metres.
        """
        thing = self.thing(name)
        match thing:
            case Ball():
                position = self.clamped_position(x, y, thing.radius)
                moved_ball = replace(thing, x=position[0], y=position[1])
                return replace(self, balls=_with_replaced(self.balls, thing, moved_ball))
            case Person():
                position = self.clamped_position(x, y, thing.radius)
                moved_person = replace(thing, x=position[0], y=position[1])
                return replace(self, people=_with_replaced(self.people, thing, moved_person))
            case Box():
                position = self.clamped_position(x, y, thing.width / 2, thing.depth / 2)
                moved_box = replace(thing, x=position[0], y=position[1])
                return replace(self, boxes=_with_replaced(self.boxes, thing, moved_box))
            case Marker():
                return replace(
                    self, markers=_with_replaced(self.markers, thing, self._attached_to_wall(thing, x, y))
                )
        return self

    def with_pushed_ball(self, x: float, y: float, radius: float) -> Room:
        """Return the room after a disc at (x, y) has pushed aside the balls that it overlaps."""
        room = self
        for ball in self.balls:
            away_x, away_y = ball.x - x, ball.y - y
            distance = math.hypot(away_x, away_y)
            min_distance = radius + ball.radius
            if distance >= min_distance:
                continue
            if distance < 1e-6:
                away_x, away_y, distance = 1.0, 0.0, 1.0
            room = room.with_moved(
                ball.name, x + away_x / distance * min_distance, y + away_y / distance * min_distance
            )
        return room

    def _attached_to_wall(self, card: Marker, x: float, y: float) -> Marker:
        half = card.size / 2
        x, y = self.clamped_position(x, y, _WALL_GAP_M)
        walls = (
            (x - self.x_min, 0.0, (self.x_min + _WALL_GAP_M, y)),
            (self.x_max - x, 180.0, (self.x_max - _WALL_GAP_M, y)),
            (y - self.y_min, 90.0, (x, self.y_min + _WALL_GAP_M)),
            (self.y_max - y, -90.0, (x, self.y_max - _WALL_GAP_M)),
        )
        distance, facing, position = min(walls)
        if distance > _WALL_SNAP_M:
            x, y = self.clamped_position(x, y, half)
            return replace(card, x=x, y=y, facing_deg=None)
        return replace(card, x=position[0], y=position[1], facing_deg=facing)

    def carried_position(
        self, x: float, y: float, radius: float, current: tuple[float, float]
    ) -> tuple[float, float] | None:
        """Return the position that a carried robot reaches; None if obstacles block it.

        The robot stops at walls and slides along obstacles.

        Args:
            x: Target position.
            y: Target position.
            radius: Radius of the robot.
            current: Current position of the robot.
        """
        target = self.clamped_position(x, y, radius)
        for position in (target, (target[0], current[1]), (current[0], target[1])):
            if self.is_free(*position, radius, current):
                return position
        return None

    def clamped_position(
        self, x: float, y: float, half_width: float, half_depth: float | None = None
    ) -> tuple[float, float]:
        """Return the nearest position at which an object is completely within the walls.

        Args:
            x: Centre of the object.
            y: Centre of the object.
            half_width: Half of the size along x.
            half_depth: Half of the size along y (default: `half_width`).
        """
        half_depth = half_width if half_depth is None else half_depth
        return (
            min(max(x, self.x_min + half_width), self.x_max - half_width),
            min(max(y, self.y_min + half_depth), self.y_max - half_depth),
        )

    def _distance_to_walls(self, x: float, y: float, dx: float, dy: float) -> float:
        hits = []
        if abs(dx) > 1e-9:
            hits.append(((self.x_max if dx > 0 else self.x_min) - x) / dx)
        if abs(dy) > 1e-9:
            hits.append(((self.y_max if dy > 0 else self.y_min) - y) / dy)
        return max(0.0, min(hits))


def _with_replaced(things: tuple[T, ...], old: T, new: T) -> tuple[T, ...]:
    return tuple(new if thing is old else thing for thing in things)


def _distance_to_circle(x: float, y: float, dx: float, dy: float, obstacle: _RoundObject) -> float:
    along = (obstacle.x - x) * dx + (obstacle.y - y) * dy
    aside = abs((obstacle.x - x) * dy - (obstacle.y - y) * dx)
    if along <= 0 or aside > obstacle.radius:
        return math.inf
    return max(0.0, along - math.sqrt(obstacle.radius**2 - aside**2))


def _distance_to_box(x: float, y: float, dx: float, dy: float, box: Box) -> float:
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
