"""The question of a running program that a person has not answered yet."""

from __future__ import annotations

from dataclasses import dataclass

from app.core.run.runner import Runner, RunnerEvent


@dataclass(frozen=True, slots=True)
class AskedQuestion:
    """A question as it is shown: of which run, its number there, its words, and what can be chosen."""

    run: int
    number: int
    words: str
    choices: tuple[str, ...] = ()


class Asking:
    """One question at a time, as the program's process tells it."""

    def __init__(self) -> None:
        self.question: AskedQuestion | None = None
        self._runner: Runner | None = None

    def begin(self, runner: Runner) -> None:
        """A program runs now, and may ask."""
        self.question, self._runner = None, runner

    def take(self, event: RunnerEvent) -> None:
        """The program asks, or takes its question back; other events are no matter of this."""
        if event.kind == "ask" and self._runner is not None:
            number = event.question
            self.question = AskedQuestion(event.run, number, event.text, event.choices) if number else None

    def answer(self, question: AskedQuestion, words: str) -> None:
        """A person answers this question; nothing happens when it is not asked any more."""
        if self._runner is not None and question == self.question:
            self.question = None
            self._runner.answer(question.number, words)

    def clear(self) -> None:
        """The program ends."""
        self.question = self._runner = None
