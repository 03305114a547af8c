"""The codec `image`: pictures as JPEG, PNG or raw bytes ↔ `uint8` arrays (height, width, 3) in BGR order.

The extension that travels beside the bytes is
`{"shape": [height, width, 3], "encoding": "jpeg" | "png" | "bgr8" | "rgb8" | "mono8"}`.
Arrays are published as JPEG of quality 90; `raw_image(array)` makes a payload that is sent as it is, without
loss. Bytes that already are a JPEG or PNG file pass unchanged. Messages of the original NEP carry no
extension: their encoding is read from their first bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING

from nep.encoded import Encoded
from nep.errors import DecodeError, EncodeError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Frame = NDArray[np.uint8]

__all__ = ["JPEG_QUALITY", "decode", "encode", "picture_info", "raw_image"]

JPEG_QUALITY = 90
_NEEDS = "install the picture codec with: pip install 'nep-studio[image]'"
_JPEG = b"\xff\xd8\xff"
_PNG = b"\x89PNG\r\n\x1a\n"
_RAW_CHANNELS = {"bgr8": 3, "rgb8": 3, "mono8": 1}


def _opencv() -> ModuleType:
    """OpenCV, loaded at the first picture: it costs a fifth of a second and is optional."""
    import cv2  # noqa: PLC0415 - optional and heavy

    return cv2


def _numpy() -> ModuleType:
    import numpy as np  # noqa: PLC0415 - optional and heavy

    return np


def encode(payload: object) -> Encoded:
    """A picture as JPEG, or JPEG/PNG bytes unchanged. Raises `EncodeError` for anything else."""
    if isinstance(payload, bytes | bytearray | memoryview):
        data = bytes(payload)
        info = picture_info(data)
        if info is None:
            raise EncodeError("image", "bytes", "they are neither a JPEG nor a PNG file")
        return Encoded(data, info)
    try:
        frame = _checked(payload)
        ok, buffer = _opencv().imencode(".jpg", frame, [1, JPEG_QUALITY])  # 1 = IMWRITE_JPEG_QUALITY
    except ImportError as error:
        raise EncodeError("image", type(payload).__name__, _NEEDS) from error
    if not ok:
        raise EncodeError("image", type(payload).__name__, "OpenCV cannot make a JPEG of it")
    height, width = frame.shape[:2]
    return Encoded(buffer.tobytes(), {"shape": [height, width, 3], "encoding": "jpeg"})


def raw_image(payload: object) -> Encoded:
    """A picture without loss: its bytes as they are ("bgr8", or "mono8" for two dimensions)."""
    try:
        frame = _checked(payload)
    except ImportError as error:
        raise EncodeError("image", type(payload).__name__, _NEEDS) from error
    height, width = frame.shape[:2]
    encoding = "mono8" if frame.ndim == 2 else "bgr8"
    return Encoded(frame.tobytes(), {"shape": [height, width, 3], "encoding": encoding})


def _checked(payload: object) -> Frame:
    np = _numpy()
    kind = type(payload).__name__
    if not isinstance(payload, np.ndarray):
        raise EncodeError("image", kind, "publish a 'uint8' array (height, width, 3) or a JPEG")
    if payload.dtype != np.uint8:
        raise EncodeError("image", kind, f"its numbers are '{payload.dtype}'; convert them to 'uint8'")
    is_picture = payload.ndim == 2 or (payload.ndim == 3 and payload.shape[2] in (1, 3, 4))
    if not is_picture or 0 in payload.shape:
        reason = f"its shape {payload.shape} is none of a picture; use (height, width, 3)"
        raise EncodeError("image", kind, reason)
    frame: Frame = payload
    if payload.ndim == 3 and payload.shape[2] != 3:  # one channel, or an alpha channel that JPEG cannot hold
        frame = payload[:, :, 0] if payload.shape[2] == 1 else payload[:, :, :3]
    contiguous: Frame = np.ascontiguousarray(frame)
    return contiguous


def decode(data: memoryview, extension: Mapping[str, object]) -> object:
    """The picture as a `uint8` array (height, width, 3) in BGR order. Raises `DecodeError`."""
    encoding = extension.get("encoding")
    try:
        if isinstance(encoding, str) and encoding in _RAW_CHANNELS:
            return _decode_raw(data, encoding, extension.get("shape"))
        np = _numpy()
        if not data.nbytes:
            raise DecodeError("image", 0, "there is nothing in it")
        return _read(np.frombuffer(data, np.uint8))
    except ImportError as error:
        raise DecodeError("image", data.nbytes, _NEEDS) from error


def _read(data: NDArray[np.uint8]) -> object:
    """The picture in a file's bytes. Raises `DecodeError`."""
    opencv = _opencv()
    try:
        picture: object = opencv.imdecode(data, 1)  # 1 = IMREAD_COLOR
    except (opencv.error, MemoryError) as error:  # a head may tell of a million rows
        raise DecodeError("image", data.nbytes, "they are a picture larger than can be read") from error
    if picture is None:
        raise DecodeError("image", data.nbytes, "they are no picture that OpenCV reads")
    return picture


def _decode_raw(data: memoryview, encoding: str, shape: object) -> object:
    np = _numpy()
    channels = _RAW_CHANNELS[encoding]
    if not isinstance(shape, list | tuple) or len(shape) < 2 or not all(isinstance(n, int) for n in shape):
        raise DecodeError("image", data.nbytes, f"'{shape}' is no shape of a picture")
    height, width = shape[0], shape[1]
    if min(height, width) < 1 or height * width * channels != data.nbytes:
        reason = f"a '{encoding}' picture of {width} x {height} has another size"
        raise DecodeError("image", data.nbytes, reason)
    frame = np.frombuffer(data, np.uint8).reshape(height, width, channels)
    if encoding == "rgb8":
        frame = np.ascontiguousarray(frame[:, :, ::-1])
    elif encoding == "mono8":
        frame = np.repeat(frame, 3, axis=2)
    picture: object = frame
    return picture


def picture_info(data: bytes | memoryview) -> dict[str, object] | None:
    """The extension of a JPEG or PNG file, read from its head without decoding; None when it is neither."""
    head = bytes(data[:24])
    if head.startswith(_PNG) and len(head) == 24:
        width, height = int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")
        return {"shape": [height, width, 3], "encoding": "png"}
    if head.startswith(_JPEG):
        size = _jpeg_size(data)
        return None if size is None else {"shape": [*size, 3], "encoding": "jpeg"}
    return None


def _jpeg_size(data: bytes | memoryview) -> tuple[int, int] | None:
    """(height, width) from the frame header among a JPEG's segments."""
    at = 2
    while at + 9 <= len(data):
        if data[at] != 0xFF:
            return None
        marker = data[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
            continue
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            return int.from_bytes(data[at + 5 : at + 7], "big"), int.from_bytes(data[at + 7 : at + 9], "big")
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
