"""Compression and decompression of chunks, with bounded memory. Performs no input or output.

python-zstandard ignores ``max_output_size`` if a frame declares its size, so the declared size is compared
with the chunk's size before memory is allocated. Other frames are decompressed as a stream with a limit.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from nep.errors import RecordingsUnavailableError
from nep.recordings.formats.limits import max_chunk_bytes
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import lz4.frame as lz4_frame  # type: ignore[import-untyped]
    import zstandard

    from nep.recordings.formats.records import ChunkHead
else:  # optional for programs that don't record
    lz4_frame = lazy_module("lz4.frame")
    zstandard = lazy_module("zstandard")


_ZSTD_LEVEL = 1
"""Compression level with the best throughput.

Compresses joint states in JSON to 40 % at 170 MB/s (lz4: 80 % at 360 MB/s) and skips JPEG at 1200 MB/s.
Higher levels take three times as long without a gain (2 cores, 1 MB chunks).
"""
_MAX_WINDOW_BYTES = 2**27
_STEP_BYTES = 2**20
_PART_STEP_BYTES = 16_384


def check_packages() -> None:
    """Raise `RecordingsUnavailableError` if a package required for recordings is not installed."""
    try:
        import lz4.frame  # noqa: F401, PLC0415 - optional
        import mcap.records  # noqa: F401, PLC0415
        import zstandard  # noqa: F401, PLC0415
    except ImportError as error:
        raise RecordingsUnavailableError("pip install 'nep-studio[recordings]'") from error


def compress(data: bytes, compression: str) -> bytes:
    """Compress the data of a chunk.

    Args:
        data: Data to compress.
        compression: "zstd", "lz4", or "" for none.
    """
    if compression == "zstd":
        return zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress(data)
    if compression == "lz4":
        result: bytes = lz4_frame.compress(data)
        return result
    return data


def decompress(data: memoryview, header: ChunkHead) -> bytes | memoryview:
    """Decompress the records of a chunk, and verify the size and the CRC.

    Memory is limited to the declared size plus one step, and the declared size to `max_chunk_bytes`.

    Args:
        data: Compressed data.
        header: Header of the chunk.

    Raises:
        ValueError: The chunk is damaged or too large.
    """
    size = header.uncompressed_bytes
    if size > max_chunk_bytes(header.data_bytes):
        raise ValueError("too large")
    result: bytes | memoryview
    try:
        if not header.compression:
            result = data
        elif header.compression == "zstd" and zstandard.frame_content_size(data) == size:
            result = zstandard.ZstdDecompressor(max_window_size=_MAX_WINDOW_BYTES).decompress(data)
        else:
            result = _join(_decompress_stream(data, header.compression, size + 1))
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise ValueError(str(error)) from error
    if len(result) != size:
        raise ValueError("size")
    if header.crc and zlib.crc32(result) != header.crc:
        raise ValueError("crc")
    return result


def decompress_partial(data: memoryview, header: ChunkHead) -> bytes | memoryview:
    """Decompress as many records as possible from a truncated chunk, without verification.

    Args:
        data: First bytes of the compressed data.
        header: Header of the chunk.
    """
    if not header.compression:
        return data
    size = min(header.uncompressed_bytes, max_chunk_bytes(header.data_bytes))
    buffer = bytearray()
    try:
        for piece in _decompress_stream(data, header.compression, size, _PART_STEP_BYTES):
            buffer += piece
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
        pass  # pieces before the cut are intact
    return memoryview(buffer)


def _join(pieces: Iterator[bytes]) -> memoryview:
    buffer = bytearray()
    for piece in pieces:
        buffer += piece
    return memoryview(buffer)


def _decompress_stream(
    data: memoryview, compression: str, remaining_bytes: int, step_bytes: int = _STEP_BYTES
) -> Iterator[bytes]:
    # Short steps, so that Ctrl+C can interrupt.
    if compression == "zstd":
        decompressor = zstandard.ZstdDecompressor(max_window_size=_MAX_WINDOW_BYTES)
        with decompressor.stream_reader(data, read_size=step_bytes) as stream:
            while remaining_bytes > 0 and (piece := stream.read(min(step_bytes, remaining_bytes))):
                remaining_bytes -= len(piece)
                yield piece
        return
    with lz4_frame.LZ4FrameDecompressor() as lz4:
        offset = 0
        while remaining_bytes > 0 and not lz4.eof and (offset < len(data) or not lz4.needs_input):
            part = data[offset : offset + step_bytes] if lz4.needs_input else b""
            offset += len(part)
            decoded: bytes = lz4.decompress(part, max_length=min(step_bytes, remaining_bytes))
            remaining_bytes -= len(decoded)
            if decoded:
                yield decoded
