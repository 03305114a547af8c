"""Tests of the limit of 64 nesting levels in every codec, when encoding and when decoding."""

from __future__ import annotations

import json
import logging
from collections import OrderedDict
from dataclasses import dataclass
from datetime import datetime, timezone

import msgpack
import orjson
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nep
from nep.errors import DecodeError, EncodeError
from nep.messages.codecs import codec
from nep.messages.nesting import MAX_LEVELS, is_json_too_deep, is_packed_too_deep
from nep.messages.packing import pack
from tests.examples import examples

SENTENCE = "the value has more than 64 levels of lists and maps"


def nested(levels: int, kind: str) -> object:
    value: object = 1
    for level in range(levels):
        value = [value] if kind == "lists" or (kind == "both" and level % 2) else {"a": value}
    return value


@pytest.mark.parametrize("kind", ["lists", "maps", "both"])
@pytest.mark.parametrize("name", ["json", "msgpack"])
def test_payload_of_64_levels_is_encoded_and_65_levels_are_rejected_with_one_message(
    name: str, kind: str
) -> None:
    assert codec(name).decode(codec(name).encode(nested(64, kind)).data, {}) == nested(64, kind)
    for levels in (65, 300, 1_000, 2_000):
        value = nested(levels, kind)
        with pytest.raises(EncodeError, match=SENTENCE):
            codec(name).encode(value)
        if name == "json":
            opening = {"lists": "[", "maps": '{"a":', "both": '[{"a":'}[kind]
            data = (
                opening * levels
                + "1"
                + ("]" if kind == "lists" else "}" if kind == "maps" else "}]") * levels
            )
            packed = data.encode()
        else:
            packed = {"lists": b"\x91", "maps": b"\x81\xa1a", "both": b"\x91\x81\xa1a"}[
                kind
            ] * levels + b"\x01"
        with pytest.raises(DecodeError, match=SENTENCE):
            codec(name).decode(packed, {})


@pytest.mark.parametrize(
    "text",
    [
        json.dumps(["]", "[" * 200, '"', "\\", '\\"[', "{" * 100]),
        json.dumps([{"x": 1, "y": [number]} for number in range(200)]),
        json.dumps({"a\\": '\\\\"[[[['} | {f"[{number}": "{" for number in range(200)}, indent=2),
    ],
)
def test_brackets_inside_strings_do_not_count_as_levels(text: str) -> None:
    assert codec("json").decode(text.encode(), {}) == json.loads(text)


@pytest.mark.parametrize(("before", "after"), [('["]",', '"["]'), ('["\\\\]",', ',"["]'), ('{"}":', "}")])
def test_brackets_inside_strings_do_not_bypass_the_depth_limit(before: str, after: str) -> None:
    text = before * 70 + "1" + after * 70
    with pytest.raises(DecodeError, match=SENTENCE):
        codec("json").decode(text.encode(), {})


JSON_VALUES = st.recursive(
    st.none() | st.integers(-5, 5) | st.text('[]{}"\\a', max_size=6),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text('[]{}"\\a', max_size=3), inner, max_size=3)
    ),
    max_leaves=60,
)


def levels_of(value: object) -> int:
    if isinstance(value, (list, tuple)):
        return 1 + max(map(levels_of, value), default=0)
    return 1 + max(map(levels_of, value.values()), default=0) if isinstance(value, dict) else 0


@settings(max_examples=examples(150))
@given(JSON_VALUES, st.integers(0, 80))
def test_depth_check_of_json_bytes_matches_depth_of_the_value(value: object, around: int) -> None:
    for _level in range(around):
        value = [value, "]"]
    assert is_json_too_deep(orjson.dumps(value)) == (levels_of(value) > MAX_LEVELS)


PACKED_VALUES = st.recursive(
    st.none()
    | st.integers(-5, 5)
    | st.floats(0, 1)
    | st.text(max_size=2)
    | st.just(msgpack.ExtType(1, b"12"))
    | st.just(datetime(2026, 1, 1, tzinfo=timezone.utc)),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=2).map(tuple)
        | st.dictionaries(st.text(max_size=2) | st.just(((1, ((2,),)),)), inner, max_size=3)
        | st.dictionaries(st.text(max_size=1), inner, max_size=2).map(OrderedDict)
    ),
    max_leaves=30,
)


@settings(max_examples=examples(150))
@given(PACKED_VALUES, st.integers(50, 70), st.sampled_from(["list", "tuple", "map"]))
def test_depth_check_of_decoded_msgpack_matches_depth_of_the_value(
    value: object, around: int, kind: str
) -> None:
    padding = [0.5] * 500  # too large for counting the headers
    for _level in range(around):
        value = {"a": value} if kind == "map" else (value,) if kind == "tuple" else [value]
    value = [value, padding]
    data = pack(value)
    assert is_packed_too_deep(data, value) == (levels_of(value) > MAX_LEVELS)


@pytest.mark.parametrize("inner", [[], {}, [1], {"a": 1}, 1, "text"])
@pytest.mark.parametrize("levels", [63, 64, 65])
def test_empty_lists_and_maps_count_as_levels(levels: int, inner: object) -> None:
    value = inner
    for _level in range(levels - levels_of(inner)):
        value = [value, *range(8)]
    assert levels_of(value) == levels
    assert is_packed_too_deep(pack(value) + bytes(4096), value) == (levels > MAX_LEVELS)


def test_utf16_json_does_not_bypass_the_depth_limit() -> None:
    text = '["\u5d5d\u2222",' * 100 + "1" + "]" * 100
    with pytest.raises(DecodeError):
        codec("json").decode(text.encode("utf-16"), {})


@dataclass
class Linked:
    """Dataclass, which is sent as a map."""

    next: object
    _previous: object = None


@pytest.mark.parametrize("name", ["json", "msgpack"])
def test_nested_dataclasses_count_as_levels(name: str) -> None:
    value: object = "x" * 200
    for _level in range(64):
        before, value = value, Linked(value)
        if isinstance(before, Linked):
            before._previous = value  # a cycle, but private fields are not sent
    assert codec(name).decode(codec(name).encode(value).data, {})
    with pytest.raises(EncodeError, match=SENTENCE):
        codec(name).encode(Linked(value))


def test_publisher_rejects_and_counts_too_deep_payloads(caplog: pytest.LogCaptureFixture) -> None:
    with nep.node("deep", "memory") as node, caplog.at_level(logging.WARNING):
        publisher, subscriber = node.new_pub("/deep"), node.new_sub("/deep")
        publisher.publish(nested(65, "both"))
        assert publisher.refused == 1
        assert SENTENCE in publisher.problem
        publisher.publish_bytes(b"[" * 65 + b"]" * 65)
        publisher.publish(nested(64, "both"))
        assert subscriber.listen(timeout_s=30.0) == (True, nested(64, "both"))


def test_deep_msgpack_in_a_large_payload_is_rejected() -> None:
    with pytest.raises(DecodeError, match=SENTENCE):
        codec("msgpack").decode(msgpack.packb([[1.5] * 1000, nested(70, "maps")]), {})
