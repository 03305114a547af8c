"""Images of a hostile program: a few bytes that need gigabytes of memory or minutes to decode."""

from __future__ import annotations

import struct
import zlib

PNG = b"\x89PNG\r\n\x1a\n"
SIDE = 48_000


def chunk(kind: bytes, data: bytes) -> bytes:
    """Return a PNG chunk."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def head(width: int, height: int, depth: int = 8, colour: int = 2) -> bytes:
    """Return the header chunk of a PNG."""
    return chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))


def png(
    width: int, height: int, rows: bytes, *more: bytes, depth: int = 8, colour: int = 2, first: bytes = b""
) -> bytes:
    """Return a PNG of these rows, with additional chunks before its pixels."""
    pixels = chunk(b"IDAT", zlib.compress(rows))
    return PNG + first + head(width, height, depth, colour) + b"".join(more) + pixels + chunk(b"IEND", b"")


def segment(marker: int, data: bytes) -> bytes:
    """Return a JPEG segment."""
    return bytes([0xFF, marker]) + struct.pack(">H", len(data) + 2) + data


def frame(width: int, height: int, marker: int = 0xC0, *, bits: int = 8, colours: int = 3) -> bytes:
    """Return the frame header of a JPEG."""
    parts = b"".join(bytes([each + 1, 0x11, 0]) for each in range(colours))
    return segment(marker, struct.pack(">BHHB", bits, height, width, colours) + parts)


def scan(colours: int = 3) -> bytes:
    """Return the header of a JPEG scan and a few bits of data."""
    parts = b"".join(bytes([each + 1, 0]) for each in range(colours))
    return segment(0xDA, bytes([colours]) + parts + b"\0\x3f\0") + b"\x12\x34"


def jpeg(*parts: bytes) -> bytes:
    """Return a JPEG of these parts."""
    return b"\xff\xd8" + b"".join(parts) + b"\xff\xd9"


def exif(orientation: int, order: str = ">") -> bytes:
    """Return EXIF data with an orientation."""
    mark = b"MM\0*" if order == ">" else b"II*\0"
    entry = struct.pack(f"{order}HHIHH", 0x0112, 3, 1, orientation, 0)
    return b"Exif\0\0" + mark + struct.pack(f"{order}IH", 8, 1) + entry + b"\0\0\0\0"


def bmp(side: int) -> bytes:
    """Return a BMP of 1 kB whose header declares an image of `side` x `side` pixels."""
    info = struct.pack("<IiiHHIIiiII", 40, side, side, 1, 24, 0, 0, 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", 1024, 0, 0, 54) + info + bytes(970)


def gif(side: int) -> bytes:
    """Return a GIF of 35 bytes whose header declares an image of `side` x `side` pixels."""
    size = struct.pack("<HH", side, side)
    return b"GIF89a" + size + b"\0\0\0," + b"\0\0\0\0" + size + b"\0\x02\x02L\x01\0;" + b"\0" * 5


HIDDEN = segment(0xFE, b"")[:2] + b"\x00\x15" + frame(8, 8)  # small header for a parser that skips wrongly

BOMBS = {
    "bmp": bmp(SIDE),
    "gif": gif(SIDE),
    "tiff": b"II*\0" + bytes(200),
    "webp": b"RIFF\x20\0\0\0WEBPVP8L" + bytes(60),
    "pnm": b"P6 48000 48000 255\n" + bytes(20),
    "svg": b"<svg xmlns='http://www.w3.org/2000/svg' width='99999' height='99999'/>",
    "png of many pixels": png(SIDE, SIDE, b"\0"),
    "png of one long row": png(2_000_000_000, 1, b"\0"),
    "png of 16 bits": png(9_500, 12_000, b"\0", depth=16, colour=6),
    "png of one bit": png(SIDE, SIDE, b"\0", depth=1, colour=0),
    "png of no pixels": png(0, 5, b"\0"),
    "png with two heads": png(8, 8, b"\0", head(SIDE, SIDE)),
    "png whose head is hidden": png(SIDE, SIDE, b"\0", first=chunk(b"CgBI", bytes(4)) + head(8, 8)),
    "png of a depth that is none": png(8, 8, b"\0", depth=3, colour=2),
    "png of a chunk of gigabytes": png(8, 8, b"\0").replace(
        struct.pack(">I", len(zlib.compress(b"\0"))) + b"IDAT", b"\xdb\0\0\0IDAT"
    ),
    "png of endless chunks": PNG + head(8, 8) + chunk(b"tEXt", b"") * 100_001,
    "jpeg of many pixels": jpeg(frame(65_000, 65_000), scan()),
    "jpeg of many pixels in refinements": jpeg(frame(10_000, 10_000, 0xC2), scan()),
    "jpeg of many passes": jpeg(frame(4_000, 4_000, 0xC2), scan(1) * 90),
    "jpeg of a thousand passes": jpeg(frame(100, 100, 0xC2), scan(1) * 1000),
    "jpeg of many passes, one colour each": jpeg(frame(4_000, 4_000), scan(1) * 90),
    "jpeg with two heads": jpeg(frame(8, 8), frame(60_000, 60_000), scan()),
    "jpeg with a head behind a marker without length": jpeg(
        b"\xff\x01", HIDDEN, frame(60_000, 60_000), scan()
    ),
    "jpeg with a head behind restarts": jpeg(b"\xff\xd0\xff\xd7", frame(60_000, 60_000), scan()),
    "jpeg with rubbish between": jpeg(b"\0\0", frame(8, 8), scan()),
    "jpeg of endless fill": b"\xff\xd8" + b"\xff" * 5_000_000,
    "jpeg of endless segments": b"\xff\xd8" + b"\xff\xfe\0\2" * 100_001,
    "jpeg whose rows come later": jpeg(frame(60_000, 0), scan(), segment(0xDC, b"\xff\xff")),
    "jpeg of 12 bits": jpeg(frame(8, 8, bits=12), scan()),
    "jpeg without loss": jpeg(frame(8, 8, 0xC3), scan()),
    "jpeg of arithmetic codes": jpeg(frame(8, 8, 0xC9), scan()),
    "jpeg of no colour": jpeg(frame(8, 8, colours=0), scan()),
    "jpeg whose pixels come first": jpeg(scan(), frame(8, 8)),
    "jpeg of a marker nobody knows": jpeg(segment(0xF0, b"\0" * 9), frame(8, 8), scan()),
    "nothing": b"",
    "a word": b"no picture",
}
"""Decompression bombs by name; none may reach a decoder."""
