"""Typed parts of a robot description: actions, sensors, events, safe stop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.errors import InputProblem
from app.robots.description.inputs import Choice, Parameter, check_input, input_problems


@dataclass(frozen=True)
class DataField:
    """Value in the object of a sensor or the output of an action. ``unit`` is the unit as displayed."""

    name: str
    title: str
    kind: str
    unit: str | None = None


@dataclass(frozen=True)
class Action:
    """Action of a robot.

    Attributes:
        text: Text of the block, with ``%robot`` once, words, and ``%parameter`` for each parameter.
        repeat_s: Set for an action that continues after it has succeeded (a speed), until a stop or the next
            action.
    """

    name: str
    title: str
    icon: str
    category: str
    parameters: tuple[Parameter, ...]
    text: str
    says: str | None
    topic: str
    reply_topic: str
    risk: str | None = None
    cancellable: bool = False
    timeout_s: float | None = None
    uses: tuple[str, ...] = ()
    on_busy: str = "queue"
    synchronous: bool = False
    feedback: tuple[DataField, ...] = ()
    output: tuple[DataField, ...] = ()
    repeat_s: float | None = None

    def parameter(self, name: str) -> Parameter | None:
        """Return the parameter with this name, or None."""
        return next((found for found in self.parameters if found.name == name), None)

    def check(self, given: object) -> tuple[str, ...]:
        """Return a message for each problem of an input; empty if the input is valid."""
        return check_input(self.name, self.parameters, given)

    def problems(self, given: object) -> tuple[InputProblem, ...]:
        """Return the problems of an input and the parameters concerned, without the name of the action."""
        return input_problems(self.parameters, given)

    def complete(self, given: Mapping[str, object]) -> dict[str, object]:
        """Return the input with default values for missing parameters."""
        defaults = {found.name: found.default for found in self.parameters if found.default is not None}
        return {**defaults, **given}


@dataclass(frozen=True)
class Sensor:
    """Value that the robot publishes continuously.

    Attributes:
        kind: boolean, number, integer, text, choice, object, list, image or detections (boxes in pixels of
            the image of `camera`).
        text: Text of the block, with ``%robot`` once; empty if there is no block.
    """

    name: str
    title: str
    kind: str
    topic: str
    unit: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    rate_hz: float | None = None
    fields: tuple[DataField, ...] = ()
    icon: str = "activity"
    category: str = "Sensors"
    text: str = ""
    camera: str | None = None
    choices: tuple[Choice, ...] = ()

    @property
    def is_image(self) -> bool:
        """True for images, which use the codec ``image``."""
        return self.kind == "image"


@dataclass(frozen=True)
class Event:
    """Event of a robot. ``filters`` are the fields that the block offers as choices."""

    name: str
    title: str
    icon: str
    category: str
    fields: tuple[Parameter, ...]
    filters: tuple[str, ...]
    text: str
    topic: str


@dataclass(frozen=True)
class SafeStop:
    """Declaration of how the robot is stopped.

    ``confirmed`` is False for robots that never reply to a stop.
    """

    action: str
    watchdog_s: float | None
    within_s: float
    on_program_end: bool
    on_disconnect: bool
    confirmed: bool


@dataclass(frozen=True)
class RobotTopics:
    """Topics of a robot. Only virtual robots have ``state`` and ``world``."""

    description: str
    command: str
    answer: str
    state: str | None = None
    world: str | None = None


@dataclass(frozen=True)
class Robot:
    """Parsed description of a robot; ``source`` is the original document.

    ``beat_s`` is the interval at which the robot sends heartbeats on its reply topic during actions; None for
    none.
    """

    name: str
    model: str
    title: str
    virtual: bool
    dialect: str
    actions: tuple[Action, ...]
    sensors: tuple[Sensor, ...]
    events: tuple[Event, ...]
    safe_stop: SafeStop
    resources: tuple[str, ...]
    topics: RobotTopics
    source: Mapping[str, object] = field(compare=False, repr=False)
    beat_s: float | None = None

    def action(self, name: str) -> Action | None:
        """Return the action with this name, or None."""
        return next((found for found in self.actions if found.name == name), None)

    def sensor(self, name: str) -> Sensor | None:
        """Return the sensor with this name, or None."""
        return next((found for found in self.sensors if found.name == name), None)

    def event(self, name: str) -> Event | None:
        """Return the event with this name, or None."""
        return next((found for found in self.events if found.name == name), None)
