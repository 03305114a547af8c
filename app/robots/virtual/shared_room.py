"""Synchronization of a virtual robot with the room it shares with other robots."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Protocol

from app.robots.driver.call import Link
from app.robots.virtual.neighbours import Neighbours
from app.robots.virtual.room import OtherRobot, Room
from app.robots.virtual.room_map import ROBOTS_TOPIC, TOPIC, RoomMap

ARRIVAL_PERIOD_S = 3.0
"""Time in seconds after the start during which a robot moves away from an occupied position."""


class RoomBody(Protocol):
    """Interface of the body that `SharedRoom` synchronizes."""

    room: Room
    x: float
    y: float
    theta_deg: float

    @property
    def is_still(self) -> bool:
        """True if the robot doesn't move."""

    def set_position(self, x: float, y: float) -> None:
        """Set the position of the robot in m."""

    def reset(self, room: Room) -> None:
        """Stop everything, enter a room, and return to the start position."""


class SharedRoom:
    """Synchronization of the room of one robot with the other robots.

    Args:
        link: Connection to the network.
        body: Body of this robot.
        lock: Lock that guards the body.
        appearance: Size and appearance of this robot, as seen by other robots.
    """

    def __init__(
        self,
        link: Link,
        body: RoomBody,
        lock: AbstractContextManager[object],
        appearance: OtherRobot,
    ) -> None:
        self._body, self._lock, self._appearance, self._clock = (
            body,
            lock,
            replace(appearance, name=link.name),
            link.clock,
        )
        self._map = RoomMap(body.room)
        self._neighbours = Neighbours(link.name, link.clock)
        self._revision = self._map.revision
        self._has_unpublished_changes = body.room != Room()
        self._arrival_end_s = link.clock.now() + ARRIVAL_PERIOD_S
        self._start = body.x, body.y
        self._returning_names: frozenset[str] = frozenset()
        self._publish_room = link.open_shared_topic(TOPIC, self._receive_room, latched=True)
        self._publish_position = link.open_shared_topic(ROBOTS_TOPIC, self._receive_robot)

    def _receive_room(self, message: Mapping[str, object]) -> None:
        with self._lock:
            self._map.merge(message)

    def _receive_robot(self, message: Mapping[str, object]) -> None:
        with self._lock:
            self._neighbours.receive(message)

    # -- call with the lock held ------------------------------------------------------------------------

    def update_body(self) -> None:
        """Update the room of the body with changes by other robots. Call this with the lock held.

        A robot that was just started moves away from a position that another robot occupies.
        """
        body, other_robots = self._body, self._neighbours.present_robots()
        if self._map.revision != self._revision:
            self._revision = self._map.revision
            body.room = replace(self._map.room(), other_robots=other_robots)
        elif other_robots != body.room.other_robots:
            body.room = replace(body.room, other_robots=other_robots)
        if self._clock.now() < self._arrival_end_s and body.is_still:
            radius = self._appearance.radius
            if self._neighbours.must_give_way(body.x, body.y, radius, self._returning_names):
                body.set_position(*body.room.nearest_free(body.x, body.y, radius))
                self._start = body.x, body.y

    def update_map(self) -> None:
        """Record the positions of objects that the body has pushed, for `publish_changes`.

        Call this with the lock held.
        """
        if self._map.update_positions(self._body.room):
            self._revision, self._has_unpublished_changes = self._map.revision, True

    def move(self, name: str, x: float, y: float) -> None:
        """Move an object for the user. Call this with the lock held."""
        self._has_unpublished_changes = self._map.move(name, x, y) or self._has_unpublished_changes
        self.update_body()

    def return_to_start(self, returning_names: object) -> None:
        """Move the body to its start position; the objects in the room are not moved.

        If another robot is there, the nearest free position is used. Call this with the lock held.

        Args:
            returning_names: Names of the robots that return at the same time, whose current positions become
                free.
        """
        self.update_body()
        names = returning_names if isinstance(returning_names, list) else []
        body, leaving = self._body, frozenset(name for name in names if isinstance(name, str))
        self._returning_names = leaving  # their reported positions may still be the old ones
        body.reset(body.room)
        staying = tuple(other for other in body.room.other_robots if other.name not in leaving)
        room = replace(body.room, other_robots=staying)
        body.set_position(*room.nearest_free(*self._start, self._appearance.radius))

    def reset(self) -> Room:
        """Reset the room to its initial state and return it. Call this with the lock held."""
        self._map.reset()
        self._has_unpublished_changes = True
        self.update_body()
        return self._body.room

    # -- call without the lock -------------------------------------------------------------------------

    def publish_changes(self) -> None:
        """Publish the position of the body, and the objects if they have changed.

        Call this after every step, without holding the lock.
        """
        with self._lock:
            body = self._body
            me = replace(
                self._appearance,
                x=round(body.x, 3),
                y=round(body.y, 3),
                theta_deg=round(body.theta_deg, 1),
            )
            map_message, self._has_unpublished_changes = (
                self._map.message() if self._has_unpublished_changes else None,
                False,
            )
        if map_message is not None:
            self._publish_room(map_message)
        self._neighbours.publish_position(me, self._publish_position)
