"""Declaration of a robot in Python: actions, sensors, events and safe stop, converted to a Thing Model.

A robot is a class whose constructor takes a :class:`~app.robots.driver.call.Link`. Methods decorated with
:class:`action` are its actions; :func:`sensor`, :func:`picture`, :func:`detections` and :func:`event` create
class attributes; exactly one method is decorated with :func:`safe_stop`.
"""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar

from app.errors import DeclarationError, DescriptionError
from app.robots.description.validate import validate
from app.robots.driver.call import Link
from app.robots.driver.schema import (
    Schema,
    fields_schema,
    input_schema,
    input_types,
    return_type,
    schema_of,
)
from app.robots.driver.schema_values import any_to_json, check_encodable, fields_to_json, to_json
from app.robots.driver.tasks import HEARTBEAT_INTERVAL_S
from nep.i18n import _
from nep.system.syntax import parse_module

Function = TypeVar("Function", bound=Callable[..., object])
DeclaredType = TypeVar("DeclaredType")
BusyPolicy: TypeAlias = Literal["queue", "replace", "reject"]
Risk: TypeAlias = Literal["moves", "locomotes"]
FromRize: TypeAlias = Callable[[str, Mapping[str, object]], Mapping[str, object]]
ToRize: TypeAlias = Callable[[Mapping[str, object]], tuple[str, Mapping[str, object]]]
_JSON_LD_CONTEXT = [
    "https://www.w3.org/2022/wot/td/v1.1",
    {"rb": "https://nep-studio.example/robot-blocks/v1#"},
]
_ACTION_ATTRIBUTE = "__robot_action__"
_STOP_ATTRIBUTE = "__robot_stop__"


@dataclass(frozen=True)
class action:  # noqa: N801 - used as a decorator
    """Decorator that declares a method as an action.

    The parameters' type annotations define the input; see `app.robots.driver.schema`.

    Attributes:
        text: Text of the block, with ``%parameter`` for each parameter.
        category: Category of the block.
        icon: Icon of the block.
        says: The text in the third person, for messages.
        title: Display name (default: the name of the method).
        uses: Names of the resources that the action occupies, such as "base". Actions that use the same
            resource don't run at the same time.
        on_busy: "queue", "replace" or "reject" when a resource is in use.
        timeout_s: Maximum duration in seconds.
        risk: "moves" if parts of the robot move, "locomotes" if the robot drives; None for neither.
        cancellable: False if the action can't be cancelled.
        repeat_s: For actions that continue after their function returned (such as a speed): interval in
            seconds at which tools may repeat the action. The requesting program must stay alive.
        output: Types of the result's fields by name (default: the return type).
        feedback: Types of the feedback's fields by name.
        rize: Name of RIZE's primitive.
        from_rize: Converts RIZE's input and options to the action's input; None if the names are the same.

    Example:
        ::

            @action("walk %distance m", "Movement", "footprints", uses=("base",), risk="locomotes")
            def walk(self, call: Call, distance: Annotated[float, Range(-2, 2, unit="m")] = 0.5) -> None: ...
    """

    text: str
    category: str
    icon: str
    says: str | None = None
    title: str | None = None
    uses: tuple[str, ...] = ()
    on_busy: BusyPolicy = "queue"
    timeout_s: float | None = None
    risk: Risk | None = None
    cancellable: bool = True
    repeat_s: float | None = None
    output: Mapping[str, object] | None = None
    feedback: Mapping[str, object] | None = None
    rize: str | None = None
    from_rize: FromRize | None = None

    def __call__(self, function: Function) -> Function:
        """Declare a function as an action and check its types.

        Raises:
            DeclarationError: The function is not a valid action; the message contains the line.
        """
        try:
            _check_function(function)
            returns = ReturnSpec(self.output, return_type(function))
            spec = ActionSpec(
                self._description(function, returns),
                self.rize,
                self.from_rize,
                input_types(function),
                returns,
            )
        except (TypeError, NameError) as error:
            source_line = line_of(function)
            raise DeclarationError(function.__name__, str(error), str(source_line or "")) from error
        setattr(function, _ACTION_ATTRIBUTE, spec)
        return function

    def _description(self, function: Callable[..., object], returns: ReturnSpec) -> Schema:
        description: Schema = {
            "title": self.title or function.__name__.replace("_", " "),
            "synchronous": not self.cancellable,
            **_without_none({"description": inspect.getdoc(function), "input": input_schema(function)}),
        }
        output = returns.schema()
        if output is not None:
            description["output"] = output
        if self.feedback:
            description["rb:feedback"] = fields_schema(self.feedback)
        description |= {"rb:cancel": self.cancellable, "rb:uses": list(self.uses), "rb:onBusy": self.on_busy}
        description |= _without_none(
            {"rb:timeout": self.timeout_s, "rb:risk": self.risk, "rb:repeat": self.repeat_s}
        )
        block: Schema = {"category": self.category, "icon": self.icon, "text": {"en": self.text}}
        description["rb:block"] = block | ({"says": {"en": self.says}} if self.says else {})
        return description


@dataclass(frozen=True)
class ReturnSpec:
    """Type of an action's result.

    Attributes:
        fields: Types of the result's fields by name, as given to the decorator.
        kind: Return type of the function, which is used if `fields` is empty.
    """

    fields: Mapping[str, object] | None = None
    kind: object = None

    def schema(self) -> Schema | None:
        """Return the schema of the result, which is always an object; None for an action without result.

        A single value is in the field ``value``.
        """
        if self.fields:
            return fields_schema(self.fields)
        if self.kind is None:
            return None
        schema = schema_of(self.kind)
        if schema.get("type") == "object":
            return schema
        return {"type": "object", "properties": {"value": {"title": "value", **schema}}}

    def to_output(self, value: object) -> Mapping[str, object]:
        """Convert the return value of a function to the result. Raises RobotValueError for a wrong type."""
        output = self._to_output(value)
        check_encodable(output)
        return output

    def _to_output(self, value: object) -> Mapping[str, object]:
        if self.fields:
            if value is None:
                return {}
            only_field = list(self.fields) if len(self.fields) == 1 else []
            if only_field and not isinstance(value, Mapping):
                value = {only_field[0]: value}
            return fields_to_json(self.fields, value)
        converted = any_to_json(value) if self.kind is None else to_json(self.kind, value)
        if isinstance(converted, dict):
            return converted
        return {} if converted is None else {"value": converted}


@dataclass(frozen=True)
class ActionSpec:
    """Declaration of an action, created by the decorator :class:`action`.

    Attributes:
        description: Description of the action in the Thing Model.
        primitive: Name of RIZE's primitive, or None.
        from_rize: Converts RIZE's input and options to the action's input.
        inputs: Types of the parameters by name.
        returns: Type of the result.
    """

    description: Schema
    primitive: str | None
    from_rize: FromRize | None
    inputs: Mapping[str, object] = field(default_factory=dict)
    returns: ReturnSpec = field(default_factory=ReturnSpec)


@dataclass(frozen=True)
class StopSpec:
    """Declaration of the stop, created by :func:`safe_stop`; see there for the attributes."""

    watchdog_s: float
    within_s: float


@dataclass(frozen=True)
class SensorSpec:
    """Declaration of a sensor.

    Attributes:
        description: Description of the sensor in the Thing Model.
        is_image: True for a camera.
        is_object: True if the values are objects.
        kind: Type of the value, or a mapping of field names to types.
    """

    description: Schema
    is_image: bool = False
    is_object: bool = False
    kind: object = None

    def to_json(self, value: object) -> object:
        """Convert a value to the payload of the sensor's topic; an image is returned unchanged.

        A value that isn't an object is put in the field ``value``. Raises RobotValueError for a wrong
        type.
        """
        if self.is_image:
            return value
        if isinstance(self.kind, Mapping):
            return fields_to_json(self.kind, value)
        return to_json(self.kind, value) if self.is_object else {"value": to_json(self.kind, value)}


@dataclass(frozen=True)
class EventSpec:
    """Declaration of an event.

    Attributes:
        description: Description of the event in the Thing Model.
        to_rize: Converts the fields to RIZE's primitive and input; None if RIZE has no such event.
        fields: Types of the fields by name.
    """

    description: Schema
    to_rize: ToRize | None = None
    fields: Mapping[str, object] = field(default_factory=dict)


def safe_stop(*, watchdog_s: float = 1.0, within_s: float = 0.2) -> Callable[[Function], Function]:
    """Return the decorator that declares a method as the robot's stop.

    The method takes no arguments, returns when the robot stands still, and raises Failed if the robot can't
    be stopped.

    Args:
        watchdog_s: Time in seconds without a heartbeat of the moving program after which the robot stops by
            itself.
        within_s: Time in seconds within which the robot stops.
    """

    def mark(function: Function) -> Function:
        setattr(function, _STOP_ATTRIBUTE, StopSpec(watchdog_s, within_s))
        return function

    return mark


def sensor(
    kind: object, *, title: str, text: str = "", icon: str = "activity", rate_hz: float | None = None
) -> SensorSpec:
    """Return the declaration of a sensor, to be assigned to a class attribute.

    Args:
        kind: Type of the value, or a mapping of field names to types.
        title: Display name.
        text: Text of the block; "" for no block.
        icon: Icon of the block.
        rate_hz: Typical publishing rate.
    """
    schema = (
        _declared_schema(fields_schema, kind)
        if isinstance(kind, Mapping)
        else _declared_schema(schema_of, kind)
    )
    is_object = schema.get("type") == "object"
    part: Schema = {**schema, "title": title, "readOnly": True, "observable": True}
    part |= _without_none({"rb:rate": rate_hz})
    part["rb:block"] = {"category": "Sensors", "icon": icon} | ({"text": {"en": text}} if text else {})
    return SensorSpec(part, is_object=is_object, kind=kind)


def picture(*, title: str, width: int, height: int, rate_hz: float, hfov_deg: float) -> SensorSpec:
    """Return the declaration of a camera, which publishes images with the codec ``image``.

    Args:
        title: Display name.
        width: Width in pixels.
        height: Height in pixels.
        rate_hz: Frame rate.
        hfov_deg: Horizontal field of view in degrees.
    """
    part: Schema = {"title": title, "type": "string", "readOnly": True, "observable": True}
    part |= {"contentEncoding": "base64", "contentMediaType": "image/jpeg", "rb:widget": "image"}
    part |= {"rb:rate": rate_hz, "rb:image": {"width": width, "height": height, "hfov": hfov_deg}}
    part["rb:block"] = {"category": "Sensors", "icon": "camera"}
    return SensorSpec(part, is_image=True)


def detections(*, title: str, camera: str, icon: str, rate_hz: float | None = None) -> SensorSpec:
    """Return the declaration of a sensor for objects detected in a camera's image, as named boxes in pixels.

    Args:
        title: Display name.
        camera: Name of the camera's sensor.
        icon: Icon of the block.
        rate_hz: Typical publishing rate.
    """
    kind = {"count": int, "name": str}
    part: Schema = {**fields_schema(kind), "title": title}
    part |= {"readOnly": True, "observable": True, "rb:widget": "detections", "rb:camera": camera}
    part |= _without_none({"rb:rate": rate_hz})
    part["rb:block"] = {"category": "Sensors", "icon": icon}
    return SensorSpec(part, is_object=True, kind=kind)


def event(
    text: str,
    *,
    title: str,
    icon: str,
    fields: Mapping[str, object],
    choose: tuple[str, ...] = (),
    rize: ToRize | None = None,
) -> EventSpec:
    """Return the declaration of an event, to be assigned to a class attribute.

    Args:
        text: Text of the block.
        title: Display name.
        icon: Icon of the block.
        fields: Types of the fields by name.
        choose: Names of the fields by which the block filters events.
        rize: Converts the fields to RIZE's primitive and input.
    """
    block: Schema = {"category": "Events", "icon": icon, "text": {"en": text}}
    part: Schema = {
        "title": title,
        "data": _declared_schema(fields_schema, fields),
        "rb:filter": list(choose),
        "rb:block": block,
    }
    return EventSpec(part, rize, fields)


@dataclass(frozen=True)
class Kind:
    """Kind of robot: the class that implements it, and its Thing Model.

    Attributes:
        model: Id of the model.
        title: Display name.
        body: Class of the robot.
        virtual: True for a simulated robot.
        kinds: Categories, such as "mobile".
        driver: Kind of driver, such as "python".
        description: Sentence about the robot.
        thing_model: Generated Thing Model.

    Raises:
        DescriptionError: The declaration is invalid.
    """

    model: str
    title: str
    body: Callable[[Link], object]
    virtual: bool = False
    kinds: tuple[str, ...] = ()
    driver: str = "python"
    description: str = ""
    thing_model: Mapping[str, object] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        lines = lines_of(self.body) if isinstance(self.body, type) else {}
        thing_model = self._thing_model()
        problems = (
            *self._duplicate_problems(lines),
            *(_with_line(each, lines) for each in validate(thing_model)),
        )
        if problems:
            raise DescriptionError(self.model, problems)
        object.__setattr__(self, "thing_model", thing_model)

    @cached_property
    def actions(self) -> dict[str, ActionSpec]:
        """Declared actions by name of the method, in the order of declaration."""
        return {
            name: getattr(member, _ACTION_ATTRIBUTE)
            for name, member in self._members()
            if hasattr(member, _ACTION_ATTRIBUTE)
        }

    @cached_property
    def sensors(self) -> dict[str, SensorSpec]:
        """Declared sensors by name, in the order of declaration."""
        return {name: member for name, member in self._members() if isinstance(member, SensorSpec)}

    @cached_property
    def events(self) -> dict[str, EventSpec]:
        """Declared events by name, in the order of declaration."""
        return {name: member for name, member in self._members() if isinstance(member, EventSpec)}

    @property
    def stop(self) -> tuple[str, StopSpec]:
        """Name and declaration of the stop method. Raises DescriptionError unless there is exactly one."""
        stops = [
            (name, getattr(m, _STOP_ATTRIBUTE)) for name, m in self._members() if hasattr(m, _STOP_ATTRIBUTE)
        ]
        if len(stops) != 1:
            raise DescriptionError(self.model, (_("exactly one method must be marked with safe_stop"),))
        return stops[0]

    def _duplicate_problems(self, lines: Mapping[str, list[SourceLine]]) -> list[str]:
        declared_names = {*self.actions, *self.sensors, *self.events, self.stop[0]}
        duplicates = [
            (name, locations)
            for name, locations in lines.items()
            if len(locations) > 1 and name in declared_names
        ]
        return [
            _("{found}: '{name}' is defined twice, first in line {number}").format(
                found=locations[-1], name=name, number=locations[0].number
            )
            for name, locations in duplicates
        ]

    def _members(self) -> list[tuple[str, object]]:
        if not isinstance(self.body, type):
            raise DescriptionError(self.model, (_("a robot must be declared as a class"),))
        members: dict[str, object] = {}
        for owner in reversed(self.body.__mro__):
            members.update(vars(owner))
        return list(members.items())

    def _thing_model(self) -> Schema:
        stop, timing = self.stop
        actions = {name: spec.description for name, spec in self.actions.items()}
        stop_block: Schema = {"category": "Movement", "icon": "octagon-x", "text": {"en": "stop moving"}}
        actions[stop] = {"title": "stop", "synchronous": True, "idempotent": True, "rb:cancel": False}
        actions[stop] |= {"rb:uses": [], "rb:block": stop_block | {"says": {"en": "stops"}}}
        resources = (name for part in actions.values() for name in _string_list(part.get("rb:uses")))
        robot_info: Schema = {"model": self.model, "title": self.title, "virtual": self.virtual}
        robot_info |= {"kinds": list(self.kinds), "driver": self.driver, "dialect": "native"}
        return {
            "@context": _JSON_LD_CONTEXT,
            "@type": ["tm:ThingModel", "rb:Robot"],
            "title": self.title,
            **_without_none({"description": self.description or None}),
            "version": {"model": "1.0.0"},
            "rb:profile": 1,
            "rb:robot": robot_info,
            "rb:resources": list(dict.fromkeys(resources)),
            "rb:beat": HEARTBEAT_INTERVAL_S,
            "rb:safeStop": {
                "action": stop,
                "watchdog": timing.watchdog_s,
                "within": timing.within_s,
                "onProgramEnd": True,
                "onDisconnect": True,
                "confirmed": True,
            },
            "properties": {name: spec.description for name, spec in self.sensors.items()},
            "actions": actions,
            "events": {name: spec.description for name, spec in self.events.items()},
        }


def _check_function(function: Callable[..., object]) -> None:
    if inspect.isgeneratorfunction(function) or inspect.isasyncgenfunction(function):
        raise TypeError(_("actions can't be generators (yield); report progress with call.feedback"))
    names = list(inspect.signature(function).parameters)
    if names[1:2] != ["call"]:
        raise TypeError(
            _("the parameter after 'self' must be the call; write def NAME(self, call: Call, ...)")
        )


def _declared_schema(schema: Callable[[DeclaredType], Schema], kind: DeclaredType) -> Schema:
    try:
        return schema(kind)
    except TypeError as error:
        frame = sys._getframe(1)  # noqa: SLF001 - documented way to get the caller
        while frame.f_back is not None and frame.f_code.co_filename == __file__:
            frame = frame.f_back
        location = SourceLine(Path(frame.f_code.co_filename).name, frame.f_lineno)
        raise DeclarationError("", str(error), str(location)) from error


def _string_list(value: object) -> list[str]:
    return [str(item) for item in value] if isinstance(value, list) else []


def _without_none(values: Mapping[str, object]) -> Schema:
    return {name: value for name, value in values.items() if value is not None}


def _with_line(problem: str, lines: Mapping[str, list[SourceLine]]) -> str:
    path = problem.replace(":", ".").split(" ")[0].split(".")
    source_lines = (
        lines.get(path[1]) if len(path) > 1 and path[0] in {"actions", "properties", "events"} else None
    )
    return f"{source_lines[-1]}: {problem}" if source_lines else problem


@dataclass(frozen=True)
class SourceLine:
    """Line of a source file, formatted as ``table.py, line 12``."""

    file: str
    number: int

    def __str__(self) -> str:
        return _("{file}, line {number}").format(file=self.file, number=self.number)


def line_of(function: object) -> SourceLine | None:
    """Return the line at which a function is defined; None if it isn't written in Python."""
    code = getattr(inspect.unwrap(function), "__code__", None) if callable(function) else None
    return None if code is None else SourceLine(Path(code.co_filename).name, code.co_firstlineno)


def lines_of(body: type) -> dict[str, list[SourceLine]]:
    """Return the lines at which a class defines each of its names; empty if the source is unavailable.

    Property setters and overloads don't count as a second definition.
    """
    try:
        lines, first = inspect.getsourcelines(body)
        file = Path(inspect.getsourcefile(body) or "").name
        tree = parse_module(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError, ValueError):
        return {}
    lines_by_name: dict[str, list[SourceLine]] = {}
    (class_statement,) = tree.body
    for statement in class_statement.body if isinstance(class_statement, ast.ClassDef) else ():
        for name in _bound_names(statement):
            lines_by_name.setdefault(name, []).append(SourceLine(file, first + statement.lineno - 1))
    return lines_by_name


def _bound_names(statement: ast.stmt) -> Iterator[str]:
    if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef)):
        decorators = (_decorator_name(each) for each in statement.decorator_list)
        if not {"setter", "getter", "deleter", "overload"} & set(decorators):
            yield statement.name
    elif isinstance(statement, ast.Assign):
        yield from (each.id for each in statement.targets if isinstance(each, ast.Name))
    elif isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name) and statement.value:
        yield statement.target.id


def _decorator_name(decorator: ast.expr) -> str:
    if isinstance(decorator, ast.Attribute):
        return decorator.attr
    return decorator.id if isinstance(decorator, ast.Name) else ""
