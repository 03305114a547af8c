"""Codec `image`: arrays in BGR order, encoded as JPEG, PNG or raw pixels.

The extension of a message is `{"shape": [height, width, channels], "encoding": NAME}`. NAME is "jpeg" or
"png", or the layout of raw pixels: "mono8", "bgr8", "bgra8", "mono16", "bgr16", "bgra16", "rgb8", "rgba8", or
number type and number of channels, such as "32FC1" (float).

An array is encoded as its publisher's `ImageFormat` requests. By default `uint8` with one or three channels,
as from a camera, is sent as JPEG of quality 90, with alpha channel or 16 bits (depth) as PNG, and other types
as raw pixels. `raw_image(array)` returns a payload that is sent raw: without loss and without the time for
PNG compression. Bytes of a JPEG or PNG file are sent unchanged. Subscribers get an array (height, width) for
one channel, otherwise (height, width, channels), of the same number type. Messages of the original NEP have
no extension: the format is detected from the first bytes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any

from nep.errors import DecodeError, EncodeError
from nep.i18n import _, lazy
from nep.messages.encoded import Encoded
from nep.messages.image_files import ImageFile, check_size, parse_header
from nep.system.arguments import check_choice, check_range

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


JPEG_QUALITY = 90
MAX_WIDTH = 65_535
"""Maximum width in pixels."""
_INSTALL_HINT = lazy("install the image codec with: pip install 'nep-studio[image]'")
_FAST_PNG_OPTIONS = [16, 1]  # IMWRITE_PNG_COMPRESSION: the fastest that compresses
_NAMED_LAYOUTS = {
    "mono8": ("u1", 1), "bgr8": ("u1", 3), "bgra8": ("u1", 4), "rgb8": ("u1", 3), "rgba8": ("u1", 4),
    "mono16": ("<u2", 1), "bgr16": ("<u2", 3), "bgra16": ("<u2", 4), "rgb16": ("<u2", 3),
    "rgba16": ("<u2", 4),
}  # fmt: skip
_DTYPES = {"8U": "u1", "8S": "i1", "16U": "<u2", "16S": "<i2", "32S": "<i4", "32F": "<f4", "64F": "<f8"}
_LAYOUT_PATTERN = re.compile(r"(8U|8S|16U|16S|32S|32F|64F)C([1-4])")
_ENCODINGS_BY_LAYOUT = {value: key for key, value in _NAMED_LAYOUTS.items() if not key.startswith("rgb")}
_DTYPE_NAMES = lazy("uint8, int8, uint16, int16, int32, float32 or float64")


@dataclass(frozen=True)
class ImageFormat:
    """Format in which a publisher encodes images: `nep.ImageFormat("jpeg", quality=70, width=640)`.

    Encoded files and `raw_image` are sent unchanged. Raises `ValueError` for invalid values.

    Attributes:
        kind: "jpeg" (`uint8` with one or three channels), "png", "raw", or "auto": JPEG for `uint8` arrays
            with one or three channels, PNG for other 8-bit and 16-bit images, else raw.
        quality: JPEG quality, 1 to 100.
        width: Maximum width in pixels; wider images are scaled down, keeping the aspect ratio. Images of 16
            bits and more (depth, labels) are subsampled instead of interpolated.
    """

    kind: str = "auto"
    quality: int = JPEG_QUALITY
    width: int | None = None

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, ("auto", "jpeg", "png", "raw"))
        check_range("quality", self.quality, 1, 100)
        if self.width is not None:
            check_range("width", self.width, 1, MAX_WIDTH)

    def encode(self, payload: object) -> Encoded:
        """Encode an image in this format; JPEG and PNG files pass unchanged.

        Raises `EncodeError` if the payload isn't an image that this format supports, or if a package
        for encoding is missing.
        """
        if isinstance(payload, bytes | bytearray | memoryview):
            return encode(payload)
        try:
            frame = self._scale(_as_contiguous(payload))
            if self.kind == "jpeg":
                return _encode_jpeg(frame, self.quality)
            if self.kind == "png":
                return _encode_png(frame)
        except ImportError as error:
            raise EncodeError("image", type(payload).__name__, _(_INSTALL_HINT)) from error
        return _encode_raw(frame) if self.kind == "raw" else _encode_default(frame, self.quality)

    def _scale(self, frame: NDArray[Any]) -> NDArray[Any]:
        height, width = frame.shape[:2]
        if self.width is None or width <= self.width:
            return frame
        opencv, rows = _opencv(), max(1, round(height * self.width / width))
        if frame.dtype.name != "uint8":
            columns = _numpy().arange(self.width) * width // self.width
            lines = _numpy().arange(rows) * height // rows
            subsampled: NDArray[Any] = frame[lines][:, columns]
            return subsampled
        scaled: NDArray[Any] = opencv.resize(frame, (self.width, rows), interpolation=3)  # INTER_AREA
        return scaled


@dataclass(frozen=True, slots=True)
class RawLayout:
    """Layout of raw pixels.

    Attributes:
        dtype: numpy type of a channel's value.
        channels: Number of channels per pixel.
        is_red_first: True for the order RGB, False for BGR.
    """

    dtype: str
    channels: int
    is_red_first: bool = False


def _opencv() -> ModuleType:
    # Imported lazily: OpenCV is optional and takes 0.2 s.
    import cv2  # noqa: PLC0415 - optional and heavy

    return cv2


def _numpy() -> ModuleType:
    import numpy as np  # noqa: PLC0415 - optional and heavy

    return np


# ---- encoding


def encode(payload: object) -> Encoded:
    """Encode an image in the default format; JPEG and PNG files pass unchanged.

    Raises `EncodeError` if the payload isn't an image, or if a package for encoding is missing.
    """
    kind = type(payload).__name__
    if isinstance(payload, bytes | bytearray | memoryview):
        data = bytes(payload)
        try:
            return Encoded(data, parse_header(data).extension)
        except DecodeError as error:
            raise EncodeError("image", kind, error.reason) from error
    try:
        return _encode_default(_as_contiguous(payload), JPEG_QUALITY)
    except ImportError as error:
        raise EncodeError("image", kind, _(_INSTALL_HINT)) from error


def _channel_count(frame: NDArray[Any]) -> int:
    return 1 if frame.ndim == 2 else int(frame.shape[2])


def _encode_default(frame: NDArray[Any], quality: int) -> Encoded:
    # The module docstring describes the default format.
    if frame.dtype.name == "uint8" and _channel_count(frame) in (1, 3):
        return _encode_jpeg(frame, quality)
    return _encode_png(frame) if _can_encode_png(frame) else _encode_raw(frame)


def _can_encode_png(frame: NDArray[Any]) -> bool:
    return frame.dtype.name in ("uint8", "uint16") and _channel_count(frame) in (1, 3, 4)


def _encode_jpeg(frame: NDArray[Any], quality: int) -> Encoded:
    if frame.dtype.name != "uint8" or _channel_count(frame) not in (1, 3):
        reason = _("a JPEG image needs 'uint8' and one or three channels; choose 'png', 'raw' or 'auto'")
        raise EncodeError("image", type(frame).__name__, reason)
    return _encode_file(frame, "jpeg", [1, quality])  # 1 = IMWRITE_JPEG_QUALITY


def _encode_png(frame: NDArray[Any]) -> Encoded:
    if not _can_encode_png(frame):
        reason = _(
            "a PNG image needs 'uint8' or 'uint16' and one, three or four channels; choose 'raw' or 'auto'"
        )
        raise EncodeError("image", type(frame).__name__, reason)
    return _encode_file(frame, "png", _FAST_PNG_OPTIONS)


def raw_image(payload: object) -> Encoded:
    """Return a payload that is sent as raw pixels: lossless and without compression.

        pub.publish(nep.raw_image(depth))

    Args:
        payload: numpy array (height, width) or (height, width, 1 to 4 channels), colours in BGR order
            as in OpenCV. The array is not copied: publish it before you change its values.

    Raises:
        EncodeError: The value is not an image, or numpy is not installed.
    """
    try:
        return _encode_raw(_as_contiguous(payload))
    except ImportError as error:
        raise EncodeError("image", type(payload).__name__, _(_INSTALL_HINT)) from error


def _encode_file(frame: NDArray[Any], kind: str, options: list[int]) -> Encoded:
    opencv = _opencv()
    try:
        is_encoded, buffer = opencv.imencode(f".{kind}", frame, options)
    except opencv.error:  # such as a JPEG with more than 65535 rows
        is_encoded, buffer = False, None
    if not is_encoded:
        reason = _("OpenCV can't encode this image as {kind}; publish 'nep.raw_image(…)' instead").format(
            kind=kind
        )
        raise EncodeError("image", type(frame).__name__, reason)
    return Encoded(buffer.tobytes(), {"shape": _shape(frame), "encoding": kind})


def _encode_raw(frame: NDArray[Any]) -> Encoded:
    shape = _shape(frame)
    dtype_name = _dtype_name(frame.dtype)
    encoding = _ENCODINGS_BY_LAYOUT.get((dtype_name, shape[2]))
    if encoding is None:
        encoding = f"{next(name for name, each in _DTYPES.items() if each == dtype_name)}C{shape[2]}"
    # not copied: a publisher copies it once, into shared memory if possible
    data = frame.astype(dtype_name, copy=False).data.cast("B")
    return Encoded(data, {"shape": shape, "encoding": encoding})


def _dtype_name(dtype: np.dtype[Any]) -> str:
    # Name as in `_DTYPES`: little-endian, as everything on the wire.
    return dtype.newbyteorder("<").str.removeprefix("|")


def _shape(frame: NDArray[Any]) -> list[int]:
    return [frame.shape[0], frame.shape[1], 1 if frame.ndim == 2 else frame.shape[2]]


def check_image(payload: object) -> None:
    """Raise `EncodeError` if a value's type, shape or number type is not supported for images."""
    if isinstance(payload, (bytes, bytearray, memoryview)):
        return
    try:
        _validate(payload)
    except ImportError as error:
        raise EncodeError("image", type(payload).__name__, _(_INSTALL_HINT)) from error


def _validate(payload: object) -> NDArray[Any]:
    np = _numpy()
    kind = type(payload).__name__
    if not isinstance(payload, np.ndarray):
        raise EncodeError("image", kind, _("publish a 'uint8' array (height, width, 3) or a JPEG"))
    if _dtype_name(payload.dtype) not in _DTYPES.values():
        raise EncodeError(
            "image",
            kind,
            _("the elements are '{dtype}'; use {types}").format(dtype=payload.dtype, types=_(_DTYPE_NAMES)),
        )
    is_picture = payload.ndim == 2 or (payload.ndim == 3 and 1 <= payload.shape[2] <= 4)
    if not is_picture or 0 in payload.shape:
        reason = _("{shape} isn't a valid image shape; use (height, width, 3)").format(shape=payload.shape)
        raise EncodeError("image", kind, reason)
    frame: NDArray[Any] = payload
    try:
        height, width = frame.shape[:2]
        check_size(width, height, frame.nbytes / height / width, frame.nbytes)
    except DecodeError as error:
        raise EncodeError("image", kind, error.reason) from error
    return frame


def _as_contiguous(payload: object) -> NDArray[Any]:
    # One channel becomes two dimensions. Raises `EncodeError`.
    np = _numpy()
    frame = _validate(payload)
    if frame.ndim == 3 and frame.shape[2] == 1:
        frame = frame[:, :, 0]
    contiguous: NDArray[Any] = np.ascontiguousarray(frame, dtype=frame.dtype.newbyteorder("="))
    return contiguous


# ---- decoding


def decode(data: memoryview, extension: Mapping[str, object]) -> object:
    """Decode an image to an array (height, width) or (height, width, channels) in BGR order.

    Raises `DecodeError` if the data is invalid, exceeds a limit of `nep.messages.image_files`, or
    can't be decoded because a package is missing. The limits are checked before memory is allocated.
    """
    try:
        layout = raw_layout(extension.get("encoding"))
        if layout is None:
            return decode_file(parse_header(data))
        frame = raw_array(data, layout, extension.get("shape"))
        if layout.is_red_first:
            frame = frame[:, :, [2, 1, 0, 3][: layout.channels]]
        return frame
    except ImportError as error:
        raise DecodeError("image", data.nbytes, _(_INSTALL_HINT)) from error


def decode_file(file: ImageFile, reduction: int = 1) -> NDArray[Any]:
    """Decode the pixels of a file, rotated upright.

    Args:
        file: Examined file.
        reduction: Factor by which a JPEG is scaled down: 1, 2, 4 or 8.

    Raises:
        DecodeError: The pixels can't be decoded.
    """
    opencv, np = _opencv(), _numpy()
    if file.kind == "png":
        flag = -1  # IMREAD_UNCHANGED: keeps number type, single channel and alpha
    else:
        grey, colour = {1: (0, 1), 2: (16, 17), 4: (32, 33), 8: (64, 65)}[reduction]  # IMREAD_REDUCED_…
        flag = 128 + (grey if file.channels == 1 else colour)  # IMREAD_IGNORE_ORIENTATION
    try:
        picture = opencv.imdecode(np.frombuffer(file.data, np.uint8), flag)
    except (opencv.error, MemoryError) as error:
        raise DecodeError("image", len(file.data), _("the image is too large to decode")) from error
    if picture is None:
        raise DecodeError("image", len(file.data), _("OpenCV can't decode the image"))
    return _apply_orientation(picture, file.orientation)


def _apply_orientation(picture: NDArray[Any], orientation: int) -> NDArray[Any]:
    # Rotate and flip by the EXIF orientation.
    if orientation == 1:
        return picture
    if orientation >= 5:
        picture = picture.swapaxes(0, 1)
    rows = slice(None, None, -1 if orientation in (3, 4, 7, 8) else 1)
    columns = slice(None, None, -1 if orientation in (2, 3, 6, 7) else 1)
    upright: NDArray[Any] = _numpy().ascontiguousarray(picture[rows, columns])
    return upright


def raw_layout(encoding: object) -> RawLayout | None:
    """Return the pixel layout of an encoding such as "bgr8", or None if `encoding` is not a raw format."""
    if not isinstance(encoding, str):
        return None
    layout = _NAMED_LAYOUTS.get(encoding)
    if layout is not None:
        return RawLayout(*layout, is_red_first=encoding.startswith("rgb"))
    match = _LAYOUT_PATTERN.fullmatch(encoding)
    return None if match is None else RawLayout(_DTYPES[match[1]], int(match[2]))


def raw_array(data: memoryview, layout: RawLayout, shape: object) -> NDArray[Any]:
    """View raw bytes as an array in their original channel order, without a copy.

    Raises `DecodeError` if `shape` is invalid, doesn't match the size of `data`, or exceeds a limit.
    """
    np = _numpy()
    dtype = np.dtype(layout.dtype)
    sides = shape[:2] if isinstance(shape, list | tuple) else ()
    if len(sides) < 2 or not all(type(side) is int for side in sides):
        raise DecodeError(
            "image", data.nbytes, _("'{shape}' isn't a valid image shape").format(shape=str(shape)[:60])
        )
    height, width = sides
    pixel_bytes = layout.channels * dtype.itemsize
    if min(height, width) < 1 or height * width * pixel_bytes != data.nbytes:
        reason = _(
            "the data size doesn't match an image of {width} x {height} pixels with {pixel_bytes} bytes each"
        ).format(width=width, height=height, pixel_bytes=pixel_bytes)
        raise DecodeError("image", data.nbytes, reason)
    check_size(width, height, pixel_bytes, data.nbytes)
    flat: NDArray[Any] = np.frombuffer(data, dtype)
    return flat.reshape((height, width) if layout.channels == 1 else (height, width, layout.channels))


def image_info(data: bytes | memoryview) -> dict[str, object] | None:
    """Return the message extension for a JPEG or PNG file.

    Returns None if the file isn't a valid JPEG or PNG, or exceeds a limit. The pixels are not decoded.
    """
    try:
        return parse_header(data).extension
    except DecodeError:
        return None
