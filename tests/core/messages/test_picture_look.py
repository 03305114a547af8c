"""Tests of the appearance of images: brightness, contrast and colour scales."""

from __future__ import annotations

import numpy as np
import pytest

from app.core.messages.image_style import (
    COLOUR_MAPS,
    PLAIN,
    PictureStyle,
    apply_colour_map,
    apply_tones,
    parse_style,
)
from app.core.messages.picture import decode
from nep.messages.message import Message

ENCODINGS = {("uint8", 1): "mono8", ("uint16", 1): "mono16", ("uint8", 3): "bgr8"}


def message(array: np.ndarray) -> Message:
    channels = array.shape[2] if array.ndim == 3 else 1
    extension = {"shape": list(array.shape), "encoding": ENCODINGS[array.dtype.name, channels]}
    return Message("/c", array.tobytes(), "image", "image", extension=extension)


def test_default_appearance_returns_image_unchanged() -> None:
    picture = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    assert apply_tones(PLAIN, picture) is picture


def test_brightness_and_contrast_are_applied_and_clipped() -> None:
    grey = np.array([[0, 64, 128, 192, 255]], np.uint8)
    assert apply_tones(PictureStyle(brightness=0.5), grey).tolist() == [[128, 192, 255, 255, 255]]
    assert apply_tones(PictureStyle(brightness=-1), grey).tolist() == [[0, 0, 0, 0, 0]]
    assert apply_tones(PictureStyle(contrast=2), grey).tolist() == [[0, 1, 129, 255, 255]]
    assert apply_tones(PictureStyle(contrast=0.1), grey).tolist() == [[115, 121, 128, 134, 140]]


@pytest.mark.parametrize("name", COLOUR_MAPS)
def test_pixel_colours_match_the_colour_scale(name) -> None:
    depth = np.array([[100, 600, 1100]], np.uint16)
    bgra, scale = apply_colour_map(PictureStyle(colour_map=name), depth)
    assert (scale.low, scale.high) == (100.0, 1100.0)
    assert bgra[0, 0, 2::-1].tolist() == scale.colours[0].tolist()
    assert bgra[0, 1, 2::-1].tolist() == scale.colours[127].tolist()
    assert bgra[0, 2, 2::-1].tolist() == scale.colours[255].tolist()


def test_custom_range_clips_values_outside() -> None:
    depth = np.array([[0.0, 1.0, 2.0, 9.0, np.nan, np.inf]], np.float32)
    bgra, scale = apply_colour_map(PictureStyle(colour_map="grey", low=1.0, high=3.0), depth)
    assert (scale.low, scale.high) == (1.0, 3.0)
    assert bgra[0, :, 0].tolist() == [0, 0, 127, 255, 0, 0]


@pytest.mark.parametrize(
    ("numbers", "ends"),
    [
        (np.full((2, 2), 7, np.uint16), (7.0, 7.0)),
        (np.full((2, 2), np.nan, np.float32), (0.0, 0.0)),
        (np.array([[-1e308, 1e308]]), (-1e308, 1e308)),
        (np.array([[0, 2**64 - 1]], np.uint64), (0.0, float(2**64 - 1))),
    ],
)
def test_constant_nan_and_extreme_values_have_a_colour_scale(numbers, ends) -> None:
    bgra, scale = apply_colour_map(PLAIN, numbers)
    assert bgra.shape == (*numbers.shape, 4)
    assert (scale.low, scale.high) == ends


def test_single_limit_outside_the_data_range_collapses_the_colour_scale() -> None:
    _bgra, scale = apply_colour_map(PictureStyle(low=50.0), np.array([[1, 2]], np.uint16))
    assert scale.low == scale.high == 50.0
    _bgra, scale = apply_colour_map(PictureStyle(high=-5.0), np.array([[1, 2]], np.uint16))
    assert scale.low == scale.high == -5.0


def test_decoded_image_reports_its_appearance_and_colour_scale() -> None:
    plain, _error = decode(message(np.array([[0, 255]], np.uint8)), 0.0)
    assert plain is not None
    assert (plain.scale, plain.style) == (None, PLAIN)
    look = PictureStyle(colour_map="jet", brightness=0.1)
    shown, _error = decode(message(np.array([[0, 255]], np.uint8)), 0.0, None, look)
    assert shown is not None
    assert shown.scale is not None
    assert (shown.scale.low, shown.scale.high, shown.style) == (0.0, 255.0, look)
    assert shown.pixel(1, 0) == 255  # the value, regardless of its colour
    colours, _error = decode(message(np.zeros((2, 2, 3), np.uint8)), 0.0, None, PictureStyle(brightness=1.0))
    assert colours is not None
    assert colours.scale is None
    assert colours.bgra[..., :3].min() == 255


@pytest.mark.parametrize(
    ("saved", "look"),
    [
        (PictureStyle(0.25, 2.0, "turbo", 1.0, 9.0).to_json(), PictureStyle(0.25, 2.0, "turbo", 1.0, 9.0)),
        (None, PLAIN),
        ({"brightness": 7, "contrast": 0, "colours": "none such"}, PictureStyle(1.0, 0.1)),
        ({"brightness": "x", "contrast": float("nan"), "low": 10**400, "high": True}, PLAIN),
        ({"low": 9.0, "high": 1.0}, PLAIN),
        ({"low": 9.0}, PictureStyle(low=9.0)),
    ],
)
def test_saved_appearance_is_restored_and_invalid_values_become_defaults(saved, look) -> None:
    assert parse_style(saved) == look
