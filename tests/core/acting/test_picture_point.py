"""Tests of publishing a clicked pixel as a message of each type."""

from __future__ import annotations

import pytest

from app.core.run.acting.picture_point import MESSAGE_TYPES, PicturePoint, default_topic
from nep.messages.codecs import codec_for

POINT = PicturePoint(16, 8, 320, 240, 1_795_164_093_000_000_007, "middle")


def test_json_point_has_all_known_fields() -> None:
    assert POINT.payload("/camera", "json") == {
        "x": 16,
        "y": 8,
        "width": 320,
        "height": 240,
        "button": "middle",
        "stamp": {"sec": 1_795_164_093, "nanosec": 7},
        "topic": "/camera",
    }
    untimed = PicturePoint(0, 0, 1, 1, None)
    assert untimed.payload("/c", "json")["stamp"] is None
    assert untimed.relative_position == (0.5, 0.5)
    assert PicturePoint(319, 239, 320, 240, None).relative_position == pytest.approx(
        (0.99844, 0.99792), abs=1e-5
    )


def test_ros_point_types_have_their_fields() -> None:
    place = {"x": 16.0, "y": 8.0, "z": 0.0}
    assert POINT.payload("/camera", "geometry_msgs/Point") == place
    assert POINT.payload("/camera", "geometry_msgs/PointStamped") == {
        "header": {"stamp": {"sec": 1_795_164_093, "nanosec": 7}, "frame_id": ""},
        "point": place,
    }
    for msg_type in MESSAGE_TYPES:
        made = codec_for(msg_type).encode(POINT.payload("/camera", msg_type))
        assert codec_for(msg_type).decode(made.data, {}) == POINT.payload("/camera", msg_type)


def test_point_topic_is_below_image_topic() -> None:
    assert default_topic("/robot/camera") == "/robot/camera/point"
    assert default_topic("camera/") == "camera/point"
