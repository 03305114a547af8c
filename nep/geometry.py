"""Geometry messages with the same fields as in ROS, for typed topics (docs/types.md).

Units are metres, radians and seconds; x points forward, y to the left and z up (REP 103).
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

_NS_PER_S = 1_000_000_000


@dataclass
class Time:
    """Time stamp: seconds since 1970 (UTC) and nanoseconds (0 to 999999999)."""

    MSG_TYPE: ClassVar[str] = "builtin_interfaces/Time"

    sec: int = field(default=0, metadata={"nep.other_name": "secs"})  # ROS 1 uses other names
    nanosec: int = field(default=0, metadata={"nep.other_name": "nsecs"})

    @classmethod
    def now(cls) -> Self:
        """Return the current time of this computer's clock."""
        return cls.from_ns(time.time_ns())

    @classmethod
    def from_ns(cls, stamp_ns: int) -> Self:
        """Create a time stamp from nanoseconds since 1970, such as `Message.stamp_ns`."""
        return cls(*divmod(stamp_ns, _NS_PER_S))

    def to_ns(self) -> int:
        """Return the time stamp in nanoseconds since 1970."""
        return self.sec * _NS_PER_S + self.nanosec


@dataclass
class Header:
    """Time stamp and coordinate frame of a measurement."""

    MSG_TYPE: ClassVar[str] = "std_msgs/Header"

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3:
    """Vector in three dimensions."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Vector3"

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Point:
    """Point in three dimensions, in metres."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Point"

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Quaternion:
    """Rotation as a unit quaternion. The default is the identity."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Quaternion"

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0

    @classmethod
    def from_euler(cls, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Self:
        """Create a rotation about the fixed axes x, y and z, applied in this order.

        Args:
            roll: Rotation about x in radians.
            pitch: Rotation about y in radians.
            yaw: Rotation about z in radians.
        """
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
        """Return (roll, pitch, yaw) in radians; pitch is from -pi/2 to pi/2.

        The quaternion need not be normalized. At a pitch of ±pi/2 (gimbal lock) roll is 0.

        Raises:
            ValueError: The length is 0 or not finite.
        """
        length = math.hypot(self.x, self.y, self.z, self.w)
        if not 0.0 < length < math.inf:
            raise ValueError(
                _("'{given}' isn't a rotation; its length must be finite and greater than 0").format(
                    given=self
                )
            )
        x, y, z, w = (each / length for each in (self.x, self.y, self.z, self.w))
        sin_pitch = 2.0 * (w * y - z * x)
        if abs(sin_pitch) > 1.0 - 1e-12:
            yaw = math.copysign(2.0, -sin_pitch) * math.atan2(x, w)
            return 0.0, math.copysign(math.pi / 2, sin_pitch), math.remainder(yaw, math.tau)
        return (
            math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            math.asin(sin_pitch),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )


@dataclass
class Pose:
    """Position and orientation."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Pose"

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped:
    """Pose with time stamp and coordinate frame."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/PoseStamped"

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass
class Twist:
    """Linear velocity in m/s and angular velocity in rad/s."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Twist"

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class Transform:
    """Transform between two coordinate frames."""

    MSG_TYPE: ClassVar[str] = "geometry_msgs/Transform"

    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)
