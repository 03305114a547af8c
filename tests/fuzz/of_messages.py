"""Fuzz targets for payloads, images, typed messages and the functions of nep that process payloads."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
from typing import Literal

import orjson

import nep
from nep.errors import DecodeError, EncodeError
from nep.messages import image_codec
from nep.messages.codecs import CODECS, find_nan
from nep.messages.image_files import parse_header
from nep.messages.packing import pack, unpack, unpack_bounded, unpack_first
from nep.messages.typed import TypedReader, message_type, typed_codec
from nep.nodes.log_handler import LogRecord
from nep.patterns.parameters.parameter import NodeParameter, new_parameter
from nep.programs.blackboard.board import Blackboard
from nep.programs.blackboard.keys import key_matches, key_text, parse_key
from nep.programs.bridges.trail import MAX_HOPS, read_trail
from tests.fuzz.target import SEPARATOR, Targets, is_same, joined, map_of, parts_of, text_of, value_of
from tests.nep import bad_pictures

TARGETS = Targets()
VALUE = {"number": 1, "float": 2.5, "list": [None, True, "ñ"], "deep": {"a": {"b": []}}}


def values() -> Iterator[bytes]:
    yield orjson.dumps(VALUE)
    yield pack({**VALUE, "bytes": b"\0\xff", "when": datetime(2026, 1, 2, 3, 4, 5).astimezone()})
    yield b'{"a": NaN, "b": [1e999, -Infinity, 12345678901234567890123], "c": "\\ud800"}'
    yield b"[" * 3 + b"]" * 3


@TARGETS.add(DecodeError, EncodeError, seeds=values, words=(b"NaN", b"\\ud800", b"1e999", b"null"))
def json_codec(data: bytes) -> None:
    codec = CODECS["json"]
    value = codec.decode(memoryview(data), {})
    find_nan(value)
    assert is_same(codec.decode(data, {}), value)
    made = codec.encode(value).data
    # NaN and infinity are sent as null at any depth.
    assert is_same(codec.decode(made, {}), value) or b"null" in made


@TARGETS.add(DecodeError, EncodeError, seeds=lambda: ["ñandú".encode(), b""])
def string_codec(data: bytes) -> None:
    for codec in (CODECS["bytes"], CODECS["string"]):
        assert codec.encode(codec.decode(memoryview(data), {})).data == data


@TARGETS.add(
    DecodeError,
    EncodeError,
    seeds=values,
    words=(b"\xd7\xff", b"\xc7\x0c\xff", b"\xdd\x00\x7f\xff\xff", b"\xdf\xff\xff\xff\xff", b"\xd6\xff"),
)
def msgpack_codec(data: bytes) -> None:
    codec = CODECS["msgpack"]
    value = codec.decode(memoryview(data), {})
    again = codec.decode(codec.encode(value).data, {})
    # A list used as a map key is decoded as a tuple and encoded as a list.
    assert is_same(again, value)


@TARGETS.add(ValueError, seeds=values, words=(b"\x93", b"\xdc\xff\xff"))
def bounded_msgpack(data: bytes) -> None:
    for read in (unpack_first, lambda data: unpack_bounded(data, 100, 50), unpack):
        read(data)


# ---- pictures


def pictures() -> Iterator[bytes]:
    yield bad_pictures.png(2, 2, b"\0abcdef\0abcdef")
    yield bad_pictures.png(2, 2, b"\0ab\0ab", depth=8, colour=0)
    yield bad_pictures.png(2, 2, b"\0" * 18, bad_pictures.chunk(b"tEXt", b"a\0b"))
    yield bad_pictures.jpeg(bad_pictures.frame(2, 2), bad_pictures.scan())
    yield bad_pictures.jpeg(
        bad_pictures.segment(0xE1, bad_pictures.exif(6)), bad_pictures.frame(2, 2), bad_pictures.scan()
    )
    for suffix, kind in (("jpeg", 3), ("png", 3), ("png", 1)):
        import numpy as np

        frame = np.arange(8 * 6 * kind, dtype=np.uint8).reshape((8, 6, kind))
        made = image_codec.ImageFormat(suffix).encode(frame[:, :, 0] if kind == 1 else frame)
        yield bytes(made.data)


JPEG_WORDS = (
    b"\xff\xd8\xff",
    b"\xff\xe1",
    b"\xff\xda",
    b"\xff\xc0",
    b"\xff\xc2",
    b"\xff\xd9",
    b"Exif\0\0",
    b"MM\0*",
)
PNG_WORDS = (b"IHDR", b"IDAT", b"IEND", b"PLTE", b"tRNS", b"acTL", b"fdAT", b"\x89PNG\r\n\x1a\n")


@TARGETS.add(DecodeError, seeds=pictures, words=(*JPEG_WORDS, *PNG_WORDS))
def picture_files(data: bytes) -> None:
    info = image_codec.image_info(data)
    found = parse_header(data)
    assert info == found.extension
    assert 1 <= found.orientation <= 8
    assert len(found.data) <= len(data)


@TARGETS.add(DecodeError, seeds=pictures, words=(*JPEG_WORDS, *PNG_WORDS), slower=8)
def pictures_decoded(data: bytes) -> None:
    found = parse_header(data)
    if found.width * found.height > 1_000_000:
        return  # decoding would slow down the fuzzer
    picture = image_codec.decode(memoryview(data), {})
    assert picture.shape[:2] == (found.height, found.width)


def raw_pictures() -> Iterator[bytes]:
    yield joined([pack({"shape": [2, 2, 3], "encoding": "bgr8"}), b"x" * 12])
    yield joined([pack({"shape": [2, 2], "encoding": "mono16"}), b"x" * 8])
    yield joined([pack({"shape": [1, 2], "encoding": "32FC1"}), b"x" * 8])


@TARGETS.add(DecodeError, seeds=raw_pictures, words=(b"bgr8", b"rgba8", b"64FC4", b"8UC1", SEPARATOR))
def raw_pictures_decoded(data: bytes) -> None:
    first, *rest = parts_of(data)
    picture = CODECS["image"].decode(memoryview(b"".join(rest)), map_of(first))
    assert picture.ndim in {2, 3}


# ---- typed messages


class Colour(Enum):
    """Enum as a field of `Everything`."""

    RED = "red"
    ONE = 1


@dataclass
class Point:
    """Nested dataclass as a field of `Everything`."""

    x: float
    y: float = 0.0


@dataclass
class Everything:
    """Dataclass with one field of each supported kind."""

    number: int
    real: float = 1.0
    text: str = ""
    truth: bool = False
    at: Point = field(default_factory=lambda: Point(1.0))
    points: list[Point] = field(default_factory=list)
    pair: tuple[int, str] = (1, "")
    named: dict[str, float] = field(default_factory=dict)
    some: int | str | None = None
    choice: Literal["a", 2] = "a"
    colour: Colour = Colour.RED
    when: datetime | None = None
    other: object = None


def typed() -> Iterator[bytes]:
    codec = typed_codec(message_type(Everything), CODECS["json"])
    when = datetime(2026, 1, 2).astimezone()
    whole = Everything(
        1, 2.5, "ñ", True, Point(1.0), [Point(2.0)], (3, "x"), {"a": 1.0}, "b", 2, Colour.ONE, when
    )
    yield bytes(codec.encode(whole).data)
    yield b'{"number": 1, "real": null, "when": "2026-01-02", "some": 5}'


TYPE_WORDS = tuple(
    f'"{name}":'.encode() for name in ("number", "real", "at", "points", "pair", "when", "other")
)


@TARGETS.add(DecodeError, EncodeError, seeds=typed, words=TYPE_WORDS)
def typed_messages(data: bytes) -> None:
    declared = message_type(Everything)
    decode = TypedReader(declared)._decoder(CODECS["json"].decode)
    value = decode(data, {})
    assert isinstance(value, Everything)
    made = typed_codec(declared, CODECS["json"]).encode(value)
    assert is_same(decode(made.data, {}), value) or b"null" in made.data


@TARGETS.add(
    DecodeError, EncodeError, seeds=lambda: [b'{"header":{"stamp":{"sec":1,"nanosec":2}},"range":1.5}']
)
def typed_messages_of_ros(data: bytes) -> None:
    for kind in (nep.sensor.Range, nep.geometry.Pose, nep.geometry.Twist):
        value = TypedReader(message_type(kind))._decoder(CODECS["json"].decode)(data, {})
        assert isinstance(value, kind)


# ---- payloads of nep's own topics


def records() -> Iterator[bytes]:
    yield orjson.dumps({"level": "WARN", "text": "x", "stamp_ns": 5, "file": "a.py", "line": 3, "pid": 4})
    yield b'{"level": [1], "stamp_ns": 1e300, "line": true, "pid": -1}'


@TARGETS.add(seeds=records, words=(b'"stamp_ns":', b'"level":', b'"line":'))
def log_records(data: bytes) -> None:
    record = LogRecord.from_plain(value_of(data), 7)
    assert 0 <= record.stamp_ns < 2**63
    assert isinstance(record.text, str)


def trails() -> Iterator[bytes]:
    yield orjson.dumps({"bridge": {"networks": ["a", "b"], "bridges": ["c"]}})


@TARGETS.add(seeds=trails, words=(b'"networks":', b'"bridges":'))
def trails_of_bridges(data: bytes) -> None:
    trail = read_trail(map_of(data))
    assert len(trail.networks) <= MAX_HOPS + 2
    assert len(trail.bridges) <= MAX_HOPS + 2
    trail.may_forward("network", "bridge")
    assert read_trail({"bridge": trail.to_plain()}) == trail


@TARGETS.add(
    nep.NepError,
    seeds=lambda: [b"human.1.position", b"file.a\\.txt", b"**.x", b"a\\\\.b"],
    words=(b"\\.", b"\\\\"),
)
def keys(data: bytes) -> None:
    key = parse_key(text_of(data))
    assert key_text(key).encode()
    assert parse_key(key_text(key)) == key
    assert key_matches(("**",), key)
    assert parse_key(key) == key


def entries() -> Iterator[bytes]:
    yield orjson.dumps({"human": {"1": {"position": [1, 2]}}, "robot.pose": {"x": 1.5}})


@TARGETS.add(nep.NepError, seeds=entries, words=(b'"a.b":', b"\\ud800", b"{}"), slower=2)
def blackboard_values(data: bytes) -> None:
    board = Blackboard(max_keys=20, max_bytes=10_000)
    for key, value in map_of(data).items():
        board.put(key, value, lives_s=5.0)
        json.dumps(list(board.keys()))
        board.get(key, None)
    assert len(board.keys()) <= 20


def settings_of_parameters() -> Iterator[bytes]:
    yield b'{"whole": 3, "real": 2.5, "text": "x", "one": "a", "truth": true}'


@TARGETS.add(nep.NepError, seeds=settings_of_parameters, words=(b'"whole":', b'"real":', b"1e999"))
def parameter_values(data: bytes) -> None:
    known = {
        "whole": parameter("whole", 3, minimum=0, maximum=10),
        "real": parameter("real", 0.5, minimum=-1.0),
        "text": parameter("text", ""),
        "one": parameter("one", "a", choices=["a", "b"]),
        "truth": parameter("truth", False),
    }
    for name, value in map_of(data).items():
        if name in known:
            orjson.dumps(known[name].with_value(value).as_map())


def parameter(name: str, default: object, **limits: object) -> NodeParameter:
    every = {
        "kind": None,
        "description": "",
        "minimum": None,
        "maximum": None,
        "choices": (),
        "is_read_only": False,
    }
    return new_parameter(name, default, **{**every, **limits})
