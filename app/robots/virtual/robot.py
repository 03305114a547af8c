"""Sensors of the virtual Pepper, and helpers for its actions, whose movements brake on cancellation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, TypeAlias

from app.robots.driver.call import Call, Canceled, Failed, Link
from app.robots.driver.common_actions import battery_sensor, distance_sensor, position_sensor
from app.robots.driver.declare import EventSpec, detections, event, picture, sensor
from app.robots.driver.schema import Suggested
from app.robots.virtual.body import START_PITCH_DEG, Body
from app.robots.virtual.camera import lens_of
from app.robots.virtual.motion import Motion
from app.robots.virtual.room import Room
from app.robots.virtual.simulation import Simulation
from app.robots.virtual.vision import angles_to
from nep.i18n import _

_HEAD_ANGLES = {
    "ahead": (0.0, START_PITCH_DEG),
    "left": (50.0, START_PITCH_DEG),
    "right": (-50.0, START_PITCH_DEG),
}
_HEAD_ANGLES |= {"up": (0.0, -25.0), "down": (0.0, 30.0)}
FEEDBACK_INTERVAL_S = 0.2
"""Interval in seconds between two feedback messages of an action."""

TouchablePart: TypeAlias = Literal["head", "left_hand", "right_hand"]


def _touch_event(text: str, title: str, rize_value: int) -> EventSpec:
    return event(
        text,
        title=title,
        icon="hand",
        fields={"place": TouchablePart},
        choose=("place",),
        rize=lambda data: ("touched", {str(data["place"]): rize_value}),
    )


def _face_event(text: str, title: str, rize_word: str) -> EventSpec:
    return event(
        text,
        title=title,
        icon="scan-face",
        fields={"name": str},
        rize=lambda _data: ("human_detected", {rize_word: 1}),
    )


class SensorDeclarations:
    """Declarations of the sensors and events of the virtual Pepper.

    :class:`~app.robots.virtual.simulation.Simulation` publishes their values.
    """

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

    touched = _touch_event("when %robot %place is touched", "touched", 1)
    released = _touch_event("when %robot %place is released", "released", 0)
    face_seen = _face_event("when %robot sees a face", "face seen", "yes")
    face_lost = _face_event("when %robot loses the face", "face lost", "no")
    heard = event(
        "when %robot hears %word",
        title="heard",
        icon="ear",
        fields={"word": Annotated[str, Suggested("hello")]},
        choose=("word",),
        rize=lambda data: ("word", {str(data["word"]): 1}),
    )
    bumped = event(
        "when %robot bumps into something with its %side",
        title="bumped",
        icon="octagon-alert",
        fields={"side": Literal["front", "back"]},
        choose=("side",),
        rize=lambda data: ("bumpers", {str(data["side"]): 1}),
    )


class SimulatedRobot(SensorDeclarations):
    """Base class of the virtual Pepper: owns the simulation and provides helpers for actions."""

    start_room: ClassVar[Room] = Room()

    def __init__(self, link: Link) -> None:
        self._simulation = Simulation(Body(room=self.start_room), link)
        link.on_world(self._simulation.apply_change)
        self._simulation.start()

    def close(self) -> None:
        """Stop the threads of the simulation."""
        self._simulation.close()

    def _run_motion(self, call: Call, start: Callable[[Body], Motion]) -> Motion:
        with self._simulation.lock:
            motion = start(self._simulation.body)
        try:
            while not call.until(lambda: motion.done, for_s=FEEDBACK_INTERVAL_S):
                call.feedback(to_go=round(abs(motion.remaining), 2))
        except Canceled:
            self._brake(motion)
            call.last(to_go=round(abs(motion.remaining), 3))
            raise
        return motion

    def _brake(self, motion: Motion) -> None:
        with self._simulation.lock:
            motion.halt()
        self._simulation.wait_for(lambda: motion.done, timeout_s=1.0)

    def _turn_head(self, call: Call, yaw: float, pitch: float) -> None:
        with self._simulation.lock:
            self._simulation.body.head_yaw.set_target(yaw)
            self._simulation.body.head_pitch.set_target(pitch)
        self._wait_until(
            call, lambda: self._simulation.body.are_joints_at_target, self._simulation.body.stop_joints
        )

    def _head_angles_to(self, target: str) -> tuple[float, float]:
        if target in _HEAD_ANGLES:
            return _HEAD_ANGLES[target]
        visible_objects = self._simulation.latest_detections.get("faces" if target == "face" else "balls", [])
        if not visible_objects:
            raise Failed(
                _("look at: no face in the picture")
                if target == "face"
                else _("look at: no ball in the picture")
            )
        left, down = angles_to(lens_of(self._simulation.body), visible_objects[0].centre)
        body = self._simulation.body
        return body.head_yaw.angle + left, body.head_pitch.angle + down

    def _wait_until(self, call: Call, is_done: Callable[[], bool], halt: Callable[[], None]) -> None:
        try:
            call.until(is_done)
        except Canceled:
            with self._simulation.lock:
                halt()
            raise
