"""Positions of the other virtual robots in the shared room."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Mapping

from app.clock import Clock
from app.robots.virtual.room import OtherRobot

PRESENCE_TIMEOUT_S = 1.5
"""Time in seconds without messages after which a robot counts as gone."""
IDLE_PUBLISH_INTERVAL_S = 0.2
"""Interval in seconds of the position messages of a robot that doesn't move."""
MAX_NEIGHBOURS = 12


class Neighbours:
    """Other robots in the shared room. Not thread-safe: hold the owner's lock around every call.

    Args:
        name: Name of this robot.
        clock: Monotonic clock.
        began_ns: Start time of this robot (ns since 1970); default: now.
    """

    def __init__(self, name: str, clock: Clock, began_ns: int | None = None) -> None:
        self._name, self._clock = name, clock
        self.began_ns = time.time_ns() if began_ns is None else began_ns
        self._other_robots: dict[str, tuple[OtherRobot, float, int]] = {}
        self._published_state: OtherRobot | None = None
        self._last_publish_s = -math.inf

    def receive(self, message: Mapping[str, object]) -> None:
        """Process a position message.

        Invalid messages, messages of this robot, and new robots beyond `MAX_NEIGHBOURS` are ignored.
        """
        other = _parse_position(message)
        if other is None or other.name == self._name:
            return
        if other.name not in self._other_robots and len(self._other_robots) >= MAX_NEIGHBOURS:
            return
        began_ns = message.get("began_ns")
        self._other_robots[other.name] = (
            other,
            self._clock.now(),
            began_ns if isinstance(began_ns, int) else 0,
        )

    def present_robots(self) -> tuple[OtherRobot, ...]:
        """Return the other robots that are currently in the room."""
        oldest_s = self._clock.now() - PRESENCE_TIMEOUT_S
        self._other_robots = {
            name: entry for name, entry in self._other_robots.items() if entry[1] >= oldest_s
        }
        return tuple(other for other, _at, _began in self._other_robots.values())

    def must_give_way(self, x: float, y: float, radius: float, ignored: Collection[str] = ()) -> bool:
        """Return True if this robot overlaps a robot that was started earlier, and therefore must move away.

        Args:
            x: Position of this robot in m.
            y: Position of this robot in m.
            radius: Radius of this robot in m.
            ignored: Names of robots to ignore.
        """
        return any(
            other.name not in ignored
            and math.hypot(other.x - x, other.y - y) < other.radius + radius
            and (began_ns, other.name) < (self.began_ns, self._name)
            for other, _at, began_ns in self._other_robots.values()
        )

    def publish_position(self, me: OtherRobot, publish: Callable[[Mapping[str, object]], None]) -> None:
        """Publish the position of this robot: immediately if it has changed, otherwise at intervals.

        The interval is `IDLE_PUBLISH_INTERVAL_S`.

        Args:
            me: This robot with its current position.
            publish: Publishes a message.
        """
        now = self._clock.now()
        if me != self._published_state or now - self._last_publish_s >= IDLE_PUBLISH_INTERVAL_S:
            self._published_state, self._last_publish_s = me, now
            publish(
                {
                    "robot": me.name,
                    **{k: v for k, v in vars(me).items() if k != "name"},
                    "began_ns": self.began_ns,
                }
            )


def _parse_position(message: Mapping[str, object]) -> OtherRobot | None:
    name, figure = message.get("robot"), message.get("figure")
    numbers = [message.get(key) for key in ("x", "y", "theta_deg", "radius", "height")]
    if not isinstance(name, str) or not 0 < len(name) < 200 or not isinstance(figure, str):
        return None
    if not all(isinstance(n, (int, float)) and abs(n) < 1000 for n in numbers):  # also false for NaN
        return None
    x, y, theta, radius, height = (float(n) for n in numbers)  # type: ignore[arg-type]
    is_valid = 0.0 < radius < 1.0 and 0.0 < height < 3.0
    return OtherRobot(name, x, y, theta, radius, height, figure) if is_valid else None
