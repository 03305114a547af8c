"""What the virtual robot tells: its sensors and its events, as the description has them."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from app.robots.driver.common_actions import battery_sensor, distance_sensor, position_sensor
from app.robots.driver.declare import detections, event, picture, sensor
from app.robots.driver.schema import Suggested

Place: TypeAlias = Literal["head", "left_hand", "right_hand"]


class Senses:
    """The declarations; what fills them is :class:`~app.robots.virtual.life.Life`."""

    battery = battery_sensor()
    distance = distance_sensor(most_m=5)
    head_touched = sensor(bool, title="head touch", text="head is touched", icon="hand")
    sees_face = sensor(bool, title="sees a face", text="sees a face", icon="scan-face", rate_hz=5)
    sees_ball = sensor(bool, title="sees a ball", text="sees a ball", icon="scan", rate_hz=5)
    heard_word = sensor(str, title="last word heard", text="last word heard", icon="ear")
    pose = position_sensor(rate_hz=10)
    camera = picture(title="camera", width=320, height=240, rate_hz=15, hfov_deg=56.3)
    faces = detections(title="faces", camera="camera", icon="scan-face", rate_hz=5)
    balls = detections(title="balls", camera="camera", icon="scan", rate_hz=5)
    markers = detections(title="markers", camera="camera", icon="scan-line", rate_hz=5)

    touched = event(
        "when %robot %place is touched",
        title="touched",
        icon="hand",
        fields={"place": Place},
        choose=("place",),
        rize=lambda data: ("touched", {str(data["place"]): 1}),
    )
    released = event(
        "when %robot %place is released",
        title="released",
        icon="hand",
        fields={"place": Place},
        choose=("place",),
        rize=lambda data: ("touched", {str(data["place"]): 0}),
    )
    face_seen = event(
        "when %robot sees a face",
        title="face seen",
        icon="scan-face",
        fields={"name": str},
        rize=lambda _: ("human_detected", {"yes": 1}),
    )
    face_lost = event(
        "when %robot loses the face",
        title="face lost",
        icon="scan-face",
        fields={"name": str},
        rize=lambda _: ("human_detected", {"no": 1}),
    )
    heard = event(
        "when %robot hears %word",
        title="heard",
        icon="ear",
        fields={"word": Annotated[str, Suggested("hello")]},
        choose=("word",),
        rize=lambda data: ("word", {str(data["word"]): 1}),
    )
    bumped = event(
        "when %robot bumps with its %side",
        title="bumped",
        icon="octagon-alert",
        fields={"side": Literal["front", "back"]},
        choose=("side",),
        rize=lambda data: ("bumpers", {str(data["side"]): 1}),
    )
