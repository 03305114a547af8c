"""Movements of the virtual body, each a small machine that is stepped in time.

A movement is asked for, then stepped until ``done``; ``halt`` lets it brake to a stand. No clock, no threads.
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
    """Moves by `amount` (m or °, either sign) at most at `speed`, gently at both ends.

    ``moved`` is how far it came; ``blocked`` tells that something stood in the way.
    """

    amount: float
    speed: float
    acceleration: float
    braking: float
    moved: float = 0.0
    done: bool = False
    blocked: bool = False
    _velocity: float = field(default=0.0, repr=False)
    _halting: bool = field(default=False, repr=False)

    @classmethod
    def walk(cls, distance: float, speed: float) -> Motion:
        """Straight ahead, metres and m/s."""
        return cls(distance, speed, WALK_ACCELERATION, WALK_BRAKING)

    @classmethod
    def turn(cls, angle_deg: float, speed_deg: float) -> Motion:
        """On the spot, degrees and °/s, to the left when positive."""
        return cls(angle_deg, speed_deg, TURN_ACCELERATION, TURN_BRAKING)

    @property
    def remaining(self) -> float:
        """What is still to go, with its sign."""
        return self.amount - self.moved

    def halt(self) -> None:
        """Brake hard and end."""
        self._halting = True
        self.done = self.done or self._velocity == 0.0

    def block(self) -> None:
        """End here: something is in the way."""
        self.blocked = True
        self.done = True
        self._velocity = 0.0

    def hold(self) -> bool:
        """Stand still now and go on later; False when it is to end, which it may."""
        self._velocity = 0.0
        return not self._halting

    def step(self, dt: float) -> float:
        """The way made in the next `dt` seconds, with its sign."""
        if self.done:
            return 0.0
        if self._halting:
            self._velocity = max(0.0, self._velocity - self.braking * dt)
            self.done = self._velocity == 0.0
        else:
            fast_enough_to_end = math.sqrt(2 * self.acceleration * abs(self.remaining))
            self._velocity = min(self.speed, self._velocity + self.acceleration * dt, fast_enough_to_end)
        way = math.copysign(min(self._velocity * dt, abs(self.remaining)), self.remaining)
        # The last millimetres would take for ever: their speed goes to 0 with the way that is left.
        if abs(self.remaining - way) < 0.002 * max(1.0, abs(self.acceleration)):
            way = self.remaining if not self._halting else way
            self.done = True
        self.moved += way
        if self.done:
            self._velocity = 0.0
        return way


@dataclass
class Joint:
    """One angle that goes to its target with a limited speed (°/s) inside its limits (°)."""

    speed: float
    low: float
    high: float
    angle: float = 0.0
    target: float = 0.0

    def aim(self, target: float) -> None:
        """Go there, or as far as the limit."""
        self.target = min(max(target, self.low), self.high)

    def hold(self) -> None:
        """Stay where it is now."""
        self.target = self.angle

    @property
    def arrived(self) -> bool:
        """True once it has come to its target."""
        return self.angle == self.target

    def step(self, dt: float) -> None:
        """Go on for `dt` seconds."""
        way = self.target - self.angle
        reach = self.speed * dt
        self.angle = self.target if abs(way) <= reach else self.angle + math.copysign(reach, way)


@dataclass
class Wave:
    """One arm's greeting: up, three times to and fro with the elbow, and down again."""

    arm: Joint
    elbow: Joint
    done: bool = False
    _poses: list[tuple[float, float]] = field(
        default_factory=lambda: [(140, 20), (140, 60), (140, 5), (140, 60), (140, 5), (140, 40), (0, 0)]
    )

    def step(self) -> None:
        """Aim at the next pose once both joints have arrived; joints are stepped by the body."""
        if self.done or not (self.arm.arrived and self.elbow.arrived):
            return
        if not self._poses:
            self.done = True
            return
        arm, elbow = self._poses.pop(0)
        self.arm.aim(arm)
        self.elbow.aim(elbow)

    def halt(self) -> None:
        """Hold the arm where it is."""
        self.arm.hold()
        self.elbow.hold()
        self.done = True
