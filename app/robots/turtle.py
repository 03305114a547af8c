"""Virtual two-wheeled robot: ``python -m app.robots.turtle --name Turtle`` runs it as a process.

The robot is simulated in the same kind of room as the virtual Pepper. Studio draws the state published on
``/<name>/state``.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2

from app.robots.description.json_access import finite_float
from app.robots.diffdrive import DIFFDRIVE, DiffDrive
from app.robots.driver.call import Link
from app.robots.driver.process import main as drive
from app.robots.virtual.camera import Camera
from app.robots.virtual.canvas import Picture
from app.robots.virtual.lens import Lens
from app.robots.virtual.room import OtherRobot, Room
from app.robots.virtual.shared_room import SharedRoom
from app.robots.virtual.simulation import ROBOT_ITSELF, Ticker, is_valid_event, parse_event, room_state
from app.robots.virtual.vision import ColourPatch, colours_in
from app.robots.virtual.wheels import HEIGHT, RADIUS, WheelBody

VIRTUAL_ROBOT = ("diffdrive", "Turtle")
BODY_HZ, CAMERA_HZ = 60.0, 15.0
_STATE_PERIOD_STEPS, _SLOW_PERIOD_STEPS, _BATTERY_PERIOD_STEPS = 2, 6, 60
_MAX_STEP_S = 0.25
_EYE_HEIGHT_M = 0.22
_EYE_PITCH_DEG = -6.0
_JOIN_TIMEOUT_S = 2.0


@dataclass(frozen=True)
class _CameraView:
    """Cached image from one position, reused until the room or the position changes."""

    room: Room
    lens: Lens
    image: Picture
    colours: Mapping[str, ColourPatch]


class VirtualWheels:
    """Simulated base.

    The body is simulated in one thread at 60 Hz, the camera in another at 15 Hz. Thread-safe.

    Args:
        link: Connection to the network.
    """

    def __init__(self, link: Link) -> None:
        self.body = WheelBody()
        self._link, self._clock = link, link.clock
        self._lock = threading.Lock()
        self._ended = self._clock.event()
        self._camera = Camera(self.body.room)
        self._view: _CameraView | None = None
        self._visible_colours: set[str] = set()
        appearance = OtherRobot(link.name, 0.0, 0.0, 0.0, RADIUS, HEIGHT, "turtle")
        self._shared = SharedRoom(link, self.body, self._lock, appearance)
        self._last_step_s = self._clock.now()
        self._threads: list[threading.Thread] = []
        link.on_world(self.apply_change)

    def start(self) -> None:
        """Start both threads."""
        cv2.setNumThreads(1)
        for target, label in ((self._run_body, "wheels"), (self._run_camera, "camera")):
            self._threads.append(self._clock.start_thread(target, f"{self._link.name} {label}"))

    # ---- Wheels interface --------------------------------------------------------------------------------

    def drive(self, speed: float, turn_speed: float) -> None:
        """Set the target speed (m/s) and turning speed (°/s)."""
        with self._lock:
            self.body.drive(speed, turn_speed)

    def pose(self) -> tuple[float, float, float]:
        """Return the position (x and y in m) and the orientation (theta in degrees)."""
        with self._lock:
            return self.body.x, self.body.y, self.body.theta_deg

    def driven_m(self) -> float:
        """Return the total distance rolled in m, without the distance that the user has carried the robot."""
        with self._lock:
            return self.body.driven_m

    def is_still(self) -> bool:
        """Return True if the base is not moving."""
        with self._lock:
            self._advance_locked()  # don't wait for the next step of the body thread
            return self.body.is_still

    def bumped_side(self) -> str:
        """Return the side at which the base touches something, such as "left"; "" if it touches nothing."""
        return self.body.pressed_bumper

    def set_light(self, colour: str) -> None:
        """Set the colour of the light (``#rrggbb``)."""
        with self._lock:
            self.body.light = colour

    def close(self) -> None:
        """Stop both threads."""
        self._ended.set()
        for thread in self._threads:
            thread.join(_JOIN_TIMEOUT_S)

    # ---- threads ----------------------------------------------------------------------------------

    def _run_body(self) -> None:
        with self._lock:
            self._last_step_s = self._clock.now()
        for step, _ in enumerate(Ticker(self._clock, self._ended, 1 / BODY_HZ)):
            with self._lock:
                self._advance_locked()
                events = list(self.body.events)
                self.body.events.clear()
                state = self._drawing_state() if step % _STATE_PERIOD_STEPS == 0 else None
                slow_values = (
                    (self.body.distance, self.body.pressed_bumper) if step % _SLOW_PERIOD_STEPS == 0 else None
                )
            for event in events:
                self._link.happen(event.name, **event.data)
            if state is not None:
                self._shared.publish_changes()
                self._link.publish_value("state", state)
                self._link.sense("pose", {"x": state["x"], "y": state["y"], "theta": state["theta_deg"]})
            if slow_values is not None:
                distance, pressed_bumper = slow_values
                self._link.sense("distance", round(distance, 2))
                self._link.sense("bumper", bool(pressed_bumper))
            if step % _BATTERY_PERIOD_STEPS == 0:
                self._link.sense("battery", int(self.body.battery))

    def _advance_locked(self) -> None:
        # Call with the lock held. Simulates the time since the last step.
        now = self._clock.now()
        self._shared.update_body()
        self.body.step(min(max(0.0, now - self._last_step_s), _MAX_STEP_S))
        self._shared.update_map()
        self._last_step_s = now

    def _drawing_state(self) -> dict[str, object]:
        body = self.body
        return {
            "figure": "turtle",
            "x": round(body.x, 3),
            "y": round(body.y, 3),
            "theta_deg": round(body.theta_deg, 1),
            "eyes": body.light,
            "moving": not body.is_still,
            "bumped": body.pressed_bumper,
            "radius": RADIUS,
            "held": body.is_lifted,
            **room_state(body.room),
        }

    def _run_camera(self) -> None:
        for count, _ in enumerate(Ticker(self._clock, self._ended, 1 / CAMERA_HZ)):
            is_watched = self._link.subscriber_count("camera") > 0
            if not is_watched and count % 3:
                continue
            with self._lock:
                body = self.body
                room, lens = body.room, Lens((body.x, body.y, _EYE_HEIGHT_M), body.theta_deg, _EYE_PITCH_DEG)
            if self._view is None or (self._view.room, self._view.lens) != (room, lens):
                image = self._camera.picture(room, lens)
                image.flags.writeable = False  # reused until something moves
                self._view = _CameraView(room, lens, image, colours_in(image))
            if is_watched:
                self._link.sense("camera", self._view.image)
            colours = self._view.colours
            for name in colours.keys() - self._visible_colours:
                self._link.happen("colour", name=name, x=colours[name].x, area=colours[name].area)
            self._visible_colours = set(colours)

    def apply_change(self, change: Mapping[str, object]) -> None:
        """Apply a change of the world by the user.

        Args:
            change: Payload of a message on ``/<name>/world``: move, hold, reset, start, or a simulated event.
        """
        moved_name, x, y = change.get("move"), finite_float(change.get("x")), finite_float(change.get("y"))
        with self._lock:
            if isinstance(change.get("hold"), bool):
                self.body.set_lifted(is_lifted=change["hold"] is True)
            if isinstance(moved_name, str) and x is not None and y is not None:
                if moved_name == ROBOT_ITSELF:
                    self.body.carry(x, y)
                else:
                    self._shared.move(moved_name, x, y)
            if change.get("reset") is True:
                self.body.reset(self._shared.reset())
            if "start" in change:
                self._shared.return_to_start(change["start"])
        if isinstance(change.get("happen"), str):
            event, data_fields = parse_event(change)
            data = {**({"x": 0.0, "area": 0.1} if event == "colour" else {}), **data_fields}
            if not is_valid_event(self._link, event, data):
                return
            if event == "bump":
                with self._lock:
                    self.body.press(str(data["side"]))
            else:
                self._link.happen(event, **data)


class VirtualTurtle(DiffDrive):
    """Virtual two-wheeled robot in its room."""

    def __init__(self, link: Link) -> None:
        wheels = VirtualWheels(link)
        super().__init__(link, wheels)
        self._wheels = wheels
        wheels.start()

    def odometer(self) -> Callable[[], float]:
        """Return a function that returns the distance in m rolled from now on, not counting being carried."""
        start_m = self._wheels.driven_m()
        return lambda: self._wheels.driven_m() - start_m


ROBOT = replace(
    DIFFDRIVE,
    title="Turtle",
    body=VirtualTurtle,
    virtual=True,
    driver="virtual",
    description="A virtual robot on two wheels in a small room: camera, distance, bumper, light.",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the virtual robot as a process and return the exit code.

    Args:
        arguments: Arguments of `app.robots.driver.process.main`.
    """
    return drive(ROBOT, arguments)


if __name__ == "__main__":
    sys.exit(main())
