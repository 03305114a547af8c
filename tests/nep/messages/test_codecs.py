"""Tests of the codecs: round trips and the errors for unsupported payloads."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import subprocess
import sys
import uuid
from datetime import date, datetime, time, timedelta, timezone
from enum import Enum

import cv2
import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nep.errors import DecodeError, EncodeError
from nep.messages import image_codec
from nep.messages.codecs import CODECS, codec, codec_by_number, codec_for

TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
SMALL = st.integers(-(2**63), 2**63 - 1)
JSON = st.recursive(
    st.none() | st.booleans() | SMALL | st.floats(allow_nan=False, allow_infinity=False) | TEXT,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=4),
    max_leaves=20,
)
TIMES = st.datetimes(timezones=st.sampled_from([timezone.utc, timezone(timedelta(hours=-9, minutes=-30))]))
PLAIN = st.none() | st.booleans() | SMALL | st.integers(0, 2**64 - 1) | st.floats(allow_nan=False) | TEXT
KEYS = st.recursive(
    PLAIN | st.binary(max_size=8) | TIMES, lambda inner: st.lists(inner, max_size=3).map(tuple), max_leaves=4
)
MSGPACK = st.recursive(
    PLAIN | st.binary(max_size=20) | TIMES,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=20,
)
PAYLOADS = {"json": JSON, "string": TEXT, "bytes": st.binary(), "msgpack": MSGPACK}


def back(name: str, payload: object) -> object:
    data, extension = codec(name).encode(payload)
    return codec(name).decode(memoryview(data), extension or {})


@pytest.mark.parametrize("name", sorted(PAYLOADS))
def test_payloads_round_trip(name: str) -> None:
    @given(PAYLOADS[name])
    def check(payload: object) -> None:
        assert back(name, payload) == payload

    check()


@pytest.mark.parametrize("name", sorted(CODECS))
@given(data=st.binary(max_size=200))
def test_arbitrary_bytes_decode_or_raise_decode_error(name: str, data: bytes) -> None:
    with contextlib.suppress(DecodeError):
        codec(name).decode(memoryview(data), {})


def test_codecs_are_found_by_name_number_and_message_type() -> None:
    assert [codec(name) for name in CODECS] == list(CODECS.values())
    assert [codec_by_number(number) for number in range(1, 6)] == list(CODECS.values())
    assert codec_by_number(99) is None
    assert codec_for("robot/description").name == codec_for("dictionary").name == "json"
    assert codec_for("images").name == "image"
    with pytest.raises(DecodeError, match="did you mean 'json'"):
        codec("jason")


def test_json_encodes_numpy_values_number_keys_and_dataclasses() -> None:
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


def test_json_encodes_nan_as_null_and_decodes_nan_literals() -> None:
    assert back("json", [math.nan, math.inf]) == [None, None]
    value = codec("json").decode(memoryview(b'{"a": NaN}'), {})
    assert isinstance(value, dict)
    assert math.isnan(value["a"])


class Mood(Enum):
    HAPPY = "happy"


@dataclasses.dataclass(frozen=True)
class Place:
    x: float
    when: datetime


def test_msgpack_encodes_json_compatible_types_and_preserves_datetimes() -> None:
    moment = datetime(2026, 11, 22, 16, 30, 0, 123456, timezone.utc)
    payload = {
        "place": Place(math.inf, moment), "day": date(2026, 11, 22), "at": time(16, 30), "mood": Mood.HAPPY,
        "id": uuid.UUID(int=7), "array": np.arange(3), "scalar": np.float32(0.5), "bytes": b"\x00",
    }  # fmt: skip
    assert back("msgpack", payload) == {
        "place": {"x": math.inf, "when": moment}, "day": "2026-11-22", "at": "16:30:00", "mood": "happy",
        "id": "00000000-0000-0000-0000-000000000007", "array": [0, 1, 2], "scalar": 0.5, "bytes": b"\x00",
    }  # fmt: skip
    nan = back("msgpack", math.nan)
    assert isinstance(nan, float)
    assert math.isnan(nan)


def test_naive_datetime_is_encoded_as_local_time() -> None:
    moment = datetime(2026, 11, 22, 16, 30, 0, 5)  # noqa: DTZ001 - that is what is tried
    assert back("msgpack", moment) == moment.astimezone(timezone.utc)


@pytest.mark.parametrize(
    ("data", "moment"),
    [  # the three timestamp formats of msgpack's specification
        ("d6ff5a4af6a5", datetime(2018, 1, 2, 3, 4, 5, tzinfo=timezone.utc)),
        ("d7ff3b9ac9fc5a4af6a5", datetime(2018, 1, 2, 3, 4, 5, 249999, tzinfo=timezone.utc)),
        ("c70cff00000000fffffffffffffff6", datetime(1969, 12, 31, 23, 59, 50, tzinfo=timezone.utc)),
    ],
)
def test_msgpack_timestamps_of_other_languages_are_decoded(data: str, moment: datetime) -> None:
    assert codec("msgpack").decode(memoryview(bytes.fromhex(data)), {}) == moment
    assert (
        codec("msgpack").encode(datetime(2018, 1, 2, 3, 4, 5, tzinfo=timezone.utc)).data.hex()
        == "d6ff5a4af6a5"
    )


@pytest.mark.parametrize("seconds", [2**63 - 1, -(2**63), 2**40])
def test_timestamp_out_of_datetime_range_is_kept_as_msgpack_timestamp(seconds: int) -> None:
    stamp = msgpack.Timestamp(seconds, 7)
    assert back("msgpack", {"t": stamp, (1, (2,)): 3}) == {"t": stamp, (1, (2,)): 3}


@given(st.binary(max_size=40))
def test_arbitrary_bytes_after_timestamp_or_map_header_decode_or_raise_decode_error(data: bytes) -> None:
    for head in (b"\xd6\xff", b"\xd7\xff", b"\xc7\x0c\xff", b"\x81\x91", b"\x82\x81", b"\x91\xc7"):
        with contextlib.suppress(DecodeError):
            codec("msgpack").decode(memoryview(head + data), {})


@pytest.mark.parametrize(
    ("name", "payload", "sentence"),
    [
        ("json", {1, 2}, "can't encode a 'set' as 'json': 'set' can't be encoded as JSON"),
        ("json", {"a": object()}, "can't encode a 'dict' as 'json': 'object' can't be encoded as JSON"),
        ("string", 5, "can't encode a 'int' as 'string': publish a 'str'"),
        ("string", "\ud800", "unpaired surrogate"),
        ("bytes", "text", "can't encode a 'str' as 'bytes': publish 'bytes'"),
        ("msgpack", {"a": {1}}, "can't encode a 'dict' as 'msgpack': 'set' can't be encoded as JSON"),
        ("msgpack", 2**70, "can't encode a 'int' as 'msgpack'"),
        ("image", "text", "publish a 'uint8' array"),
        ("image", b"text", "not a JPEG or PNG image"),
        ("image", np.zeros((2, 2, 3), bool), "the elements are 'bool'; use uint8, int8, uint16"),
        ("image", np.zeros((2, 2, 3), np.complex64), "the elements are 'complex64'; use uint8"),
        ("image", np.zeros((2, 2, 5), np.uint8), r"\(2, 2, 5\) isn't a valid image shape"),
        ("image", np.zeros((2,), np.uint8), r"\(2,\) isn't a valid image shape"),
        ("image", np.zeros((0, 5, 3), np.uint8), r"\(0, 5, 3\) isn't a valid image shape"),
    ],
)
def test_unsupported_payload_raises_encode_error(name: str, payload: object, sentence: str) -> None:
    with pytest.raises(EncodeError, match=sentence):
        codec(name).encode(payload)


def test_self_referencing_payload_raises_encode_error() -> None:
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


def test_image_array_is_published_as_jpeg(picture: np.ndarray) -> None:
    data, extension = codec("image").encode(picture)
    assert extension == {"shape": [48, 64, 3], "encoding": "jpeg"}
    assert image_codec.image_info(data) == extension
    read = back("image", picture)
    assert isinstance(read, np.ndarray)
    assert (read.shape, read.dtype) == ((48, 64, 3), np.uint8)
    assert np.abs(read.astype(int) - picture).mean() < 4
    assert np.array_equal(codec("image").decode(memoryview(data), {}), read)  # type: ignore[arg-type]


def test_raw_image_round_trip_is_lossless(picture: np.ndarray) -> None:
    def read(encoded: image_codec.Encoded) -> object:
        return codec("image").decode(memoryview(encoded.data), encoded.extension or {})

    assert np.array_equal(read(image_codec.raw_image(picture)), picture)  # type: ignore[arg-type]
    assert np.array_equal(read(image_codec.raw_image(picture[::2, ::2])), picture[::2, ::2])  # type: ignore[arg-type]
    rgb = codec("image").decode(
        memoryview(picture[:, :, ::-1].tobytes()), {"shape": [48, 64, 3], "encoding": "rgb8"}
    )
    assert np.array_equal(rgb, picture)  # type: ignore[arg-type]


NUMBERS = ("uint8", "int8", "uint16", "int16", "int32", "float32", "float64")
SHAPES = ((3, 5), (3, 5, 1), (3, 5, 2), (3, 5, 3), (3, 5, 4), (1, 1), (1, 7, 3))


def numbers_of(kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return an array with the extreme values of its type; for floats, with -infinity and NaN."""
    made = np.random.default_rng(1).integers(0, 100, shape).astype(kind)
    least, most = (np.iinfo(kind).min, np.iinfo(kind).max) if made.dtype.kind in "iu" else (-np.inf, np.nan)
    made.flat[0], made.flat[-1] = least, most
    return made


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", NUMBERS)
def test_any_dtype_and_channel_count_round_trips_losslessly(kind: str, shape: tuple[int, ...]) -> None:
    made = numbers_of(kind, shape)
    wanted = made[:, :, 0] if shape[2:] == (1,) else made
    sent = [image_codec.raw_image(made), image_codec.raw_image(made.astype(made.dtype.newbyteorder(">")))]
    if kind != "uint8" or shape[2:] in ((2,), (4,)):  # all images that aren't encoded as JPEG
        sent.append(codec("image").encode(made))
        sent.append(codec("image").encode(np.asfortranarray(made)))
    for data, extension in sent:
        assert extension is not None
        assert extension["shape"] == [*wanted.shape[:2], 1 if wanted.ndim == 2 else shape[2]]
        read = codec("image").decode(memoryview(data), extension)
        assert isinstance(read, np.ndarray)
        assert read.dtype == np.dtype(kind)
        assert np.array_equal(read, wanted, equal_nan=kind.startswith("float"))


@pytest.mark.parametrize(
    ("made", "encodings"),
    [
        (np.zeros((2, 3), np.uint8), ("jpeg", "mono8")),
        (np.zeros((2, 3, 3), np.uint8), ("jpeg", "bgr8")),
        (np.zeros((2, 3, 4), np.uint8), ("png", "bgra8")),
        (np.zeros((2, 3), np.uint16), ("png", "mono16")),
        (np.zeros((2, 3, 3), np.uint16), ("png", "bgr16")),
        (np.zeros((2, 3), np.float32), ("32FC1", "32FC1")),
        (np.zeros((2, 3, 2), np.float64), ("64FC2", "64FC2")),
        (np.zeros((2, 3), np.int16), ("16SC1", "16SC1")),
    ],
)
def test_image_encoding_depends_on_dtype_and_channels(made: np.ndarray, encodings: tuple[str, str]) -> None:
    sent = codec("image").encode(made), image_codec.raw_image(made)
    assert tuple((extension or {})["encoding"] for _, extension in sent) == encodings


def test_greyscale_jpeg_keeps_one_channel(picture: np.ndarray) -> None:
    for grey in (picture[:, :, 0], picture[:, :, :1]):
        read = back("image", grey)
        assert isinstance(read, np.ndarray)
        assert (read.shape, read.dtype) == ((48, 64), np.uint8)
        assert np.abs(read.astype(int) - picture[:, :, 0]).mean() < 4


@pytest.mark.parametrize(("encoding", "kind"), [("rgb8", "uint8"), ("rgba8", "uint8"), ("rgb16", "<u2")])
def test_rgb_images_are_decoded_as_bgr(encoding: str, kind: str) -> None:
    channels = 4 if "a" in encoding else 3
    made = np.arange(4 * 5 * channels, dtype=kind).reshape(4, 5, channels)
    data = memoryview(made[:, :, [2, 1, 0, 3][:channels]].tobytes())
    read = codec("image").decode(data, {"shape": [4, 5, channels], "encoding": encoding})
    assert np.array_equal(read, made)  # type: ignore[arg-type]


@pytest.mark.parametrize("ending", ["jpeg", "png"])
def test_encoded_image_files_are_published_unchanged(picture: np.ndarray, ending: str) -> None:
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
        (b"abc", {"shape": [1, 1, 1], "encoding": "32FC1"}),
        (b"abcd", {"shape": [1, 1], "encoding": "32FC5"}),
        (b"", {"shape": [0, 2**64], "encoding": "mono8"}),
    ],
)
def test_corrupt_images_raise_decode_error(data: bytes, extension: dict[str, object]) -> None:
    with pytest.raises(DecodeError):
        codec("image").decode(memoryview(data), extension)


def test_json_encoding_of_unsupported_or_encoded_payloads_does_not_import_numpy():
    """orjson imports numpy inside `publish`, which stalled a publisher for 0.1 s at its first subscriber."""
    code = (
        "import sys\n"
        "from nep.messages.codecs import JSON, Encoded, fast_encoder\n"
        "for encode in (JSON.encode, fast_encoder(JSON)):\n"
        "    for payload in ({1, 2}, Encoded(b'1')):\n"
        "        try: encode(payload)\n"
        "        except Exception: pass\n"
        "assert 'orjson' in sys.modules\n"
        "sys.exit('numpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
