"""Tests of messages as images: colours and pixel values, decoded at the size at which they are shown."""

from __future__ import annotations

import contextlib
import zlib
from unittest.mock import patch

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.messages.picture import decode, encode_png
from nep.errors import DecodeError, EncodeError, NepError
from nep.messages import image_files
from nep.messages.message import Message
from tests.examples import examples


def message(data: bytes, **extension: object) -> Message:
    return Message("/camera", data, "image", "image", seq=3, stamp_ns=5, extension=extension)


def scene(width: int, height: int) -> np.ndarray:
    frame = np.zeros((height, width, 3), np.uint8)
    frame[:, : width // 2] = (10, 20, 200)
    frame[:, width // 2 :] = (30, 180, 40)
    return frame


def encoded(frame: np.ndarray, kind: str = "png") -> Message:
    data = cv2.imencode(f".{kind}", frame)[1].tobytes()
    return message(data, shape=[*frame.shape[:2], 3], encoding="jpeg" if kind == "jpg" else kind)


def raw(frame: np.ndarray, encoding: str) -> Message:
    return message(frame.tobytes(), shape=list(frame.shape), encoding=encoding)


def test_image_without_target_size_is_decoded_in_full() -> None:
    picture, error = decode(encoded(scene(32, 24)), 7.0)
    assert error is None
    assert picture is not None
    assert (picture.width, picture.height, picture.seq, picture.stamp_ns, picture.received_s) == (
        32,
        24,
        3,
        5,
        7.0,
    )
    assert picture.is_full_resolution
    assert picture.pixel(0, 0) == (200, 20, 10)
    assert picture.pixel(31, 23) == (40, 180, 30)
    assert picture.pixel(32, 0) is None


@pytest.mark.parametrize("kind", ["jpg", "png", "bgr8", "rgb8"])
def test_small_view_gets_downscaled_image(kind: str) -> None:
    frame = scene(640, 480)
    sent = raw(frame, kind) if kind.endswith("8") else encoded(frame, kind)
    picture, _ = decode(sent, 0.0, (150, 100))
    assert picture is not None
    assert (picture.width, picture.height) == (640, 480)
    assert picture.bgra.shape == (120, 160, 4)
    assert not picture.is_full_resolution
    assert picture.pixel(3, 3) is None  # full resolution wasn't decoded
    red = (200, 20, 10) if kind == "rgb8" else (10, 20, 200)
    assert np.abs(picture.bgra[60, 10, :3].astype(int) - red).max() < 6
    assert picture.bgra[60, 10, 3] == 255


def test_view_larger_than_half_size_gets_full_image() -> None:
    picture, _ = decode(encoded(scene(640, 480), "jpg"), 0.0, (321, 241))
    assert picture is not None
    assert picture.is_full_resolution


def test_grey_and_depth_images_have_pixel_values() -> None:
    grey = np.arange(24, dtype=np.uint8).reshape(4, 6)
    depth = (grey.astype(np.uint16) + 1) * 1000
    for sent, wanted in ((raw(grey, "mono8"), 23), (encoded(grey), 23), (encoded(depth), 24_000)):
        picture, error = decode(sent, 0.0)
        assert error is None
        assert picture is not None
        assert picture.pixel(5, 3) == wanted
        assert picture.bgra.shape == (4, 6, 4)
    small, _ = decode(raw(np.zeros((400, 600), np.uint8), "mono8"), 0.0, (60, 40))
    assert small is not None
    assert small.bgra.shape == (50, 75, 4)
    assert small.channel_values is None


@pytest.mark.parametrize(
    ("sent", "words"),
    [
        (message(b""), "the image is empty"),
        (message(b"no picture"), "not a JPEG or PNG image"),
        (
            message(b"123", shape=[4, 6], encoding="mono8"),
            "doesn't match an image of 6 x 4 pixels with 1 bytes each",
        ),
        (message(b"123", shape="wide", encoding="bgr8"), "'wide' isn't a valid image shape"),
        (message(b"\x89PNG\r\n\x1a\n" + b"\0" * 40), "the PNG image is damaged"),
    ],
)
def test_invalid_image_gives_an_error_message(sent: Message, words: str) -> None:
    picture, error = decode(sent, 0.0)
    assert picture is None
    assert error is not None
    assert words in error


FAR = 3.4e38
"""Value close to the largest float: the difference from its negative overflows."""


@pytest.mark.parametrize(
    ("values", "low", "high"),
    [
        (np.array([[0.5, 2.0], [np.nan, np.inf]], np.float32), (0, 0), (0, 1)),
        (np.array([[-FAR, FAR], [np.nan, -np.inf]], np.float32), (0, 0), (0, 1)),
        (np.array([[-2.0, 1e300], [np.nan, np.nan]]), (0, 0), (0, 1)),
        (np.array([[-5, 700], [0, 0]], np.int16), (0, 0), (0, 1)),
    ],
)
def test_signed_and_float_values_are_scaled_for_display_and_kept_for_reading(values, low, high) -> None:
    picture, error = decode(
        raw(values, f"{values.dtype.itemsize * 8}{'F' if values.dtype.kind == 'f' else 'S'}C1"), 0
    )
    assert error is None
    assert picture is not None
    assert picture.pixel(high[1], high[0]) == values[high]
    darkest, brightest = picture.bgra[low].tolist(), picture.bgra[high].tolist()
    assert (darkest, brightest) == ([84, 1, 68, 255], [37, 231, 253, 255])  # the ends of the colour scale
    for place in np.argwhere(~np.isfinite(values)):
        assert picture.bgra[tuple(place)].tolist() == [0, 0, 0, 255], "no number is black"


def test_images_with_high_bit_depth_or_only_nan_are_decoded() -> None:
    deep = np.full((4, 6, 3), 0x8000, np.uint16)
    unit = np.full((4, 6, 3), 0.5, np.float32)
    for sent in (raw(deep, "bgr16"), encoded(deep), raw(unit, "32FC3")):
        picture, error = decode(sent, 0.0)
        assert error is None
        assert picture is not None
        assert picture.bgra[0, 0].tolist() == [128, 128, 128, 255]
    for nothing in (np.full((4, 6), np.nan), np.zeros((4, 6, 2)), np.full((4, 6), 7.0)):
        picture, error = decode(raw(nothing, f"64FC{nothing.ndim - 1}"), 0.0)
        assert error is None
        assert picture is not None


def test_downscaled_depth_has_same_brightness_as_full_depth() -> None:
    depth = np.full((400, 600), 1000, np.uint16)
    depth[:, 300:] = 2000
    for sent in (encoded(depth), raw(depth, "mono16"), raw(depth.astype(np.float32), "32FC1")):
        small, _ = decode(sent, 0.0, (60, 40))
        assert small is not None
        assert small.bgra.shape == (50, 75, 4)
        assert small.bgra[20, 70].tolist() == [37, 231, 253, 255]


def test_float_image_cannot_be_encoded_as_png() -> None:
    with pytest.raises(EncodeError, match="can't encode a 'image of float32' as 'png': only integers"):
        encode_png(raw(np.zeros((4, 6), np.float32), "32FC1"))


def png_of_size(side: int) -> Message:
    """Return a small PNG whose header declares an image of `side` x `side` pixels."""
    data = bytearray(cv2.imencode(".png", scene(8, 8))[1].tobytes())
    data[16:24] = side.to_bytes(4, "big") * 2
    data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
    return message(bytes(data))


def test_oversized_image_is_rejected_at_full_and_reduced_size() -> None:
    picture, error = decode(png_of_size(20_000), 0.0)
    assert picture is None
    assert error is not None
    assert "20000 × 20000 pixels are too many" in error  # noqa: RUF001
    assert decode(png_of_size(20_000), 0.0, (320, 240)) == (None, error), "nor for a small view"


def test_header_with_huge_dimensions_is_rejected() -> None:
    jpeg = bytearray(cv2.imencode(".jpg", scene(8, 8))[1].tobytes())
    at = jpeg.index(b"\xff\xc0") + 5  # height and width in the frame header
    jpeg[at : at + 4] = (65_000).to_bytes(2, "big") * 2
    for huge in (png_of_size(60_000), message(bytes(jpeg))):
        picture, error = decode(huge, 0.0)
        assert picture is None
        assert error
        with pytest.raises(DecodeError):
            _ = huge.payload
    with pytest.raises(DecodeError):
        encode_png(message(bytes(jpeg)))


def test_snapshot_is_identical_to_received_image() -> None:
    frame = scene(64, 48)
    png = encoded(frame)
    assert encode_png(png) == bytes(png.data)
    for sent in (raw(frame, "bgr8"), raw(frame[:, :, ::-1].copy(), "rgb8")):
        assert np.array_equal(
            cv2.imdecode(np.frombuffer(encode_png(sent), np.uint8), cv2.IMREAD_UNCHANGED), frame
        )
    jpeg = encoded(frame, "jpg")
    back = cv2.imdecode(np.frombuffer(encode_png(jpeg), np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(back, cv2.imdecode(np.frombuffer(jpeg.data, np.uint8), cv2.IMREAD_COLOR))
    with pytest.raises(DecodeError):
        encode_png(message(b"nothing"))


JPEG = cv2.imencode(".jpg", scene(40, 30))[1].tobytes()
PNG = cv2.imencode(".png", scene(40, 30))[1].tobytes()
ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64)
    | st.floats()
    | st.text(max_size=8)
    | st.binary(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=2),
    max_leaves=6,
)
KINDS = st.sampled_from(["jpeg", "png", "bgr8", "rgb8", "mono8", "tiff", "32FC1", "bgra8", "16SC2", "64FC3"])
SHAPES = st.lists(st.integers(-3, 2**40) | st.integers(0, 6), max_size=4)
SENT = (
    st.binary(max_size=60)
    | st.builds(lambda data, end: data[:end], st.sampled_from([JPEG, PNG]), st.integers(0, 900))
    | st.builds(
        lambda data, at, byte: data[:at] + bytes([byte]) + data[at + 1 :],
        st.sampled_from([JPEG, PNG]), st.integers(0, 60), st.integers(0, 255),
    )
)  # fmt: skip


@given(
    SENT,
    st.fixed_dictionaries({}, optional={"encoding": KINDS | ANYTHING, "shape": SHAPES | ANYTHING}),
    st.none() | st.tuples(st.integers(0, 5000), st.integers(0, 5000)),
)
@settings(max_examples=examples(400), deadline=None)
def test_arbitrary_data_is_decoded_or_rejected_with_error_message(data, extension, fit) -> None:
    with patch.object(image_files, "MAX_PIXELS", 1_000_000):  # one byte can give 100 million pixels: slow
        look_at_a_picture(data, extension, fit)


def look_at_a_picture(data, extension, fit) -> None:
    sent = message(data, **extension)
    picture, error = decode(sent, 0.0, fit)
    assert (picture is None) is isinstance(error, str)
    if picture is not None:
        assert picture.bgra.dtype == np.uint8
        assert picture.bgra.shape[2] == 4
        assert picture.bgra.flags.c_contiguous, "QImage reads it as one piece"
    for read in (lambda: sent.payload, lambda: encode_png(sent)):
        with contextlib.suppress(NepError, OSError):
            read()
