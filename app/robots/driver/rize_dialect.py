"""RIZE's dialect: commands on ``robot_action``, replies on ``action_state`` (docs/robots.md).

A command is ``{"node": "action", "primitives": {...} or [...], "robots": "Pepper", "state": "idle", ...}``; a
list of primitives runs in parallel. The reply is the same object with the state ``success`` or ``failure``.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from app.robots.description.inputs import Parameter
from app.robots.description.json_access import as_object, text, to_number
from app.robots.description.model import Action, Robot
from app.robots.driver.call import Call
from app.robots.driver.commands import CommandHandler
from app.robots.driver.declare import ActionSpec
from app.robots.driver.task import Task, TaskReply
from app.robots.driver.tasks import Tasks
from nep.text import bounded_str

Publish: TypeAlias = Callable[[Mapping[str, object]], None]
_MAX_WAIT_S = 3600.0
_MAX_PRIMITIVES = 100


@dataclass(eq=False)
class _PrimitiveGroup:
    """Primitives of one command, to which the driver replies once."""

    command: Mapping[str, object]
    open_count: int
    states: list[str] = field(default_factory=list)


class RizeDialect:
    """Interpreter of RIZE commands for one robot.

    Runs in the thread of the robot's `Tasks`; `stop` and `is_stop` can be called from any thread.

    Args:
        robot: Description of the robot.
        specs: Declarations of the actions by name.
        commands: Command handler, which creates the tasks.
        tasks: Tasks of the robot.
        publish: Publishes a reply.
    """

    def __init__(
        self,
        robot: Robot,
        specs: Mapping[str, ActionSpec],
        commands: CommandHandler,
        tasks: Tasks,
        publish: Publish,
    ) -> None:
        self._robot, self._commands, self._tasks, self._publish = robot, commands, tasks, publish
        self._specs = {spec.primitive: (name, spec) for name, spec in specs.items() if spec.primitive}
        self._numbers = itertools.count(1)

    def is_stop(self, message: object) -> bool:
        """Return True if the primitives of a message include the robot's stop. Thread-safe."""
        command = as_object(message)
        return (
            self._is_for_robot(command)
            and command.get("node") == "action"
            and any(
                self._action_of(as_object(each)) == self._robot.safe_stop.action
                for each in _primitives(command)
            )
        )

    def stop(self, message: object) -> None:  # noqa: ARG002 - see `Dialect`
        """Stop the robot immediately. Thread-safe. `receive` replies to the message."""
        self._tasks.stop(None)

    def receive(self, message: object, publisher: int | None = None, epoch: int | None = None) -> None:  # noqa: ARG002
        """Handle a message of ``robot_action``; messages for other robots are ignored.

        Args:
            message: Payload of any type.
            publisher: Not used.
            epoch: Value of `Tasks.epoch` when the message was received.
        """
        command = as_object(message)
        if not self._is_for_robot(command):
            return
        if command.get("node") == "cancel":
            self._tasks.cancel(lambda task: task.id.startswith(_TASK_ID_PREFIX))
        elif command.get("node") == "action":
            self._run(command, epoch)

    def reject(self, wanted: str, operation: str, error: str) -> None:
        """Do nothing, because a reply of RIZE's dialect would have to repeat the whole command."""

    def _is_for_robot(self, command: Mapping[str, object]) -> bool:
        robots = command.get("robots")
        return robots == self._robot.name or (isinstance(robots, list) and self._robot.name in robots)

    def _action_of(self, primitive: Mapping[str, object]) -> str:
        name = text(primitive.get("primitive")) or ""
        return self._specs.get(name, (name, None))[0]

    def _run(self, command: Mapping[str, object], epoch: int | None) -> None:
        primitives = _primitives(command)
        group = _PrimitiveGroup(command, open_count=len(primitives))
        if not primitives or len(primitives) > _MAX_PRIMITIVES:
            self._publish({**command, "state": "failure"})
            return
        for primitive in primitives:
            self._start(as_object(primitive), lambda answer: self._record_reply(group, answer), epoch)

    def _record_reply(self, group: _PrimitiveGroup, answer: TaskReply) -> None:
        if not answer.is_final:
            return
        group.open_count -= 1
        group.states.append(answer.state)
        if group.open_count == 0:
            good = all(state == "succeeded" for state in group.states)
            self._publish({**group.command, "state": "success" if good else "failure"})

    def _start(
        self, primitive: Mapping[str, object], answer: Callable[[TaskReply], None], epoch: int | None
    ) -> None:
        name, given = text(primitive.get("primitive")) or "", _as_text(primitive.get("input"))
        wanted = f"{_TASK_ID_PREFIX}{next(self._numbers)}"
        known, spec = self._specs.get(name, (name, None))
        action = self._robot.action(known)
        if action is not None and action.name == self._robot.safe_stop.action:
            self._tasks.stop(answer)
            return
        task = None
        if action is not None:
            meant = _parsed_input(
                action, spec, given, as_object(primitive.get("options"))
            )  # options may be "none"
            if meant is not None and not action.check(meant):
                task = self._commands.create_task(wanted, action, meant, answer, epoch=epoch)
        elif name == "wait":
            task = _wait_task(wanted, given, answer, epoch)
        if task is None:
            answer(TaskReply("failed"))
        else:
            self._tasks.submit(task)


_TASK_ID_PREFIX = "rize:"


def _primitives(command: Mapping[str, object]) -> Sequence[object]:
    given = command.get("primitives")
    return given if isinstance(given, list) else [given]


def _as_text(value: object) -> str:
    return str(value or "") if isinstance(value, (str, float, bool)) else bounded_str(value or "")


def _wait_task(
    wanted: str, given: str, answer: Callable[[TaskReply], None], epoch: int | None
) -> Task | None:
    seconds = to_number(given)
    if seconds is None or not 0 <= seconds <= _MAX_WAIT_S:
        return None
    return Task(wanted, "wait", lambda call: _wait(call, seconds), answer, epoch=epoch)


def _wait(call: Call, seconds: float) -> None:
    call.wait(seconds)


def _parsed_input(
    action: Action, spec: ActionSpec | None, given: str, options: Mapping[str, object]
) -> Mapping[str, object] | None:
    if spec is None or spec.from_rize is None:
        return _input_by_name(action, given, options)
    try:
        return spec.from_rize(given, options)
    except (ValueError, KeyError, TypeError, OverflowError):
        return None


def _input_by_name(action: Action, given: str, options: Mapping[str, object]) -> dict[str, object]:
    meant: dict[str, object] = {}
    if action.parameters and given:
        first = action.parameters[0]
        meant[first.name] = _convert_to_kind(first, given)
    for name, value in options.items():
        parameter = action.parameter(name)
        if parameter is not None:
            meant[name] = _convert_to_kind(parameter, value)
    return meant


def _convert_to_kind(parameter: Parameter, value: object) -> object:
    if parameter.kind in {"number", "integer", "angle"} and isinstance(value, str):
        number = to_number(value)
        return value if number is None else number
    if parameter.kind == "boolean" and isinstance(value, str):
        return {"true": True, "false": False}.get(value.lower(), value)
    return value
