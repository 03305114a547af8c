"""Tests of `nep.geometry` and `nep.sensor`: fields as in ROS, rotations and times."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nep.geometry
import nep.sensor
from nep.geometry import Header, PoseStamped, Quaternion, Time
from nep.messages.codecs import JSON, Codec
from nep.messages.message import MessageKind, received_message
from nep.messages.typed import TypedReader, message_type, typed_codec
from tests.examples import examples


def through(payload: Any, codec: Codec = JSON) -> Any:
    """Encode a payload as a typed publisher does and decode it as a typed subscriber does."""
    encoded = typed_codec(message_type(type(payload)), codec).encode(payload)
    return read(type(payload), encoded.data, codec)


def read(declared: type, data: bytes | memoryview, codec: Codec = JSON) -> Any:
    kind = MessageKind("t", codec.name, "t", False, codec.decode)
    return TypedReader(message_type(declared)).convert(received_message(kind, data, None, 1, 1)).payload


_ROS = {
    each.MSG_TYPE: each
    for module in (nep.geometry, nep.sensor)
    for each in vars(module).values()
    if isinstance(each, type) and is_dataclass(each)
}


@pytest.mark.parametrize("name", sorted(_ROS))
def test_fields_and_constants_of_robot_types_match_ros_definitions(name: str) -> None:
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    of_ros = store.types[name.replace("/", "/msg/")]
    ours = _ROS[name]
    assert [each.name for each in fields(ours)] == [
        each.name for each in fields(of_ros) if each.name.strip("_").islower() and "__" not in each.name
    ]
    constants = {key: value for key, value in vars(ours).items() if key.isupper() and key != "MSG_TYPE"}
    assert constants == {key: getattr(of_ros, key) for key in constants}


@pytest.mark.parametrize("name", sorted(set(_ROS) - {"builtin_interfaces/Time"}))
def test_robot_types_round_trip_as_ros2_types(name: str) -> None:
    pytest.importorskip("rosbags")
    from nep.backends.ros2.type_mapping import mapping_for

    payload = _filled(_ROS[name])
    mapping = mapping_for(name)
    encoded = typed_codec(message_type(type(payload)), mapping.codec).encode(payload)
    kind = mapping.kind("t", name, is_latched=False)
    reader = TypedReader(message_type(type(payload)))
    came = reader.convert(received_message(kind, mapping.unpack(mapping.pack(encoded)), None, 1, 1)).payload
    assert came == payload


@pytest.mark.parametrize("name", sorted(set(_ROS) - {"builtin_interfaces/Time", "std_msgs/Header"}))
def test_robot_types_round_trip_as_ros1_types(name: str) -> None:
    typesys = pytest.importorskip("rosbags.typesys")
    from nep.backends.ros.type_mapping import ros_codec
    from nep.backends.ros_types.definition import parse

    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    codec = ros_codec(parse(name, store.generate_msgdef(name.replace("/", "/msg/"), ros_version=1)[0]))
    payload = _filled(_ROS[name])
    assert through(payload, codec) == payload


def _filled(declared: type) -> Any:
    """Return an instance whose values differ from the defaults; all of them are exact in 32 bits."""
    values: dict[str, Any] = {}
    for number, each in enumerate(fields(declared), 1):
        value = getattr(declared(), each.name)
        if is_dataclass(value):
            values[each.name] = _filled(type(value))
        elif isinstance(value, bool):
            values[each.name] = True
        elif isinstance(value, list):
            text = each.name == "name"
            values[each.name] = [str(n) if text else n / 2 for n in range(9)]
        else:
            values[each.name] = type(value)(number)
    return declared(**values)


@pytest.mark.parametrize("name", sorted(_ROS))
def test_robot_types_with_default_and_given_values_round_trip_as_json(name: str) -> None:
    assert through(_ROS[name]()) == _ROS[name]()
    assert through(_filled(_ROS[name])) == _filled(_ROS[name])
    assert read(_ROS[name], b"{}") == _ROS[name]()


def test_geometry_and_sensor_export_all_17_types() -> None:
    assert len(_ROS) == 17
    assert set(nep.geometry.__all__ + nep.sensor.__all__) == {each.__name__ for each in _ROS.values()}


_angles = st.floats(-math.pi, math.pi)


@given(_angles, st.floats(-1.57, 1.57), _angles)
@settings(max_examples=examples(300), deadline=None)
def test_euler_angles_round_trip_through_quaternion(roll: float, pitch: float, yaw: float) -> None:
    turned = Quaternion.from_euler(roll, pitch, yaw)
    again = Quaternion.from_euler(*turned.to_euler())
    same = turned.x * again.x + turned.y * again.y + turned.z * again.z + turned.w * again.w
    assert abs(same) == pytest.approx(1.0, abs=1e-9)  # q and -q are the same rotation
    assert all(-math.pi <= angle <= math.pi for angle in turned.to_euler())


@given(_angles, st.sampled_from([-math.pi / 2, math.pi / 2]), _angles)
@settings(max_examples=examples(200), deadline=None)
def test_euler_conversion_preserves_rotation_at_gimbal_lock(roll: float, pitch: float, yaw: float) -> None:
    turned = Quaternion.from_euler(roll, pitch, yaw)
    again = Quaternion.from_euler(*turned.to_euler())
    same = turned.x * again.x + turned.y * again.y + turned.z * again.z + turned.w * again.w
    assert abs(same) == pytest.approx(1.0, abs=1e-6)


def test_euler_angles_convert_to_known_quaternions_and_invalid_quaternions_are_rejected() -> None:
    half = math.sqrt(0.5)
    assert Quaternion() == Quaternion.from_euler()
    turned = Quaternion.from_euler(yaw=math.pi / 2)
    assert (turned.x, turned.y, turned.z, turned.w) == pytest.approx((0.0, 0.0, half, half))
    turned = Quaternion.from_euler(roll=math.pi / 2)
    assert (turned.x, turned.y, turned.z, turned.w) == pytest.approx((half, 0.0, 0.0, half))
    assert Quaternion(0, 0, 3, 3).to_euler() == pytest.approx((0.0, 0.0, math.pi / 2))
    for bad in (Quaternion(0, 0, 0, 0), Quaternion(w=math.nan), Quaternion(x=math.inf)):
        with pytest.raises(
            ValueError, match="isn't a rotation; its length must be finite and greater than 0"
        ):
            bad.to_euler()


@pytest.mark.parametrize("stamp_ns", [0, 1, -1, 1_700_000_000_123_456_789, (1 << 63) - 1])
def test_time_conversion_preserves_nanoseconds(stamp_ns: int) -> None:
    moment = Time.from_ns(stamp_ns)
    assert moment.to_ns() == stamp_ns
    assert 0 <= moment.nanosec < 1_000_000_000


def test_ros1_time_field_names_are_decoded() -> None:
    data = b'{"header":{"seq":1,"stamp":{"secs":5,"nsecs":6},"frame_id":"map"}}'
    assert read(PoseStamped, data).header == Header(Time(5, 6), "map")
