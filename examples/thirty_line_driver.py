"""A turntable: a whole driver in 30 lines; docs/write-a-driver.md explains them."""

from typing import Annotated

from app.robots.kit import Call, Kind, Link, Range, action, main, safe_stop, sensor

Angle = Annotated[float, Range(-360, 360, 5, "deg", "angle")]


class Turntable:
    """Turntable with a lamp."""

    angle = sensor(Annotated[float, Range(0, 360, unit="deg")], title="angle", text="angle", icon="compass")

    def __init__(self, link: Link) -> None:
        self.link, self.degrees = link, 0.0  # connect to the motor here

    @action("turn %angle °", "Movement", "rotate-ccw", uses=("motor",), on_busy="replace", risk="moves")
    def turn(self, call: Call, angle: Angle = 90.0) -> None:
        """Turn, to the left when positive."""
        for _ in range(round(abs(angle))):
            call.wait(0.01)  # raises Canceled when the turn is to end
            self.degrees = (self.degrees + (1 if angle > 0 else -1)) % 360  # move the motor here
            self.link.sense("angle", self.degrees)

    @action("blink %times times", "Lights", "lightbulb", uses=("lamp",), timeout_s=10)
    def blink(self, call: Call, times: Annotated[int, Range(1, 20)] = 3) -> None:
        """Switch the lamp on and off."""
        for _ in range(2 * times):
            call.wait(0.1)  # switch the lamp here

    @safe_stop(watchdog_s=1.0, within_s=0.2)
    def stop(self) -> None:
        """Hold the motor here; what was running has been canceled already."""


ROBOT = Kind(model="turntable", title="Turntable", body=Turntable)
if __name__ == "__main__":
    raise SystemExit(main(ROBOT))
