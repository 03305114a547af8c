"""Tests of the native wire: joined parts are split again, and invalid parts are rejected."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nep.errors import BadTopicError, WireError
from nep.protocol import wire
from nep.protocol.requests import derive_id, derive_node_id

VECTORS = json.loads((Path(__file__).parents[2] / "data" / "wire" / "messages.json").read_text("utf-8"))

U64 = st.integers(0, 2**64 - 1)
TOPICS = st.text(
    st.characters(exclude_categories=["C", "Z"], exclude_characters="{"), min_size=1, max_size=40
).filter(lambda topic: len(topic.encode()) <= 200 and not any(letter.isspace() for letter in topic))
HEADERS = st.builds(wire.Header, st.integers(0, 255), st.sampled_from([0, 1]), U64, U64, U64, st.just(0))
EXTENSIONS = st.dictionaries(
    st.text(max_size=8), st.integers() | st.text(max_size=8) | st.binary(max_size=8)
).map(
    lambda map_: {
        key: value for key, value in map_.items() if not isinstance(value, int) or abs(value) < 2**63
    }
)


@given(TOPICS, HEADERS, st.binary(max_size=100), EXTENSIONS)
def test_joined_message_parts_split_into_the_original_message(
    topic: str, header: wire.Header, payload: bytes, extension: dict[str, object]
) -> None:
    parts = wire.join(topic, header, payload, extension)
    assert len(parts) == (4 if extension else 3)
    assert len(parts[1]) == wire.HEADER_BYTES
    back = wire.split(parts)
    assert (back.topic, back.payload, back.extension) == (topic, payload, extension)
    assert back.header._replace(flags=header.flags) == header


@given(st.binary(max_size=60), st.integers(1, 2**32 - 1))
def test_payload_of_another_size_than_declared_is_rejected(payload: bytes, told: int) -> None:
    parts = wire.join("t", wire.Header(3, 0, 1, 2, 3, told), payload)
    if told == len(payload):
        assert wire.split(parts).payload == payload
    else:
        with pytest.raises(WireError, match=f"declares {told} bytes, but the payload has {len(payload)}"):
            wire.split(parts)


def test_fast_header_packing_matches_the_header_class() -> None:
    head = wire.pack_header(wire.encode_form(3, wire.LATCHED), 17, 5, 6, 7)
    assert head == wire.Header(3, wire.LATCHED, 5, 6, 7, 17).pack()
    assert wire.read_header(head) == wire.Header(3, wire.LATCHED, 5, 6, 7, 17)
    assert wire.unpack_header(head) == (wire.encode_form(3, wire.LATCHED), 17, 5, 6, 7)


@given(st.lists(st.binary(max_size=60), max_size=5))
def test_arbitrary_parts_raise_only_wire_errors(parts: list[bytes]) -> None:
    with contextlib.suppress(WireError):
        wire.split(parts)


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["name"])
def test_wire_vectors_are_decoded_and_encoded_or_rejected_with_their_error_code(
    vector: dict[str, object],
) -> None:
    parts = [bytes.fromhex(part) for part in vector["parts"]]  # type: ignore[attr-defined]
    if "error" in vector:
        with pytest.raises(WireError) as refused:
            wire.split(parts)
        assert refused.value.code == vector["error"]
        return
    read = wire.split(parts)
    said = vector["means"]
    assert isinstance(said, dict)
    assert read.topic == said["topic"]
    assert read.header == wire.Header(
        said["codec"],
        said["flags"],
        *(int(said[name]) for name in ("seq", "stamp_ns", "publisher")),
        said.get("size", 0),
    )
    assert bytes(read.payload).hex() == said["payload"]
    assert read.extension == said["extension"]
    joined = wire.join(read.topic, read.header, read.payload, read.extension or None)
    assert list(joined) == parts or [b"".join(joined)] == parts


@given(TOPICS, HEADERS, st.binary(max_size=100))
def test_single_part_message_is_split_like_three_parts(
    topic: str, header: wire.Header, payload: bytes
) -> None:
    parts = wire.join(topic, header, payload)
    assert wire.split([b"".join(parts)]) == wire.split(parts)


@given(st.integers(0, 2**64 - 1), TOPICS, st.booleans(), st.booleans(), st.booleans())
def test_hello_round_trip(subscriber: int, topic: str, one_part: bool, tells: bool, batches: bool) -> None:
    part = wire.hello_part(
        subscriber, topic, reads_one_part=one_part, acknowledges_echoes=tells, reads_batches=batches
    )
    said = (one_part or tells or batches, tells or batches, batches)
    assert wire.parse_hello(part) == (subscriber, topic, *said)
    assert part > wire.topic_part(topic)  # libzmq sends filters in byte order


@pytest.mark.parametrize(
    "part",
    [
        b"",
        b"topic\0",
        b"\xffhello/",
        b"\xffhello/12/t",
        b"\xffhello/zzzzzzzzzzzzzzzz/t",
        b"\xffhello/" + b"0" * 16,
    ],
)
def test_invalid_hello_is_not_parsed(part: bytes) -> None:
    assert wire.parse_hello(part) is None


@given(st.builds(wire.Acknowledgement, *[st.integers(0, 2**64 - 1)] * 4))
def test_acknowledgement_round_trip(read: wire.Acknowledgement) -> None:
    assert wire.parse_acknowledgement(wire.acknowledgement_part(read)) == read
    assert wire.parse_hello(wire.acknowledgement_part(read)) is None


@given(st.binary(max_size=80) | st.text("0123456789abcdef/-", max_size=70).map(str.encode))
def test_invalid_acknowledgement_is_not_parsed(junk: bytes) -> None:
    read = wire.parse_acknowledgement(b"\xffread/" + junk)
    assert read is None or wire.acknowledgement_part(read) == b"\xffread/" + junk.lower()
    assert wire.parse_acknowledgement(junk) is None


@pytest.mark.parametrize("topic", ["a", "/Pepper/camera", "ü/ä", "x" * 200, "a=b,c", "機器人"])
def test_topic_names_of_up_to_200_bytes_in_any_script_are_accepted(topic: str) -> None:
    assert wire.check_topic(topic) == topic


@pytest.mark.parametrize(
    ("topic", "reason"),
    [
        ("", "the name is 0 bytes"),
        ("x" * 201, "the name is 201 bytes"),
        ("ü" * 101, "the name is 202 bytes"),
        ("a b", "the character ' ' isn't allowed"),
        ("a\tb", r"the character '\\t'"),
        ("a{b", "the character '{'"),
        ("a\0", r"the character '\\x00'"),
        ("a\u2028", r"the character '\\u2028'"),
        ("a\x85", r"the character '\\x85'"),
        ("\ud800", r"\\ud800'.*Unicode"),
        (7, "a topic name must be a 'str'"),
    ],
)
def test_empty_or_too_long_topic_names_and_forbidden_characters_are_rejected(topic: str, reason: str) -> None:
    with pytest.raises(BadTopicError, match=reason):
        wire.check_topic(topic)


def test_unknown_wire_version_raises_an_error_that_suggests_an_update() -> None:
    header = bytearray(wire.Header(1, 0, 1, 2, 3).pack())
    header[0] = 9
    with pytest.raises(
        WireError, match="the message has wire version 9, but this nep reads version 1; update nep"
    ):
        wire.read_header(bytes(header))


def test_extension_that_msgpack_cannot_encode_is_rejected() -> None:
    with pytest.raises(WireError, match="can't encode the extension"):
        wire.extension_part({"a": object()})


def test_ids_derived_from_the_key_match_the_vectors() -> None:
    vectors = json.loads((Path(__file__).parents[2] / "data" / "wire" / "ids.json").read_text("utf-8"))
    assert len(vectors["nodes"]) == 3
    for each in vectors["nodes"]:
        assert derive_node_id(each["key"]) == each["node_id"]
        assert {number: str(derive_id(each["key"], int(number))) for number in each["ids"]} == each["ids"]
