from __future__ import annotations

import base64
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nep.messages.codecs import codec_for
from nep.programs.gateway.framing import (
    FrameError,
    FrameFormat,
    escape_for_csharp,
    escape_for_javascript,
    framing_of,
    has_replaced_nan,
)

JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.parametrize(
    ("port", "msg_type", "framing"),
    [
        (7000, "json", "prefixed"),
        (7000, "string", "prefixed"),
        (7000, "image", "prefixed"),
        (7000, "my/type", "prefixed"),
        (7000, "bytes", "bare"),
        (7000, "msgpack", "bare"),
        (7000, "images", "bare"),
        (50000, "json", "bare"),
        (50000, "string", "bare"),
        (50000, "dictionary", "prefixed"),
        (50000, "image", "prefixed"),
        (50000, "images", "bare"),
    ],
)
def test_framing_is_determined_by_port_and_type(port, msg_type, framing):
    assert framing_of(port, msg_type) == framing


def test_message_types_of_the_originals_map_to_json_string_and_image():
    assert [codec_for(name).name for name in ("json", "dictionary", "dict", "string", "image", "images")] == [
        "json",
        "json",
        "json",
        "string",
        "image",
        "image",
    ]


def test_prefixed_json_is_the_topic_a_space_and_the_payload():
    shape = FrameFormat("t", "prefixed", "json")
    assert shape.decode_frame(b't {"a":1}') == b'{"a":1}'
    assert shape.encode_frame(b'{"a":1}') == b't {"a":1}'


def test_lists_and_strings_are_decoded_from_prefixed_json():
    shape = FrameFormat("t", "prefixed", "json")
    assert shape.decode_frame(b"t [1,2]") == b"[1,2]"
    assert shape.decode_frame(b't "x"') == b'"x"'


def test_prefixed_json_without_its_prefix_is_decoded():
    assert FrameFormat("t", "prefixed", "json").decode_frame(b'{"a":1}') == b'{"a":1}'


def test_frame_of_another_topic_is_rejected():
    with pytest.raises(FrameError, match="doesn't begin with the topic"):
        FrameFormat("t", "prefixed", "string").decode_frame(b"t2 hello")


def test_string_round_trips_with_spaces_and_unicode():
    text = "  zwei  Wörter — 日本 😀 ".encode()
    for framing in ("prefixed", "bare"):
        shape = FrameFormat("t", framing, "string")
        assert shape.decode_frame(shape.encode_frame(text)) == text


def test_bare_string_that_starts_with_its_topic_is_not_stripped():
    assert FrameFormat("t", "bare", "string").decode_frame(b"t is a letter") == b"t is a letter"


def test_image_frame_is_a_base64_encoded_jpeg():
    jpeg = bytes(range(256))
    for framing, prefix in (("prefixed", b"cam "), ("bare", b"")):
        shape = FrameFormat("cam", framing, "image")
        frame = shape.encode_frame(jpeg)
        assert frame == prefix + base64.b64encode(jpeg)
        assert shape.decode_frame(frame) == jpeg


def test_image_with_invalid_base64_is_rejected():
    with pytest.raises(FrameError, match="base64"):
        FrameFormat("cam", "bare", "image").decode_frame(b"****")


def test_nan_is_converted_to_null_for_strict_readers():
    assert json.loads(FrameFormat("t", "bare", "json").decode_frame(b'{"a": NaN, "b": [-Infinity, 1]}')) == {
        "a": None,
        "b": [None, 1],
    }


def test_numbers_replaced_by_null_are_detected():
    shape = FrameFormat("t", "prefixed", "json")
    for said, is_lost in (
        (b'{"a": NaN}', True),
        (b'{"a": "NaN", "b": Infinity}', True),
        (b'["NaN", null]', False),
        (b"[null]", False),
    ):
        frame = b"t " + said
        assert has_replaced_nan(frame, shape.decode_frame(frame)) is is_lost


def test_word_nan_in_a_string_is_unchanged():
    assert json.loads(FrameFormat("t", "bare", "json").decode_frame(b'{"a": "NaN"}')) == {"a": "NaN"}


def test_nep_0546_and_0547_are_recognised_by_their_frames():
    shape = FrameFormat("t", "bare", "json")
    for frame, version in ((b't {"a":1}', "0.5.4.6"), (json.dumps(json.dumps({"a": 1})).encode(), "0.5.4.7")):
        with pytest.raises(FrameError) as caught:
            shape.decode_frame(frame)
        assert caught.value.version == version


def test_plain_json_string_is_not_mistaken_for_nep_0547():
    assert FrameFormat("t", "bare", "json").decode_frame(b'"hello"') == b'"hello"'


def test_nep_0546_is_recognised_by_its_filter():
    assert FrameFormat("t", "bare", "json").is_from_0546(b"t")
    assert not FrameFormat("t", "bare", "json").is_from_0546(b"")
    assert not FrameFormat("t", "prefixed", "json").is_from_0546(b"t")


def test_subscription_filter_matches_only_possible_frame_prefixes():
    prefixed, bare = FrameFormat("test", "prefixed", "json"), FrameFormat("test", "bare", "json")
    assert prefixed.matches_filter(b"test")
    assert prefixed.matches_filter(b"")
    assert not prefixed.matches_filter(b"test2")
    assert bare.matches_filter(b"")
    assert not bare.matches_filter(b"test")


@given(JSON_VALUES, st.text(alphabet="abe1n ü日", min_size=1, max_size=3))
def test_escaping_for_javascript_and_csharp_never_changes_the_value(value, topic):
    data = json.dumps(value, ensure_ascii=False).encode()
    assert json.loads(escape_for_javascript(data, topic)) == value
    assert json.loads(escape_for_csharp(data)) == value


@given(st.text(), st.sampled_from(["camera", "日本", "robot_action", "aa"]))
def test_json_escaped_for_javascript_contains_no_topic_name(text, topic):
    data = json.dumps(
        {"message": f"{text}{topic}{text}{topic[0]}{topic}", topic: 1}, ensure_ascii=False
    ).encode()
    assert topic.encode() not in escape_for_javascript(data, topic)


def test_json_escaped_for_csharp_contains_no_space():
    assert b" " not in escape_for_csharp(b'{"a b": "c  d", "e": [1, 2]}')
