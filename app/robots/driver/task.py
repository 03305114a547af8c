"""One thing that a robot is asked to do, and what is answered to it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

from app.robots.driver.call import Call

State: TypeAlias = Literal["accepted", "running", "succeeded", "failed", "canceled"]


@dataclass(frozen=True)
class Answer:
    """How a task stands; `error` is a sentence for people.

    An accepted one may wait for other actions (`waits_for`) or have ended them (`replaces`).
    """

    state: State
    output: Mapping[str, object] = field(default_factory=dict)
    feedback: Mapping[str, object] = field(default_factory=dict)
    error: str | None = None
    waits_for: tuple[str, ...] = ()
    replaces: tuple[str, ...] = ()

    @property
    def is_final(self) -> bool:
        """True when no other answer follows."""
        return self.state in {"succeeded", "failed", "canceled"}


class ProgramId(NamedTuple):
    """Who asks a robot to act: the name in ``from``, and the id of the publisher that the command came from.

    Anybody can write another's name; only both together are the program that must stay alive.
    """

    name: str
    publisher: int | None


@dataclass(eq=False)
class Task:
    """Something to run: `run` gets its :class:`Call` in a thread, `answer` is called in the deciding one.

    `stopped` says that a stop of the robot told it to end; `answered` that its final answer was given, also
    while its function goes on.
    `program` asked for it and must stay alive while it runs; one that `goes_on` (a speed) also afterwards.
    `publisher` is the id of the publisher that the command came from, also when it named no program.
    `epoch` is `Tasks.epoch` when the command was received: after a later stop it is not run.
    """

    id: str
    action: str
    run: Callable[[Call], object]
    answer: Callable[[Answer], None]
    uses: tuple[str, ...] = ()
    on_busy: str = "queue"
    timeout_s: float | None = None
    cancellable: bool = True
    title: str = ""
    program: ProgramId | None = None
    publisher: int | None = None
    goes_on: bool = False
    epoch: int | None = None
    call: Call | None = None
    thread: threading.Thread | None = None
    due_s: float | None = None
    ending: Answer | None = None
    answered: bool = False
    stopped: bool = False

    def end(self, how: Answer) -> None:
        """Ask the running function to end; `how` is what will be answered, whatever it returns."""
        self.ending = self.ending or how
        if self.call is not None:
            self.call.cancel()

    def finish(self, answer: Answer) -> None:
        """Give the final answer, once."""
        if not self.answered:
            self.answered = True
            self.answer(answer)
