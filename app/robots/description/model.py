"""The typed parts of a robot: what it can do, what it tells, what happens to it, how it is stopped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.errors import InputProblem
from app.robots.description.inputs import Choice, Parameter, check_input, problems_of


@dataclass(frozen=True)
class DataField:
    """One value inside a sensor's object or an action's output; the unit is as people write it."""

    name: str
    title: str
    kind: str
    unit: str | None = None


@dataclass(frozen=True)
class Action:
    """Something the robot can do; ``text`` is its block: ``%robot`` once, then words and ``%parameter``.

    One with ``repeat_s`` goes on when it has succeeded (a speed), until a stop or the next one.
    """

    name: str
    title: str
    icon: str
    category: str
    parameters: tuple[Parameter, ...]
    text: str
    says: str | None
    topic: str
    answer_topic: str
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
        """The parameter of that name, or None."""
        return next((found for found in self.parameters if found.name == name), None)

    def check(self, given: object) -> tuple[str, ...]:
        """One sentence for each thing wrong with an input; empty when the robot may be asked."""
        return check_input(self.name, self.parameters, given)

    def problems(self, given: object) -> tuple[InputProblem, ...]:
        """The same, each with the parameter that it is about, and without the action's name."""
        return problems_of(self.parameters, given)

    def complete(self, given: Mapping[str, object]) -> dict[str, object]:
        """The input with the defaults of everything it leaves out."""
        defaults = {found.name: found.default for found in self.parameters if found.default is not None}
        return {**defaults, **given}


@dataclass(frozen=True)
class Sensor:
    """Something the robot tells all the time.

    ``kind`` is boolean, number, integer, text, choice, object, list, image or detections (boxes in pixels of
    the picture of ``camera``). ``text`` is its block with ``%robot`` once; empty when it makes no block.
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
        """True for pictures, which travel with the codec ``image``."""
        return self.kind == "image"


@dataclass(frozen=True)
class Event:
    """Something that happens; ``filters`` are the fields a block offers as a choice."""

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
    """How the robot is stopped; ``confirmed`` is False for robots that never answer a stop."""

    action: str
    watchdog_s: float | None
    within_s: float
    on_program_end: bool
    on_disconnect: bool
    confirmed: bool


@dataclass(frozen=True)
class RobotTopics:
    """Where a robot is talked to; ``state`` and ``world`` exist for virtual robots."""

    description: str
    command: str
    answer: str
    state: str | None = None
    world: str | None = None


@dataclass(frozen=True)
class Robot:
    """A robot as its description tells it; ``source`` is that document, unchanged.

    ``beat_s`` is how often it says on its answer topic that it lives while it does something; None: never.
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
        """The action of that name, or None."""
        return next((found for found in self.actions if found.name == name), None)

    def sensor(self, name: str) -> Sensor | None:
        """The sensor of that name, or None."""
        return next((found for found in self.sensors if found.name == name), None)

    def event(self, name: str) -> Event | None:
        """The event of that name, or None."""
        return next((found for found in self.events if found.name == name), None)
