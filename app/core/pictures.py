"""One decoded picture, and how messages become pictures: as large as they are shown, no larger."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nep import images
from nep.errors import DecodeError, NepError
from nep.message import Message

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Size = tuple[int, int]
Pixel = int | tuple[int, int, int]
RAW_CHANNELS = {"bgr8": 3, "rgb8": 3, "mono8": 1}
REDUCED = (8, 4, 2)
MOST_PIXELS = 120_000_000
"""More than any camera has; decoding takes up to four bytes of memory for each, whatever was sent."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One decoded picture of ``width`` x ``height`` pixels.

    ``bgra`` is a contiguous uint8 array (rows, columns, 4), as QImage.Format_RGB32 reads it; it has fewer
    rows and columns than the picture when it was decoded for a small view (`whole` is False then).
    ``numbers`` are the values of a picture with one channel (grey, depth), else None. ``message`` is what it
    was decoded from.
    """

    bgra: NDArray[np.uint8]
    width: int
    height: int
    seq: int | None
    stamp_ns: int | None
    received_s: float
    message: Message | None = None
    numbers: NDArray[Any] | None = None

    @property
    def whole(self) -> bool:
        """Whether every pixel was decoded."""
        return self.bgra.shape[:2] == (self.height, self.width)

    def pixel(self, x: int, y: int) -> Pixel | None:
        """Red, green and blue, or the number of a picture with one channel; None where it is not known."""
        if not (self.whole and 0 <= x < self.width and 0 <= y < self.height):
            return None
        if self.numbers is not None:
            return int(self.numbers[y, x])
        blue, green, red = (int(value) for value in self.bgra[y, x, :3])
        return red, green, blue


def decode(message: Message, received_s: float, fit: Size | None = None) -> tuple[Picture | None, str | None]:
    """A message as a picture, or the sentence that says why it is none.

    ``fit`` is how large it is shown (width, height in pixels of the screen): a picture of twice that and more
    is decoded smaller. None decodes all of it.
    """
    import cv2  # noqa: PLC0415  150 MB: loaded when the first picture arrives, not at start

    try:
        frame, size = _frame(message, fit)
        found = _bgra(frame)
    except NepError as error:
        return None, str(error)
    except (cv2.error, MemoryError) as error:
        return None, f"“{message.topic}” sends a picture that can't be shown: {_short(error)}"
    if found is None:
        return None, f"“{message.topic}” has pictures of {frame.shape} {frame.dtype}; they can't be shown"
    bgra, numbers = found
    if (bgra.shape[1], bgra.shape[0]) != size:
        numbers = None
    return Picture(bgra, *size, message.seq, message.stamp_ns, received_s, message, numbers), None


def _short(error: BaseException) -> str:
    """The last part of OpenCV's long message."""
    return str(error).strip().splitlines()[-1].rpartition("error: ")[2][:200] if str(error) else "no memory"


def png_of(message: Message) -> bytes:
    """The whole picture as a PNG file, as it was received. Raises NepError, or OSError when it can't be made.

    A message that is a PNG already is taken as it is.
    """
    import cv2  # noqa: PLC0415  heavy

    if message.extension.get("encoding") == "png" or bytes(message.data[:4]) == b"\x89PNG":
        return bytes(message.data)
    frame, _size = _frame(message, None)
    good, data = cv2.imencode(".png", frame)
    if not good:
        raise OSError(f"a picture of {frame.shape} can't be written as PNG")
    return bytes(data.tobytes())


def _frame(message: Message, fit: Size | None) -> tuple[NDArray[Any], Size]:
    """The picture as OpenCV has it (grey, BGR or BGRA; 8 or 16 bits), perhaps smaller, and its whole size."""
    import cv2  # noqa: PLC0415
    import numpy as np  # noqa: PLC0415

    encoding = message.extension.get("encoding")
    if isinstance(encoding, str) and encoding in RAW_CHANNELS:
        whole = _raw(message, encoding)
        size = (whole.shape[1], whole.shape[0])
        factor = _factor(size, fit)
        if factor > 1:
            small = (max(1, size[0] // factor), max(1, size[1] // factor))
            whole = cv2.resize(whole, small, interpolation=cv2.INTER_AREA)
        if encoding == "rgb8":
            whole = cv2.cvtColor(whole, cv2.COLOR_RGB2BGR)
        return whole, size
    if not message.data.nbytes:
        raise DecodeError("image", 0, "there is nothing in it")
    shape = (images.picture_info(message.data) or {}).get("shape")
    if isinstance(shape, list) and shape[0] * shape[1] > MOST_PIXELS:
        raise DecodeError("image", message.size_bytes, f"{shape[1]} × {shape[0]} pixels are too many")  # noqa: RUF001
    told = _told_size(message)
    factor = _factor(told, fit) if told is not None else 1
    flag = _flag(message, factor, cv2)
    try:
        frame = cv2.imdecode(np.frombuffer(message.data, np.uint8), flag)
    except (cv2.error, MemoryError) as error:  # such as a head that tells of a million rows
        raise DecodeError("image", message.size_bytes, _short(error)) from error
    if frame is None:
        raise DecodeError("image", message.size_bytes, "they are no picture that OpenCV reads")
    if factor == 1 or told is None:
        told = (frame.shape[1], frame.shape[0])
    return frame, told


def _raw(message: Message, encoding: str) -> NDArray[Any]:
    import numpy as np  # noqa: PLC0415

    channels = RAW_CHANNELS[encoding]
    shape = message.extension.get("shape")
    good = isinstance(shape, Sequence) and len(shape) >= 2 and all(isinstance(n, int) for n in shape)
    if good and shape[0] * shape[1] * channels == message.size_bytes and min(shape[:2]) > 0:  # type: ignore[index]
        flat = np.frombuffer(message.data, np.uint8)
        rows, columns = shape[0], shape[1]  # type: ignore[index]
        return flat.reshape((rows, columns) if channels == 1 else (rows, columns, channels))
    return np.asarray(images.decode(message.data, message.extension))  # raises, with its sentence


def _told_size(message: Message) -> Size | None:
    """Width and height, as the message tells or as its first bytes do; None when nobody tells."""
    shape = message.extension.get("shape")
    if shape is None:
        shape = (images.picture_info(message.data) or {}).get("shape")
    if isinstance(shape, Sequence) and len(shape) >= 2 and all(isinstance(n, int) for n in shape[:2]):
        return int(shape[1]), int(shape[0])
    return None


def _factor(size: Size, fit: Size | None) -> int:
    """By how much a picture of this size may be decoded smaller to be shown as large as ``fit``."""
    if fit is None:
        return 1
    shrink = min(size[0] / max(1, fit[0]), size[1] / max(1, fit[1]))
    return next((factor for factor in REDUCED if shrink >= factor), 1)


def _flag(message: Message, factor: int, cv2: Any) -> int:  # noqa: ANN401  a module
    """How OpenCV is to read: a PNG with one channel keeps its numbers."""
    if factor > 1:
        found = {2: cv2.IMREAD_REDUCED_COLOR_2, 4: cv2.IMREAD_REDUCED_COLOR_4, 8: cv2.IMREAD_REDUCED_COLOR_8}
        return int(found[factor])
    head = bytes(message.data[:26])
    grey_png = head.startswith(b"\x89PNG") and len(head) == 26 and head[25] == 0
    return int(cv2.IMREAD_UNCHANGED if grey_png else cv2.IMREAD_COLOR)


def _bgra(frame: NDArray[Any]) -> tuple[Any, NDArray[Any] | None] | None:
    """As QImage reads it, and the numbers of one channel; None for what is no picture."""
    import cv2  # noqa: PLC0415
    import numpy as np  # noqa: PLC0415

    channels = 1 if frame.ndim == 2 else frame.shape[2] if frame.ndim == 3 else 0
    if channels == 1 and frame.dtype == np.uint16:
        grey = frame.reshape(frame.shape[:2])
        shown = cv2.normalize(grey, np.zeros(grey.shape, np.uint8), 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)
        return cv2.cvtColor(cv2.applyColorMap(shown, cv2.COLORMAP_VIRIDIS), cv2.COLOR_BGR2BGRA), grey
    if frame.dtype != np.uint8 or 0 in frame.shape:
        return None
    if channels == 1:
        grey = frame.reshape(frame.shape[:2])
        return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGRA), grey
    if channels == 3:
        return cv2.cvtColor(frame, cv2.COLOR_BGR2BGRA), None
    return (np.ascontiguousarray(frame), None) if channels == 4 else None
