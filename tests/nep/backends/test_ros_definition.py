"""Tests of the ROS message codec without ROS, and of its equality with genpy where that is installed."""

from __future__ import annotations

import contextlib
import io
import math
import re
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nep
from nep.backends.ros.library import message_definition
from nep.backends.ros.type_mapping import codec_of, is_ros_type, ros_type_of, to_ros_body, unpacker_for
from nep.backends.ros_types.definition import parse
from nep.errors import WireError
from nep.messages.encoded import Encoded
from tests.nep.backends.ros_programs import skip_without_ros

EVERYTHING = """
# a comment = no constant
uint8 RED=1
string NAME=a # b
float32 PI = 3.14
bool flag
int8 i8
uint16 u16   # with a comment
int64 i64
uint64 u64
float32 f32
string text
time at
duration span
uint8[] data
char[3] letters
int16[] numbers
bool[] flags
string[2] words
Point[] points
other/Thing thing
================================================================================
MSG: own/Point
float64 x
float64 y
================================================================================
MSG: other/Thing
byte b
Header header
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""
ALL = parse("own/All", EVERYTHING)
PAYLOAD: dict[str, object] = {
    "flag": True, "i8": -128, "u16": 65535, "i64": -(2**63), "u64": 2**64 - 1, "f32": 0.5, "text": "grüß",
    "at": {"secs": 2**32 - 1, "nsecs": 1}, "span": {"secs": -1, "nsecs": 5}, "data": b"\0\xff",
    "letters": b"abc", "numbers": [-1, 32767], "flags": [True, False], "words": ["", "é"],
    "points": [{"x": 1.0, "y": -2.0}],
    "thing": {"b": -1, "header": {"seq": 3, "stamp": {"secs": 1, "nsecs": 2}, "frame_id": "map"}},
}  # fmt: skip


def test_dict_round_trips_through_ros_encoding() -> None:
    assert ALL.decode(ALL.encode(PAYLOAD)) == PAYLOAD
    assert not ALL.has_header


def test_omitted_fields_are_zero_or_empty() -> None:
    made = ALL.decode(ALL.encode({}))
    assert made["letters"] == b"\0\0\0"
    assert (made["words"], made["points"], made["text"], made["at"]) == (
        ["", ""], [], "", {"secs": 0, "nsecs": 0}
    )  # fmt: skip
    assert made["thing"]["header"]["frame_id"] == ""  # type: ignore[index]


@pytest.mark.parametrize(
    ("payload", "sentence"),
    [
        ({"i8": 128}, "field 'i8' is 128; 'int8' must be from -128 to 127"),
        ({"u64": -1}, "field 'u64' is -1; 'uint64' must be from 0 to 18446744073709551615"),
        ({"u64": 2**64}, "field 'u64' is 18446744073709551616; 'uint64' must be from 0 to"),
        ({"i8": True}, "field 'i8' is True; expected a 'int8'"),
        ({"i8": 1.0}, "field 'i8' is 1.0; expected a 'int8'"),
        ({"flag": 2}, "field 'flag' is 2; expected a 'bool'"),
        ({"f32": "1"}, "field 'f32' is '1'; expected a 'float32'"),
        ({"f32": 1e300}, "field 'f32' is 1e+300, which isn't a 'float32'"),
        ({"text": 5}, "field 'text' is 5; expected a 'string'"),
        ({"text": "\ud800"}, "field 'text' contains an unpaired surrogate"),
        ({"text": None}, "field 'text' is None; expected a 'string'"),
        ({"at": {"secs": -1}}, "field 'at' is a 'dict', which isn't a 'time'"),
        ({"at": -0.5}, "field 'at' is -0.5, which isn't a 'time'"),
        ({"at": math.nan}, "field 'at' is nan; expected a 'time'"),
        ({"at": {"sec": 1}}, "field 'at.sec' doesn't exist; did you mean 'secs'?"),
        ({"letters": b"ab"}, "field 'letters' has 2 elements; expected 3"),
        ({"words": ["a"] * 3}, "field 'words' has 3 elements; expected 2"),
        ({"words": "ab"}, "field 'words' is 'ab'; expected a 'string[2]'"),
        ({"data": [256]}, "field 'data' contains a value that isn't an integer from 0 to 255"),
        ({"data": "ab"}, "field 'data' is 'ab'; expected a 'uint8[]'"),
        ({"numbers": [1, 40000]}, "field 'numbers[1]' is 40000; 'int16' must be from -32768 to 32767"),
        ({"numbers": [1, True]}, "field 'numbers[1]' is True"),
        ({"points": [{}, {"z": 1}]}, "field 'points[1].z' doesn't exist; known names: 'x', 'y'"),
        ({"points": [5]}, "field 'points[0]' is 5; expected a 'own/Point'"),
        ({"thing": {"header": {"frame": 1}}}, "field 'thing.header.frame' doesn't exist; did you mean"),
        ({"txt": ""}, "field 'txt' doesn't exist; did you mean 'text'?"),
        ({5: 1}, "field '5' doesn't exist"),
        ([], "publish a 'dict' with the fields 'flag', 'i8'"),
    ],
)  # fmt: skip
def test_invalid_value_is_rejected_with_its_path(payload: object, sentence: str) -> None:
    with pytest.raises(nep.EncodeError) as raised:
        ALL.encode(payload)
    assert f"as 'own/All': {sentence}" in str(raised.value)


def test_numpy_values_and_float_seconds_are_accepted() -> None:
    made = ALL.decode(
        ALL.encode({
            "i8": np.int8(-3), "f32": np.float64(0.25), "flag": np.bool_(True), "at": 1.5, "span": -1.5,
            "data": np.arange(3, dtype=np.uint8), "numbers": np.array([5, -6]), "letters": memoryview(b"xyz"),
        })
    )  # fmt: skip
    assert (made["i8"], made["f32"], made["flag"]) == (-3, 0.25, True)
    assert made["at"] == {"secs": 1, "nsecs": 500_000_000}
    assert made["span"] == {"secs": -2, "nsecs": 500_000_000}
    assert (made["data"], made["numbers"], made["letters"]) == (b"\0\1\2", [5, -6], b"xyz")


def test_truncated_or_oversized_bytes_raise_decode_error() -> None:
    whole = ALL.encode(PAYLOAD)
    for size in range(len(whole)):
        with pytest.raises(nep.DecodeError, match="can't decode"):
            ALL.decode(whole[:size])
    with pytest.raises(nep.DecodeError, match="1 unexpected bytes follow the message"):
        ALL.decode(whole + b"x")


@given(st.binary(max_size=300))
@settings(max_examples=300, deadline=None)
def test_any_bytes_are_decoded_or_raise_decode_error(data: bytes) -> None:
    with contextlib.suppress(nep.DecodeError):
        ALL.decode(data)


def test_impossible_lengths_raise_decode_error() -> None:
    empty = parse("a/A", "B[] all\n" + "=" * 80 + "\nMSG: a/B\n")
    assert empty.decode(struct.pack("<I", 3)) == {"all": [{}, {}, {}]}
    with pytest.raises(nep.DecodeError, match=r"'all' .*more nested messages"):
        empty.decode(b"\xff\xff\xff\xff")
    numbers = parse("a/A", "float64[] all")
    with pytest.raises(nep.DecodeError, match="'all' has 4294967295 elements"):
        numbers.decode(b"\xff\xff\xff\xff" + bytes(100))
    fixed = parse("a/A", "uint8[4000000000] all")
    with pytest.raises(nep.DecodeError, match=r"100 bytes .*'all' is truncated"):
        fixed.decode(bytes(100))


def test_exponentially_nested_definition_is_rejected() -> None:
    line = "=" * 80
    levels = "".join(f"{line}\nMSG: a/L{n}\nL{n + 1} a\nL{n + 1} b\nL{n + 1} c\n" for n in range(25))
    bomb = parse("a/L", f"L0 a\n{levels}{'=' * 80}\nMSG: a/L25\n")
    with pytest.raises(nep.DecodeError, match=r"'a\.a\..* more nested messages"):
        bomb.decode(b"")


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("A again", "A"), ("nothing/Known x", "nothing/Known"), ("float64", "float64"),
        ("float64 x y", "float64 x y"), ("int8[x] y", "int8[x] y"), ("float64[1", "float64[1"),
        ("B b", "B"), ("\0", "\\x00"),
    ],
)  # fmt: skip
def test_invalid_definitions_are_rejected(text: str, part: str) -> None:
    with pytest.raises(nep.NepError, match=f"'a/A' .*'{re.escape(part)}'"):
        parse("a/A", text)


@pytest.mark.parametrize(
    ("msg_type", "ros_type"),
    [
        ("json", "std_msgs/String"), ("robot/description", "std_msgs/String"), ("string", "std_msgs/String"),
        ("bytes", "std_msgs/UInt8MultiArray"), ("msgpack", "std_msgs/UInt8MultiArray"),
        ("image", "sensor_msgs/CompressedImage"), ("geometry_msgs/Twist", "geometry_msgs/Twist"),
    ],
)  # fmt: skip
def test_message_types_map_to_ros_types(msg_type: str, ros_type: str) -> None:
    assert ros_type_of(msg_type) == ros_type
    assert is_ros_type(msg_type) == (msg_type == ros_type)


def test_invalid_message_bodies_are_rejected() -> None:
    read = unpacker_for("json", "std_msgs/String", "").unpack
    assert read(memoryview(to_ros_body("std_msgs/String", "text", Encoded(b"{}"))))[0] == b"{}"
    for wrong in (b"", b"\1\0\0", b"\5\0\0\0ab", b"\1\0\0\0ab"):
        with pytest.raises((WireError, struct.error)):
            read(memoryview(wrong))
    read = unpacker_for("bytes", "std_msgs/UInt8MultiArray", "").unpack
    for wrong in (b"\xff\xff\xff\xff", bytes(7), b"\1\0\0\0" + bytes(11)):
        with pytest.raises((WireError, struct.error)):
            read(memoryview(wrong))
    labelled = b"\1\0\0\0" + b"\2\0\0\0ab" + bytes(8) + b"\1\0\0\0" + b"\3\0\0\0xyz"
    assert bytes(read(memoryview(labelled))[0]) == b"yz", "the data begins where data_offset says"


def test_undecodable_image_is_rejected() -> None:
    for data in (b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n"):
        with pytest.raises(nep.EncodeError):
            to_ros_body("sensor_msgs/CompressedImage", "image", Encoded(data))


def test_extension_is_rejected_for_ros_types() -> None:
    with pytest.raises(WireError, match="a 'std_msgs/String' can't carry an extension"):
        to_ros_body("std_msgs/String", "text", Encoded(b"{}", {"a": 1}))


def test_only_message_packages_are_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    skip_without_ros()
    for name, folder in (("of_no_ros", ""), ("of_no_ros_either", "messages"), ("of_my_own", "msg")):
        (tmp_path / name / folder).mkdir(parents=True)
        (tmp_path / name / "__init__.py").touch()
        (tmp_path / name / folder / "__init__.py").touch()
    (tmp_path / "of_my_own" / "msg" / "__init__.py").write_text(
        "class Thing:\n    _full_text, _md5sum = 'int8 a', 'x'\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert message_definition("of_no_ros/Thing") is None
    assert message_definition("of_no_ros_either/Thing") is None
    assert message_definition("of_my_own/Thing") == ("int8 a", "x")
    assert message_definition("of_my_own/Other") is None
    assert message_definition("not there/Thing") is None
    assert {each for each in sys.modules if each.startswith("of_")} == {"of_my_own", "of_my_own.msg"}


def test_encoded_bytes_match_genpy() -> None:
    skip_without_ros()
    from nep.backends.ros.library import get_rospy

    get_rospy()
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from sensor_msgs.msg import JointState

    pose = PoseWithCovarianceStamped()
    pose.header.frame_id = "map"
    pose.pose.pose.orientation.w = 1.0
    pose.pose.covariance = [float(n) for n in range(36)]
    out = io.BytesIO()
    pose.serialize(out)
    codec = codec_of("geometry_msgs/PoseWithCovarianceStamped")
    payload = codec.decode(out.getvalue(), {})
    assert payload["pose"]["covariance"] == [float(n) for n in range(36)]  # type: ignore[index]
    assert codec.encode(payload).data == out.getvalue()
    state = {"name": ["a", "b"], "position": [1.0, 2.0], "header": {"stamp": 0}}
    read = JointState()
    read.deserialize(codec_of("sensor_msgs/JointState").encode(state).data)
    assert (read.name, list(read.position), list(read.effort)) == (["a", "b"], [1.0, 2.0], [])
