"""Display style of images: brightness, contrast, and the colour map for numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

COLOUR_MAPS = ("grey", "viridis", "turbo", "inferno", "jet")
"""Names of the colour maps; "" is the default: grey for bytes, viridis for other types."""
MIN_CONTRAST, MAX_CONTRAST = 0.1, 10.0
STRIP_ROWS = 64
DEFAULT_COLOUR_MAP = "viridis"


@dataclass(frozen=True, slots=True)
class PictureStyle:
    """Display style of an image; equal styles give equal images.

    Attributes:
        brightness: -1 to 1; 0 leaves the image unchanged.
        contrast: 0.1 to 10; 1 leaves the image unchanged.
        colour_map: Colour map of images with one channel: one of `COLOUR_MAPS`, or "" for the default.
        low: Value of the first colour; None for the minimum of the image (0 for bytes).
        high: Value of the last colour; None for the maximum of the image (255 for bytes).
    """

    brightness: float = 0.0
    contrast: float = 1.0
    colour_map: str = ""
    low: float | None = None
    high: float | None = None

    def to_json(self) -> dict[str, object]:
        """Return the style as JSON data for a layout; `parse_style` parses it."""
        return {
            "brightness": self.brightness,
            "contrast": self.contrast,
            "colours": self.colour_map,
            "low": self.low,
            "high": self.high,
        }


PLAIN = PictureStyle()


def parse_style(saved: object) -> PictureStyle:
    """Parse the result of `PictureStyle.to_json`; invalid values become defaults."""
    if not isinstance(saved, Mapping):
        return PLAIN
    saved_values = {name: _number(saved.get(name)) for name in ("brightness", "contrast", "low", "high")}
    brightness, contrast, low, high = saved_values.values()
    colour_map = saved.get("colours")
    style = PictureStyle(
        min(max(brightness, -1.0), 1.0) if brightness is not None else 0.0,
        min(max(contrast, MIN_CONTRAST), MAX_CONTRAST) if contrast is not None else 1.0,
        colour_map if isinstance(colour_map, str) and colour_map in COLOUR_MAPS else "",
    )
    return replace(style, low=low, high=high) if low is None or high is None or low < high else style


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        converted = float(value)
    except OverflowError:
        return None
    return converted if math.isfinite(converted) else None


@dataclass(frozen=True, slots=True, eq=False)
class ColourScale:
    """Colour scale of an image with one channel.

    Attributes:
        low: Value of the first colour.
        high: Value of the last colour.
        colours: uint8 array (256, 3) of red, green and blue.
    """

    low: float
    high: float
    colours: NDArray[np.uint8]


def apply_tones(style: PictureStyle, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return 8-bit values with the brightness and the contrast of a display style applied."""
    if (style.brightness, style.contrast) == (0.0, 1.0):
        return picture
    import cv2  # noqa: PLC0415  slow import
    import numpy as np  # noqa: PLC0415

    return np.asarray(cv2.LUT(picture, _tone_table(style)), np.uint8)


def apply_colour_map(
    style: PictureStyle, channel_values: NDArray[Any]
) -> tuple[NDArray[np.uint8], ColourScale]:
    """Apply the colour map to an image with one channel.

    Args:
        style: Display style.
        channel_values: Array (rows, columns).

    Returns:
        Array (rows, columns, 4) of blue, green, red and 255, black for NaN and infinity; and the colour
        scale.
    """
    import cv2  # noqa: PLC0415
    import numpy as np  # noqa: PLC0415

    is_finite = np.isfinite(channel_values)
    low, high = _value_range(style, channel_values[is_finite], is_bytes=channel_values.dtype == np.uint8)
    colours = _colour_table(
        style.colour_map or ("grey" if channel_values.dtype == np.uint8 else DEFAULT_COLOUR_MAP)
    )[_tone_table(style)]
    scaled_image = cv2.cvtColor(scaled(channel_values, is_finite, low, high), cv2.COLOR_GRAY2BGR)
    bgra = cv2.cvtColor(cv2.LUT(scaled_image, colours[:, ::-1].reshape(256, 1, 3)), cv2.COLOR_BGR2BGRA)
    if not is_finite.all():
        bgra[~is_finite] = (0, 0, 0, 255)
    return np.asarray(bgra, np.uint8), ColourScale(low, high, colours)


def _value_range(style: PictureStyle, values: NDArray[Any], *, is_bytes: bool) -> tuple[float, float]:
    # In ascending order.
    default_range = (
        (0.0, 255.0)
        if is_bytes
        else (float(values.min()), float(values.max()))
        if values.size
        else (0.0, 0.0)
    )
    low = style.low if style.low is not None else default_range[0]
    high = style.high if style.high is not None else default_range[1]
    return (low, high) if low <= high else (low, low) if style.low is not None else (high, high)


def scaled(frame: NDArray[Any], is_valid: NDArray[np.bool_], low: float, high: float) -> NDArray[np.uint8]:
    """Scale values linearly to the range 0 (``low`` and below) to 255 (``high`` and above).

    The result is 0 everywhere if ``high`` is not greater than ``low``.

    Args:
        frame: Values.
        is_valid: False where a value is invalid; the result is 0 there.
        low: Value that becomes 0.
        high: Value that becomes 255.
    """
    import numpy as np  # noqa: PLC0415

    result = np.zeros(frame.shape, np.uint8)
    span = high / 2 - low / 2  # halves, because the difference of two floats may overflow
    if span <= 0:
        return result
    # in strips, because double precision takes eight bytes per value
    for start in range(0, len(frame), STRIP_ROWS):
        rows = slice(start, start + STRIP_ROWS)
        strip = np.where(is_valid[rows], frame[rows], low).astype(np.float64)
        result[rows] = np.clip((strip / 2 - low / 2) * (255 / span), 0, 255).astype(np.uint8)
    return result


def _tone_table(style: PictureStyle) -> NDArray[np.uint8]:
    # Lookup table of the 256 values.
    import numpy as np  # noqa: PLC0415

    levels = (np.arange(256.0) - 127.5) * style.contrast + 127.5 + style.brightness * 255
    return np.clip(levels + 0.5, 0, 255).astype(np.uint8)


@lru_cache(maxsize=len(COLOUR_MAPS))
def _colour_table(name: str) -> NDArray[np.uint8]:
    # As red, green and blue.
    import cv2  # noqa: PLC0415
    import numpy as np  # noqa: PLC0415

    levels = np.arange(256, dtype=np.uint8)
    if name == "grey":
        return np.repeat(levels[:, None], 3, axis=1)
    maps = {
        "viridis": cv2.COLORMAP_VIRIDIS,
        "turbo": cv2.COLORMAP_TURBO,
        "inferno": cv2.COLORMAP_INFERNO,
        "jet": cv2.COLORMAP_JET,
    }
    bgr = cv2.applyColorMap(levels.reshape(256, 1), maps[name]).reshape(256, 3)
    return np.ascontiguousarray(bgr[:, ::-1])
