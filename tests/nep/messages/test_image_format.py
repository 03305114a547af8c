"""Tests of a publisher's image format: file format, quality and size."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import nep
from nep.errors import EncodeError
from nep.messages import image_codec
from nep.messages.codecs import codec
from nep.messages.image_codec import ImageFormat

COLOUR = np.random.default_rng(1).integers(0, 255, (60, 80, 3), np.uint8)
DEPTH = np.arange(60 * 80, dtype=np.uint16).reshape(60, 80)


def back(image: ImageFormat, frame: Any) -> Any:
    """Return the image as a subscriber decodes it."""
    made = image.encode(frame)
    return codec("image").decode(memoryview(made.data), made.extension or {})


@pytest.fixture
def node() -> Iterator[nep.Node]:
    with nep.node("pictures", "memory") as made:
        yield made


@pytest.mark.parametrize(
    ("image", "frame", "encoding"),
    [
        (ImageFormat(), COLOUR, "jpeg"),
        (ImageFormat(), DEPTH, "png"),
        (ImageFormat("jpeg"), COLOUR, "jpeg"),
        (ImageFormat("png"), COLOUR, "png"),
        (ImageFormat("png"), DEPTH, "png"),
        (ImageFormat("raw"), COLOUR, "bgr8"),
        (ImageFormat("raw"), DEPTH, "mono16"),
        (ImageFormat("raw"), DEPTH.astype(np.float32), "32FC1"),
        (ImageFormat(), DEPTH.astype(np.float32), "32FC1"),
    ],
)
def test_image_is_encoded_in_the_requested_format(image: ImageFormat, frame: Any, encoding: str) -> None:
    made = image.encode(frame)
    assert made.extension is not None
    assert made.extension["encoding"] == encoding
    if encoding != "jpeg":
        np.testing.assert_array_equal(back(image, frame), frame)


def test_lower_jpeg_quality_uses_fewer_bytes() -> None:
    sizes = [len(ImageFormat("jpeg", quality=each).encode(COLOUR).data) for each in (1, 50, 90, 100)]
    assert sizes == sorted(set(sizes))
    assert ImageFormat("jpeg").encode(COLOUR).data == image_codec.encode(COLOUR).data


@pytest.mark.parametrize("kind", ["auto", "jpeg", "png", "raw"])
def test_image_is_scaled_down_to_its_maximum_width_with_its_aspect_ratio_but_not_up(kind: str) -> None:
    assert back(ImageFormat(kind, width=40), COLOUR).shape == (30, 40, 3)
    assert back(ImageFormat(kind, width=80), COLOUR).shape == COLOUR.shape
    assert back(ImageFormat(kind, width=1000), COLOUR).shape == COLOUR.shape
    assert back(ImageFormat(kind, width=1), np.zeros((1, 500, 3), np.uint8)).shape == (1, 1, 3)


def test_depth_image_is_downsampled_without_interpolation() -> None:
    frame = np.where(np.arange(80) % 2, 0, 5000).astype(np.uint16) * np.ones((60, 1), np.uint16)
    small = back(ImageFormat("png", width=30), frame)
    assert small.shape == (22, 30)
    assert set(np.unique(small).tolist()) <= {0, 5000}


def test_colour_image_is_downsampled_by_averaging() -> None:
    frame = np.where(np.arange(80) % 2, 0, 200).astype(np.uint8)[None, :, None] * np.ones(
        (60, 1, 3), np.uint8
    )
    assert np.unique(back(ImageFormat("raw", width=40), frame)).tolist() == [100]


@pytest.mark.parametrize(
    ("image", "frame", "sentence"),
    [
        (ImageFormat("jpeg"), DEPTH, "a JPEG image needs 'uint8' and one or three channels"),
        (
            ImageFormat("jpeg"),
            np.zeros((4, 4, 4), np.uint8),
            "a JPEG image needs 'uint8' and one or three channels",
        ),
        (ImageFormat("png"), DEPTH.astype(np.float32), "a PNG image needs 'uint8' or 'uint16'"),
        (ImageFormat("png"), np.zeros((4, 4, 2), np.uint8), "a PNG image needs 'uint8' or 'uint16'"),
        (ImageFormat("raw"), "picture", "publish a 'uint8' array"),
        (ImageFormat("raw"), b"no file", "not a JPEG or PNG image"),
    ],
)
def test_image_unsupported_by_the_format_raises_encode_error(
    image: ImageFormat, frame: Any, sentence: str
) -> None:
    with pytest.raises(EncodeError, match=sentence):
        image.encode(frame)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"kind": "gif"}, "kind is 'gif'; use 'auto', 'jpeg', 'png' or 'raw'"),
        ({"quality": 0}, "quality must be a whole number from 1 to 100, not 0"),
        ({"quality": 101}, "quality must be a whole number from 1 to 100, not 101"),
        ({"quality": 50.0}, "quality must be a whole number from 1 to 100, not 50.0"),
        ({"width": 0}, "width must be a whole number from 1 to 65535, not 0"),
        ({"width": -1}, "width must be a whole number from 1 to 65535, not -1"),
        ({"width": True}, "width must be a whole number from 1 to 65535, not True"),
    ],
)
def test_image_format_with_invalid_kind_quality_or_width_is_rejected(
    given: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        ImageFormat(**given)


def test_publisher_applies_its_image_format_but_not_to_encoded_files(node: nep.Node) -> None:
    sub = node.new_sub("camera", "image")
    with node.new_pub("camera", "image", image=nep.ImageFormat("png", width=40)) as pub:
        pub.publish(COLOUR)
        assert sub.listen(timeout_s=30.0)[1].shape == (30, 40, 3)
        file = image_codec.encode(COLOUR).data
        pub.publish(file)
        message = sub.receive(30.0)
        assert message is not None
        assert (bytes(message.data), message.extension["encoding"]) == (file, "jpeg")
        pub.publish(nep.raw_image(DEPTH))
        np.testing.assert_array_equal(sub.listen(timeout_s=30.0)[1], DEPTH)


def test_image_unsupported_by_its_format_is_rejected_and_logged(
    node: nep.Node, caplog: pytest.LogCaptureFixture
) -> None:
    node.new_sub("camera", "image")
    pub = node.new_pub("camera", "image", image=nep.ImageFormat("jpeg"))
    pub.publish(DEPTH)
    assert pub.refused == 1
    assert "a JPEG image needs 'uint8' and one or three channels" in caplog.text


@pytest.mark.parametrize(
    ("msg_type", "image", "sentence"),
    [
        ("json", ImageFormat(), "'image' requires the message type 'image'"),
        ("image", "jpeg", "'image' must be a 'nep.ImageFormat', not 'str'"),
    ],
)
def test_image_argument_must_be_an_image_format_and_requires_the_message_type_image(
    node: nep.Node, msg_type: str, image: Any, sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        node.new_pub("camera", msg_type, image=image)
    assert not node.graph().topics
