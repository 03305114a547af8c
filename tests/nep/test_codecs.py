"""Codecs: round trips, and sentences for what does not fit."""

from __future__ import annotations

import contextlib
import dataclasses
import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nep import images
from nep.codecs import CODECS, codec, codec_for, codec_numbered
from nep.errors import DecodeError, EncodeError

TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
SMALL = st.integers(-(2**63), 2**63 - 1)
JSON = st.recursive(
    st.none() | st.booleans() | SMALL | st.floats(allow_nan=False, allow_infinity=False) | TEXT,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=4),
    max_leaves=20,
)
MSGPACK = st.recursive(
    st.none() | st.booleans() | SMALL | st.floats(allow_nan=False) | TEXT | st.binary(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT | SMALL, inner, max_size=4),
    max_leaves=20,
)
PAYLOADS = {"json": JSON, "string": TEXT, "bytes": st.binary(), "msgpack": MSGPACK}


def back(name: str, payload: object) -> object:
    data, extension = codec(name).encode(payload)
    return codec(name).decode(memoryview(data), extension or {})


@pytest.mark.parametrize("name", sorted(PAYLOADS))
def test_round_trip(name: str) -> None:
    @given(PAYLOADS[name])
    def check(payload: object) -> None:
        assert back(name, payload) == payload

    check()


@pytest.mark.parametrize("name", sorted(CODECS))
@given(data=st.binary(max_size=200))
def test_any_bytes_decode_or_raise_a_decode_error(name: str, data: bytes) -> None:
    with contextlib.suppress(DecodeError):
        codec(name).decode(memoryview(data), {})


def test_names_and_numbers() -> None:
    assert [codec_numbered(number) for number in range(1, 6)] == list(CODECS.values())
    assert codec_numbered(99) is None
    assert codec_for("robot/description").name == codec_for("dictionary").name == "json"
    assert codec_for("images").name == "image"
    with pytest.raises(DecodeError, match="did you mean 'json'"):
        codec("jason")


def test_json_takes_numpy_number_keys_and_dataclasses() -> None:
    @dataclasses.dataclass
    class Pose:
        x: float

    payload = {
        "a": np.arange(3),
        "s": np.float32(0.5),
        "i": np.int64(7),
        4: True,
        "p": Pose(1.0),
        "t": (1, 2),
    }
    assert back("json", payload) == {
        "a": [0, 1, 2], "s": 0.5, "i": 7, "4": True, "p": {"x": 1.0}, "t": [1, 2],
    }  # fmt: skip
    assert back("json", np.zeros((2, 2))[:, ::2]) == [[0.0], [0.0]]


def test_json_has_no_nan_but_reads_that_of_the_originals() -> None:
    assert back("json", [math.nan, math.inf]) == [None, None]
    value = codec("json").decode(memoryview(b'{"a": NaN}'), {})
    assert isinstance(value, dict)
    assert math.isnan(value["a"])


@pytest.mark.parametrize(
    ("name", "payload", "sentence"),
    [
        ("json", {1, 2}, "cannot encode a 'set' as 'json'; 'set' has no form in it"),
        ("json", {"a": object()}, "cannot encode a 'dict' as 'json'; 'object' has no form in it"),
        ("string", 5, "cannot encode a 'int' as 'string'; publish a 'str'"),
        ("string", "\ud800", "half of a surrogate pair"),
        ("bytes", "text", "cannot encode a 'str' as 'bytes'; publish 'bytes'"),
        ("msgpack", {"a": {1}}, "cannot encode a 'dict' as 'msgpack'; 'set' has no form in it"),
        ("msgpack", 2**70, "cannot encode a 'int' as 'msgpack'"),
        ("image", "text", "publish a 'uint8' array"),
        ("image", b"text", "neither a JPEG nor a PNG"),
        ("image", np.zeros((2, 2, 3)), "its numbers are 'float64'; convert them to 'uint8'"),
        ("image", np.zeros((2,), np.uint8), r"its shape \(2,\) is none of a picture"),
        ("image", np.zeros((0, 5, 3), np.uint8), "none of a picture"),
    ],
)
def test_what_does_not_fit(name: str, payload: object, sentence: str) -> None:
    with pytest.raises(EncodeError, match=sentence):
        codec(name).encode(payload)


def test_json_that_nests_too_deeply_is_an_encode_error() -> None:
    payload: list[object] = []
    payload.append(payload)
    with pytest.raises(EncodeError):
        codec("json").encode(payload)
    with pytest.raises(EncodeError):
        codec("msgpack").encode(payload)


@pytest.fixture
def picture() -> np.ndarray:
    rows, columns = np.mgrid[0:48, 0:64]
    return np.dstack([rows * 4, columns * 3, np.full_like(rows, 128)]).astype(np.uint8)


def test_a_picture_is_published_as_jpeg(picture: np.ndarray) -> None:
    data, extension = codec("image").encode(picture)
    assert extension == {"shape": [48, 64, 3], "encoding": "jpeg"}
    assert images.picture_info(data) == extension
    read = back("image", picture)
    assert isinstance(read, np.ndarray)
    assert (read.shape, read.dtype) == ((48, 64, 3), np.uint8)
    assert np.abs(read.astype(int) - picture).mean() < 4
    assert np.array_equal(codec("image").decode(memoryview(data), {}), read)  # type: ignore[arg-type]


def test_raw_pictures_are_exact(picture: np.ndarray) -> None:
    def read(encoded: images.Encoded) -> object:
        return codec("image").decode(memoryview(encoded.data), encoded.extension or {})

    assert np.array_equal(read(images.raw_image(picture)), picture)  # type: ignore[arg-type]
    assert np.array_equal(read(images.raw_image(picture[::2, ::2])), picture[::2, ::2])  # type: ignore[arg-type]
    grey = read(images.raw_image(picture[:, :, 0]))
    assert np.array_equal(grey, np.repeat(picture[:, :, :1], 3, axis=2))  # type: ignore[arg-type]
    rgb = codec("image").decode(
        memoryview(picture[:, :, ::-1].tobytes()), {"shape": [48, 64, 3], "encoding": "rgb8"}
    )
    assert np.array_equal(rgb, picture)  # type: ignore[arg-type]


def test_other_shapes_of_pictures(picture: np.ndarray) -> None:
    alpha = np.dstack([picture, np.full((48, 64), 255, np.uint8)])
    for odd in (alpha, picture[:, :, :1], picture[:, :, 0]):
        read = back("image", odd)
        assert isinstance(read, np.ndarray)
        assert read.shape == (48, 64, 3)


@pytest.mark.parametrize("ending", ["jpeg", "png"])
def test_files_pass_unchanged(picture: np.ndarray, ending: str) -> None:
    file = cv2.imencode(f".{ending}", picture)[1].tobytes()
    data, extension = codec("image").encode(file)
    assert data == file
    assert extension == {"shape": [48, 64, 3], "encoding": ending}


@pytest.mark.parametrize(
    ("data", "extension"),
    [
        (b"", {}),
        (b"abc", {"shape": [1, 1, 3], "encoding": "jpeg"}),
        (b"abcd", {"shape": [1, 1, 3], "encoding": "bgr8"}),
        (b"abc", {"shape": "x", "encoding": "bgr8"}),
        (b"abc", {"shape": [-1, -1, 3], "encoding": "bgr8"}),
        (b"abc", {"encoding": "mono8"}),
    ],
)
def test_broken_pictures(data: bytes, extension: dict[str, object]) -> None:
    with pytest.raises(DecodeError):
        codec("image").decode(memoryview(data), extension)
