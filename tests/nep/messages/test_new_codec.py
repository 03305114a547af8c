"""Tests that a codec is added in one file, and that programs without it reject its messages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

import nep
from nep.errors import DecodeError
from nep.masters.master import Master
from nep.messages import codecs
from nep.recordings.reader import Recording
from tests.nep.programs import ROOT, Program, eventually, running

CODEC = '''
"""Codec of points in a plane: two little-endian floats."""
import struct

from nep.errors import DecodeError, EncodeError
from nep.messages.codecs import Codec, Encoded, register

_LAYOUT = struct.Struct("<dd")


def _check(payload):
    if not isinstance(payload, tuple) or len(payload) != 2:
        raise EncodeError("point", type(payload).__name__, "publish a pair of numbers")
    return payload


def _encode(payload):
    return Encoded(_LAYOUT.pack(*_check(payload)))


def _decode(data, _extension):
    if len(data) != _LAYOUT.size:
        raise DecodeError("point", len(data), "a point has 16 bytes")
    return _LAYOUT.unpack(data)


POINT = register(
    Codec("point", 200, _encode, _decode, lambda: (0.0, 0.0), _check, is_small=True, ros_carrier="bytes"),
    "points",
)
'''
RECORD = """
import sys
import nep
import point_codec
from nep.recordings.reader import Recording
from nep.recordings.recorder import Recorder, TopicSelection
from nep.recordings.writer import RecordingWriter
from tests.nep.programs import eventually
from tests.nep.recordings.messages import limits

with nep.node("arm", "memory", master="codecs") as arm, nep.node("eye", "memory", master="codecs") as eye:
    goal = TopicSelection(("/goal",))
    with RecordingWriter(sys.argv[1], limits=limits()) as writer, Recorder(eye, writer, goal):
        publisher, subscriber = arm.new_pub("/goal", "point"), eye.new_sub("/goal", "point")
        publisher.publish((1.5, -2.0))
        message = subscriber.receive(30)
        print(message.codec, message.payload)
        eventually(lambda: writer.status.message_count == 1)
with Recording(sys.argv[1]) as recording:
    print(recording.topics["/goal"].codec, [each.payload for _time, each in recording.read(topics=["/goal"])])
"""
ROS = """
import point_codec
from nep.backends.ros.type_mapping import codec_of, ros_type_of, to_ros_body, unpacker_for
from nep.backends.ros2.type_mapping import mapping_for

for name in ("point", "points"):
    codec, ros_type = codec_of(name), ros_type_of(name)
    body = to_ros_body(ros_type, codec.ros_carrier, codec.encode((1.5, -2.0)))
    data, extension = unpacker_for(name, ros_type, "").unpack(memoryview(body))
    print(ros_type, codec.decode(data, extension or {}))
    mapping = mapping_for(name)
    data = mapping.unpack(mapping.pack(mapping.codec.encode((1.5, -2.0))))
    print(mapping.ros_type, mapping.codec.decode(data, {}))
"""
PUBLISH = """
import sys
import nep
import point_codec

with nep.node("arm", master=sys.argv[1]) as node:
    points, texts = node.new_pub("/goal", "point"), node.new_pub("/state", "string")
    print("ready")
    for line in sys.stdin:
        points.publish((1.5, -2.0))
        texts.publish(line.strip())
"""


@contextmanager
def with_codec(tmp_path: Path, code: str, *args: str) -> Iterator[Program]:
    """Run a program that can import the module of the codec."""
    (tmp_path / "point_codec.py").write_text(CODEC)
    path = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]\n"
    with running(path + code, *args) as program:
        yield program


def output_of(program: Program) -> list[str]:
    """Return the lines of a program that ends successfully."""
    output, errors = program.end()
    assert program.process.returncode == 0, errors
    return output.splitlines()


def test_codec_of_one_module_is_published_recorded_and_read(tmp_path: Path) -> None:
    with with_codec(tmp_path, RECORD, str(tmp_path / "points.mcap")) as program:
        assert output_of(program) == ["point (1.5, -2.0)", "point [(1.5, -2.0)]"]
    with Recording(tmp_path / "points.mcap") as recording:  # by a program without the codec
        ((_time, message),) = recording.read(topics=["/goal"])
        assert (message.codec, message.msg_type, len(message.data)) == ("point", "point", 16)
        with pytest.raises(DecodeError, match=r"point.*unknown codec"):
            _ = message.payload


def test_ros_carrier_is_taken_from_the_codec(tmp_path: Path) -> None:
    with with_codec(tmp_path, ROS) as program:
        assert (
            output_of(program)
            == [
                "std_msgs/UInt8MultiArray (1.5, -2.0)",
                "std_msgs/msg/UInt8MultiArray (1.5, -2.0)",
            ]
            * 2
        )


def test_program_without_the_codec_rejects_and_counts_its_messages(tmp_path: Path, master: Master) -> None:
    with (
        nep.node("eye", master=master.address) as node,
        with_codec(tmp_path, PUBLISH, master.address) as program,
    ):
        goals, states = node.new_sub("/goal", "point"), node.new_sub("/state", "string")
        assert program.line() == "ready"
        for number in range(1, 4):
            program.say(f"state {number}")
            message = states.receive(30)
            assert message is not None
            assert message.payload == f"state {number}"
            eventually(lambda expected=number: goals.refused == expected)  # type: ignore[misc]
        assert goals.receive(0) is None
        eventually(lambda: any("codec 200" in alert.sentence for alert in node.graph().alerts))


@pytest.mark.parametrize(
    ("changes", "aliases", "reason"),
    [
        ({"name": "json"}, (), "name or number of another"),
        ({"number": 1}, (), "name or number of another"),
        ({"name": "images"}, (), "name or number of another"),
        ({}, ("string",), "name or number of another"),
        ({}, ("dict",), "name or number of another"),
        ({"number": 0}, (), "use 1 to 255"),
        ({"number": 256}, (), "use 1 to 255"),
    ],
)
def test_codec_with_an_invalid_or_taken_name_or_number_is_rejected(
    changes: dict[str, object], aliases: tuple[str, ...], reason: str
) -> None:
    registered = dict(codecs.CODECS)
    codec = replace(codecs.BYTES, **({"name": "point", "number": 200} | changes))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=reason):
        codecs.register(codec, *aliases)
    assert registered == codecs.CODECS
    assert codecs.codec_for("point") is codecs.JSON
