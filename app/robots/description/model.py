"""Parts of a robot description as dataclasses: actions, sensors, events, safe stop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.errors import InputProblem
from app.robots.description.inputs import Choice, Parameter, check_input, input_problems


@dataclass(frozen=True)
class DataField:
    """Field in the value of a sensor, or in the result or feedback of an action.

    Attributes:
        name: Name in messages.
        title: Display name.
        kind: Kind as in `Parameter`.
        unit: Unit as displayed.
    """

    name: str
    title: str
    kind: str
    unit: str | None = None


@dataclass(frozen=True)
class Action:
    """Action of a robot.

    Attributes:
        text: Text of the block, with ``%robot`` once, words, and ``%parameter`` for each parameter.
        says: Sentence about the running action with the same placeholders, such as ``%robot turns %angle°``.
        risk: "moves" if parts of the robot move, "locomotes" if the robot drives; None for neither.
        uses: Names of the resources that the action occupies.
        on_busy: "queue", "replace" or "reject" when a resource is in use.
        repeat_s: Interval in seconds at which tools may repeat an action that continues after it has
            succeeded (such as a speed); None for other actions.
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
    is_synchronous: bool = False
    feedback: tuple[DataField, ...] = ()
    output: tuple[DataField, ...] = ()
    repeat_s: float | None = None

    def parameter(self, name: str) -> Parameter | None:
        """Return the parameter with this name, or None."""
        return next((parameter for parameter in self.parameters if parameter.name == name), None)

    def check(self, values: object) -> tuple[str, ...]:
        """Return one message per problem of an input; empty if it is valid.

        Each message starts with the name of the action.
        """
        return check_input(self.name, self.parameters, values)

    def problems(self, values: object) -> tuple[InputProblem, ...]:
        """Return the problems of an input, without the name of the action; empty if it is valid."""
        return input_problems(self.parameters, values)

    def complete(self, values: Mapping[str, object]) -> dict[str, object]:
        """Return an input with default values added for missing parameters."""
        defaults = {
            parameter.name: parameter.default
            for parameter in self.parameters
            if parameter.default is not None
        }
        return {**defaults, **values}


@dataclass(frozen=True)
class Sensor:
    """Value that the robot publishes continuously.

    Attributes:
        kind: boolean, number, integer, text, choice, object, list, image or detections (boxes in pixels of
            the image of `camera`).
        text: Text of the block, with ``%robot`` once; "" for no block.
        camera: Name of the camera's sensor, for detections.
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
        """True if the values are images, which use the codec ``image``."""
        return self.kind == "image"


@dataclass(frozen=True)
class Event:
    """Event of a robot.

    Attributes:
        filters: Names of the fields by which the block filters events.
        text: Text of the block.
    """

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

    Attributes:
        action: Name of the stop action.
        watchdog_s: Time in seconds without a heartbeat of the moving program after which the robot stops by
            itself; None if the robot has no watchdog.
        within_s: Time in seconds within which the robot stops.
        stops_on_program_end: True if the robot stops when the moving program ends.
        stops_on_disconnect: True if the robot stops when the moving program is disconnected.
        can_confirm: False for robots that never reply to a stop.
    """

    action: str
    watchdog_s: float | None
    within_s: float
    stops_on_program_end: bool
    stops_on_disconnect: bool
    can_confirm: bool


@dataclass(frozen=True)
class RobotTopics:
    """Names of a robot's topics. Only virtual robots have the topics ``state`` and ``world``."""

    description: str
    command: str
    reply: str
    state: str | None = None
    world: str | None = None


@dataclass(frozen=True)
class Robot:
    """Parsed description of a robot.

    Attributes:
        source: Original document.
        heartbeat_interval_s: Interval in seconds at which the robot sends heartbeats on its reply topic
            during actions; None if it sends none.
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
    heartbeat_interval_s: float | None = None

    def action(self, name: str) -> Action | None:
        """Return the action with this name, or None."""
        return next((action for action in self.actions if action.name == name), None)

    def sensor(self, name: str) -> Sensor | None:
        """Return the sensor with this name, or None."""
        return next((sensor for sensor in self.sensors if sensor.name == name), None)

    def event(self, name: str) -> Event | None:
        """Return the event with this name, or None."""
        return next((event for event in self.events if event.name == name), None)
