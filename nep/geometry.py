"""Where things are and how they move: typed messages with the fields that ROS gives them (docs/types.md).

Metres, radians and seconds; x is ahead, y to the left, z up. Imported when it is first used.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from nep.i18n import _

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Header", "Point", "Pose", "PoseStamped", "Quaternion", "Time", "Transform", "Twist", "Vector3"]

_NS = 1_000_000_000


@dataclass
class Time:
    """A moment: seconds since 1970, and nanoseconds from 0 to 999999999."""

    MSG_TYPE: ClassVar[str] = "builtin_interfaces/Time"

    sec: int = field(default=0, metadata={"nep.other_name": "secs"})  # as ROS 1 calls them
    nanosec: int = field(default=0, metadata={"nep.other_name": "nsecs"})

    @classmethod
    def now(cls) -> Self:
        """The moment of this call, by the clock of this computer."""
        return cls.from_ns(time.time_ns())

    @classmethod
    def from_ns(cls, stamp_ns: int) -> Self:
        """Of nanoseconds since 1970, as `Message.stamp_ns` has them."""
        return cls(*divmod(stamp_ns, _NS))

    def to_ns(self) -> int:
        """Nanoseconds since 1970."""
        return self.sec * _NS + self.nanosec


@dataclass
class Header:
    """When something was measured, and in which frame of coordinates."""

    MSG_TYPE: ClassVar[str] = "std_msgs/Header"

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3:
    """A direction with a length."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Vector3"

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Point:
    """A place."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Point"

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Quaternion:
    """A rotation. Without arguments: none."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Quaternion"

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0

    @classmethod
    def from_euler(cls, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Self:
        """A rotation about the fixed axes x, y and z, one after the other, in radians."""
        cr, sr = math.cos(roll / 2), math.sin(roll / 2)
        cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
        cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
        return cls(
            x=sr * cp * cy - cr * sp * sy,
            y=cr * sp * cy + sr * cp * sy,
            z=cr * cp * sy - sr * sp * cy,
            w=cr * cp * cy + sr * sp * sy,
        )

    def to_euler(self) -> tuple[float, float, float]:
        """(roll, pitch, yaw) in radians, pitch from -pi/2 to pi/2; any length but 0 will do.

        Straight up or down roll and yaw turn about the same axis: roll is 0 there. Raises `ValueError` for a
        length of 0, or what is no number.
        """
        length = math.hypot(self.x, self.y, self.z, self.w)
        if not 0.0 < length < math.inf:
            raise ValueError(
                _("'{given}' is no rotation; its length must be above 0 and finite").format(given=self)
            )
        x, y, z, w = (each / length for each in (self.x, self.y, self.z, self.w))
        up = 2.0 * (w * y - z * x)
        if abs(up) > 1.0 - 1e-12:
            yaw = math.copysign(2.0, -up) * math.atan2(x, w)
            return 0.0, math.copysign(math.pi / 2, up), math.remainder(yaw, math.tau)
        return (
            math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            math.asin(up),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )


@dataclass
class Pose:
    """A place, and how what is there is turned."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Pose"

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped:
    """A pose, when it was, and in which frame of coordinates."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/PoseStamped"

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass
class Twist:
    """How fast something moves, in m/s, and turns, in rad/s."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Twist"

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class Transform:
    """From one frame of coordinates to another."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Transform"

    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)
