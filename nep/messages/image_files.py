"""Headers and size limits of JPEG and PNG files, checked without decoding.

Call `parse_header` before decoding a file: a file of a few bytes may declare pixels of several gigabytes,
or a thousand scans. The format is detected from the bytes, never taken from metadata. Only JPEG and PNG are
supported: each decoder of another format would add to the attack surface.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from nep.errors import DecodeError
from nep.i18n import _, number

MAX_PIXELS = 120_000_000
"""Maximum number of pixels; more than any camera of a robot has."""
MAX_BYTES = 750_000_000
"""Maximum memory in bytes for the pixels and the decoder's buffers."""
_DECODER_COPIES = 2
"""Copies of the pixels that OpenCV holds while decoding (measured with 4.14, JPEG and PNG)."""
MAX_SCANS = 100
"""Maximum number of scans in a progressive JPEG. Encoders write about ten."""
MAX_SCANNED_PIXELS = 1_200_000_000
"""Maximum number of pixels times number of scans, which limits decoding to a few seconds."""
MAX_SEGMENTS = 100_000
"""Maximum number of JPEG segments or PNG chunks. Encoders write segments of 8 kB and more."""

_JPEG_SIGNATURE = b"\xff\xd8\xff"
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_UNSUPPORTED_FORMATS = {
    b"GIF8": "GIF", b"BM": "BMP", b"RIFF": "WebP", b"II*\0": "TIFF", b"MM\0*": "TIFF", b"<svg": "SVG",
    b"<?xml": "SVG", b"\0\0\0\x0cjP": "JPEG 2000", b"\xff\x4f\xff\x51": "JPEG 2000",
    b"\x76\x2f\x31\x01": "OpenEXR", b"#?RAD": "HDR", b"P4": "PNM", b"P5": "PNM", b"P6": "PNM",
    b"P7": "PNM", b"PF": "PNM",
}  # fmt: skip
_FILL_BYTES = re.compile(rb"\xff*")
_MARKERS_WITHOUT_LENGTH = frozenset({0x01, *range(0xD0, 0xD8)})
"""JPEG markers that have no length field: TEM and RST."""
_FRAME_MARKERS = {0xC0: False, 0xC1: False, 0xC2: True}
"""Supported JPEG frame markers, and True for progressive ones. Cameras and browsers use no others."""
_TABLE_MARKERS = frozenset({0xC4, 0xDB, 0xDD, 0xFE, *range(0xE0, 0xF0)})
_SCAN, _APP1 = 0xDA, 0xE1
_PNG_CHANNELS = {0: 1, 2: 3, 3: 3, 4: 4, 6: 4}
"""Number of channels of a decoded PNG, by colour type."""
_PNG_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
_REQUIRED_CHUNKS = frozenset({b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"})
_FIRST_ROTATED_ORIENTATION = 5
"""First EXIF orientation that swaps rows and columns."""


@dataclass(frozen=True)
class ImageFile:
    """Header of a JPEG or PNG file that may be decoded.

    Attributes:
        kind: Format of the file.
        width: Width in pixels after applying `orientation`.
        height: Height in pixels after applying `orientation`.
        channels: 1 (grey), 3, or 4 (with alpha).
        bits: Bits per channel, 8 or 16.
        orientation: EXIF orientation, 1 to 8.
        data: Bytes for the decoder: the file, or a PNG without its text, profiles and animation.
    """

    kind: Literal["jpeg", "png"]
    width: int
    height: int
    channels: int
    bits: int
    orientation: int
    data: bytes | memoryview

    @property
    def extension(self) -> dict[str, object]:
        """Extension of a message that contains this file."""
        return {"shape": [self.height, self.width, self.channels], "encoding": self.kind}


def parse_header(data: bytes | memoryview) -> ImageFile:
    """Parse the header of a file.

    Raises:
        DecodeError: The file is not a valid JPEG or PNG, or exceeds a limit.
    """
    file = data if isinstance(data, bytes) else memoryview(data).cast("B")
    signature = bytes(file[:8])
    if signature == _PNG_SIGNATURE:
        return _PngReader(file).read()
    if signature.startswith(_JPEG_SIGNATURE):
        return _JpegReader(file).read()
    size = len(file)
    if not size:
        raise DecodeError("image", 0, _("the image is empty"))
    for start, name in _UNSUPPORTED_FORMATS.items():
        if signature.startswith(start):
            raise DecodeError(
                "image", size, _("{name} files aren't supported; use JPEG or PNG").format(name=name)
            )
    raise DecodeError("image", size, _("not a JPEG or PNG image"))


def check_size(width: int, height: int, pixel_bytes: float, size_bytes: int) -> None:
    """Raise `DecodeError` if an image has no pixels, or exceeds the limits of pixels or memory.

    Args:
        width: Width in pixels.
        height: Height in pixels.
        pixel_bytes: Memory per pixel in bytes.
        size_bytes: Size of the received data, for the error message.
    """
    if width < 1 or height < 1:
        raise DecodeError(
            "image",
            size_bytes,
            _("an image can't have {width} × {height} pixels").format(width=width, height=height),  # noqa: RUF001
        )
    if width * height > MAX_PIXELS:
        reason = _("{width} × {height} pixels are too many; the limit is {most} million").format(  # noqa: RUF001
            width=width, height=height, most=MAX_PIXELS // 10**6
        )
        raise DecodeError("image", size_bytes, reason)
    needed_bytes = width * height * pixel_bytes
    if needed_bytes > MAX_BYTES:
        reason = _("{width} × {height} pixels need {needed} MB; the limit is {most} MB").format(  # noqa: RUF001
            width=width,
            height=height,
            needed=number(needed_bytes / 1000000.0, ".0f"),
            most=MAX_BYTES // 10**6,
        )
        raise DecodeError("image", size_bytes, reason)


class _HeaderReader:
    """Base class of the JPEG and PNG header readers."""

    kind: Literal["jpeg", "png"]

    def __init__(self, data: bytes | memoryview) -> None:
        self.data = data
        self.size = len(data)

    def number(self, offset: int, count: int) -> int:
        return int.from_bytes(self.data[offset : offset + count], "big")

    def error(self, reason: str) -> DecodeError:
        reason = _("the {upper} image is damaged: {reason}").format(upper=self.kind.upper(), reason=reason)
        return DecodeError("image", self.size, reason)


class _JpegReader(_HeaderReader):
    """Reader of JPEG segments up to the first scan.

    Unusual structures are rejected, because a decoder might interpret them differently and the decoded
    size would then differ from the checked size.
    """

    kind = "jpeg"

    def read(self) -> ImageFile:
        frame, orientation, offset = None, 1, 2
        for _piece in range(MAX_SEGMENTS):
            marker, offset = self._read_marker(offset)
            if marker in _MARKERS_WITHOUT_LENGTH:
                continue
            length = self.number(offset, 2)
            if length < 2 or offset + length > self.size:
                raise self.error(_("the data is truncated"))
            if marker in _FRAME_MARKERS:
                if frame is not None:
                    raise self.error(_("two frame headers"))
                frame = self._read_frame(marker, offset, length)
            elif marker == _SCAN:
                if frame is None:
                    raise self.error(_("pixels before the frame header"))
                return self._check_frame(frame, orientation, offset)
            elif marker == _APP1:
                orientation = _parse_orientation(self.data[offset + 2 : offset + length]) or orientation
            elif marker not in _TABLE_MARKERS:
                raise self.error(_("unknown marker 'ff{marker}'").format(marker=number(marker, "02x")))
            offset += length
        raise self.error(_("too many segments"))

    def _read_marker(self, offset: int) -> tuple[int, int]:
        if self.number(offset, 1) != 0xFF:
            reason = (
                _("the data is truncated")
                if offset >= self.size
                else _("a segment doesn't follow directly after the previous one")
            )
            raise self.error(reason)
        match = _FILL_BYTES.match(self.data, offset)
        offset = match.end() if match is not None else offset
        if offset >= self.size:
            raise self.error(_("the data is truncated"))
        return self.data[offset], offset + 1

    def _read_frame(self, marker: int, offset: int, length: int) -> _JpegFrame:
        bits, height, width = (
            self.number(offset + 2, 1),
            self.number(offset + 3, 2),
            self.number(offset + 5, 2),
        )
        components = self.number(offset + 7, 1)
        if length != 8 + 3 * components or components not in (1, 3, 4):
            raise self.error(
                _("invalid number of colour components: {components}").format(components=components)
            )
        if bits != 8:
            raise DecodeError(
                "image",
                self.size,
                _("JPEG images with {bits} bits per channel aren't supported; use PNG").format(bits=bits),
            )
        sampling = [self.number(offset + 9 + 3 * each, 1) for each in range(components)]
        factors = [(each >> 4, each & 15) for each in sampling]
        if not all(1 <= horizontal <= 4 and 1 <= vertical <= 4 for horizontal, vertical in factors):
            raise self.error(_("invalid sampling factors of the colour components"))
        return _JpegFrame(width, height, components, _FRAME_MARKERS[marker], factors)

    def _check_frame(self, frame: _JpegFrame, orientation: int, offset: int) -> ImageFile:
        channels = 1 if frame.components == 1 else 3
        pixel_bytes = float(_DECODER_COPIES * channels)
        is_refined = frame.is_progressive or self.number(offset + 2, 1) != frame.components
        if is_refined:  # the decoder holds all coefficients until the last scan
            pixel_bytes += frame.coefficient_bytes
        check_size(frame.width, frame.height, pixel_bytes, self.size)
        if is_refined:
            # a scan of a few bytes makes the decoder process all pixels again
            scans = bytes(self.data[offset:]).count(b"\xff\xda") + 1
            if scans > MAX_SCANS or scans * frame.width * frame.height > MAX_SCANNED_PIXELS:
                reason = _("{width} × {height} pixels in {scans} passes take too long to decode").format(  # noqa: RUF001
                    width=frame.width, height=frame.height, scans=scans
                )
                raise DecodeError("image", self.size, reason)
        width, height = frame.width, frame.height
        if orientation >= _FIRST_ROTATED_ORIENTATION:
            width, height = height, width
        return ImageFile("jpeg", width, height, channels, 8, orientation, self.data)


@dataclass(frozen=True)
class _JpegFrame:
    """JPEG frame header."""

    width: int
    height: int
    components: int
    is_progressive: bool
    sampling_factors: list[tuple[int, int]]

    @property
    def coefficient_bytes(self) -> float:
        # Two bytes per coefficient, in whole blocks.
        max_horizontal, max_vertical = (
            max(each[0] for each in self.sampling_factors),
            max(each[1] for each in self.sampling_factors),
        )
        units = -(-self.width // (8 * max_horizontal)) * -(-self.height // (8 * max_vertical))
        blocks = units * sum(each[0] * each[1] for each in self.sampling_factors)
        return 128 * blocks / max(1, self.width * self.height)


class _PngReader(_HeaderReader):
    """Reader of PNG chunks."""

    kind = "png"

    def read(self) -> ImageFile:
        if self.size < 33 or self.data[8:16] != b"\0\0\0\x0dIHDR":
            raise self.error(_("the header chunk is missing"))
        width, height = self.number(16, 4), self.number(20, 4)
        depth, colour = self.data[24], self.data[25]
        if depth not in _PNG_DEPTHS.get(colour, ()):
            raise self.error(
                _("colour type {colour} doesn't allow {depth} bits").format(colour=colour, depth=depth)
            )
        needed, kinds, orientation = self._read_chunks()
        channels = 4 if b"tRNS" in kinds and colour in (2, 3) else _PNG_CHANNELS[colour]
        bits = 16 if depth == 16 else 8
        check_size(width, height, _DECODER_COPIES * channels * bits // 8, self.size)
        if orientation >= _FIRST_ROTATED_ORIENTATION:
            width, height = height, width
        data = self.data
        if len(needed) > 1 or needed[0] != (8, self.size):
            data = _PNG_SIGNATURE + b"".join([bytes(self.data[start:end]) for start, end in needed])
        return ImageFile("png", width, height, channels, bits, orientation, data)

    def _read_chunks(self) -> tuple[list[tuple[int, int]], set[bytes], int]:
        # Returns the ranges of the chunks needed for the picture, all kinds, and the orientation. Other
        # chunks are dropped: compressed text and profiles may be decompression bombs, and animation frames
        # are not used.
        needed: list[tuple[int, int]] = []
        kinds: set[bytes] = set()
        orientation, offset = 1, 8
        for _piece in range(MAX_SEGMENTS):
            kind, end = bytes(self.data[offset + 4 : offset + 8]), offset + 12 + self.number(offset, 4)
            if kind == b"IHDR" and kind in kinds:
                raise self.error(_("two header chunks"))
            if kind in _REQUIRED_CHUNKS:
                if end > self.size:  # OpenCV allocates the declared size, up to 4 GB, before it checks
                    raise self.error(_("the data is truncated"))
                kinds.add(kind)
                if needed and needed[-1][1] == offset:
                    needed[-1] = needed[-1][0], end
                else:
                    needed.append((offset, end))
            elif kind == b"eXIf":
                orientation = (
                    _parse_orientation(
                        b"Exif\0\0" + bytes(self.data[offset + 8 : offset + 8 + _MAX_EXIF_BYTES])
                    )
                    or orientation
                )
            offset = end
            if kind == b"IEND" or offset + 8 > self.size:
                return needed, kinds, orientation
        raise self.error(_("too many chunks"))


_MAX_EXIF_BYTES = 4096
"""Number of bytes of EXIF data that are searched for the orientation."""


def _parse_orientation(exif: bytes | memoryview) -> int | None:
    # None without an orientation.
    data = bytes(exif[:_MAX_EXIF_BYTES])
    if data[:6] != b"Exif\0\0" or data[6:10] not in (b"II*\0", b"MM\0*"):
        return None
    order: Literal["big", "little"] = "little" if data[6:7] == b"I" else "big"
    tiff = data[6:]
    offset = int.from_bytes(tiff[4:8], order)
    count = int.from_bytes(tiff[offset : offset + 2], order)
    for start in range(offset + 2, min(offset + 2 + 12 * count, len(tiff) - 11), 12):
        if int.from_bytes(tiff[start : start + 2], order) == 0x0112:
            orientation = int.from_bytes(tiff[start + 8 : start + 10], order)
            return orientation if 1 <= orientation <= 8 else None
    return None
