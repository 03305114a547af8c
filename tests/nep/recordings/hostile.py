"""MCAP files with false sizes, counts and offsets, built record by record."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
HUGE = 600 * 2**20
"""Size in bytes beyond the memory that a test may use; compressed it takes 55 kB."""
TIMES = (10**9, 2 * 10**9)


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value: str | bytes) -> bytes:
    whole = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(whole)) + whole


def pairs(values: Mapping[str, str]) -> bytes:
    return text(b"".join(text(key) + text(value) for key, value in values.items()))


HEADER = record(1, text("") + text("hostile"))


def channel(number: int = 1, topic: str = "/t", encoding: str = "json") -> bytes:
    return record(4, struct.pack("<HH", number, 0) + text(topic) + text(encoding) + pairs({}))


def message(number: int = 1, log_ns: int = 10**9, data: bytes = b'{"a":1}') -> bytes:
    return record(5, struct.pack("<HIQQ", number, 0, log_ns, log_ns) + data)


def chunk(
    packed: bytes, size: int, compression: str = "zstd", crc: int = 0, times: tuple[int, int] = TIMES
) -> bytes:
    head = struct.pack("<QQQI", *times, size, crc) + text(compression) + struct.pack("<Q", len(packed))
    return record(6, head + packed)


def chunk_of(data: bytes) -> bytes:
    return chunk(zstandard.ZstdCompressor(level=1).compress(data), len(data))


def chunk_index(offset: int, length: int) -> bytes:
    content = struct.pack("<QQQQ", *TIMES, offset, length) + text(b"") + struct.pack("<Q", 0)
    return record(8, content + text("zstd") + struct.pack("<QQ", 0, 0))


def statistics(count: int = 1) -> bytes:
    counts = text(struct.pack("<HQ", 1, count))
    return record(11, struct.pack("<QHIIIIQQ", count, 0, 1, 0, 0, 1, *TIMES) + counts)


def metadata(name: str, values: Mapping[str, str]) -> bytes:
    return record(12, text(name) + pairs(values))


def attachment(name: str, size: int, data: bytes) -> bytes:
    head = struct.pack("<QQ", 1, 1) + text(name) + text("text/plain") + struct.pack("<Q", size)
    return record(9, head + data + struct.pack("<I", 0))


def footer(summary_start: int) -> bytes:
    return record(2, struct.pack("<QQI", summary_start, 0, 0)) + MAGIC


def closed(data: bytes, summary: Callable[[int], bytes] | bytes = b"") -> bytes:
    """Return a complete file with this data; `summary` is called with the offset of the data."""
    start = MAGIC + HEADER
    made = start + data + record(15, bytes(4))
    told = summary(len(start)) if callable(summary) else summary
    return made + told + footer(len(made) if told else 0)


@cache
def zstd_zeros(size: int, *, states_size: bool = True) -> bytes:
    compressor = zstandard.ZstdCompressor(level=1).compressobj(size=size if states_size else -1)
    block, pieces, left = bytes(2**24), [], size
    while left:
        some = min(left, len(block))
        pieces.append(compressor.compress(block[:some]))
        left -= some
    return b"".join([*pieces, compressor.flush()])


def _one_chunk(packed: bytes, size: int, compression: str = "zstd", crc: int = 0, times: int = 1) -> bytes:
    one, first = chunk(packed, size, compression, crc), channel()
    return closed(
        first + one, lambda at: first + statistics() + chunk_index(at + len(first), len(one)) * times
    )


def files() -> dict[str, Callable[[], bytes]]:
    """Return the function that builds each file, by name."""
    claims_12_gb = b"\x28\xb5\x2f\xfd" + bytes([0b11100000]) + struct.pack("<Q", 12 * 2**30) + b"\x01\0\0"
    begin = MAGIC + HEADER + channel()
    return {
        "zstd frame larger than its chunk states": lambda: _one_chunk(zstd_zeros(HUGE), 1000),
        "zstd frame without a size": lambda: _one_chunk(zstd_zeros(HUGE, states_size=False), 1000),
        "zstd frame that states 12 GB": lambda: _one_chunk(claims_12_gb, 1000),
        "chunk that states 600 MB and has them": lambda: _one_chunk(zstd_zeros(HUGE), HUGE),
        "chunk that states 2^63": lambda: _one_chunk(b"", 2**63),
        "lz4 frame larger than its chunk states": lambda: _one_chunk(_lz4_zeros(), 1000, "lz4"),
        "lz4 chunk of 300 MB": lambda: _one_chunk(_lz4_zeros(), 300 * 2**20, "lz4"),
        "3 000 entries for one chunk": lambda: _one_chunk(zstd_zeros(2**26), 2**26, times=3000),
        "not closed, chunk too large": lambda: begin + chunk(zstd_zeros(HUGE), 1000),
        "not closed, damaged chunk too large": lambda: (
            begin + chunk(zstd_zeros(HUGE), HUGE, crc=1234) + chunk_of(message())
        ),
        "100 chunks of 16 MB": lambda: begin + chunk(zstd_zeros(2**24), 2**24) * 100,
        "record of 2^63 bytes": lambda: begin + struct.pack("<BQ", 6, 2**63) + bytes(100),
        "attachment that states 2^63": lambda: closed(
            channel() + attachment("a", 2**63, b"x" * 1000) + chunk_of(message())
        ),
        "empty records, 210 000": lambda: MAGIC + record(12, b"") * 210_000,
        "one channel 210 000 times": lambda: MAGIC + channel() * 210_000,
        "one metadata record 1 500 times": _many_metadata,
        "3 000 channels": many_channels,
        "chunk of empty records": lambda: begin + chunk_of(record(0x80, b"") * 300_000),
        "all chunks at all times": lambda: (
            begin
            + b"".join(chunk(data, len(data), "", times=(0, 2**64 - 1)) for data in [_messages(1000)] * 20)
        ),
    }


def _messages(count: int) -> bytes:
    return b"".join(message(log_ns=10**9 + number, data=b'{"a":1}') for number in range(count))


@cache
def _lz4_zeros() -> bytes:
    made: bytes = lz4.frame.compress(bytes(300 * 2**20))
    return made


def _many_metadata() -> bytes:
    one, first, data = metadata("n", {str(n): "v" for n in range(5_000)}), channel(), chunk_of(message())

    def summary(at: int) -> bytes:
        index = record(13, struct.pack("<QQ", at, len(one)) + text("n"))
        chunks = chunk_index(at + len(one) + len(first), len(data))
        return first + statistics() + chunks + index * 1500

    return closed(one + first + data, summary)


def many_channels(count: int = 3_000) -> bytes:
    """Return a file with `count` topics and one message on each."""
    numbers = range(1, count + 1)
    channels = b"".join(channel(number, f"/t{number}/{'x' * 200}") for number in numbers)
    data = chunk_of(b"".join(map(message, numbers)))
    return closed(
        channels + data,
        lambda at: channels + statistics() + chunk_index(at + len(channels), len(data)),
    )


def write_all(folder: Path) -> list[Path]:
    paths = []
    for name, make in files().items():
        paths.append(folder / f"{name}.mcap")
        paths[-1].write_bytes(make())
    return paths
