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
        done: Waits for the return value of an action if it is awaitable, and returns the result.
    """

    def __init__(
        self,
        robot: Robot,
        body: object,
        specs: Mapping[str, ActionSpec],
        tasks: Tasks,
        publish: Publish,
        done: Resolve,
    ) -> None:
        self._robot, self._body, self._specs = robot, body, specs
        self._tasks, self._publish, self._done = tasks, publish, done
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
        ended = text(message.get("ends"))
        if ended is not None:
            self._ended_programs.append(program_of(ended))
        wanted, operation = _id_of(message), message.get("op")
        if wanted is None or (operation == "invoke" and wanted in self._open_ids):
            self._tasks.stop(None)
        else:
            self._tasks.stop(self._reply_callback(wanted, str(operation), self._robot.safe_stop.action))

    def receive(self, command: object, publisher: int | None = None, epoch: int | None = None) -> None:
        """Handle a message of the command topic. Replies only if the command has an id.

        Args:
            command: Payload of any type.
            publisher: Id of the publisher. Heartbeats and cancels are valid only from the publisher that
                requested the action.
            epoch: Value of `Tasks.epoch` when the message was received.
        """
        message = as_object(command)
        wanted = _id_of(message)
        try:
            if self.is_stop(message):
                self.stop(message)
            else:
                self._handle(message, wanted, publisher, epoch)
        except Exception as error:
            if wanted is not None and wanted not in self._open_ids:
                words = _("{robot} can't handle this command: {error}").format(
                    robot=self._robot.name, error=quotable(error)
                )
                self._reply_callback(wanted, quotable(message.get("op")), "")(
                    TaskReply("failed", error=words)
                )
            raise

    def reject(self, wanted: str, operation: str, error: str) -> None:
        """Reply with an error to a command that was not decoded.

        There is no reply if another pending command has the same id.

        Args:
            wanted: Id of the command.
            operation: Operation of the command, such as "invoke".
            error: Error message.
        """
        if wanted not in self._open_ids:
            self._reply_callback(wanted, operation, "")(TaskReply("failed", error=error))

    def _handle(
        self,
        message: Mapping[str, object],
        wanted: str | None,
        publisher: int | None,
        epoch: int | None,
    ) -> None:
        operation, name = message.get("op"), text(message.get("from"))
        if name is not None and len(name) > _MAX_ID_LENGTH:
            if wanted is not None:
                self.reject(
                    wanted,
                    quotable(operation),
                    _("“from” is longer than {count} characters").format(count=_MAX_ID_LENGTH),
                )
            return
        program = None if name is None else ProgramId(name, publisher)
        if program is not None:
            self._tasks.record_heartbeat(program, watch=operation == "invoke")
        if operation == "alive" or wanted is None:
            return
        if operation == "cancel":
            self._cancel(wanted, quotable(message.get("action") or ""), publisher)
        elif operation == "invoke":
            self._invoke(wanted, message, program, publisher, epoch)
        else:
            error = _("unknown operation “{operation}”; use invoke, cancel, stop or alive").format(
                operation=quotable(operation)
            )
            self._reply_callback(wanted, quotable(operation), "")(TaskReply("failed", error=error))

    def publish_heartbeat(
        self, not_ended: Sequence[str] = (), error: str | None = None, rejected: int = 0
    ) -> None:
        """Publish a heartbeat, so that programs notice when the robot no longer responds.

        Args:
            not_ended: Names of cancelled actions whose functions are still running.
            error: Message about these actions.
            rejected: Number of messages to the robot that were not handled.
        """
        told: dict[str, object] = {"op": "alive", "id": "", "action": "", "state": "running"}
        told |= {"not_ended": list(not_ended), "error": _replace_surrogates(error)}
        counts = {"rejected": rejected, "errors": self._tasks.failures}
        self._publish(told | {name: count for name, count in counts.items() if count})

    def create_task(
        self,
        wanted: str,
        action: Action,
        given: Mapping[str, object],
        answer: Callable[[TaskReply], None],
        program: ProgramId | None = None,
        *,
        publisher: int | None = None,
        epoch: int | None = None,
    ) -> Task:
        """Create the task that runs an action with a valid input.

        Args:
            wanted: Id of the command.
            action: Description of the action.
            given: Input of the action; defaults are added.
            answer: Publishes the replies.
            program: Requesting program.
            publisher: Id of the publisher of the command.
            epoch: Value of `Tasks.epoch` when the command was received.
        """
        spec = self._specs[action.name]
        complete = action.complete(given)
        function: Callable[..., object] = getattr(self._body, action.name)

        def run(call: Call) -> Mapping[str, object]:
            returned = self._done(function(call, **_typed_arguments(spec, function, complete)), call)
            try:
                return spec.returns.to_output(returned)
            except RobotValueError as error:
                raise Failed(
                    _("{name} finished, but its result is invalid: {error}").format(
                        name=action.name, error=error
                    )
                ) from error

        return Task(
            id=wanted,
            action=action.name,
            run=run,
            reply=answer,
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
        words = (
            _("{robot} can't “{action}”; did you mean “{close}”?") if close else _("{robot} can't “{action}”")
        )
        return words.format(robot=self._robot.name, action=quotable(name), close=close)

    def _invoke(
        self,
        wanted: str,
        message: Mapping[str, object],
        program: ProgramId | None,
        publisher: int | None,
        epoch: int | None,
    ) -> None:
        if wanted in self._open_ids:
            return  # duplicate command
        name, given = message.get("action"), message.get("input")
        answer = self._reply_callback(wanted, "invoke", quotable(name or ""))
        if program is not None and program.name in self._ended_programs:
            # sent before its program was ended, received after the stop: must not move the robot
            answer(TaskReply("canceled", error=_("its program was stopped")))
            return
        action = self._robot.action(name) if isinstance(name, str) else None
        if action is None:
            answer(TaskReply("failed", error=self.unknown_action_message(bounded_str(name or ""))))
            return
        if action.name == self._robot.safe_stop.action:
            self._tasks.stop(answer)
            return
        sentences = action.check({} if given is None else given)
        if sentences:
            answer(TaskReply("failed", error="; ".join(sentences)))
            return
        task = self.create_task(
            wanted, action, as_object(given), answer, program, publisher=publisher, epoch=epoch
        )
        self._open_ids.add(wanted)
        try:
            self._tasks.submit(task)
        except BaseException:
            self._open_ids.discard(wanted)
            raise

    def _cancel(self, wanted: str, name: str, publisher: int | None) -> None:
        error = self._tasks.cancel(lambda task: task.id == wanted and task.publisher == publisher)
        if error is not None and wanted in self._open_ids and error == NO_SUCH_TASK_MESSAGE:
            error = _(
                "only the program that started “{action}” can cancel it; any program can stop the robot"
            ).format(action=name or wanted)
        if error is not None:
            error = _(error) if error == NO_SUCH_TASK_MESSAGE else error
            self._reply_callback(wanted, "cancel", name)(TaskReply("failed", error=error))

    def _reply_callback(self, wanted: str, operation: str, name: str) -> Callable[[TaskReply], None]:
        def reply(given: TaskReply) -> None:
            if given.is_final and operation == "invoke":
                self._open_ids.discard(wanted)
            told: dict[str, object] = {"id": wanted, "op": operation, "action": name, "state": given.state}
            told |= {
                "output": dict(given.output),
                "feedback": dict(given.feedback),
                "error": _replace_surrogates(given.error),
            }
            if given.waits_for:
                told["waits_for"] = list(given.waits_for)
            if given.replaces:
                told["replaces"] = list(given.replaces)
            self._publish(told)

        return reply


def _id_of(message: Mapping[str, object]) -> str | None:
    wanted = text(message.get("id"))
    if wanted is None or len(wanted) > _MAX_ID_LENGTH or bounded_str(wanted) != wanted:
        return None
    return wanted


def _replace_surrogates(error: str | None) -> str | None:
    return None if error is None else error.encode("utf-8", "replace").decode("utf-8")


def _typed_arguments(
    spec: ActionSpec, function: Callable[..., object], inputs: Mapping[str, object]
) -> dict[str, object]:
    typed: dict[str, object] = {}
    for name, value in inputs.items():
        try:
            typed[name] = from_json(spec.inputs[name], value)
        except ValueError as error:
            raise Failed(f"{name}: {error}") from error
    for name, parameter in inspect.signature(function).parameters.items():
        if name in spec.inputs and name not in typed and parameter.default is parameter.empty:
            typed[name] = None  # an omitted Optional
    return typed
