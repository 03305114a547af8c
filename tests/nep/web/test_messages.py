"""Tests of the conversion between NEP and ROS messages, in each compression."""

from __future__ import annotations

import base64
import dataclasses
import json
import struct

import cbor2
import numpy as np
import pytest

from nep import geometry, sensor
from nep.errors import NepError
from nep.messages.codecs import codec_for
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.programs.web.messages.operations import OperationError
from nep.programs.web.messages.payloads import (
    PayloadError,
    from_ros,
    is_compatible,
    nep_type_of,
    ros_type_of,
    to_ros,
)
from nep.programs.web.messages.png import decode_png, encode_png
from nep.programs.web.messages.ros_definitions import definition_of, type_definitions
from nep.programs.web.outgoing import EncodingOptions, operation_frames, publish_frames
from tests import hostile

PICTURE = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)


def message(msg_type: str, payload: object, encoded: Encoded | None = None) -> Message:
    codec = codec_for(msg_type)
    made = codec.encode(payload) if encoded is None else encoded
    extension = made.extension or {}
    return Message("/t", made.data, codec.name, msg_type, stamp_ns=1_500_000_002, seq=3, extension=extension)


def sent(made: Message, *form: object) -> object:
    (frame,) = publish_frames("/t", made, EncodingOptions(*form))
    whole = json.loads(frame.data) if frame.is_text else cbor2.loads(frame.data)
    assert (whole["op"], whole["topic"]) == ("publish", "/t")
    return whole["msg"]


def test_string_is_converted_to_and_from_a_data_field() -> None:
    assert sent(message("string", "hé")) == {"data": "hé"}
    assert sent(message("string", "hé"), "cbor") == {"data": "hé"}
    assert from_ros({"data": "hé"}, "std_msgs/String", "string") == "hé"
    assert nep_type_of("std_msgs/msg/String") == "string"
    assert ros_type_of("string") == "std_msgs/String"
    with pytest.raises(PayloadError):
        from_ros({"data": 1}, "std_msgs/String", "string")


def test_json_payload_is_sent_unchanged_and_nan_as_null() -> None:
    text = b'{"z": 1.50, "a": [1, {"b": null}]}'
    made = message("json", None, Encoded(text))
    (frame,) = publish_frames("/t", made, EncodingOptions())
    assert text in frame.data
    assert sent(message("json", None, Encoded(b'{"x": NaN}'))) == {"x": None}
    assert from_ros([1, 2], "nep/Json", "json") == [1, 2]
    assert ros_type_of("json") == "nep/Json"
    assert is_compatible("std_msgs/String", "json")
    assert not is_compatible("std_msgs/String", "image")


def test_bytes_are_base64_in_json_and_bytes_in_cbor() -> None:
    made = message("bytes", b"\0\xff")
    assert sent(made)["data"] == base64.b64encode(b"\0\xff").decode()
    assert sent(made, "cbor")["data"] == b"\0\xff"
    for given in (base64.b64encode(b"\0\xff").decode(), [0, 255]):
        assert from_ros({"data": given}, "std_msgs/UInt8MultiArray", "bytes") == b"\0\xff"
    for given in ("é", [256], [-1], 3, None):
        with pytest.raises(PayloadError):
            from_ros({"data": given}, "std_msgs/UInt8MultiArray", "bytes")


def test_image_is_sent_as_compressed_image_or_raw_pixels_on_request() -> None:
    made = message("image", PICTURE)
    file = to_ros(made)
    assert (file["format"], file["data"][:2]) == ("jpeg", b"\xff\xd8")
    assert file["header"] == {"seq": 3, "stamp": {"secs": 1, "nsecs": 500_000_002}, "frame_id": ""}
    raw = message("image", None, codec_for("image").encode(PICTURE.astype(np.float32)))
    assert (
        to_ros(message("image", None, Encoded(PICTURE.tobytes(), {"shape": [6, 8, 3], "encoding": "bgr8"})))[
            "format"
        ]
        == "jpeg"
    )
    pixels = to_ros(raw, as_pixels=True)
    assert (pixels["height"], pixels["width"], pixels["encoding"]) == (6, 8, "32FC3")
    back = from_ros({**pixels, "data": list(pixels["data"])}, "sensor_msgs/Image", "image")
    assert bytes(back.data) == PICTURE.astype(np.float32).tobytes()
    assert from_ros({"data": base64.b64encode(b"\xff\xd8x").decode()}, "sensor_msgs/CompressedImage", "image")
    with pytest.raises(PayloadError):
        from_ros({"height": -1, "data": ""}, "sensor_msgs/Image", "image")


def test_cbor_has_typed_arrays_for_array_types() -> None:
    scan = message("sensor_msgs/LaserScan", {"header": {}, "ranges": [1.0, None], "intensities": []})
    tag = sent(scan, "cbor")["ranges"]
    assert (tag.tag, tag.value[:4]) == (85, struct.pack("<f", 1.0))
    assert sent(message("json", {"ranges": [1.0]}), "cbor") == {"ranges": [1.0]}


def test_cbor_raw_contains_the_serialized_ros_message() -> None:
    twist = message("geometry_msgs/Twist", {"linear": {"x": 2.0}})
    raw = sent(twist, "cbor-raw")
    assert (raw["secs"], raw["nsecs"]) == (1, 500_000_002)
    assert struct.unpack("<6d", raw["bytes"]) == (2.0, 0, 0, 0, 0, 0)
    stamped = message("sensor_msgs/Temperature", {"header": {"stamp": {"sec": 7, "nanosec": 8}}})
    assert struct.unpack_from("<III", sent(stamped, "cbor-raw")["bytes"]) == (0, 7, 8)
    assert sent(message("json", {"a": 1}), "cbor-raw")["bytes"] == b'\x07\0\0\0{"a":1}'
    assert sent(message("string", "hi"), "cbor-raw")["bytes"] == b"\x02\0\0\0hi"


def test_png_round_trip_preserves_the_text_and_invalid_or_large_png_is_rejected() -> None:
    for text in (b"{}", json.dumps({"x": "é" * 999}).encode()):
        assert decode_png(encode_png(text)) == text
    packed = json.loads(publish_frames("/t", message("json", {"a": 1}), EncodingOptions("png"))[0].data)
    assert json.loads(decode_png(packed["data"]))["msg"] == {"a": 1}
    for data in ("", "é", "AAAA", encode_png(b"\n" * 9_000_000)):
        with pytest.raises(OperationError):
            decode_png(data)


def test_large_message_is_split_into_fragments() -> None:
    frames = publish_frames("/t", message("string", "é" * 1_000), EncodingOptions("none", 200))
    parts = [json.loads(each.data) for each in frames]
    assert {each["op"] for each in parts} == {"fragment"}
    assert [each["num"] for each in parts] == list(range(parts[0]["total"]))
    assert json.loads("".join(each["data"] for each in parts))["msg"] == {"data": "é" * 1_000}


@pytest.mark.parametrize("compression", ["none", "cbor", "cbor-raw"])
def test_hostile_message_is_sent_or_rejected(compression: str) -> None:
    for data in hostile.INVALID_PAYLOADS:
        for msg_type in ("json", "string", "bytes", "image", "msgpack", "geometry_msgs/Twist"):
            made = message(msg_type, None, Encoded(data))
            try:
                publish_frames("/t", made, EncodingOptions(compression))
            except NepError:
                continue


def test_reply_that_cannot_be_encoded_as_json_is_rejected() -> None:
    with pytest.raises(NepError):
        operation_frames({"op": "service_response", "values": {"x": object()}}, EncodingOptions())


def test_ros_type_definitions_have_the_fields_of_nep_types() -> None:
    for module in (geometry, sensor):
        for name in module.__all__:
            kind = getattr(module, name)
            if name == "Time":
                continue
            definition = definition_of(kind.MSG_TYPE)
            assert definition is not None, name
            known = [each.name for each in definition.fields]
            assert [each for each in known if each != "seq"] == [
                each.name for each in dataclasses.fields(kind)
            ]
    inside = type_definitions("geometry_msgs/PoseStamped")
    assert [each["type"] for each in inside] == [
        "geometry_msgs/PoseStamped", "std_msgs/Header", "geometry_msgs/Pose", "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
    ]  # fmt: skip
