"""Two-wheeled robot with a camera: its declaration, and its actions for any base with speed control.

A driver supplies the base (:class:`Wheels`): a real one, or the virtual one of :mod:`app.robots.turtle`.
Distances are computed from the positions that the base measures.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from typing import Annotated, Literal, Protocol

from app.clock import poll
from app.robots.driver.call import Call, Canceled, Failed, Link
from app.robots.driver.common_actions import (
    MOVEMENT,
    battery_sensor,
    distance_sensor,
    drives,
    position_sensor,
)
from app.robots.driver.declare import Kind, action, event, picture, safe_stop, sensor
from app.robots.driver.schema import Colour, Range
from nep.i18n import _

LIGHTS = "Lights"
STEP_INTERVAL_S = 1 / 30
FEEDBACK_PERIOD_STEPS = 6
SPEED, TURN_SPEED = 0.35, 80.0
MIN_SPEED, MIN_TURN_SPEED = 0.03, 6.0
DECELERATION, TURN_DECELERATION = 0.5, 200.0  # m/s², °/s²
DISTANCE_TOLERANCE_M, ANGLE_TOLERANCE_DEG = 0.008, 0.8
MIN_DISTANCE_M = 0.03
STANDSTILL_TIMEOUT_S = 1.0
_STANDSTILL_POLL_S = 0.005
MAX_DISTANCE_M = 5.0

Distance = Annotated[float, Range(-MAX_DISTANCE_M, MAX_DISTANCE_M, 0.05, "m")]


class Wheels(Protocol):
    """Interface of the robot's base. All methods must be thread-safe."""

    def drive(self, speed: float, turn_speed: float) -> None:
        """Set the speed of the base.

        Args:
            speed: Speed in m/s, positive forwards.
            turn_speed: Turning speed in °/s, positive to the left. If both speeds are 0, the base brakes.
        """

    def pose(self) -> tuple[float, float, float]:
        """Return the position (x and y in m) and the orientation (theta in degrees)."""

    def is_still(self) -> bool:
        """Return True if the base is not moving."""

    def bumped_side(self) -> str:
        """Return the side at which the base touches something, such as "left"; "" if it touches nothing."""

    def set_light(self, colour: str) -> None:
        """Set the colour of the light.

        Args:
            colour: Colour in the form ``#rrggbb``.
        """

    def close(self) -> None:
        """Disconnect from the base."""


class DiffDrive:
    """Declaration and actions of a two-wheeled robot with a camera.

    Args:
        link: Connection to the network.
        wheels: Base of the robot.
    """

    pose = position_sensor(rate_hz=30)
    distance = distance_sensor(most_m=4)
    bumper = sensor(bool, title="bumper", text="touches something", icon="octagon-alert", rate_hz=10)
    battery = battery_sensor()
    camera = picture(title="camera", width=320, height=240, rate_hz=15, hfov_deg=56.3)
    bump = event(
        "when %robot bumps into something on the %side",
        title="bumped",
        icon="octagon-alert",
        fields={"side": Literal["left", "right", "front", "back"]},
        choose=("side",),
    )
    colour = event(
        "when %robot sees something %name",
        title="colour seen",
        icon="palette",
        fields={
            "name": Literal["red", "green", "blue"],
            "x": Annotated[float, Range(-1, 1)],
            "area": Annotated[float, Range(0, 1)],
        },
        choose=("name",),
    )

    def __init__(self, link: Link, wheels: Wheels) -> None:
        self.link, self.wheels = link, wheels
        self._steering = threading.Lock()

    def close(self) -> None:
        """Disconnect from the base."""
        self.wheels.close()

    # ---- actions ----------------------------------------------------------------------------------

    @action(
        "drive at %speed m/s turning %turn °/s",
        MOVEMENT,
        "joystick",
        says="drives at %speed m/s",
        uses=("base",),
        on_busy="replace",
        risk="locomotes",
        cancellable=False,
        repeat_s=0.2,
    )
    def drive(
        self,
        call: Call,
        speed: Annotated[float, Range(-0.5, 0.5, 0.05, "m/s", "slider")] = 0.2,
        turn: Annotated[float, Range(-90, 90, 5, "deg/s", "slider")] = 0.0,
    ) -> None:
        """Keep moving until the next drive or stop. The robot stops if its program no longer responds."""
        self._set_speeds(call, speed, turn)

    @drives("move %distance m", "footprints", "moves %distance m", unit="m", moved=True)
    def move(self, call: Call, distance: Distance = 0.5) -> Mapping[str, object]:
        """Move straight ahead, or backwards if the distance is negative."""
        total_m = abs(distance)
        moved_m = self._drive_straight(
            call, distance, lambda moved: {"moved": moved, "to_go": _remaining(total_m, moved)}
        )
        return {"moved": round(moved_m, 3)}

    @drives("turn %angle °", "rotate-ccw", "turns %angle°", unit="deg")
    def turn(self, call: Call, angle: Annotated[float, Range(-360, 360, 5, "deg", "angle")] = 90.0) -> None:
        """Turn on the spot; positive angles turn left."""
        self._turn_on_spot(call, angle, lambda turned: {"to_go": _remaining(abs(angle), turned)})

    @drives("go to x %x m y %y m", "map-pin", "goes to %x, %y m", unit="m", title="go to")
    def go_to(self, call: Call, x: Distance = 0.0, y: Distance = 0.0) -> None:
        """Turn to a position and move there in a straight line. The robot doesn't avoid obstacles."""
        current_x, current_y, current_theta_deg = self.wheels.pose()
        distance_m = math.hypot(x - current_x, y - current_y)
        if distance_m < MIN_DISTANCE_M:
            return
        turn_deg = math.degrees(math.atan2(y - current_y, x - current_x)) - current_theta_deg
        self._turn_on_spot(
            call, (turn_deg + 180.0) % 360.0 - 180.0, lambda _: {"to_go": round(distance_m, 2)}
        )
        self._drive_straight(call, distance_m, lambda moved: {"to_go": _remaining(distance_m, moved)})

    @action(
        "light %colour",
        LIGHTS,
        "lightbulb",
        says="lights up",
        uses=("light",),
        on_busy="replace",
        cancellable=False,
    )
    def light(self, call: Call, colour: Colour = "#35c26b") -> None:  # noqa: ARG002 - every action receives its call
        """Set the colour of the light."""
        self.wheels.set_light(colour)

    @safe_stop(watchdog_s=0.5, within_s=0.1)
    def stop(self) -> None:
        """Brake and return when the robot stands still. Raises Failed if the wheels still turn after 1 s."""
        with self._steering:  # running actions are canceled and don't steer any more
            self.wheels.drive(0.0, 0.0)
        if not poll(self.link.clock, self.wheels.is_still, STANDSTILL_TIMEOUT_S, _STANDSTILL_POLL_S):
            raise Failed(_("its wheels keep turning"))

    # ---- steering ---------------------------------------------------------------------------------

    def _set_speeds(self, call: Call, speed: float, turn_speed: float) -> None:
        with self._steering:
            if call.canceled:
                raise Canceled
            self.wheels.drive(speed, turn_speed)

    def _brake(self) -> None:
        with self._steering:
            self.wheels.drive(0.0, 0.0)

    def odometer(self) -> Callable[[], float]:
        """Return a function that returns the distance in m from the current position."""
        start_x, start_y, _ = self.wheels.pose()

        def driven_m() -> float:
            x, y, _ = self.wheels.pose()
            return math.hypot(x - start_x, y - start_y)

        return driven_m

    def _drive_straight(
        self, call: Call, distance: float, create_feedback: Callable[[float], dict[str, object]]
    ) -> float:
        read_distance = self.odometer()

        def steer(remaining: float) -> None:
            speed = min(SPEED, max(MIN_SPEED, math.sqrt(2 * DECELERATION * remaining)))
            self._set_speeds(call, math.copysign(speed, distance), 0.0)

        def send_feedback(moved: float) -> None:
            call.feedback(**create_feedback(round(moved, 2)))

        self._steer(call, abs(distance), DISTANCE_TOLERANCE_M, read_distance, steer, send_feedback)
        return read_distance()

    def _turn_on_spot(
        self, call: Call, angle: float, create_feedback: Callable[[float], dict[str, object]]
    ) -> None:
        last_theta_deg = [self.wheels.pose()[2]]
        total_deg = [0.0]

        def turned_deg() -> float:
            theta_deg = self.wheels.pose()[2]
            total_deg[0] += (theta_deg - last_theta_deg[0] + 180.0) % 360.0 - 180.0
            last_theta_deg[0] = theta_deg
            return abs(total_deg[0])

        def steer(remaining: float) -> None:
            speed = min(TURN_SPEED, max(MIN_TURN_SPEED, math.sqrt(2 * TURN_DECELERATION * remaining)))
            self._set_speeds(call, 0.0, math.copysign(speed, angle))

        def send_feedback(progress: float) -> None:
            call.feedback(**create_feedback(round(progress, 1)))

        self._steer(call, abs(angle), ANGLE_TOLERANCE_DEG, turned_deg, steer, send_feedback)

    def _steer(
        self,
        call: Call,
        amount: float,
        tolerance: float,
        read_progress: Callable[[], float],
        steer: Callable[[float], None],
        send_feedback: Callable[[float], None],
    ) -> None:
        steps = 0
        try:
            while (remaining := amount - read_progress()) > tolerance:
                if steps and self.wheels.bumped_side() and self.wheels.is_still():
                    raise Failed(_("{action}: something is in the way").format(action=call.action))
                steer(remaining)
                if steps % FEEDBACK_PERIOD_STEPS == 0:
                    send_feedback(read_progress())
                steps += 1
                call.wait(STEP_INTERVAL_S)
        finally:
            self._brake()


def _remaining(amount: float, progress: float) -> float:
    return round(max(0.0, amount - progress), 2)


class DiffDriveTemplate(DiffDrive):
    """Robot without a base, used to generate the description; drivers replace this class by their own."""

    def __init__(self, link: Link) -> None:
        raise Failed(
            _("{robot} has no wheels; its driver must provide them, as app.robots.turtle does").format(
                robot=link.name
            )
        )


DIFFDRIVE = Kind(
    model="diffdrive",
    title="Differential-drive robot with a camera",
    body=DiffDriveTemplate,
    kinds=("mobile",),
    driver="python",
    description="Two wheels, a camera, a distance sensor and a bumper.",
)
