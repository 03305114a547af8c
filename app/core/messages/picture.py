"""Decoded images. Messages are decoded to images no larger than they are displayed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from app.core.messages.image_style import (
    PLAIN,
    ColourScale,
    PictureStyle,
    apply_colour_map,
    apply_tones,
    scaled,
)
from nep.errors import EncodeError, NepError
from nep.i18n import _
from nep.messages import image_codec
from nep.messages.image_files import parse_header
from nep.messages.message import Message

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Size = tuple[int, int]
Pixel = int | float | tuple[int, int, int]
REDUCTION_FACTORS = (8, 4, 2)
PNG_DTYPES = ("uint8", "uint16")
COMPARED_SAMPLES = 4096
AVERAGED_DTYPES = ("uint8", "uint16")
"""Data types that are downscaled by averaging.

Other types may contain NaN and are downscaled by taking every nth pixel.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """Decoded image of ``width`` x ``height`` pixels.

    Attributes:
        bgra: Contiguous uint8 array (rows, columns, 4) in the layout of QImage.Format_RGB32. Has fewer
            rows and columns than the image if the image was decoded for a small view.
        channel_values: Values of an image with one channel (grey, depth), else None.
        message: Message that was decoded.
    """

    bgra: NDArray[np.uint8]
    width: int
    height: int
    seq: int | None
    stamp_ns: int | None
    received_s: float
    message: Message | None = None
    channel_values: NDArray[Any] | None = None
    style: PictureStyle = PLAIN
    """Display style with which the image was decoded."""
    scale: ColourScale | None = None
    """Colour scale of an image that shows numbers as colours, else None."""
    has_one_channel: bool = False
    """True if the image has one channel, even if `channel_values` is None."""

    @property
    def is_full_resolution(self) -> bool:
        """True if the image was decoded in full resolution."""
        return self.bgra.shape[:2] == (self.height, self.width)

    def pixel(self, x: int, y: int) -> Pixel | None:
        """Return the value of a pixel: (red, green, blue), or a number for an image with one channel.

        Returns None outside the image, or if the image was not decoded in full resolution.
        """
        if not (self.is_full_resolution and 0 <= x < self.width and 0 <= y < self.height):
            return None
        if self.channel_values is not None:
            number: int | float = self.channel_values[y, x].item()
            return number
        blue, green, red = (int(value) for value in self.bgra[y, x, :3])
        return red, green, blue


def decode(
    message: Message, received_s: float, display_size: Size | None = None, style: PictureStyle = PLAIN
) -> tuple[Picture | None, str | None]:
    """Decode a message to an image.

    Args:
        message: Message with an image.
        received_s: Arrival time of the message (monotonic seconds).
        display_size: Displayed width and height in screen pixels. An image at least twice as large is
            decoded at a reduced size. None means full resolution.
        style: Display style.

    Returns:
        The image and None, or None and an error message.
    """
    import cv2  # noqa: PLC0415  150 MB: loaded with the first image, not at the start

    try:
        frame, size = _decode_frame(message, display_size)
        converted = _to_bgra(frame, style)
    except NepError as error:
        return None, str(error)
    except (cv2.error, MemoryError) as error:
        return None, _("An image on “{topic}” can't be shown: {problem}").format(
            topic=message.topic, problem=_short_message(error)
        )
    if converted is None:
        return None, _("“{topic}” has images of {shape} {dtype}, which can't be shown").format(
            topic=message.topic, shape=frame.shape, dtype=frame.dtype
        )
    bgra, channel_values, scale = converted
    is_grey = channel_values is not None
    if (bgra.shape[1], bgra.shape[0]) != size:
        channel_values = None
    image = Picture(
        bgra, *size, message.seq, message.stamp_ns, received_s, message, channel_values, style, scale, is_grey
    )
    return image, None


def reuse_picture(
    displayed: Picture | None,
    message: Message,
    received_s: float,
    display_size: Size | None,
    style: PictureStyle = PLAIN,
) -> Picture | None:
    """Return the shown image for a new message without decoding, if both messages contain equal bytes.

    Returns None if no image or the image of this very message is shown, if the bytes differ, or if
    another size or style is requested (see `decode`).
    """
    if (
        displayed is None
        or displayed.message is None
        or displayed.message is message
        or displayed.style != style
    ):
        return None
    displayed_message, factor = (
        displayed.message,
        _reduction_factor((displayed.width, displayed.height), display_size),
    )
    if abs(displayed.bgra.shape[0] * factor - displayed.height) >= factor:  # rounded up or down
        return None
    if displayed_message.extension != message.extension or not _are_bytes_equal(
        displayed_message.data, message.data
    ):
        return None
    return replace(
        displayed, seq=message.seq, stamp_ns=message.stamp_ns, received_s=received_s, message=message
    )


def _are_bytes_equal(one: memoryview, other: memoryview) -> bool:
    # Changing camera images are detected by a sample of bytes.
    if one.nbytes != other.nbytes:
        return False
    step = max(1, one.nbytes // COMPARED_SAMPLES)
    return bytes(one[::step]) == bytes(other[::step]) and bytes(one) == bytes(other)


def _short_message(error: BaseException) -> str:
    # Returns the last part of OpenCV's long message.
    return (
        str(error).strip().splitlines()[-1].rpartition("error: ")[2][:200]
        if str(error)
        else _("not enough memory")
    )


def encode_png(message: Message) -> bytes:
    """Return the image of a message in full resolution as the content of a PNG file.

    A message in PNG format is returned unchanged, without trailing data. Raises NepError if the message
    is not an image or its values are not integers of 8 or 16 bits, OSError if encoding fails.
    """
    import cv2  # noqa: PLC0415  slow import

    if image_codec.raw_layout(message.extension.get("encoding")) is None:
        file = parse_header(message.data)
        if file.kind == "png":
            return bytes(file.data)
    frame, _size = _decode_frame(message, None)
    if frame.dtype not in PNG_DTYPES:
        raise EncodeError(
            "png",
            _("image of {dtype}").format(dtype=frame.dtype),
            _("only integers of 8 or 16 bits are supported"),
        )
    succeeded, data = cv2.imencode(".png", frame)
    if not succeeded:
        raise OSError(_("an image of shape {shape} can't be written as PNG").format(shape=frame.shape))
    return bytes(data.tobytes())


def _decode_frame(message: Message, display_size: Size | None) -> tuple[NDArray[Any], Size]:
    # In OpenCV's layout (grey, BGR or BGRA; any type), perhaps reduced, and its full size.
    layout = image_codec.raw_layout(message.extension.get("encoding"))
    if layout is not None:
        frame = image_codec.raw_array(message.data, layout, message.extension.get("shape"))
        size = (frame.shape[1], frame.shape[0])
        frame = _reduce(frame, _reduction_factor(size, display_size))
        if layout.is_red_first:
            frame = frame[:, :, [2, 1, 0, 3][: layout.channels]]
        return frame, size
    file = parse_header(message.data)
    size = (file.width, file.height)
    factor = _reduction_factor(size, display_size)
    if file.kind == "jpeg":
        return image_codec.decode_file(file, factor), size
    return _reduce(image_codec.decode_file(file), factor), size


def _reduce(frame: NDArray[Any], factor: int) -> NDArray[Any]:
    import cv2  # noqa: PLC0415

    if factor == 1:
        return frame
    reduced_size = (max(1, frame.shape[1] // factor), max(1, frame.shape[0] // factor))
    if frame.dtype not in AVERAGED_DTYPES:
        return frame[::factor, ::factor][: reduced_size[1], : reduced_size[0]]
    reduced: NDArray[Any] = cv2.resize(frame, reduced_size, interpolation=cv2.INTER_AREA)
    return reduced


def _reduction_factor(size: Size, display_size: Size | None) -> int:
    # Factor by which the image can be reduced for `display_size`.
    if display_size is None:
        return 1
    ratio = min(size[0] / max(1, display_size[0]), size[1] / max(1, display_size[1]))
    return next((factor for factor in REDUCTION_FACTORS if ratio >= factor), 1)


def _to_bgra(
    frame: NDArray[Any], style: PictureStyle
) -> tuple[Any, NDArray[Any] | None, ColourScale | None] | None:
    # In QImage's layout, the numbers of one channel, and the meaning of their colours; None if unsupported.
    import cv2  # noqa: PLC0415
    import numpy as np  # noqa: PLC0415

    channels = 1 if frame.ndim == 2 else frame.shape[2] if frame.ndim == 3 else 0
    if not 1 <= channels <= 4 or 0 in frame.shape:
        return None
    if channels == 1:
        grey = frame.reshape(frame.shape[:2])
        if frame.dtype == np.uint8 and (style.colour_map, style.low, style.high) == ("", None, None):
            return cv2.cvtColor(apply_tones(style, grey), cv2.COLOR_GRAY2BGRA), grey, None
        bgra, scale = apply_colour_map(style, grey)
        return bgra, grey, scale
    if frame.dtype != np.uint8:
        frame = _to_eight_bits(frame)
    if channels == 2:  # such as a vector field: shown as blue and green
        frame = np.dstack([frame, np.zeros(frame.shape[:2], np.uint8)])
    frame = apply_tones(style, frame)
    if channels == 4:
        return np.ascontiguousarray(frame), None, None
    return cv2.cvtColor(np.ascontiguousarray(frame), cv2.COLOR_BGR2BGRA), None, None


def _to_eight_bits(frame: NDArray[Any]) -> NDArray[np.uint8]:
    # 16 bits by their range, floats from 0 to 1, others by their minimum and maximum.
    import numpy as np  # noqa: PLC0415

    if frame.dtype == np.uint16:
        return (frame >> 8).astype(np.uint8)
    is_finite = np.isfinite(frame)
    values = frame[is_finite]
    if frame.dtype.kind == "f" and values.size and values.min() >= 0 and values.max() <= 1:
        return np.asarray(np.where(is_finite, frame, 0) * 255 + 0.5, np.uint8)
    if not values.size:
        return np.zeros(frame.shape, np.uint8)
    return scaled(frame, is_finite, float(values.min()), float(values.max()))
