"""Task: execution of an action, and the replies that report its state."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

from app.robots.driver.call import Call

State: TypeAlias = Literal["accepted", "running", "succeeded", "failed", "canceled"]


@dataclass(frozen=True)
class TaskReply:
    """Reply that reports the state of a task.

    Attributes:
        state: State of the task.
        output: Result of the action.
        feedback: Progress of the action.
        error: Message for the user; None if there is no error.
        waits_for: Names of the actions that an accepted task waits for.
        replaces: Names of the actions that an accepted task has replaced.
    """

    state: State
    output: Mapping[str, object] = field(default_factory=dict)
    feedback: Mapping[str, object] = field(default_factory=dict)
    error: str | None = None
    waits_for: tuple[str, ...] = ()
    replaces: tuple[str, ...] = ()

    @property
    def is_final(self) -> bool:
        """True if this is the last reply to a command."""
        return self.state in {"succeeded", "failed", "canceled"}


class ProgramId(NamedTuple):
    """Id of the program that requested an action.

    Names can be forged; only the pair identifies the program that must keep sending heartbeats.

    Attributes:
        name: Name in the member ``from`` of the command.
        publisher: Id of the command's publisher.
    """

    name: str
    publisher: int | None


@dataclass(eq=False)
class Task:
    """Execution of an action.

    `run` is called in a separate thread, `reply` in the thread of the robot's `Tasks`.

    Attributes:
        id: Id of the command.
        action: Name of the action.
        run: Function of the action.
        reply: Called with each reply.
        uses: Names of the resources that the action occupies.
        on_busy: "queue", "replace" or "reject" when a resource is in use.
        timeout_s: Maximum duration in seconds.
        cancellable: False if the action can't be cancelled.
        title: Display name.
        program: Program that must stay alive while the task is running; with `continues_after_success`, also
            afterwards.
        publisher: Id of the command's publisher, even if the command named no program.
        continues_after_success: True for an action that continues after success, such as a speed.
        epoch: Value of `Tasks.epoch` when the command was received. The task isn't run after a later stop.
        call: Running call; None before the task has started.
        thread: Thread of the running call.
        deadline_s: Time on the clock at which the time limit elapses.
        final_reply: Reply to send when the task ends, if it was cancelled, replaced, stopped or timed out.
        has_replied: True once the final reply was sent, even if the function is still running.
        is_stopped: True if a stop of the robot ended the task.
    """

    id: str
    action: str
    run: Callable[[Call], object]
    reply: Callable[[TaskReply], None]
    uses: tuple[str, ...] = ()
    on_busy: str = "queue"
    timeout_s: float | None = None
    cancellable: bool = True
    title: str = ""
    program: ProgramId | None = None
    publisher: int | None = None
    continues_after_success: bool = False
    epoch: int | None = None
    call: Call | None = None
    thread: threading.Thread | None = None
    deadline_s: float | None = None
    final_reply: TaskReply | None = None
    has_replied: bool = False
    is_stopped: bool = False

    def request_end(self, final_reply: TaskReply) -> None:
        """Cancel the running function.

        Args:
            final_reply: Final reply, unless an earlier call has set one. It replaces the function's result,
                but not its error.
        """
        self.final_reply = self.final_reply or final_reply
        if self.call is not None:
            self.call.cancel()

    def finish(self, reply: TaskReply) -> None:
        """Send the final reply, unless a final reply was already sent."""
        if not self.has_replied:
            self.has_replied = True
            self.reply(reply)
