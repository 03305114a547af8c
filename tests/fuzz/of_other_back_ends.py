"""Fuzz targets for the ROS, ROS 2, nanomsg and zenoh back ends and for addresses.

They need no network and no ROS.
"""

from __future__ import annotations

import contextlib
import importlib.util
import struct
from collections.abc import Iterator
from functools import cache

from nep.backends.connection import parse_port, validate_mode
from nep.backends.nanomsg.endpoints import (
    format_endpoint,
    parse_endpoint,
    split_message,
    subscriber_topic_part,
)
from nep.backends.ros import type_mapping
from nep.backends.ros.address import ros_master_address
from nep.backends.ros2.names import (
    dds_topic,
    decode_user_data,
    encode_user_data,
    ros_topic,
    ros_type,
    split_node_name,
    type_name,
)
from nep.backends.ros_types import definition
from nep.backends.zenoh.keys import data_key, node_key, parse_token, publisher_key, subscriber_key, topic_of
from nep.errors import DecodeError, EncodeError, NepError, WireError
from nep.protocol import wire
from nep.protocol.requests import NodeRecord, PublisherRecord, SubscriberRecord
from nep.system.addresses import check_host, is_endpoint, is_loopback, master_address, reachable_endpoint
from tests.fuzz.target import SEPARATOR, Targets, check_sentence, map_of, text_of

TARGETS = Targets()

# ---- addresses


@TARGETS.add(
    NepError,
    seeds=lambda: [b"127.0.0.1:7780", b"tcp://robot.local:1", b"*", "host:²".encode(), b"[::1]:7780"],
    words=(b"tcp://", b"ipc://@nep-1", b"0.0.0.0", b":65536", "²".encode()),
)
def addresses(data: bytes) -> None:
    text = text_of(data)
    if is_endpoint(text):
        assert reachable_endpoint([text], "192.168.1.1:7780") in {"", text} or "0.0.0.0" in text
    is_loopback(text)
    with contextlib.suppress(NepError):
        assert check_host(text) is text
    found = master_address(text)
    assert 0 <= int(found.rpartition(":")[2]) < 65536


@TARGETS.add(NepError, seeds=lambda: [b"7000", b"65536", "²".encode(), b"many2many"])
def ports_and_modes(data: bytes) -> None:
    text = text_of(data)
    with contextlib.suppress(NepError):
        assert validate_mode(text) == text
    assert 1 <= parse_port(text) <= 65535


@TARGETS.add(
    NepError,
    seeds=lambda: [b"http://robot:11311/", b"127.0.0.1"],
    words=(b"http://", b"[::1]", b"@", b":99999"),
)
def addresses_of_ros(data: bytes) -> None:
    text = text_of(data)
    if text:  # "" selects the address from the environment
        assert 0 < int(ros_master_address(text).rpartition(":")[2]) < 65536


# ---- ROS

TWIST = """Vector3 linear
Vector3 angular
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
MIXED = """Header header
string[] names
uint8[] data
bool[3] flags
time when
duration[2] howlong
char letter
byte[4] fixed
int64 LONG=-5
float32[] some # a remark
geometry_msgs/Vector3[] points
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
"""
MAP = {
    "header": {"seq": 1, "stamp": {"secs": 1, "nsecs": 2}, "frame_id": "ñ"},
    "names": ["a", ""],
    "data": b"\0\1",
    "flags": [True, False, True],
    "when": 1.5,
    "howlong": [1, 2],
    "fixed": [1, 2, 3, 4],
    "points": [{"x": 1}],
}


@cache
def mixed() -> definition.Definition:
    return definition.parse("test_msgs/Mixed", MIXED)


DEFINITION_WORDS = (
    b"uint8[",
    b"string",
    b"time ",
    b"=====================\nMSG: ",
    b"Header header",
    b"[] ",
    b"\n",
)


@TARGETS.add(
    NepError, EncodeError, seeds=lambda: [TWIST.encode(), MIXED.encode()], words=DEFINITION_WORDS, slower=4
)
def definitions_of_ros(data: bytes) -> None:
    made = definition.parse("test_msgs/Some", text_of(data))
    empty = made.encode({}) if _is_small(made) else b""
    with contextlib.suppress(DecodeError):
        assert made.encode(made.decode(empty)) == empty
    with contextlib.suppress(DecodeError):
        made.decode(b"\x01\0\0\0" * 20)


def _is_small(made: definition.Definition) -> bool:
    return sum(each.kind.min_bytes for each in made.fields) < 10_000


def bodies() -> Iterator[bytes]:
    yield mixed().encode(MAP)
    yield mixed().encode({})


@TARGETS.add(DecodeError, seeds=bodies, words=(b"\xff\xff\xff\xff", b"\x01\0\0\0"))
def messages_of_ros(data: bytes) -> None:
    value = mixed().decode(data)
    again = mixed().decode(mixed().encode(value))
    assert repr(again) == repr(value)


@TARGETS.add(
    EncodeError,
    seeds=lambda: [b'{"names":["a"],"when":{"secs":1},"flags":[true,false,1]}'],
    words=(b'"when":', b'"points":', b'"data":', b"1e999", b"NaN"),
)
def maps_for_ros(data: bytes) -> None:
    mixed().decode(mixed().encode(map_of(data)))


def carried_bodies() -> Iterator[bytes]:
    head = struct.pack("<III", 1, 2, 3) + struct.pack("<I", 1) + b"f"
    yield struct.pack("<I", 3) + b"abc"
    yield struct.pack("<II", 0, 0) + struct.pack("<I", 3) + b"abc"
    yield struct.pack("<II", 1, 1) + b"x" + struct.pack("<III", 1, 1, 0) + struct.pack("<I", 1) + b"a"
    yield head + struct.pack("<I", 4) + b"jpeg" + struct.pack("<I", 3) + b"\xff\xd8\xff"
    raw = struct.pack("<II", 2, 1) + struct.pack("<I", 4) + b"bgr8" + struct.pack("<BI", 0, 4)
    yield head + raw + struct.pack("<I", 8) + b"x" * 8
    deep = struct.pack("<II", 1, 1) + struct.pack("<I", 5) + b"32FC1" + struct.pack("<BI", 1, 4)
    yield head + deep + struct.pack("<I", 4) + b"abcd"


@TARGETS.add(
    WireError,
    struct.error,
    seeds=carried_bodies,
    words=(b"bgr8", b"mono16", b"32FC1", b"16UC4", b"\0\0\0\0", b"\xff\xff\xff\xff"),
)
def carried_by_ros(data: bytes) -> None:
    problems = []
    for msg_type, kind in (
        ("string", "std_msgs/String"),
        ("bytes", "std_msgs/UInt8MultiArray"),
        ("image", "sensor_msgs/CompressedImage"),
        ("image", "sensor_msgs/Image"),
    ):
        reader = type_mapping.unpacker_for(msg_type, kind, "")
        try:
            body, extension = reader.unpack(memoryview(data))
        except (WireError, struct.error) as error:
            problems.append(error)
            continue
        assert len(body) <= len(data)
        try:
            reader.codec.decode(body, extension or {})
        except DecodeError:
            continue
    if len(problems) == 4:
        assert all(isinstance(each, struct.error) or str(each) for each in problems)


# ---- ROS 2


@TARGETS.add(
    NepError, seeds=lambda: [b"/a/b_c", b"std_msgs/msg/String", b"std_msgs::msg::dds_::String_", b"a=b;c=d;"]
)
def names_of_ros2(data: bytes) -> None:
    text = text_of(data)
    ros_type(text)
    assert ros_topic(f"rt/{text}") == f"/{text}"
    space, name = split_node_name(text)
    assert name.isascii()
    assert space.isascii()
    told = decode_user_data(data)
    if all(each.isascii() for pair in told.items() for each in pair):
        assert decode_user_data(encode_user_data(told)) == told
    with contextlib.suppress(NepError):
        assert ros_topic(dds_topic(text)) == f"/{text.removeprefix('/')}"
    type_name(text)


if importlib.util.find_spec("rosbags"):
    from nep.backends.ros2.type_mapping import mapping_for

    def cdr() -> Iterator[bytes]:
        for msg_type, payload in (
            ("string", "ñ"),
            ("bytes", b"abc"),
            ("std_msgs/msg/Header", {"stamp": {"sec": 1}, "frame_id": "x"}),
            ("sensor_msgs/msg/LaserScan", {"ranges": [1.0, 2.0]}),
        ):
            mapping = mapping_for(msg_type)
            yield bytes(mapping.pack(mapping.codec.encode(payload)))

    @TARGETS.add(seeds=cdr, words=(b"\0\x01\0\0", b"\0\0\0\0", b"\xff\xff\xff\x7f"), slower=4)
    def messages_of_ros2(data: bytes) -> None:
        for msg_type in ("string", "bytes", "image", "std_msgs/msg/Header", "sensor_msgs/msg/LaserScan"):
            mapping = mapping_for(msg_type)
            try:
                mapping.codec.decode(mapping.unpack(data), {})
            except (WireError, DecodeError) as error:
                check_sentence(error)

    @TARGETS.add(
        EncodeError,
        seeds=lambda: [b'{"stamp":{"sec":1,"nanosec":2},"frame_id":"a"}', b'{"ranges":[1,NaN]}', b"{}"],
        words=(b'"sec":', b'"ranges":', b"1e999", b"\\ud800"),
        slower=2,
    )
    def maps_for_ros2(data: bytes) -> None:
        for msg_type in ("std_msgs/msg/Header", "sensor_msgs/msg/LaserScan"):
            mapping_for(msg_type).codec.encode(map_of(data))


# ---- nanomsg and zenoh


def of_nanomsg() -> Iterator[bytes]:
    header = wire.Header(3, 0, 5, 6, 7, 4)
    own_topic = subscriber_topic_part(7, "t")
    for message in (wire.join("t", header, b"four"), wire.join("t", header, b"four", {"a": 1})):
        yield b"".join(message)
        yield b"".join((own_topic, *message[1:]))
    yield own_topic + header.pack()


@TARGETS.add(WireError, seeds=of_nanomsg, words=(wire.HELLO, b"t\0"))
def messages_of_nanomsg(data: bytes) -> None:
    split = split_message(data, b"t\0", subscriber_topic_part(7, "t"))
    if split is None:
        assert data.startswith(wire.HELLO)
    elif len(split[1]) > 1:
        wire.parse_remaining_parts(split[1])
    elif split[0]:
        wire.read_header(split[1][0])


@TARGETS.add(seeds=lambda: [format_endpoint("127.0.0.1:5").encode()], words=(b"nanomsg://", b":65536", b":0"))
def endpoints_of_nanomsg(data: bytes) -> None:
    text = text_of(data)
    if url := parse_endpoint(text):
        assert format_endpoint(url.removeprefix("tcp://")) == text


def tokens() -> Iterator[bytes]:
    yield node_key(NodeRecord("id", "nä/me", "host", 4, "Python", "native", 5)).encode()
    yield publisher_key("id", PublisherRecord(7, "/t/*", "json", "json", latched=True)).encode()
    yield subscriber_key("", SubscriberRecord(8, "/t", "bytes")).encode()


@TARGETS.add(
    seeds=tokens, words=(b"nep/v1/live/", b"/node/", b"/pub/", b"/sub/", b"%2F", b"%FF", b"%", SEPARATOR)
)
def keys_of_zenoh(data: bytes) -> None:
    text = text_of(data)
    topic_of(text)
    alive = parse_token(text)
    if alive is None or not _is_text(text):
        return
    record = alive.record
    if isinstance(record, NodeRecord):
        made = node_key(record)
    elif isinstance(record, PublisherRecord):
        made = publisher_key(alive.node_id, record)
        assert topic_of(data_key(record.topic)) == record.topic
    else:
        made = subscriber_key(alive.node_id, record)
    assert parse_token(made) == alive


def _is_text(text: str) -> bool:
    """Return whether a text has no lone surrogates; zenoh never delivers them."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
