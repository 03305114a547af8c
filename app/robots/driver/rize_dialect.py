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
        self._task_numbers = itertools.count(1)

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

    def reject(self, command_id: str, operation: str, error: str) -> None:
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

    def _record_reply(self, group: _PrimitiveGroup, reply: TaskReply) -> None:
        if not reply.is_final:
            return
        group.open_count -= 1
        group.states.append(reply.state)
        if group.open_count == 0:
            has_succeeded = all(state == "succeeded" for state in group.states)
            self._publish({**group.command, "state": "success" if has_succeeded else "failure"})

    def _start(
        self, primitive: Mapping[str, object], on_reply: Callable[[TaskReply], None], epoch: int | None
    ) -> None:
        name, input_text = text(primitive.get("primitive")) or "", _as_text(primitive.get("input"))
        task_id = f"{_TASK_ID_PREFIX}{next(self._task_numbers)}"
        action_name, spec = self._specs.get(name, (name, None))
        action = self._robot.action(action_name)
        if action is not None and action.name == self._robot.safe_stop.action:
            self._tasks.stop(on_reply)
            return
        task = None
        if action is not None:
            task_input = _parsed_input(
                action, spec, input_text, as_object(primitive.get("options"))
            )  # options may be "none"
            if task_input is not None and not action.check(task_input):
                task = self._commands.create_task(task_id, action, task_input, on_reply, epoch=epoch)
        elif name == "wait":
            task = _wait_task(task_id, input_text, on_reply, epoch)
        if task is None:
            on_reply(TaskReply("failed"))
        else:
            self._tasks.submit(task)


_TASK_ID_PREFIX = "rize:"


def _primitives(command: Mapping[str, object]) -> Sequence[object]:
    primitives = command.get("primitives")
    return primitives if isinstance(primitives, list) else [primitives]


def _as_text(value: object) -> str:
    return str(value or "") if isinstance(value, (str, float, bool)) else bounded_str(value or "")


def _wait_task(
    task_id: str, input_text: str, on_reply: Callable[[TaskReply], None], epoch: int | None
) -> Task | None:
    seconds = to_number(input_text)
    if seconds is None or not 0 <= seconds <= _MAX_WAIT_S:
        return None
    return Task(task_id, "wait", lambda call: _wait(call, seconds), on_reply, epoch=epoch)


def _wait(call: Call, seconds: float) -> None:
    call.wait(seconds)


def _parsed_input(
    action: Action, spec: ActionSpec | None, input_text: str, options: Mapping[str, object]
) -> Mapping[str, object] | None:
    if spec is None or spec.from_rize is None:
        return _input_by_name(action, input_text, options)
    try:
        return spec.from_rize(input_text, options)
    except (ValueError, KeyError, TypeError, OverflowError):
        return None


def _input_by_name(action: Action, input_text: str, options: Mapping[str, object]) -> dict[str, object]:
    task_input: dict[str, object] = {}
    if action.parameters and input_text:
        first = action.parameters[0]
        task_input[first.name] = _convert_to_kind(first, input_text)
    for name, value in options.items():
        parameter = action.parameter(name)
        if parameter is not None:
            task_input[name] = _convert_to_kind(parameter, value)
    return task_input


def _convert_to_kind(parameter: Parameter, value: object) -> object:
    if parameter.kind in {"number", "integer", "angle"} and isinstance(value, str):
        number = to_number(value)
        return value if number is None else number
    if parameter.kind == "boolean" and isinstance(value, str):
        return {"true": True, "false": False}.get(value.lower(), value)
    return value
