"""Movements of the virtual body as state machines advanced in time steps, without clock and threads.

Advance a movement until it is ``done``; ``halt`` makes it brake.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

WALK_ACCELERATION = 0.5  # m/s²
WALK_BRAKING = 14.0
TURN_ACCELERATION = 160.0  # °/s²
TURN_BRAKING = 4000.0


@dataclass
class Motion:
    """Movement by ``amount`` (m or °, signed) with limited speed and acceleration.

    Attributes:
        moved: Amount moved so far.
        blocked: True if an obstacle ended the movement.
    """

    amount: float
    speed: float
    acceleration: float
    braking: float
    moved: float = 0.0
    done: bool = False
    is_blocked: bool = False
    _velocity: float = field(default=0.0, repr=False)
    _is_halting: bool = field(default=False, repr=False)

    @classmethod
    def walk(cls, distance: float, speed: float) -> Motion:
        """Return a straight movement; distance in m, speed in m/s."""
        return cls(distance, speed, WALK_ACCELERATION, WALK_BRAKING)

    @classmethod
    def turn(cls, angle_deg: float, speed_deg: float) -> Motion:
        """Return a turn on the spot, to the left if positive; angle in °, speed in °/s."""
        return cls(angle_deg, speed_deg, TURN_ACCELERATION, TURN_BRAKING)

    @property
    def remaining(self) -> float:
        """Remaining amount, signed."""
        return self.amount - self.moved

    def halt(self) -> None:
        """Brake hard and end the movement."""
        self._is_halting = True
        self.done = self.done or self._velocity == 0.0

    def block(self) -> None:
        """End the movement immediately because of an obstacle."""
        self.is_blocked = True
        self.done = True
        self._velocity = 0.0

    def pause(self) -> bool:
        """Pause the movement immediately; return False if it is braking and must not be paused."""
        self._velocity = 0.0
        return not self._is_halting

    def step(self, dt: float) -> float:
        """Advance by ``dt`` seconds and return the signed distance."""
        if self.done:
            return 0.0
        if self._is_halting:
            self._velocity = max(0.0, self._velocity - self.braking * dt)
            self.done = self._velocity == 0.0
        else:
            fast_enough_to_end = math.sqrt(2 * self.acceleration * abs(self.remaining))
            self._velocity = min(self.speed, self._velocity + self.acceleration * dt, fast_enough_to_end)
        way = math.copysign(min(self._velocity * dt, abs(self.remaining)), self.remaining)
        # Snap to the target: the speed approaches 0 with the remaining distance.
        if abs(self.remaining - way) < 0.002 * max(1.0, abs(self.acceleration)):
            way = self.remaining if not self._is_halting else way
            self.done = True
        self.moved += way
        if self.done:
            self._velocity = 0.0
        return way


@dataclass
class Joint:
    """Angle that approaches its target with limited speed (°/s) within its limits (°)."""

    speed: float
    low: float
    high: float
    angle: float = 0.0
    target: float = 0.0

    def set_target(self, target: float) -> None:
        """Set the target, clamped to the limits."""
        self.target = min(max(target, self.low), self.high)

    def hold(self) -> None:
        """Set the target to the current angle."""
        self.target = self.angle

    @property
    def is_at_target(self) -> bool:
        """True if the joint has reached its target."""
        return self.angle == self.target

    def step(self, dt: float) -> None:
        """Advance by ``dt`` seconds."""
        way = self.target - self.angle
        reach = self.speed * dt
        self.angle = self.target if abs(way) <= reach else self.angle + math.copysign(reach, way)


@dataclass
class Wave:
    """Greeting with one arm: up, three waves with the elbow, down."""

    arm: Joint
    elbow: Joint
    done: bool = False
    _poses: list[tuple[float, float]] = field(
        default_factory=lambda: [(140, 20), (140, 60), (140, 5), (140, 60), (140, 5), (140, 40), (0, 0)]
    )

    def step(self) -> None:
        """Set the next pose as target once both joints have arrived; the body advances the joints."""
        if self.done or not (self.arm.is_at_target and self.elbow.is_at_target):
            return
        if not self._poses:
            self.done = True
            return
        arm, elbow = self._poses.pop(0)
        self.arm.set_target(arm)
        self.elbow.set_target(elbow)

    def halt(self) -> None:
        """Stop the arm at its current angles."""
        self.arm.hold()
        self.elbow.hold()
        self.done = True
