"""Events that a program's process sends to Studio, one JSON object per line."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from app.blocks.runtime.questions import MAX_CHOICE_LENGTH, MAX_CHOICES
from app.blocks.runtime.trace import (
    MAX_TEXT_LENGTH,
    BlockBegan,
    BlockEnded,
    BlockInterrupted,
    BlockResumed,
    BlockSkipped,
    BlockWaiting,
    RecordsLost,
)
from app.blocks.runtime.variables import VariableValue

_Text = Annotated[str, Meta(max_length=MAX_TEXT_LENGTH)]
_Choice = Annotated[str, Meta(max_length=MAX_CHOICE_LENGTH)]


def limited(text: str) -> str:
    """Return a text, cut to the maximum length of texts in events."""
    return text[:MAX_TEXT_LENGTH]


class RunnerEvent(Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="is"):
    """Base class of the events of a program's process.

    Attributes:
        run: Id of the run, which the runner sets.
    """

    run: int = 0


class ProgramReady(RunnerEvent, frozen=True, kw_only=True, tag="ready"):
    """The process can start a program."""


class BlocksTraced(RunnerEvent, frozen=True, kw_only=True, tag="trace"):
    """Next records of the program's trace.

    Attributes:
        records: Records in the order of their occurrence.
    """

    records: tuple[
        BlockBegan | BlockEnded | BlockWaiting | BlockInterrupted | BlockResumed | BlockSkipped | RecordsLost,
        ...,
    ]


class ProgramRunning(RunnerEvent, frozen=True, kw_only=True, tag="running"):
    """The program runs, or its activity has changed.

    Attributes:
        description: Activity of a robot, or the running block as text.
    """

    description: _Text = ""


class ProgramPaused(RunnerEvent, frozen=True, kw_only=True, tag="paused"):
    """All scripts are suspended by a pause.

    Attributes:
        block: Id of the block that a single step runs, or None.
        description: This block as text.
        warning: Warning about what Resume does, or "".
    """

    block: str | None = None
    description: _Text = ""
    warning: _Text = ""


class ProgramFailed(RunnerEvent, frozen=True, kw_only=True, tag="error"):
    """The program has failed, or can't start.

    Attributes:
        block: Id of the block that failed, or None.
        text: Message for the user.
    """

    block: str | None = None
    text: _Text = ""


class CommandReplaced(RunnerEvent, frozen=True, kw_only=True, tag="warning"):
    """The robot action of a block was replaced by that of another script.

    Attributes:
        block: Id of the block.
        text: Message for the user.
        count: Number of times that this happened in the run.
    """

    block: str
    text: _Text = ""
    count: int = 1


class LinePrinted(RunnerEvent, frozen=True, kw_only=True, tag="print"):
    """Line that the program wrote to the Console.

    Attributes:
        text: Line.
    """

    text: _Text = ""


class VariablesChanged(RunnerEvent, frozen=True, kw_only=True, tag="variables"):
    """New values of variables.

    Attributes:
        values: Variables that have changed.
    """

    values: tuple[VariableValue, ...] = ()


class QuestionChanged(RunnerEvent, frozen=True, kw_only=True, tag="ask"):
    """Question to the user, or its withdrawal.

    Attributes:
        question: Number of the question; 0 withdraws the open question.
        text: _Text of the question.
        choices: Possible answers; empty if any answer is allowed.
    """

    question: int = 0
    text: _Text = ""
    choices: Annotated[tuple[_Choice, ...], Meta(max_length=MAX_CHOICES)] = ()


class ProgramEnded(RunnerEvent, frozen=True, kw_only=True, tag="ended"):
    """The program has ended; always the last event.

    Attributes:
        is_ok: True if no block failed.
        elapsed_s: Duration of the run in seconds, or None if unknown.
        unresponsive_robots: Names of robots that did not reply to the Stop that the program sent at its end.
        text: Reason for a failure of the process, or "".
    """

    is_ok: bool = True
    elapsed_s: float | None = None
    unresponsive_robots: tuple[str, ...] = ()
    text: _Text = ""


AnyEvent = (
    ProgramReady
    | BlocksTraced
    | ProgramRunning
    | ProgramPaused
    | ProgramFailed
    | CommandReplaced
    | LinePrinted
    | VariablesChanged
    | QuestionChanged
    | ProgramEnded
)
