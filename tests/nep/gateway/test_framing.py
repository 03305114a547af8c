from __future__ import annotations

import base64
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nep.programs.gateway.framing import (
    FrameError,
    Shape,
    codec_of,
    framing_of,
    lost_numbers,
    shield_csharp,
    shield_javascript,
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
def test_the_port_and_the_type_decide_the_framing(port, msg_type, framing):
    assert framing_of(port, msg_type) == framing


def test_types_that_the_originals_invented_travel_as_json():
    assert [codec_of(name) for name in ("json", "dictionary", "dict", "string", "image", "images")] == [
        "json",
        "json",
        "json",
        "string",
        "image",
        "image",
    ]


def test_prefixed_json_is_the_topic_a_space_and_the_datum():
    shape = Shape("t", "prefixed", "json")
    assert shape.read(b't {"a":1}') == b'{"a":1}'
    assert shape.write(b'{"a":1}') == b't {"a":1}'


def test_a_list_and_a_text_are_read_where_the_originals_could_not():
    shape = Shape("t", "prefixed", "json")
    assert shape.read(b"t [1,2]") == b"[1,2]"
    assert shape.read(b't "x"') == b'"x"'


def test_prefixed_json_without_its_prefix_is_still_read():
    assert Shape("t", "prefixed", "json").read(b'{"a":1}') == b'{"a":1}'


def test_a_frame_of_another_topic_is_refused():
    with pytest.raises(FrameError, match="does not begin with the topic"):
        Shape("t", "prefixed", "string").read(b"t2 hello")


def test_a_string_keeps_its_spaces_and_letters():
    text = "  zwei  Wörter — 日本 😀 ".encode()
    for framing in ("prefixed", "bare"):
        shape = Shape("t", framing, "string")
        assert shape.read(shape.write(text)) == text


def test_a_bare_string_that_begins_like_its_topic_is_a_string():
    assert Shape("t", "bare", "string").read(b"t is a letter") == b"t is a letter"


def test_a_picture_is_base64_outside_and_jpeg_inside():
    jpeg = bytes(range(256))
    for framing, prefix in (("prefixed", b"cam "), ("bare", b"")):
        shape = Shape("cam", framing, "image")
        frame = shape.write(jpeg)
        assert frame == prefix + base64.b64encode(jpeg)
        assert shape.read(frame) == jpeg


def test_a_picture_that_is_no_base64_is_refused():
    with pytest.raises(FrameError, match="base64"):
        Shape("cam", "bare", "image").read(b"****")


def test_nan_becomes_null_because_strict_readers_refuse_it():
    assert json.loads(Shape("t", "bare", "json").read(b'{"a": NaN, "b": [-Infinity, 1]}')) == {
        "a": None,
        "b": [None, 1],
    }


def test_whether_numbers_were_lost_can_be_told():
    shape = Shape("t", "prefixed", "json")
    for said, is_lost in (
        (b'{"a": NaN}', True),
        (b'{"a": "NaN", "b": Infinity}', True),
        (b'["NaN", null]', False),
        (b"[null]", False),
    ):
        frame = b"t " + said
        assert lost_numbers(frame, shape.read(frame)) is is_lost


def test_the_word_nan_in_a_text_stays():
    assert json.loads(Shape("t", "bare", "json").read(b'{"a": "NaN"}')) == {"a": "NaN"}


def test_nep_0546_and_0547_are_recognised_by_what_they_send():
    shape = Shape("t", "bare", "json")
    for frame, version in ((b't {"a":1}', "0.5.4.6"), (json.dumps(json.dumps({"a": 1})).encode(), "0.5.4.7")):
        with pytest.raises(FrameError) as caught:
            shape.read(frame)
        assert caught.value.version == version


def test_a_plain_text_as_json_is_not_taken_for_nep_0547():
    assert Shape("t", "bare", "json").read(b'"hello"') == b'"hello"'


def test_nep_0546_is_recognised_by_its_filter():
    assert Shape("t", "bare", "json").is_from_0546(b"t")
    assert not Shape("t", "bare", "json").is_from_0546(b"")
    assert not Shape("t", "prefixed", "json").is_from_0546(b"t")


def test_a_filter_wants_a_line_when_it_can_match_a_frame():
    prefixed, bare = Shape("test", "prefixed", "json"), Shape("test", "bare", "json")
    assert prefixed.wants(b"test")
    assert prefixed.wants(b"")
    assert not prefixed.wants(b"test2")
    assert bare.wants(b"")
    assert not bare.wants(b"test")


@given(JSON_VALUES, st.text(alphabet="abe1n ü日", min_size=1, max_size=3))
def test_shielding_never_changes_what_is_said(value, topic):
    data = json.dumps(value, ensure_ascii=False).encode()
    assert json.loads(shield_javascript(data, topic)) == value
    assert json.loads(shield_csharp(data)) == value


@given(st.text(), st.sampled_from(["camera", "日本", "robot_action", "aa"]))
def test_no_text_names_the_topic_after_shielding_for_javascript(text, topic):
    data = json.dumps(
        {"message": f"{text}{topic}{text}{topic[0]}{topic}", topic: 1}, ensure_ascii=False
    ).encode()
    assert topic.encode() not in shield_javascript(data, topic)


def test_no_space_is_left_after_shielding_for_csharp():
    assert b" " not in shield_csharp(b'{"a b": "c  d", "e": [1, 2]}')
