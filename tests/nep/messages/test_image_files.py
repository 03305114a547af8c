"""Tests of image files: their bytes are validated before decoding, with one pixel limit for all formats."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nep.errors import DecodeError, EncodeError
from nep.messages import image_codec
from nep.messages.codecs import codec
from nep.messages.image_files import MAX_PIXELS, check_size, parse_header
from tests.examples import examples
from tests.nep import bad_pictures as bad

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("name", sorted(bad.BOMBS))
def test_decompression_bomb_is_rejected_before_decoding(name: str) -> None:
    data = bad.BOMBS[name]
    with pytest.raises(DecodeError) as caught:
        parse_header(data)
    assert caught.value.size_bytes == len(data)
    assert image_codec.image_info(data) is None
    with pytest.raises(EncodeError):
        codec("image").encode(data)


CHILD = """
import json, resource, sys, time
import cv2, numpy
from app.core.messages.picture import decode, encode_png
from nep.errors import NepError
from nep.messages.message import Message
from tests.nep.bad_pictures import BOMBS

used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 300_000_000,) * 2)
said = {}
for name, data in BOMBS.items():
    for told in ({}, {"encoding": "jpeg", "shape": [8, 8, 3]}, {"encoding": "png", "shape": [8, 8, 3]}):
        message = Message("/c", data, "image", "image", extension=told)
        for read in (lambda: message.payload, lambda: encode_png(message)):
            try:
                read()
                said[name] = "was read"
            except NepError:
                pass
        if decode(message, 0.0, (320, 240))[0] is not None or decode(message, 0.0)[0] is not None:
            said[name] = "was shown"
print(json.dumps(said))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_AS is kept by Linux alone")
def test_decompression_bombs_use_little_memory_in_library_and_studio() -> None:
    done = subprocess.run(
        [sys.executable, "-c", CHILD],
        capture_output=True,
        text=True,
        cwd=REPOSITORY,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert json.loads(done.stdout) == {}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("bmp", "BMP files aren't supported; use JPEG or PNG"),
        ("gif", "GIF files aren't supported; use JPEG or PNG"),
        ("png of many pixels", "48000 × 48000 pixels are too many; the limit is 120 million"),  # noqa: RUF001
        ("png of 16 bits", "9500 × 12000 pixels need 1824 MB; the limit is 750 MB"),  # noqa: RUF001
        ("jpeg of many passes", "4000 × 4000 pixels in 90 passes take too long to decode"),  # noqa: RUF001
        ("png of a chunk of gigabytes", "the PNG image is damaged: the data is truncated"),
        ("png with two heads", "the PNG image is damaged: two header chunks"),
        ("jpeg of 12 bits", "JPEG images with 12 bits per channel aren't supported"),
        ("nothing", "the image is empty"),
        ("a word", "not a JPEG or PNG image"),
    ],
)
def test_rejected_image_error_states_the_reason(name: str, words: str) -> None:
    with pytest.raises(DecodeError) as caught:
        parse_header(bad.BOMBS[name])
    assert words in str(caught.value)


def test_pixel_limit_applies_to_decoding_and_encoding() -> None:
    check_size(MAX_PIXELS // 1000, 1000, 3, 0)
    with pytest.raises(DecodeError):
        check_size(MAX_PIXELS // 1000 + 1, 1000, 3, 0)
    with pytest.raises(EncodeError, match="too many"):
        codec("image").encode(np.broadcast_to(np.uint8(0), (12_000, 12_000)))


def scene() -> np.ndarray:
    frame = np.zeros((20, 40, 3), np.uint8)
    frame[:, :20] = (10, 20, 200)
    frame[:6, :6] = (200, 180, 40)
    return frame


def test_png_text_profile_and_animation_chunks_are_stripped() -> None:
    plain = cv2.imencode(".png", scene())[1].tobytes()
    bomb = zlib.compress(bytes(1_000_000))
    more = (
        bad.chunk(b"zTXt", b"a\0\0" + bomb), bad.chunk(b"iTXt", b"x" * 1_000_000),
        bad.chunk(b"iCCP", b"p\0\0" + bomb),
        bad.chunk(b"acTL", struct.pack(">II", 1_000_000, 0)), bad.chunk(b"fcTL", bytes(26)),
    )  # fmt: skip
    file = parse_header(plain[:33] + b"".join(more) + plain[33:] + b"rubbish behind its end")
    assert bytes(file.data) == plain
    assert file.extension == {"shape": [20, 40, 3], "encoding": "png"}
    assert parse_header(plain).data is plain, "what has nothing to be left out is not copied"


@pytest.mark.parametrize("order", [">", "<"])
@pytest.mark.parametrize("kind", ["jpeg", "png"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_applied_on_decode(kind: str, orientation: int, order: str) -> None:
    made = cv2.imencode(f".{kind}", scene())[1].tobytes()
    told = bad.exif(orientation, order)
    if kind == "jpeg":
        made = made[:2] + bad.segment(0xE1, told) + made[2:]
    else:
        made = made[:33] + bad.chunk(b"eXIf", told[6:]) + made[33:]
    read = codec("image").decode(memoryview(made), {})
    assert isinstance(read, np.ndarray)
    assert np.array_equal(read, cv2.imdecode(np.frombuffer(made, np.uint8), cv2.IMREAD_COLOR))
    assert image_codec.image_info(made) == {"shape": list(read.shape), "encoding": kind}


def test_progressive_jpeg_and_jpeg_with_restart_markers_are_decoded() -> None:
    for option in ([cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 1]):
        data = cv2.imencode(".jpg", scene(), option)[1].tobytes()
        read = codec("image").decode(memoryview(data), {"encoding": "png", "shape": [999_999, 999_999, 3]})
        assert np.array_equal(read, cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))


JPEG = cv2.imencode(".jpg", scene())[1].tobytes()
FILE_PNG = cv2.imencode(".png", scene())[1].tobytes()


@given(
    st.sampled_from([JPEG, FILE_PNG, *bad.BOMBS.values()]),
    st.lists(st.tuples(st.integers(0, 700), st.integers(0, 255)), max_size=4),
    st.integers(0, 2000),
)
@settings(max_examples=examples(300), deadline=None)
def test_decoded_image_has_the_size_in_its_header_despite_corruption(
    data: bytes, changes: list[tuple[int, int]], end: int
) -> None:
    changed = bytearray(data[:2000])
    for at, byte in changes:
        changed[at : at + 1] = bytes([byte])
    try:
        file = parse_header(bytes(changed[:end]))
        read = image_codec.decode_file(file)
    except DecodeError:
        return
    assert read.shape[:2] == (file.height, file.width)
    assert read.size <= 3 * MAX_PIXELS
