"""Question of a running program to the user."""

from __future__ import annotations

from dataclasses import dataclass

from app.blocks.runtime.events import QuestionChanged, RunnerEvent
from app.core.run.runner import Runner


@dataclass(frozen=True, slots=True)
class AskedQuestion:
    """Question of a program to the user.

    Attributes:
        run: Id of the run.
        number: Number of the question within the run.
        text: Text of the question.
        choices: Possible answers; empty if any answer is allowed.
    """

    run: int
    number: int
    text: str
    choices: tuple[str, ...] = ()


class OpenQuestion:
    """Storage of the open question of a program. At most one question is open."""

    def __init__(self) -> None:
        self.question: AskedQuestion | None = None
        self._runner: Runner | None = None

    def reset(self, runner: Runner) -> None:
        """Discard the question of the previous program and connect to a new one."""
        self.question, self._runner = None, runner

    def on_event(self, event: RunnerEvent) -> None:
        """Apply an event that asks a question or withdraws one; other events are ignored."""
        if isinstance(event, QuestionChanged) and self._runner is not None:
            number = event.question
            self.question = AskedQuestion(event.run, number, event.text, event.choices) if number else None

    def answer(self, question: AskedQuestion, text: str) -> None:
        """Send the user's answer to the program. Does nothing if the question is no longer open."""
        if self._runner is not None and question == self.question:
            self.question = None
            self._runner.answer(question.number, text)

    def clear(self) -> None:
        """Discard the question after the program has ended."""
        self.question = self._runner = None
