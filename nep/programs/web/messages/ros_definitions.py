"""ROS definitions of the message types that NEP supports without an installation of ROS, for rosapi and CBOR.

The fields and their order are as in ROS 1 (common_msgs 1.13), because readers of cbor-raw decode bytes with
these definitions. Comments and constants are omitted.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from nep.backends.ros_types.definition import Definition, FieldKind, parse

JSON_TYPE = "nep/Json"
"""ROS type of topics with arbitrary JSON messages.

In ROS serialization, a message is one string with the JSON text.
"""
MSGPACK_TYPE = "nep/Msgpack"

_HEADER = "std_msgs/Header header\n"
_DEFINITION_TEXTS = {
    JSON_TYPE: "string data\n",
    MSGPACK_TYPE: "string data\n",
    "std_msgs/Bool": "bool data\n",
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
    "std_msgs/Empty": "",
    "std_msgs/Float32": "float32 data\n",
    "std_msgs/Float64": "float64 data\n",
    "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout\nfloat64[] data\n",
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id\n",
    "std_msgs/Int32": "int32 data\n",
    "std_msgs/Int64": "int64 data\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
    "std_msgs/String": "string data\n",
    "std_msgs/UInt8MultiArray": "std_msgs/MultiArrayLayout layout\nuint8[] data\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/PoseStamped": f"{_HEADER}geometry_msgs/Pose pose\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "sensor_msgs/BatteryState": (
        f"{_HEADER}float32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\nfloat32 capacity\n"
        "float32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\nuint8 power_supply_health\n"
        "uint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\nfloat32[] cell_temperature\n"
        "string location\nstring serial_number\n"
    ),
    "sensor_msgs/CompressedImage": f"{_HEADER}string format\nuint8[] data\n",
    "sensor_msgs/Image": (
        f"{_HEADER}uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
        "uint32 step\nuint8[] data\n"
    ),
    "sensor_msgs/Imu": (
        f"{_HEADER}geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    ),
    "sensor_msgs/JointState": (
        f"{_HEADER}string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    "sensor_msgs/LaserScan": (
        f"{_HEADER}float32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\nfloat32 time_increment\n"
        "float32 scan_time\nfloat32 range_min\nfloat32 range_max\nfloat32[] ranges\nfloat32[] intensities\n"
    ),
    "sensor_msgs/NavSatFix": (
        f"{_HEADER}sensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
        "float64[9] position_covariance\nuint8 position_covariance_type\n"
    ),
    "sensor_msgs/NavSatStatus": "int8 status\nuint16 service\n",
    "sensor_msgs/Range": (
        f"{_HEADER}uint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\nfloat32 max_range\n"
        "float32 range\n"
    ),
    "sensor_msgs/Temperature": f"{_HEADER}float64 temperature\nfloat64 variance\n",
}
_SEPARATOR = "=" * 80


def bare_type(ros_type: str) -> str:
    """Return a type name without the "msg" of ROS 2: "std_msgs/String" for "std_msgs/msg/String"."""
    return ros_type.replace("/msg/", "/", 1)


@cache
def definition_of(ros_type: str) -> Definition | None:
    """Return the definition of a type including all nested types, or None if the type is unknown."""
    text = full_definition_text(ros_type)
    return None if text is None else parse(ros_type, text)


def full_definition_text(ros_type: str) -> str | None:
    """Return a definition in the format of `gendeps --cat`, or None if the type is unknown."""
    if ros_type not in _DEFINITION_TEXTS:
        return None
    nested_types = sorted(set(_nested_types(ros_type)))
    return _DEFINITION_TEXTS[ros_type] + "".join(
        f"{_SEPARATOR}\nMSG: {each}\n{_DEFINITION_TEXTS[each]}" for each in nested_types
    )


def _nested_types(ros_type: str) -> Iterator[str]:
    for line in _DEFINITION_TEXTS[ros_type].splitlines():
        name = line.partition(" ")[0].partition("[")[0]
        if name in _DEFINITION_TEXTS:
            yield name
            yield from _nested_types(name)


def type_definitions(ros_type: str) -> list[dict[str, object]] | None:
    """Return a type and its nested types in the format of rosapi, or None if the type is unknown."""
    definition = definition_of(ros_type)
    if definition is None:
        return None
    definitions: dict[str, dict[str, object]] = {}

    def add(name: str, kinds: list[tuple[str, FieldKind]]) -> None:
        if name in definitions:
            return
        items = [(field, kind, kind.element or kind) for field, kind in kinds]
        definitions[name] = {
            "type": name,
            "fieldnames": [field for field, _kind, _item in items],
            "fieldtypes": [item.name for _field, _kind, item in items],
            "fieldarraylen": [
                -1 if kind.element is None else kind.length or 0 for _field, kind, _item in items
            ],
            "examples": [_example(kind) for _field, kind, _item in items],
            "constnames": [],
            "constvalues": [],
        }
        for _field, _kind, item in items:
            if item.fields:
                add(item.name, [(each.name, each.kind) for each in item.fields])

    add(ros_type, [(each.name, each.kind) for each in definition.fields])
    return list(definitions.values())


def _example(kind: FieldKind) -> str:
    if kind.element is not None:
        return "[]"
    if kind.fields:
        return "{}"
    return {"string": "", "bool": "False", "time": "{}"}.get(kind.name, "0")
