"""Simulated body of the virtual two-wheeled robot, advanced in time steps, without clock and threads."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from app.robots.virtual.body import BodyEvent
from app.robots.virtual.room import Room

RADIUS, HEIGHT = 0.17, 0.34
START_POSE = (-0.9, -0.9, 35.0)
DEFAULT_LIGHT_COLOUR = "#35c26b"
MAX_DISTANCE_M = 4.0
ACCELERATION, BRAKING = 1.5, 20.0  # m/s²
TURN_ACCELERATION, TURN_BRAKING = 360.0, 4000.0  # °/s²
_MAX_STEP_S = 0.01
_DRAIN_PER_S, _DRAIN_MOVING_PER_S = 1 / 300, 1 / 90
_BUMPER_ANGLE_DEG = 50.0
PRESS_DURATION_S = 0.3
"""Time in seconds for which a bumper stays pressed after the user has pressed it."""


@dataclass
class WheelBody:
    """Simulated body in its room. Not thread-safe: hold the owner's lock around every call."""

    room: Room = field(default_factory=Room)
    x: float = START_POSE[0]
    y: float = START_POSE[1]
    theta_deg: float = START_POSE[2]
    speed: float = 0.0
    turn_speed: float = 0.0
    light: str = DEFAULT_LIGHT_COLOUR
    battery: float = 91.3
    pressed_bumper: str = ""
    events: deque[BodyEvent] = field(default_factory=lambda: deque(maxlen=200))
    _target_speeds: tuple[float, float] = (0.0, 0.0)
    is_lifted: bool = False
    """True while the user has lifted the robot, so that it doesn't move."""
    driven_m: float = 0.0
    """Total distance rolled in m, forwards and backwards."""
    _press_remaining_s: float = 0.0

    def drive(self, speed: float, turn_speed: float) -> None:
        """Set the target speeds.

        Args:
            speed: Speed in m/s, positive forwards.
            turn_speed: Turning speed in °/s, positive to the left. If both speeds are 0, the robot brakes.
        """
        self._target_speeds = (speed, turn_speed)

    @property
    def is_still(self) -> bool:
        """True if the robot doesn't move and the target speeds are 0."""
        return self._target_speeds == (0.0, 0.0) and self.speed == 0.0 and self.turn_speed == 0.0

    @property
    def distance(self) -> float:
        """Distance in m from the edge of the robot to the next obstacle ahead, at most 4 m."""
        distance_m = self.room.distance_ahead(self.x, self.y, self.theta_deg) - RADIUS
        return min(MAX_DISTANCE_M, max(0.0, distance_m))

    def press(self, side: str) -> None:
        """Press a bumper for `PRESS_DURATION_S`; the robot stops as after a collision.

        Args:
            side: "left", "right", "front" or "back".
        """
        self.speed, self.turn_speed, self._target_speeds = 0.0, 0.0, (0.0, 0.0)
        self.pressed_bumper, self._press_remaining_s = side, PRESS_DURATION_S
        self.events.append(BodyEvent("bump", {"side": side}))

    def reset(self, room: Room) -> None:
        """Stop, enter a room, and return to the start position or the nearest free one."""
        self.room, self._target_speeds, self.speed, self.turn_speed = room, (0.0, 0.0), 0.0, 0.0
        self.x, self.y = room.nearest_free(*START_POSE[:2], RADIUS)
        self.theta_deg, self.light, self.pressed_bumper, self.is_lifted = (
            START_POSE[2],
            DEFAULT_LIGHT_COLOUR,
            "",
            False,
        )

    def set_lifted(self, *, is_lifted: bool) -> None:
        """Lift the robot or put it down; the target speeds apply again after that.

        Args:
            is_lifted: True to lift the robot.
        """
        self.is_lifted = is_lifted

    def carry(self, x: float, y: float) -> None:
        """Move the lifted robot to a position in m, limited by walls; it stays in place if blocked."""
        position = self.room.carried_position(x, y, RADIUS, (self.x, self.y))
        if position is not None:
            self.set_position(*position)

    def set_position(self, x: float, y: float) -> None:
        """Set the position of the robot in m; overlapping balls are pushed aside."""
        self.x, self.y = x, y
        self.room = self.room.with_pushed_ball(x, y, RADIUS)

    def step(self, seconds: float) -> None:
        """Advance the simulation in steps that are small enough to detect collisions.

        Args:
            seconds: Duration in seconds.
        """
        while seconds > 1e-9:
            dt = min(seconds, _MAX_STEP_S)
            seconds -= dt
            self._step(dt)

    def _step(self, dt: float) -> None:
        speed, turn_speed = (0.0, 0.0) if self.is_lifted else self._target_speeds
        self.speed = _approach(self.speed, speed, ACCELERATION * dt, BRAKING * dt)
        self.turn_speed = _approach(self.turn_speed, turn_speed, TURN_ACCELERATION * dt, TURN_BRAKING * dt)
        if self._press_remaining_s > 0.0:
            self._press_remaining_s -= dt
            self.pressed_bumper = self.pressed_bumper if self._press_remaining_s > 0.0 else ""
        self.theta_deg = (self.theta_deg + self.turn_speed * dt + 180.0) % 360.0 - 180.0
        if self.speed:
            self._advance(self.speed * dt)
        drain = _DRAIN_PER_S if self.is_still else _DRAIN_MOVING_PER_S
        self.battery = max(0.0, self.battery - dt * drain)

    def _advance(self, distance_m: float) -> None:
        x = self.x + distance_m * math.cos(math.radians(self.theta_deg))
        y = self.y + distance_m * math.sin(math.radians(self.theta_deg))
        if self.room.is_free(x, y, RADIUS, (self.x, self.y)):
            self.x, self.y = x, y
            self.driven_m += abs(distance_m)
            self.pressed_bumper = self.pressed_bumper if self._press_remaining_s > 0.0 else ""
            self.room = self.room.with_pushed_ball(x, y, RADIUS)
            return
        self.speed, self.turn_speed, self._target_speeds = 0.0, 0.0, (0.0, 0.0)
        side = self._touching_side(distance_m)
        if side != self.pressed_bumper:
            self.pressed_bumper = side
            self.events.append(BodyEvent("bump", {"side": side}))

    def _touching_side(self, distance_m: float) -> str:
        if distance_m < 0:
            return "back"
        is_touching = {
            side: not self._is_free_towards(self.theta_deg + offset_deg)
            for side, offset_deg in (("left", _BUMPER_ANGLE_DEG), ("right", -_BUMPER_ANGLE_DEG))
        }
        if is_touching["left"] == is_touching["right"]:
            return "front"
        return "left" if is_touching["left"] else "right"

    def _is_free_towards(self, direction_deg: float) -> bool:
        x = self.x + 0.03 * math.cos(math.radians(direction_deg))
        y = self.y + 0.03 * math.sin(math.radians(direction_deg))
        return self.room.is_free(x, y, RADIUS)


def _approach(current: float, target: float, max_increase: float, max_decrease: float) -> float:
    # Braking (also to reverse) uses the larger rate.
    is_braking = abs(target) < abs(current) or current * target < 0
    max_change = max_decrease if is_braking else max_increase
    goal = 0.0 if current * target < 0 else target
    return goal if abs(goal - current) <= max_change else current + math.copysign(max_change, goal - current)
