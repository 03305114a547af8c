"""Tests of parts of the back end `ros` that need no ROS programs."""

from __future__ import annotations

import math
import struct
import subprocess
import sys
from pathlib import Path

import pytest

import nep
from nep.backends.ros.address import ros_master_address
from nep.backends.ros.library import RosFinder, load_rospy
from nep.backends.ros.queue_room import QueueLimit
from nep.backends.ros.service_types import NEP_CALL, ServiceType
from nep.backends.ros.type_mapping import unpacker_for
from nep.backends.ros_types.definition import parse
from nep.errors import WireError
from nep.messages.codecs import CODECS
from nep.protocol.service_wire import CallKind, Reply, error_reply


def test_missing_rospy_is_reported_with_the_install_command() -> None:
    def missing(_name: str) -> object:
        raise ImportError

    with pytest.raises(
        nep.NepError, match="'ros' isn't installed; install it with 'sudo apt install python3-rospy"
    ):
        load_rospy(missing)  # type: ignore[arg-type]


def test_rospy_is_not_imported_unless_requested() -> None:
    code = (
        "import sys, nep; nep.node('a').close(); names = 'rospy', 'xmlrpc', 'nep.backends.ros.transport'; "
        "sys.exit(any(each in sys.modules for each in names))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_finder_imports_only_ros_packages_from_outside_the_environment(tmp_path: Path) -> None:
    for name in ("rospy", "numpy_of_debian", "my_msgs", "turtle"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    finder = RosFinder([str(tmp_path)])
    found = [
        name for name in ("rospy", "numpy_of_debian", "my_msgs", "turtle") if finder.find_spec(name, None)
    ]
    assert found == ["rospy", "my_msgs"]
    finder.extra_names.add("turtle")
    assert finder.find_spec("turtle", None) is not None
    assert finder.find_spec("rospy", [str(tmp_path)]) is None


def test_nep_call_type_round_trips_calls_and_replies_and_rejects_invalid_ones() -> None:
    json, msgpack = CODECS["json"], CODECS["msgpack"]
    body = NEP_CALL.encode_call(json, b'{"a":1}', 1.5)
    assert body == struct.pack("<HII", 1, 1500, 7) + b'{"a":1}'
    assert NEP_CALL.decode_call(body) == (b'{"a":1}', 1, 1.5)
    assert NEP_CALL.decode_call(NEP_CALL.encode_call(msgpack, b"\xc0", None)) == (b"\xc0", 4, None)
    assert NEP_CALL.decode_call(NEP_CALL.encode_call(json, b"", 1e-9)).timeout_s == 0.001
    assert NEP_CALL.decode_call(NEP_CALL.encode_call(json, b"", 1e300)).timeout_s == (2**32 - 1) / 1000
    for reply in (Reply(CallKind.REPLY, b"1"), error_reply(CallKind.ERROR, "ValueError", "no")):
        assert NEP_CALL.decode_reply(NEP_CALL.encode_reply(reply), json) == reply
    for wrong in (b"", b"\1\1\0\0\0\0\0", b"\2\1\0\0\0\0", b"\2\1\0\5\0\0\0ab", b"\2\1\0\0\0\0\0x"):
        with pytest.raises(nep.DecodeError):
            NEP_CALL.decode_reply(wrong, json)
    with pytest.raises(nep.DecodeError):
        NEP_CALL.decode_call(b"\1")


def test_ros_service_type_carries_bytes_and_nan_with_msgpack() -> None:
    kind = ServiceType(
        "a/B", parse("a/BRequest", "uint8[] data\nfloat64 x"), parse("a/BResponse", "uint8[] data")
    )
    json, msgpack = CODECS["json"], CODECS["msgpack"]
    asked = msgpack.encode({"data": b"\0\xff", "x": math.nan}).data
    data, codec, timeout_s = kind.decode_call(kind.encode_call(msgpack, asked, 5.0))
    assert (codec, timeout_s) == (4, None)
    found = msgpack.decode(data, {})
    assert found["data"] == b"\0\xff"  # type: ignore[index]
    assert math.isnan(found["x"])  # type: ignore[index]
    body = kind.encode_reply(Reply(CallKind.REPLY, b'{"data":[1,2]}', 1))
    assert kind.decode_reply(body, msgpack).data == msgpack.encode({"data": b"\1\2"}).data
    with pytest.raises(nep.EncodeError):
        kind.decode_reply(body, json)
    for wrong in (
        Reply(CallKind.ERROR, b"{}"),
        Reply(CallKind.REPLY, b"{}", 99),
        Reply(CallKind.REPLY, b"{oops"),
    ):
        with pytest.raises((nep.DecodeError, WireError)):
            kind.encode_reply(wrong)


@pytest.mark.parametrize(
    ("given", "address"),
    [
        ("http://robot:11312/", "robot:11312"), ("192.168.1.5", "192.168.1.5:11311"), ("h:1", "h:1"),
        ("https://h", "h:11311"), ("http://127.0.0.1:11311", "127.0.0.1:11311"),
    ],
)  # fmt: skip
def test_master_address_is_parsed_from_argument_and_environment(
    given: str, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert ros_master_address(given) == address
    monkeypatch.setenv("ROS_MASTER_URI", given)
    assert ros_master_address(None) == address


@pytest.mark.parametrize(
    "given", ["http://", "http://h:99999", "h:x", "http://[::1", ":11311", "http://h:0/", " ", "a b"]
)
def test_invalid_master_address_is_rejected(given: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", given)
    with pytest.raises(nep.NepError, match=r"address"):
        nep.node("n", "ros")


def test_default_master_address_is_localhost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_MASTER_URI", raising=False)
    assert ros_master_address(None) == "127.0.0.1:11311"
    monkeypatch.setenv("ROS_MASTER_URI", "")
    assert ros_master_address("") == "127.0.0.1:11311"


class Connection:
    """Fake of rospy's QueuedConnection that never sends from its queue."""

    def __init__(self, queue_size: int, queue: list[bytes]) -> None:
        import threading

        self._lock = threading.Lock()
        self._queue_size = queue_size
        self._queue = queue


def test_queues_are_trimmed_by_count_and_bytes_per_connection() -> None:
    few, many = Connection(3, [b"a", b"b", b"c"]), Connection(100, [bytes(10)] * 5)
    assert QueueLimit().make_room([few, many], 1) == 1
    assert (few._queue, len(many._queue)) == ([b"b", b"c"], 5)
    assert QueueLimit(40).make_room([many], 39) == 0, "measured after 40 bytes only"
    room = QueueLimit(40)
    assert room.make_room([many], 40) == 5
    many._queue = [bytes(10)] * 5
    assert [room.make_room([many], 10) for _ in range(4)] == [0, 0, 0, 2]
    assert room.make_room([], 50) == 0
    assert room.make_room([object()], 50) == 0
    assert room.make_room([Connection(100, [])], 2**40) == 0


def test_definition_with_another_checksum_is_rejected() -> None:
    assert unpacker_for("json", "std_msgs/String", "", "992ce8a1687cec8c8bd883ec73ca41d1").msg_type == "json"
    with pytest.raises(
        nep.NepError, match="the publisher's 'sensor_msgs/Image' has different fields from the definition"
    ):
        unpacker_for("image", "sensor_msgs/Image", "uint8 data", "0" * 32)


def test_compressed_depth_of_ros_is_decoded() -> None:
    np, cv2 = pytest.importorskip("numpy"), pytest.importorskip("cv2")
    depth = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
    png = cv2.imencode(".png", depth)[1].tobytes()
    kind = b"16UC1; compressedDepth png"
    body = (
        bytes(16)
        + len(kind).to_bytes(4, "little")
        + kind
        + (len(png) + 12).to_bytes(4, "little")
        + bytes(12)
        + png
    )
    found = unpacker_for("image", "sensor_msgs/CompressedImage", "")
    data, extension = found.unpack(memoryview(body))
    assert (found.codec.decode(data, extension or {}) == depth).all()  # type: ignore[attr-defined]
    data, extension = found.unpack(memoryview(body.replace(b"16UC1", b"32FC1")))
    with pytest.raises(nep.DecodeError):
        found.codec.decode(data, extension or {})
