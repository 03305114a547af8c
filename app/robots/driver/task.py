"""Task of a robot, and the replies to it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

from app.robots.driver.call import Call

State: TypeAlias = Literal["accepted", "running", "succeeded", "failed", "canceled"]


@dataclass(frozen=True)
class TaskReply:
    """State of a task. ``error`` is a message for the user.

    An accepted task may have to wait for other actions (`waits_for`), or have replaced them (`replaces`).
    """

    state: State
    output: Mapping[str, object] = field(default_factory=dict)
    feedback: Mapping[str, object] = field(default_factory=dict)
    error: str | None = None
    waits_for: tuple[str, ...] = ()
    replaces: tuple[str, ...] = ()

    @property
    def is_final(self) -> bool:
        """True if no further reply follows."""
        return self.state in {"succeeded", "failed", "canceled"}


class ProgramId(NamedTuple):
    """Requesting program: the name in ``from``, and the id of the command's publisher.

    Names can be forged; only both together identify the program that must stay alive.
    """

    name: str
    publisher: int | None


@dataclass(eq=False)
class Task:
    """Execution of an action.

    `run` is called with the :class:`Call` in a separate thread, `answer` in the thread of the robot's
    `Tasks`.

    Attributes:
        id: Id of the command.
        action: Name of the action.
        run: Function of the action.
        answer: Called with each reply.
        uses: Resources of the action.
        on_busy: "queue", "replace" or "reject".
        timeout_s: Maximum duration.
        cancellable: False if the action can't be cancelled.
        title: Display name.
        program: Program that must stay alive while the task is running; with `goes_on`, also afterwards.
        publisher: Id of the command's publisher, even if the command named no program.
        goes_on: True for a speed, which continues after success.
        epoch: `Tasks.epoch` when the command was received. After a later stop, the task isn't run.
        call: Running call.
        thread: Thread of the running call.
        due_s: Time at which the time limit elapses.
        ending: Reply to send when the task ends.
        answered: True once the final reply was sent, even if the function is still running.
        stopped: True if a stop of the robot ended the task.
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

    def request_end(self, how: TaskReply) -> None:
        """Ask the running function to end. ``how`` is the final reply, whatever the function returns."""
        self.final_reply = self.final_reply or how
        if self.call is not None:
            self.call.cancel()

    def finish(self, answer: TaskReply) -> None:
        """Send the final reply, unless one was already sent."""
        if not self.has_replied:
            self.has_replied = True
            self.reply(answer)
