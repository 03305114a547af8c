"""Movements of the virtual body as state machines that are advanced in time steps, without clock and threads.

Call ``step`` until ``done`` is True; ``halt`` makes a movement brake.
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
    """Movement with limited speed and acceleration.

    Attributes:
        amount: Signed distance in m or angle in degrees.
        speed: Maximum speed in m/s or °/s.
        acceleration: Acceleration in m/s² or °/s².
        braking: Deceleration after `halt`.
        moved: Signed distance or angle covered so far.
        done: True after the end of the movement.
        is_blocked: True if an obstacle ended the movement.
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
        """Return a straight movement.

        Args:
            distance: Distance in m; negative for backwards.
            speed: Speed in m/s.
        """
        return cls(distance, speed, WALK_ACCELERATION, WALK_BRAKING)

    @classmethod
    def turn(cls, angle_deg: float, speed_deg: float) -> Motion:
        """Return a turn on the spot.

        Args:
            angle_deg: Angle in degrees, positive to the left.
            speed_deg: Turning speed in °/s.
        """
        return cls(angle_deg, speed_deg, TURN_ACCELERATION, TURN_BRAKING)

    @property
    def remaining(self) -> float:
        """Remaining distance or angle, signed."""
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
        """Set the speed to 0 and return True if the movement may be paused; False while it brakes."""
        self._velocity = 0.0
        return not self._is_halting

    def step(self, dt: float) -> float:
        """Advance the movement and return the signed distance or angle covered.

        Args:
            dt: Duration in seconds.
        """
        if self.done:
            return 0.0
        if self._is_halting:
            self._velocity = max(0.0, self._velocity - self.braking * dt)
            self.done = self._velocity == 0.0
        else:
            stoppable_speed = math.sqrt(2 * self.acceleration * abs(self.remaining))
            self._velocity = min(self.speed, self._velocity + self.acceleration * dt, stoppable_speed)
        delta = math.copysign(min(self._velocity * dt, abs(self.remaining)), self.remaining)
        # Snap to the target: the speed approaches 0 with the remaining distance.
        if abs(self.remaining - delta) < 0.002 * max(1.0, abs(self.acceleration)):
            delta = self.remaining if not self._is_halting else delta
            self.done = True
        self.moved += delta
        if self.done:
            self._velocity = 0.0
        return delta


@dataclass
class Joint:
    """Joint that approaches its target angle with limited speed.

    Attributes:
        speed: Maximum speed in °/s.
        low: Smallest angle in degrees.
        high: Largest angle in degrees.
        angle: Current angle in degrees.
        target: Target angle in degrees.
    """

    speed: float
    low: float
    high: float
    angle: float = 0.0
    target: float = 0.0

    def set_target(self, target: float) -> None:
        """Set the target angle in degrees, clamped to the limits."""
        self.target = min(max(target, self.low), self.high)

    def stop(self) -> None:
        """Stop the joint at its current angle."""
        self.target = self.angle

    @property
    def is_at_target(self) -> bool:
        """True if the joint has reached its target."""
        return self.angle == self.target

    def step(self, dt: float) -> None:
        """Advance the joint by ``dt`` seconds."""
        difference = self.target - self.angle
        max_step = self.speed * dt
        self.angle = (
            self.target if abs(difference) <= max_step else self.angle + math.copysign(max_step, difference)
        )


@dataclass
class Wave:
    """Waving of one arm: raise it, move the elbow three times, lower it."""

    arm: Joint
    elbow: Joint
    done: bool = False
    _poses: list[tuple[float, float]] = field(
        default_factory=lambda: [(140, 20), (140, 60), (140, 5), (140, 60), (140, 5), (140, 40), (0, 0)]
    )

    def step(self) -> None:
        """Set the target angles of the next pose once both joints have arrived.

        The body advances the joints.
        """
        if self.done or not (self.arm.is_at_target and self.elbow.is_at_target):
            return
        if not self._poses:
            self.done = True
            return
        arm, elbow = self._poses.pop(0)
        self.arm.set_target(arm)
        self.elbow.set_target(elbow)

    def halt(self) -> None:
        """Stop the arm at its current angles and end the wave."""
        self.arm.stop()
        self.elbow.stop()
        self.done = True
