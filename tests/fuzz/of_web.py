"""Fuzz targets for operations and origins of web pages and for messages in each compression."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from http import HTTPStatus
from urllib.parse import unquote

from nep.errors import NepError
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.programs.web.access import Access, AuthVerifier
from nep.programs.web.foxglove import protocol as foxglove
from nep.programs.web.limits import MAX_MESSAGE_BYTES
from nep.programs.web.messages import operations as op
from nep.programs.web.messages.fragments import FragmentBuffer
from nep.programs.web.messages.payloads import from_ros, nep_type_of, ros_type_of
from nep.programs.web.messages.png import decode_png, encode_png
from nep.programs.web.outgoing import EncodingOptions, publish_frames
from nep.programs.web.served_pages import PageRequest, respond
from nep.programs.web.server import node_name
from nep.programs.web.visitors import MAX_DISPLAYED_LENGTH, client_name, page_title
from nep.protocol.wire import check_node_name
from nep.text import first_control
from tests.fuzz.target import Targets, check_sentence, text_of

TARGETS = Targets()
TYPES = (
    "std_msgs/String",
    "std_msgs/UInt8MultiArray",
    "sensor_msgs/Image",
    "geometry_msgs/Twist",
    "nep/Json",
)


def operations() -> Iterator[bytes]:
    for fields in (
        {"op": "advertise", "id": "a", "topic": "/t", "type": "std_msgs/String", "latch": True},
        {"op": "publish", "id": 7, "topic": "/t", "msg": {"data": "AAAA", "height": 1, "width": 1}},
        {"op": "subscribe", "topic": "/t", "throttle_rate": 1.5, "fragment_size": 9, "compression": "cbor"},
        {"op": "call_service", "service": "/s#1", "args": [], "timeout": 1e308},
        {"op": "service_response", "id": "c", "service": "/s", "values": {}, "result": False},
        {"op": "fragment", "id": "f", "data": '{"op":"status"}', "num": 0, "total": 1},
        {"op": "png", "data": encode_png(b'{"op":"set_level","level":"info"}')},
        {"op": "auth", "mac": "m", "client": "c", "dest": "d", "rand": "r", "t": 1, "level": "l", "end": 2},
    ):
        yield json.dumps(fields).encode()


@TARGETS.add(
    NepError, seeds=operations, words=(b'"op":', b'"id":', b'"total":', b'"num":', b'"msg":', b"/msg/")
)
def operations_of_pages(data: bytes) -> None:
    buffer = FragmentBuffer()
    operation = op.parse(data)
    for _part in range(3):
        if isinstance(operation, op.Fragment | op.Png):
            whole = buffer.add(operation)
            if whole is None:
                return
            inner = decode_png(whole) if isinstance(operation, op.Png) else whole.encode("utf-8", "replace")
            assert len(inner) <= MAX_MESSAGE_BYTES
            operation = op.parse(inner)
    if isinstance(operation, op.Auth):
        assert not AuthVerifier("token", lambda: 1.0).verify(operation)
    if isinstance(operation, op.Publish):
        for ros_type in TYPES:
            try:
                from_ros(operation.msg, ros_type, nep_type_of(ros_type))
            except NepError:
                continue
    if isinstance(operation, op.Advertise):
        ros_type_of(nep_type_of(operation.ros_type))


@TARGETS.add(
    seeds=lambda: [b"http://localhost:8000", b"http://[::1]:1", b"null", b"/?token=t", b"Bearer t"],
    words=(b"http://", b"localhost", b"127.0.0.1", b"@", b"?token=", b"Bearer "),
)
def origins_of_pages(data: bytes) -> None:
    text = text_of(data)
    access = Access({"http://192.168.1.5"}, "a-long-token")
    refusal = access.origin_rejection_reason(text)
    if refusal:
        check_sentence(NepError(refusal))
    assert refusal or "localhost" in text.lower() or "127." in text or "::" in text or "192.168.1.5" in text
    assert access.check_token("/?" + text, text) is not True or "a-long-token" in text
    for name in (client_name(text), page_title(text, text, text)):
        assert len(name) <= MAX_DISPLAYED_LENGTH
        assert not first_control(name)
    if not refusal:
        check_node_name(node_name(text, "127.0.0.1:5"))


@TARGETS.add(
    seeds=lambda: [b"/?token=a-long-token localhost:9090", b"/starter.html 192.168.1.5:9090", b"/ [::1]"],
    words=(b"?token=", b"localhost", b"192.168.1.5:9090", b"/starter.html", b" "),
)
def requests_of_browsers(data: bytes) -> None:
    path, _space, host = text_of(data).partition(" ")
    found = respond(
        PageRequest("GET", path, (host,), "http://192.168.1.5:9090"), Access(token="a-long-token")
    )
    given = unquote(re.sub("[\t\r\n]", "", path))  # as urllib parses a URL
    assert b"a-long-token" not in found.body or "a-long-token" in given
    for header in found.headers.values():
        assert header.isascii()
        assert header.isprintable()
    policy = found.headers["Content-Security-Policy"]
    assert found.status != HTTPStatus.OK or policy.count(";") == 7 - ("starter" in path)
    check_sentence(NepError(found.body.decode() if "html" not in found.headers["Content-Type"] else "page"))


@TARGETS.add(
    NepError,
    seeds=lambda: [
        b'{"op":"subscribe"}',
        b"\x01\x00\x00\x00\x00{}",
        b"\x02" + bytes(8) + b"\x04\x00\x00\x00json{}",
    ],
    words=(b"\x01", b"\x02", b"json", b"\xff\xff\xff\xff"),
)
def messages_of_foxglove(data: bytes) -> None:
    found = foxglove.parse(data)
    if isinstance(found, foxglove.ServiceRequest):
        assert len(found.encoding) + len(found.data) <= len(data)
    elif isinstance(found, foxglove.ClientMessage):
        assert data.endswith(found.data)


@TARGETS.add(
    NepError, seeds=lambda: [b'{"linear":{"x":1}}', b"\xff\xd8\xff", b"[NaN]"], words=(b'"header":', b"NaN")
)
def messages_for_pages(data: bytes) -> None:
    refused = 0
    for codec, msg_type in (
        ("json", "json"), ("json", "geometry_msgs/Twist"), ("json", "sensor_msgs/LaserScan"),
        ("string", "string"), ("bytes", "bytes"), ("msgpack", "msgpack"), ("image", "image"),
    ):  # fmt: skip
        message = Message("/t", Encoded(data).data, codec, msg_type, stamp_ns=1)
        for compression in op.COMPRESSIONS:
            try:
                frames = publish_frames("/t", message, EncodingOptions(compression, 200))
            except NepError:
                refused += 1
                continue
            for frame in frames:
                if frame.is_text:
                    json.loads(frame.data)
