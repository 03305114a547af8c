"""Sensor messages with the same fields as in ROS, for typed topics (docs/types.md).

Values are in SI units. NaN means "not measured" where ROS defines this; JSON sends it as `null`. The module
`nep.sensor` is imported at its first use.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from nep.geometry import Header, Quaternion, Vector3

__all__ = [
    "BatteryState",
    "Imu",
    "JointState",
    "LaserScan",
    "NavSatFix",
    "NavSatStatus",
    "Range",
    "Temperature",
]


def _unknown_covariance() -> list[float]:
    # 3 x 3 covariance, all zero: unknown
    return [0.0] * 9


@dataclass
class JointState:
    """Positions, velocities and efforts of joints, by name.

    Same as sensor_msgs/JointState; lists may be empty.
    """

    MSG_TYPE: ClassVar[str] = "sensor_msgs/JointState"

    header: Header = field(default_factory=Header)
    name: list[str] = field(default_factory=list)
    position: list[float] = field(default_factory=list)
    velocity: list[float] = field(default_factory=list)
    effort: list[float] = field(default_factory=list)


@dataclass
class Imu:
    """Orientation, angular velocity and linear acceleration. Same as sensor_msgs/Imu.

    If the first element of a covariance is -1, the value is not measured.
    """

    MSG_TYPE: ClassVar[str] = "sensor_msgs/Imu"

    header: Header = field(default_factory=Header)
    orientation: Quaternion = field(default_factory=Quaternion)
    orientation_covariance: list[float] = field(default_factory=_unknown_covariance)
    angular_velocity: Vector3 = field(default_factory=Vector3)
    angular_velocity_covariance: list[float] = field(default_factory=_unknown_covariance)
    linear_acceleration: Vector3 = field(default_factory=Vector3)
    linear_acceleration_covariance: list[float] = field(default_factory=_unknown_covariance)


@dataclass
class LaserScan:
    """Planar range scan from `angle_min` to `angle_max`, counterclockwise. Same as sensor_msgs/LaserScan."""

    MSG_TYPE: ClassVar[str] = "sensor_msgs/LaserScan"

    header: Header = field(default_factory=Header)
    angle_min: float = 0.0
    angle_max: float = 0.0
    angle_increment: float = 0.0
    time_increment: float = 0.0
    scan_time: float = 0.0
    range_min: float = 0.0
    range_max: float = 0.0
    ranges: list[float] = field(default_factory=list)
    intensities: list[float] = field(default_factory=list)


@dataclass
class Range:
    """Single range measurement. Same as sensor_msgs/Range."""

    MSG_TYPE: ClassVar[str] = "sensor_msgs/Range"
    ULTRASOUND: ClassVar[int] = 0
    INFRARED: ClassVar[int] = 1

    header: Header = field(default_factory=Header)
    radiation_type: int = ULTRASOUND
    field_of_view: float = 0.0
    min_range: float = 0.0
    max_range: float = 0.0
    range: float = 0.0


@dataclass
class BatteryState:
    """Battery state. Same as sensor_msgs/BatteryState.

    `percentage` is from 0 to 1; `current` is negative while discharging.
    """

    MSG_TYPE: ClassVar[str] = "sensor_msgs/BatteryState"
    POWER_SUPPLY_STATUS_UNKNOWN: ClassVar[int] = 0
    POWER_SUPPLY_STATUS_CHARGING: ClassVar[int] = 1
    POWER_SUPPLY_STATUS_DISCHARGING: ClassVar[int] = 2
    POWER_SUPPLY_STATUS_NOT_CHARGING: ClassVar[int] = 3
    POWER_SUPPLY_STATUS_FULL: ClassVar[int] = 4

    header: Header = field(default_factory=Header)
    voltage: float = 0.0
    temperature: float = 0.0
    current: float = 0.0
    charge: float = 0.0
    capacity: float = 0.0
    design_capacity: float = 0.0
    percentage: float = 0.0
    power_supply_status: int = POWER_SUPPLY_STATUS_UNKNOWN
    power_supply_health: int = 0
    power_supply_technology: int = 0
    present: bool = False
    cell_voltage: list[float] = field(default_factory=list)
    cell_temperature: list[float] = field(default_factory=list)
    location: str = ""
    serial_number: str = ""


@dataclass
class NavSatStatus:
    """Status of the position fix, and satellite systems in use. Same as sensor_msgs/NavSatStatus."""

    MSG_TYPE: ClassVar[str] = "sensor_msgs/NavSatStatus"
    STATUS_NO_FIX: ClassVar[int] = -1
    STATUS_FIX: ClassVar[int] = 0
    STATUS_SBAS_FIX: ClassVar[int] = 1
    STATUS_GBAS_FIX: ClassVar[int] = 2
    SERVICE_GPS: ClassVar[int] = 1
    SERVICE_GLONASS: ClassVar[int] = 2
    SERVICE_COMPASS: ClassVar[int] = 4
    SERVICE_GALILEO: ClassVar[int] = 8

    status: int = STATUS_FIX
    service: int = 0


@dataclass
class NavSatFix:
    """Position in degrees (WGS 84) and altitude in metres above the ellipsoid.

    Same as sensor_msgs/NavSatFix.
    """

    MSG_TYPE: ClassVar[str] = "sensor_msgs/NavSatFix"
    COVARIANCE_TYPE_UNKNOWN: ClassVar[int] = 0
    COVARIANCE_TYPE_APPROXIMATED: ClassVar[int] = 1
    COVARIANCE_TYPE_DIAGONAL_KNOWN: ClassVar[int] = 2
    COVARIANCE_TYPE_KNOWN: ClassVar[int] = 3

    header: Header = field(default_factory=Header)
    status: NavSatStatus = field(default_factory=NavSatStatus)
    latitude: float = 0.0
    longitude: float = 0.0
    altitude: float = 0.0
    position_covariance: list[float] = field(default_factory=_unknown_covariance)
    position_covariance_type: int = COVARIANCE_TYPE_UNKNOWN


@dataclass
class Temperature:
    """Temperature in degrees Celsius. Same as sensor_msgs/Temperature; a variance of 0 means unknown."""

    MSG_TYPE: ClassVar[str] = "sensor_msgs/Temperature"

    header: Header = field(default_factory=Header)
    temperature: float = 0.0
    variance: float = 0.0
