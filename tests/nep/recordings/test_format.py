"""Tests of the recording format: messages are preserved completely, and other programs can read the files."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from nep.geometry import PoseStamped
from nep.messages.message import Message
from nep.recordings.formats.channels import ChannelDecoder, definition_of, encoding_of
from nep.recordings.formats.protobuf import SCHEMAS, descriptor_set, fields
from nep.recordings.formats.records import RawMessage
from nep.recordings.formats.schemas import ANY_OBJECT, json_schema, schema_of
from nep.recordings.reader import Recording
from tests.nep.recordings.mcap_doctor import McapDoctor
from tests.nep.recordings.messages import START_NS, json_message, kept, odd_messages, picture, record

U64 = 2**64 - 1
NUMBERS = st.one_of(st.none(), st.integers(0, U64), st.sampled_from([0, 1, 2**32 - 1, 2**32, U64]))
VALUES = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(-(2**63), U64), st.text(max_size=5), st.binary(max_size=5)
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=5,
)


def there_and_back(message: Message, *, is_self_contained: bool = False) -> Message:
    encoding = encoding_of(message, START_NS, is_self_contained=is_self_contained)
    data = memoryview(encoding.prefix + bytes(message.data))
    raw = RawMessage(0, 1, encoding.sequence, START_NS, encoding.publish_ns, data)
    return ChannelDecoder(definition_of(message, encoding)).message(raw)


@given(
    codec=st.sampled_from(["json", "string", "bytes", "msgpack", "image", "another"]),
    data=st.binary(max_size=40),
    seq=NUMBERS,
    stamp_ns=NUMBERS,
    publisher=NUMBERS,
    extension=st.dictionaries(st.text(max_size=10), VALUES, max_size=3),
    is_self_contained=st.booleans(),
)
def test_recorded_message_round_trip(codec, data, seq, stamp_ns, publisher, extension, is_self_contained):
    message = Message(
        "/a/b", data, codec, "some/Type", seq=seq, stamp_ns=stamp_ns, publisher=publisher, extension=extension
    )
    assert kept(there_and_back(message, is_self_contained=is_self_contained)) == kept(message)


@pytest.mark.parametrize("message", odd_messages(), ids=lambda each: each.topic)
def test_extreme_and_malformed_messages_round_trip(message):
    assert kept(there_and_back(message)) == kept(message)
    assert kept(there_and_back(message, is_self_contained=True)) == kept(message)


@given(st.binary(max_size=60))
def test_arbitrary_bytes_in_a_wrapped_message_decode_without_error(data):
    for message in (picture(1), picture(1, "raw"), Message("/t", b"x", "string", "string")):
        decoder = ChannelDecoder(definition_of(message, encoding_of(message, 0)))
        assert decoder.message(RawMessage(0, 1, 1, 1, 1, memoryview(data))).topic == message.topic


def test_recording_returns_posted_messages_in_order(tmp_path):
    messages = odd_messages()
    record(tmp_path / "a.mcap", [messages])
    with Recording(tmp_path / "a.mcap") as recording:
        assert [kept(each.message) for each in recording.read()] == [kept(each) for each in messages]


def test_recordings_pass_the_mcap_doctor(tmp_path):
    path = tmp_path / "a.mcap"
    messages = odd_messages()
    record(path, [messages, [json_message(seq) for seq in range(2, 200)], messages])
    assert McapDoctor(path).problems == []


def test_mcap_doctor_detects_a_flipped_bit(tmp_path):
    path = tmp_path / "a.mcap"
    record(path, [[json_message(seq) for seq in range(1, 20)]])
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    assert McapDoctor(path).problems


def test_mcap_library_reads_recordings_with_valid_crcs(tmp_path):
    path = tmp_path / "a.mcap"
    messages = odd_messages()
    record(path, [messages, messages])
    with path.open("rb") as file:
        assert sum(1 for _each in StreamReader(file, validate_crcs=True).records) > 2 * len(messages)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = [
            (channel, each)
            for _schema, channel, each in reader.iter_messages()
            if channel.metadata.get("nep.role") is None
        ]
        assert [channel.topic for channel, _each in found] == [each.topic for each in (*messages, *messages)]
        plain = [
            (channel.topic, each.data)
            for channel, each in found
            if channel.message_encoding in {"json", "msgpack"}
        ]
        sent = {(each.topic, bytes(each.data)) for each in messages}
        assert plain
        assert set(plain) <= sent


def test_json_channels_hold_valid_json_that_matches_their_schemas(tmp_path):
    path = tmp_path / "a.mcap"
    record(path, [odd_messages()])
    with path.open("rb") as file:
        seen = set()
        for schema, channel, each in make_reader(file).iter_messages():
            if channel.message_encoding == "json":
                value = json.loads(each.data, parse_constant=pytest.fail)
                assert schema.encoding == "jsonschema"
                rules = json.loads(schema.data)
                assert rules["type"] == "object"
                if isinstance(value, dict):
                    jsonschema.validate(value, rules)
                seen.add((channel.topic, schema.name))
    assert {("/odom", "json"), ("/typed", "geometry_msgs/Point")} <= seen


def test_images_are_foxglove_messages_with_the_original_bytes():
    for message, name, data_field in (
        (picture(1), "foxglove.CompressedImage", 2),
        (picture(3, "raw"), "foxglove.RawImage", 6),
    ):
        encoding = encoding_of(message, START_NS)
        definition = definition_of(message, encoding)
        found = dict(fields(memoryview(encoding.prefix + bytes(message.data))))
        assert (definition.schema_name, definition.message_encoding) == (name, "protobuf")
        assert bytes(found[data_field]) == bytes(message.data)
        if name.endswith("CompressedImage"):
            assert bytes(found[3]) == b"jpeg"
        else:
            assert (found[2], found[3], bytes(found[4]), found[5]) == (16, 12, b"bgr8", 48)


def test_protobuf_descriptors_match_the_verified_checksums():
    # Verified against foxglove's definitions with protobuf 7.36; the checksums pin that state.
    sums = {name: hashlib.sha256(descriptor_set(name)).hexdigest()[:16] for name in SCHEMAS}
    assert sums == GOLDEN


def test_google_protobuf_parses_a_recorded_image():
    descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    from google.protobuf import descriptor_pool, message_factory

    message = picture(1)
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(descriptor_set("foxglove.CompressedImage")).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.CompressedImage"))
    made = kind.FromString(encoding_of(message, START_NS).prefix + bytes(message.data))
    assert (made.data, made.format) == (bytes(message.data), "jpeg")
    assert made.timestamp.seconds * 10**9 + made.timestamp.nanos == message.stamp_ns


@dataclass
class Wheel:
    MSG_TYPE = "test/Wheel"
    speed: float
    name: str = ""
    laps: int | None = None
    gears: list[int] = field(default_factory=list)
    grid: list[list[int]] = field(default_factory=list)
    _hidden: int = 0


def test_json_schemas_list_fields_of_known_types_only():
    assert schema_of("anything/Else") == ANY_OBJECT
    made = json.loads(schema_of("geometry_msgs/PoseStamped"))
    assert made["properties"]["pose"]["properties"]["position"]["properties"]["x"] == {"type": "number"}
    assert made["title"] == PoseStamped.MSG_TYPE
    wheel = json.loads(json_schema(Wheel))
    assert wheel["properties"] == {
        "speed": {"type": "number"},
        "name": {"type": "string"},
        "laps": {"type": "integer"},
        "gears": {"type": "array", "items": {"type": "integer"}},
    }  # viewers don't support lists of lists


def test_recordings_of_other_programs_are_read_with_every_compression(tmp_path: Path):
    from mcap.writer import CompressionType, Writer

    path = tmp_path / "theirs.mcap"
    wrapped = picture(1)
    for compression in CompressionType:
        with path.open("wb") as file:
            writer = Writer(file, compression=compression, chunk_size=200)
            writer.start()
            schema = writer.register_schema("foxglove.CompressedImage", "protobuf", b"?")
            camera = writer.register_channel("/cam", "protobuf", schema)
            odom = writer.register_channel("/odom", "json", 0)
            ros = writer.register_channel("/ros", "cdr", 0)
            encoding = encoding_of(wrapped, 0)
            for seq in range(20):  # other programs don't sort by time
                writer.add_message(odom, 1000 - seq, b"{}", 5, seq)
            writer.add_message(camera, 1000, encoding.prefix + bytes(wrapped.data), 6, 3)
            writer.add_message(ros, 7, b"\0\1", 7, 1)
            writer.finish()
        with Recording(path) as recording:
            found = list(recording.read())
            assert [each.log_ns for each in found] == sorted(each.log_ns for each in found)
            assert [recording.topics[each].codec for each in ("/cam", "/odom", "/ros")] == [
                "image",
                "json",
                "bytes",
            ]
            newest = recording.newest(2000)
            assert bytes(newest["/cam"].message.data) == bytes(wrapped.data)
            assert newest["/cam"].message.payload.shape == (12, 16, 3)
            assert (newest["/odom"].log_ns, newest["/odom"].message.seq) == (1000, 0)
            assert recording.newest(985)["/odom"].log_ns == 985


GOLDEN = {
    "foxglove.CompressedImage": "5c7a8859d4aad3d3",
    "foxglove.RawImage": "3f7f3e34541ec2d1",
    "nep.Text": "c7cc332ae82bcea8",
    "nep.Bytes": "16eeafd98335f7dc",
}
