"""Handling of a robot's commands: messages of type ``robot/command`` create, cancel and stop tasks.

The replies are of type ``robot/answer``.
"""

from __future__ import annotations

import inspect
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from app.errors import RobotValueError
from app.robots.description.inputs import closest_match
from app.robots.description.json_access import as_object, text
from app.robots.description.model import Action, Robot
from app.robots.driver.call import Call, Failed
from app.robots.driver.declare import ActionSpec
from app.robots.driver.schema_values import from_json
from app.robots.driver.task import ProgramId, Task, TaskReply
from app.robots.driver.tasks import NO_SUCH_TASK_MESSAGE, Tasks
from app.robots.identity import program_of
from nep.i18n import _
from nep.text import bounded_str, quotable

Publish: TypeAlias = Callable[[Mapping[str, object]], None]
Resolve: TypeAlias = Callable[[object, Call], object]
_MAX_ID_LENGTH = 200
_MAX_ENDED_PROGRAMS = 100


class CommandHandler:
    """Command handler of one robot.

    Runs in the thread of the robot's `Tasks`; `stop` and `is_stop` can be called from any thread.

    Args:
        robot: Description of the robot.
        body: Instance of the robot's class.
        specs: Declarations of the actions by name.
        tasks: Tasks of the robot.
        publish: Publishes a reply.
        resolve: Waits for the return value of an action if it is awaitable, and returns the result.
    """

    def __init__(
        self,
        robot: Robot,
        body: object,
        specs: Mapping[str, ActionSpec],
        tasks: Tasks,
        publish: Publish,
        resolve: Resolve,
    ) -> None:
        self._robot, self._body, self._specs = robot, body, specs
        self._tasks, self._publish, self._resolve = tasks, publish, resolve
        self._open_ids: set[str] = set()
        self._ended_programs: deque[str] = deque(maxlen=_MAX_ENDED_PROGRAMS)

    def is_stop(self, command: object) -> bool:
        """Return True if a command stops the robot. Thread-safe."""
        message = as_object(command)
        operation = message.get("op")
        return operation == "stop" or (
            operation == "invoke" and message.get("action") == self._robot.safe_stop.action
        )

    def stop(self, command: object) -> None:
        """Execute a stop command at once, before queued commands. Thread-safe."""
        message = as_object(command)
        ended_key = text(message.get("ends"))
        if ended_key is not None:
            self._ended_programs.append(program_of(ended_key))
        command_id, operation = _id_of(message), message.get("op")
        if command_id is None or (operation == "invoke" and command_id in self._open_ids):
            self._tasks.stop(None)
        else:
            self._tasks.stop(self._reply_callback(command_id, str(operation), self._robot.safe_stop.action))

    def receive(self, command: object, publisher: int | None = None, epoch: int | None = None) -> None:
        """Handle a message of the command topic. Replies only if the command has an id.

        Args:
            command: Payload of any type.
            publisher: Id of the publisher. Heartbeats and cancels are valid only from the publisher that
                requested the action.
            epoch: Value of `Tasks.epoch` when the message was received.
        """
        message = as_object(command)
        command_id = _id_of(message)
        try:
            if self.is_stop(message):
                self.stop(message)
            else:
                self._handle(message, command_id, publisher, epoch)
        except Exception as error:
            if command_id is not None and command_id not in self._open_ids:
                problem = _("{robot} can't handle this command: {error}").format(
                    robot=self._robot.name, error=quotable(error)
                )
                self._reply_callback(command_id, quotable(message.get("op")), "")(
                    TaskReply("failed", error=problem)
                )
            raise

    def reject(self, command_id: str, operation: str, error: str) -> None:
        """Reply with an error to a command that was not decoded.

        There is no reply if another pending command has the same id.

        Args:
            command_id: Id of the command.
            operation: Operation of the command, such as "invoke".
            error: Error message.
        """
        if command_id not in self._open_ids:
            self._reply_callback(command_id, operation, "")(TaskReply("failed", error=error))

    def _handle(
        self,
        message: Mapping[str, object],
        command_id: str | None,
        publisher: int | None,
        epoch: int | None,
    ) -> None:
        operation, name = message.get("op"), text(message.get("from"))
        if name is not None and len(name) > _MAX_ID_LENGTH:
            if command_id is not None:
                self.reject(
                    command_id,
                    quotable(operation),
                    _("“from” is longer than {count} characters").format(count=_MAX_ID_LENGTH),
                )
            return
        program = None if name is None else ProgramId(name, publisher)
        if program is not None:
            self._tasks.record_heartbeat(program, watch=operation == "invoke")
        if operation == "alive" or command_id is None:
            return
        if operation == "cancel":
            self._cancel(command_id, quotable(message.get("action") or ""), publisher)
        elif operation == "invoke":
            self._invoke(command_id, message, program, publisher, epoch)
        else:
            error = _("unknown operation “{operation}”; use invoke, cancel, stop or alive").format(
                operation=quotable(operation)
            )
            self._reply_callback(command_id, quotable(operation), "")(TaskReply("failed", error=error))

    def publish_heartbeat(
        self, not_ended: Sequence[str] = (), error: str | None = None, rejected: int = 0
    ) -> None:
        """Publish a heartbeat, so that programs notice when the robot no longer responds.

        Args:
            not_ended: Names of cancelled actions whose functions are still running.
            error: Message about these actions.
            rejected: Number of messages to the robot that were not handled.
        """
        heartbeat: dict[str, object] = {"op": "alive", "id": "", "action": "", "state": "running"}
        heartbeat |= {"not_ended": list(not_ended), "error": _replace_surrogates(error)}
        counts = {"rejected": rejected, "errors": self._tasks.failures}
        self._publish(heartbeat | {name: count for name, count in counts.items() if count})

    def create_task(
        self,
        command_id: str,
        action: Action,
        values: Mapping[str, object],
        reply: Callable[[TaskReply], None],
        program: ProgramId | None = None,
        *,
        publisher: int | None = None,
        epoch: int | None = None,
    ) -> Task:
        """Create the task that runs an action with a valid input.

        Args:
            command_id: Id of the command.
            action: Description of the action.
            values: Input of the action; defaults are added.
            reply: Publishes the replies.
            program: Requesting program.
            publisher: Id of the publisher of the command.
            epoch: Value of `Tasks.epoch` when the command was received.
        """
        spec = self._specs[action.name]
        complete_input = action.complete(values)
        function: Callable[..., object] = getattr(self._body, action.name)

        def run(call: Call) -> Mapping[str, object]:
            result = self._resolve(function(call, **_typed_arguments(spec, function, complete_input)), call)
            try:
                return spec.returns.to_output(result)
            except RobotValueError as error:
                raise Failed(
                    _("{name} finished, but its result is invalid: {error}").format(
                        name=action.name, error=error
                    )
                ) from error

        return Task(
            id=command_id,
            action=action.name,
            run=run,
            reply=reply,
            uses=action.uses,
            on_busy=action.on_busy,
            timeout_s=action.timeout_s,
            cancellable=action.cancellable,
            title=action.title,
            program=program,
            publisher=publisher,
            continues_after_success=action.repeat_s is not None,
            epoch=epoch,
        )

    def unknown_action_message(self, name: str) -> str:
        """Return the error message for an unknown action."""
        close = closest_match(name, [each.name for each in self._robot.actions])
        template = (
            _("{robot} can't “{action}”; did you mean “{close}”?") if close else _("{robot} can't “{action}”")
        )
        return template.format(robot=self._robot.name, action=quotable(name), close=close)

    def _invoke(
        self,
        command_id: str,
        message: Mapping[str, object],
        program: ProgramId | None,
        publisher: int | None,
        epoch: int | None,
    ) -> None:
        if command_id in self._open_ids:
            return  # duplicate command
        name, values = message.get("action"), message.get("input")
        reply = self._reply_callback(command_id, "invoke", quotable(name or ""))
        if program is not None and program.name in self._ended_programs:
            # sent before its program was ended, received after the stop: must not move the robot
            reply(TaskReply("canceled", error=_("its program was stopped")))
            return
        action = self._robot.action(name) if isinstance(name, str) else None
        if action is None:
            reply(TaskReply("failed", error=self.unknown_action_message(bounded_str(name or ""))))
            return
        if action.name == self._robot.safe_stop.action:
            self._tasks.stop(reply)
            return
        problems = action.check({} if values is None else values)
        if problems:
            reply(TaskReply("failed", error="; ".join(problems)))
            return
        task = self.create_task(
            command_id, action, as_object(values), reply, program, publisher=publisher, epoch=epoch
        )
        self._open_ids.add(command_id)
        try:
            self._tasks.submit(task)
        except BaseException:
            self._open_ids.discard(command_id)
            raise

    def _cancel(self, command_id: str, name: str, publisher: int | None) -> None:
        error = self._tasks.cancel(lambda task: task.id == command_id and task.publisher == publisher)
        if error is not None and command_id in self._open_ids and error == NO_SUCH_TASK_MESSAGE:
            error = _(
                "only the program that started “{action}” can cancel it; any program can stop the robot"
            ).format(action=name or command_id)
        if error is not None:
            error = _(error) if error == NO_SUCH_TASK_MESSAGE else error
            self._reply_callback(command_id, "cancel", name)(TaskReply("failed", error=error))

    def _reply_callback(self, command_id: str, operation: str, name: str) -> Callable[[TaskReply], None]:
        def reply(task_reply: TaskReply) -> None:
            if task_reply.is_final and operation == "invoke":
                self._open_ids.discard(command_id)
            message: dict[str, object] = {
                "id": command_id,
                "op": operation,
                "action": name,
                "state": task_reply.state,
            }
            message |= {
                "output": dict(task_reply.output),
                "feedback": dict(task_reply.feedback),
                "error": _replace_surrogates(task_reply.error),
            }
            if task_reply.waits_for:
                message["waits_for"] = list(task_reply.waits_for)
            if task_reply.replaces:
                message["replaces"] = list(task_reply.replaces)
            self._publish(message)

        return reply


def _id_of(message: Mapping[str, object]) -> str | None:
    command_id = text(message.get("id"))
    if command_id is None or len(command_id) > _MAX_ID_LENGTH or bounded_str(command_id) != command_id:
        return None
    return command_id


def _replace_surrogates(error: str | None) -> str | None:
    return None if error is None else error.encode("utf-8", "replace").decode("utf-8")


def _typed_arguments(
    spec: ActionSpec, function: Callable[..., object], inputs: Mapping[str, object]
) -> dict[str, object]:
    arguments: dict[str, object] = {}
    for name, value in inputs.items():
        try:
            arguments[name] = from_json(spec.inputs[name], value)
        except ValueError as error:
            raise Failed(f"{name}: {error}") from error
    for name, parameter in inspect.signature(function).parameters.items():
        if name in spec.inputs and name not in arguments and parameter.default is parameter.empty:
            arguments[name] = None  # an omitted Optional
    return arguments
