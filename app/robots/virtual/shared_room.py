"""One virtual robot's part in the room that all of them share: what it hears of it, and what it tells."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Protocol

from app.robots.driver.call import Clock, Link
from app.robots.virtual.neighbours import Neighbours
from app.robots.virtual.room import Other, Room
from app.robots.virtual.room_map import ROBOTS_TOPIC, TOPIC, RoomMap

ARRIVES_S = 3.0
"""So long after its start a robot steps aside for one that stood there before."""


class InRoom(Protocol):
    """What is needed of a body in the room."""

    room: Room
    x: float
    y: float
    theta_deg: float

    @property
    def still(self) -> bool:
        """Whether nothing moves."""

    def place(self, x: float, y: float) -> None:
        """Stand there from now on."""

    def reset(self, room: Room) -> None:
        """Back to the start, in this room, with nothing going on."""


class SharedRoom:
    """Keeps a body's room as everybody has it; ``lock`` guards the body, and is held where it says so."""

    def __init__(
        self, link: Link, clock: Clock, body: InRoom, lock: AbstractContextManager[object], like: Other
    ) -> None:
        """``like`` is the robot as others see it; where it stands is asked of the body."""
        self._body, self._lock, self._like, self._clock = body, lock, replace(like, name=link.name), clock
        self._map = RoomMap(body.room)
        self._neighbours = Neighbours(link.name, clock)
        self._revision = self._map.revision
        self._is_new = body.room != Room()
        self._arrives_until_s = clock.now() + ARRIVES_S
        self._start = body.x, body.y
        self._went_back_with: frozenset[str] = frozenset()
        self._tell_room = link.share(TOPIC, self._hear_room, latched=True)
        self._tell_robots = link.share(ROBOTS_TOPIC, self._hear_robot)

    def _hear_room(self, message: Mapping[str, object]) -> None:
        with self._lock:
            self._map.merge(message)

    def _hear_robot(self, message: Mapping[str, object]) -> None:
        with self._lock:
            self._neighbours.hear(message)

    # -- the lock is held ---------------------------------------------------------------------------

    def take_over(self) -> None:
        """Let the body have the room as it is now, and who else is in it."""
        body, others = self._body, self._neighbours.others()
        if self._map.revision != self._revision:
            self._revision = self._map.revision
            body.room = replace(self._map.room(), others=others)
        elif others != body.room.others:
            body.room = replace(body.room, others=others)
        if self._clock.now() < self._arrives_until_s and body.still:
            radius = self._like.radius
            if self._neighbours.makes_way(body.x, body.y, radius, self._went_back_with):
                body.place(*body.room.nearest_free(body.x, body.y, radius))
                self._start = body.x, body.y

    def follow(self) -> None:
        """What the body pushed away is elsewhere for everybody."""
        if self._map.follow(self._body.room):
            self._revision, self._is_new = self._map.revision, True

    def move(self, name: str, x: float, y: float) -> None:
        """A person moves a thing."""
        self._is_new = self._map.move(name, x, y) or self._is_new
        self.take_over()

    def to_start(self, together: object) -> None:
        """Let the body begin again where it stood when it came; the things of the room stay.

        ``together`` are the names of the robots that go back now: their places become free. Another robot
        that stands there is avoided.
        """
        self.take_over()
        names = together if isinstance(together, list) else []
        body, leaving = self._body, frozenset(name for name in names if isinstance(name, str))
        self._went_back_with = leaving  # what is heard of them may still be where they stood before
        body.reset(body.room)
        staying = tuple(other for other in body.room.others if other.name not in leaving)
        room = replace(body.room, others=staying)
        body.place(*room.nearest_free(*self._start, self._like.radius))

    def put_back(self) -> Room:
        """Everything is where it was at the start; the room then."""
        self._map.put_back()
        self._is_new = True
        self.take_over()
        return self._body.room

    # -- the lock is not held -----------------------------------------------------------------------

    def tell(self) -> None:
        """Tell the others what is new; called with every step."""
        with self._lock:
            body = self._body
            me = replace(
                self._like,
                x=round(body.x, 3),
                y=round(body.y, 3),
                theta_deg=round(body.theta_deg, 1),
            )
            told, self._is_new = self._map.message() if self._is_new else None, False
        if told is not None:
            self._tell_room(told)
        self._neighbours.tell(me, self._tell_robots)
