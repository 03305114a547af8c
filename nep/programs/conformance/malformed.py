"""Malformed messages, one for each error code and form of message."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import msgpack  # type: ignore[import-untyped]

from nep.protocol.wire import BATCH, EXTENSION, LATCHED, Header, topic_part

_PUBLISHER_ID = (
    7  # not listed by the master, which distinguishes delivered malformed messages from valid ones
)


def _header(codec: int = 1, flags: int = 0, size: int = 0) -> bytes:
    return Header(codec, flags, 1, 1, _PUBLISHER_ID, size).pack()


def malformed_parts(topic: str) -> Iterator[tuple[str, list[bytes]]]:
    """Yield malformed messages as (error code, parts). The first part starts with the topic."""
    first, header, extension = topic_part(topic), _header(), msgpack.packb({"a": 1})
    yield "part-count", [first]
    yield "part-count", [first, header]
    yield "part-count", [first, header, b"{}", extension]
    yield "part-count", [first, header, b"{}", extension, b""]
    yield "part-count", [first, _header(flags=EXTENSION), b"{}"]
    yield "part-count", [first + header[:20]]
    yield "part-count", [first + _header(flags=EXTENSION) + b"{}"]
    yield "topic-end", [first + b"more", header, b"{}"]
    yield "topic", [first + b"\0", header, b"{}"]
    for size in (0, 1, 31, 33):
        yield "header-size", [first, (header + b"\0")[:size], b"{}"]
    for version in (0, 2, 255):
        yield "version", [first, bytes((version,)) + header[1:], b"{}"]
        yield "version", [first + bytes((version,)) + header[1:] + b"{}"]
    for size in (1, 3, 2**32 - 1):
        yield "payload-size", [first, _header(size=size), b"{}"]
        yield "payload-size", [first + _header(size=size) + b"{}"]
    for part in (
        b"",
        b"\xc1",
        extension + b"\0",
        msgpack.packb([1]),
        msgpack.packb({1: 2}),
        b"\xdf\xff\xff\xff\xff",
    ):
        yield "extension", [first, _header(flags=EXTENSION), b"{}", part]
    yield "extension", [first, _header(flags=EXTENSION), b"{}", b"\x81\xa1a" + b"\x91" * 100 + b"\xc0"]
    yield from _malformed_batches(first)
    for codec in (0, 6, 99, 255):
        yield "codec", [first, _header(codec), b"{}"]
        yield "codec", [first + _header(codec) + b"{}"]


def _malformed_batches(first: bytes) -> Iterator[tuple[str, list[bytes]]]:
    valid_batch = struct.pack("<IIQ", 1, 2, 1) + b"{}"
    yield "batch-form", [first, _header(flags=BATCH, size=len(valid_batch)), valid_batch]
    yield "batch-form", [first + _header(flags=BATCH | LATCHED, size=len(valid_batch)) + valid_batch]
    yield "payload-size", [first + _header(flags=BATCH) + valid_batch]
    yield "payload-size", [first + _header(flags=BATCH, size=len(valid_batch) + 1) + valid_batch]
    for code, body in (
        ("batch-count", b""),
        ("batch-count", struct.pack("<I", 0)),
        ("batch-count", struct.pack("<I", 257) + bytes(20)),
        ("batch-count", struct.pack("<I", 2**32 - 1) + bytes(20)),
        ("batch-table", valid_batch[:10]),
        ("batch-table", struct.pack("<I", 256) + bytes(100)),
        ("batch-sizes", valid_batch + b"more"),
        ("batch-sizes", struct.pack("<IIQ", 1, 2**32 - 1, 1) + b"{}"),
        ("batch-sizes", struct.pack("<IIIQQ", 2, 2**32 - 1, 3, 1, 1) + b"{}"),
    ):
        yield code, [first + _header(flags=BATCH, size=len(body)) + body]
