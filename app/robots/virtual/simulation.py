"""Simulation of the virtual Pepper, with one thread for the body and one for the camera."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import cv2

from app.clock import Clock, poll
from app.robots.description.json_access import finite_float
from app.robots.driver.call import Link
from app.robots.virtual.body import HEIGHT, RADIUS, Body, BodyEvent
from app.robots.virtual.camera import Camera, lens_of
from app.robots.virtual.canvas import Picture
from app.robots.virtual.lens import Lens
from app.robots.virtual.room import Ball, OtherRobot, Person, Room, Thing
from app.robots.virtual.room_map import kind_of
from app.robots.virtual.shared_room import SharedRoom
from app.robots.virtual.vision import Detection, ObjectDetector, message
from nep.text import bounded_str, quotable

BODY_HZ = 30.0
CAMERA_HZ = 15.0
_DETECTION_PERIOD_IMAGES = 3  # images; people and balls move slowly
_SLOW_PERIOD_STEPS = 3  # steps between two values of pose and distance
_SLOW_SENSOR_PERIOD_STEPS = 30  # steps between two values of slowly changing sensors
_MAX_STEP_S = 0.25  # after a suspend the simulation continues from where it was
_SMALL_STEP_S = 0.004  # used while a stop waits for the body to stand still
_FACE_LOST_TIMEOUT_S = 0.5
_JOIN_TIMEOUT_S = 2.0
ROBOT_ITSELF = "robot"
"""Name in ``move`` messages for the robot instead of an object."""
TOUCHABLE_PARTS = ("head", "left_hand", "right_hand")
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _View:
    """Cached view from one position, reused until the room or the position changes."""

    room: Room
    lens: Lens
    picture: Picture
    detections: Mapping[str, list[Detection]]


class Simulation:
    """Simulation of the virtual Pepper in two threads, which publishes its sensors, events and state.

    Attributes:
        body: Body, guarded by `lock`.
        lock: Lock of the body.
        latest_detections: Newest detections by name of the sensor.

    Args:
        body: Body in its room.
        link: Connection to the network.
    """

    def __init__(self, body: Body, link: Link) -> None:
        self.body = body
        self.lock = threading.RLock()
        self.latest_detections: Mapping[str, list[Detection]] = {}
        self._link, self._clock = link, link.clock
        self._camera, self._detector = Camera(body.room), ObjectDetector()
        appearance = OtherRobot(link.name, body.x, body.y, body.theta_deg, RADIUS, HEIGHT)
        self._shared = SharedRoom(link, body, self.lock, appearance)
        self._view: _View | None = None
        self._ended = self._clock.event()
        self._last_step_s = self._clock.now()
        self._face: str | None = None
        self._face_seen_s = 0.0
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Detect the objects in view, then start both threads."""
        cv2.setNumThreads(1)  # more threads don't pay off for small images
        # Before the camera thread's first image, so that an action of the first moment finds its target.
        self._view = self._render(self.body.room, lens_of(self.body))
        self.latest_detections = self._view.detections
        for target, label in ((self._run_body, "body"), (self._run_camera, "camera")):
            self._threads.append(self._clock.start_thread(target, f"{self._link.name} {label}"))

    def close(self) -> None:
        """Stop both threads."""
        self._ended.set()
        for thread in self._threads:
            thread.join(_JOIN_TIMEOUT_S)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until a condition on the body is true; return False on timeout.

        Args:
            condition: Condition, called with the lock held.
            timeout_s: Timeout in seconds.
        """

        def is_reached() -> bool:
            with self.lock:
                self._advance_locked()  # don't wait for the next step of the body thread
                return condition()

        return poll(self._clock, is_reached, timeout_s, _SMALL_STEP_S)

    def _advance_locked(self) -> None:
        # Call with the lock held. Simulates the time since the last step.
        now = self._clock.now()
        self._shared.update_body()
        self.body.step(min(max(0.0, now - self._last_step_s), _MAX_STEP_S))
        self._shared.update_map()
        self._last_step_s = now

    # ---- body thread --------------------------------------------------------------------------------

    def _run_body(self) -> None:
        with self.lock:
            self._last_step_s = self._clock.now()
        for step, _ in enumerate(self._ticker(BODY_HZ)):
            with self.lock:
                self._advance_locked()
                events = list(self.body.events)
                self.body.events.clear()
            self.publish_step(events, step)
            self._shared.publish_changes()

    def publish_step(self, events: list[BodyEvent], step: int) -> None:
        """Publish events, the state, and the values of the sensors that are due at a step.

        Args:
            events: Events since the last step.
            step: Number of the step.
        """
        for event in events:
            self._link.happen(event.name, **event.data)
            if event.name in {"touched", "released"}:
                self._link.sense("head_touched", "head" in self.body.touch_durations_s)
            elif event.name == "heard":
                self._link.sense("heard_word", self.body.last_word)
        with self.lock:
            state, distance = drawing_state(self.body), self.body.distance
            pose = {"x": state["x"], "y": state["y"], "theta": state["theta_deg"]}
        self._link.publish_value("state", state)
        if step % _SLOW_PERIOD_STEPS == 0:
            self._link.sense("pose", pose)
            self._link.sense("distance", round(distance, 2))
        if step % _SLOW_SENSOR_PERIOD_STEPS == 0:
            self._link.sense("battery", int(self.body.battery))
            self._link.sense("head_touched", "head" in self.body.touch_durations_s)
            self._link.sense("heard_word", self.body.last_word)

    # ---- camera thread --------------------------------------------------------------------------------

    def _run_camera(self) -> None:
        for count, _ in enumerate(self._ticker(CAMERA_HZ)):
            is_watched = self._link.subscriber_count("camera") > 0
            is_detection_due = count % _DETECTION_PERIOD_IMAGES == 0
            # subscribers get boxes that belong to the same image
            if is_watched or is_detection_due:
                self.capture(publish=is_watched)

    def capture(self, *, publish: bool) -> None:
        """Render an image, detect objects, and publish the detections.

        The last image is reused if nothing has moved since.

        Args:
            publish: True to publish the image too.
        """
        with self.lock:
            room, lens = self.body.room, lens_of(self.body)
        if self._view is None or (self._view.room, self._view.lens) != (room, lens):
            self._view = self._render(room, lens)
        picture, detections_by_sensor = self._view.picture, self._view.detections
        if publish:
            self._link.sense("camera", picture)
        with self.lock:
            self.latest_detections = detections_by_sensor
        for sensor, detections in detections_by_sensor.items():
            self._link.sense(sensor, message(detections, lens))
        self._link.sense("sees_face", bool(detections_by_sensor["faces"]))
        self._link.sense("sees_ball", bool(detections_by_sensor["balls"]))
        self._update_seen_face(detections_by_sensor["faces"])

    def _render(self, room: Room, lens: Lens) -> _View:
        picture = self._camera.picture(room, lens)
        picture.flags.writeable = False  # reused until something moves
        detections = {
            "faces": self._detector.faces(room, lens),
            "balls": self._detector.balls(picture),
            "markers": self._detector.markers(picture),
        }
        return _View(room, lens, picture, detections)

    def _update_seen_face(self, faces: list[Detection]) -> None:
        now = self._clock.now()
        name = faces[0].name if faces else None
        if name is not None:
            self._face_seen_s = now
            if self._face != name:
                self._face = name
                self._link.happen("face_seen", name=name)
        elif self._face is not None and now - self._face_seen_s >= _FACE_LOST_TIMEOUT_S:
            lost_face, self._face = self._face, None
            self._link.happen("face_lost", name=lost_face)

    # ---- time and the user's actions -----------------------------------------------------------------------

    def _ticker(self, rate_hz: float) -> Ticker:
        return Ticker(self._clock, self._ended, 1 / rate_hz)

    def apply_change(self, change: Mapping[str, object]) -> None:
        """Apply a change of the world by the user.

        Args:
            change: Payload of a message on ``/<name>/world``: touch, move, say, hold, reset, start, or a
                simulated event.
        """
        part, moved_name, word = change.get("touch"), change.get("move"), change.get("say")
        x, y = finite_float(change.get("x")), finite_float(change.get("y"))
        with self.lock:
            if part in TOUCHABLE_PARTS:
                self.body.touch(str(part), down=change.get("down") is not False)
            if isinstance(change.get("hold"), bool):
                self.body.set_lifted(is_lifted=change["hold"] is True)
            if isinstance(moved_name, str) and x is not None and y is not None:
                if moved_name == ROBOT_ITSELF:
                    self.body.carry(x, y)
                else:
                    self._shared.move(moved_name, x, y)
            if isinstance(word, str) and word.strip():
                self.body.hear(word.strip())
            if change.get("reset") is True:
                self.body.reset(self._shared.reset())
            if "start" in change:
                self._shared.return_to_start(change["start"])
        if isinstance(change.get("happen"), str):
            self._simulate_event(change)

    def _simulate_event(self, change: Mapping[str, object]) -> None:
        event, given_data = parse_event(change)
        data = {**self._default_event_data(event), **given_data}
        if not is_valid_event(self._link, event, data):
            return
        with self.lock:
            if event == "heard":
                self.body.hear(str(data["word"]))
                return
            if event == "touched":
                for down in (True, False):
                    self.body.touch(str(data["place"]), down=down)
                return
        self._link.happen(event, **data)

    def _default_event_data(self, event: str) -> dict[str, object]:
        people = self.body.room.people
        return {"name": people[0].name if people else "Aiko"} if "face" in event else {}


class Ticker:
    """Iterator that waits for the next tick of a fixed period and stops when an event is set.

    Yields the current time in seconds. Missed ticks are skipped.

    Args:
        clock: Monotonic clock.
        ended: Event that ends the iteration.
        period_s: Period in seconds.
    """

    def __init__(self, clock: Clock, ended: threading.Event, period_s: float) -> None:
        self._clock, self._ended, self._period_s = clock, ended, period_s
        self._next_tick_s = clock.now()

    def __iter__(self) -> Ticker:
        return self

    def __next__(self) -> float:
        if self._clock.wait(self._ended, max(0.0, self._next_tick_s - self._clock.now())):
            raise StopIteration
        now = self._clock.now()
        self._next_tick_s = max(self._next_tick_s + self._period_s, now)
        return now


def parse_event(change: Mapping[str, object]) -> tuple[str, dict[str, object]]:
    """Return the name and the data of a simulated event.

    Args:
        change: Message such as ``{"happen": "bumped", "side": "front"}``.
    """
    return bounded_str(change["happen"]), {name: value for name, value in change.items() if name != "happen"}


def is_valid_event(link: Link, event: str, data: Mapping[str, object]) -> bool:
    """Return True if a simulated event matches the description; otherwise log the problems."""
    problems = link.event_problems(event, data)
    if problems:
        _log.warning(
            "%s: the event '%s' can't be simulated: %s", link.name, quotable(event), "; ".join(problems)
        )
    return not problems


def drawing_state(body: Body) -> dict[str, object]:
    """Return the state of the body for drawing, in metres and degrees.

    The head pitch is positive downwards; hanging arms are at 0 and raised arms at 180 degrees.
    """
    return {
        "x": round(body.x, 3),
        "y": round(body.y, 3),
        "theta_deg": round(body.theta_deg, 1),
        "head_yaw_deg": round(body.head_yaw.angle, 1),
        "head_pitch_deg": round(body.head_pitch.angle, 1),
        "speech": body.speech,
        "spoken": round(body.spoken_fraction, 2),
        "heard": body.recent_word,
        "language": body.language,
        "volume": body.volume,
        "sound": body.sound.drawing_state() if body.sound is not None else None,
        "eyes": body.eyes,
        "shoulders": body.shoulders,
        "emotion": body.emotion,
        **{f"arm_{side}_deg": round(joint.angle, 1) for side, joint in body.arms.items()},
        **{f"elbow_{side}_deg": round(joint.angle, 1) for side, joint in body.elbows.items()},
        "moving": not body.is_still,
        "touched": sorted(body.touch_durations_s),
        "held": body.is_lifted,
        **room_state(body.room),
    }


def room_state(room: Room) -> dict[str, object]:
    """Return the room and its objects for drawing, as members of the state message."""
    return {
        "objects": _objects(room),
        "room": {
            "shared": True,
            "x_min": room.x_min,
            "x_max": room.x_max,
            "y_min": room.y_min,
            "y_max": room.y_max,
            "height": room.height,
            "openings": [vars(opening) for opening in room.openings],
        },
    }


def _objects(room: Room) -> list[dict[str, object]]:
    return [
        {"kind": kind_of(thing), "name": thing.name, **_extra_fields(thing), **vars(thing)}
        for thing in room.things
    ]


def _extra_fields(thing: Thing) -> dict[str, object]:
    match thing:
        case Ball():
            return {"z": thing.z}
        case Person():
            return {"face_z": thing.face_z}
    return {}
