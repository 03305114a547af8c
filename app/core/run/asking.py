"""Open question of a running program."""

from __future__ import annotations

from dataclasses import dataclass

from app.core.run.runner import Runner, RunnerEvent


@dataclass(frozen=True, slots=True)
class AskedQuestion:
    """Question of a run: its number, words and choices."""

    run: int
    number: int
    words: str
    choices: tuple[str, ...] = ()


class Asking:
    """Holds the program's question, one at a time."""

    def __init__(self) -> None:
        self.question: AskedQuestion | None = None
        self._runner: Runner | None = None

    def begin(self, runner: Runner) -> None:
        """Begin with a new program."""
        self.question, self._runner = None, runner

    def apply(self, event: RunnerEvent) -> None:
        """Apply an event: a question or its withdrawal; others are ignored."""
        if event.kind == "ask" and self._runner is not None:
            number = event.question
            self.question = AskedQuestion(event.run, number, event.text, event.choices) if number else None

    def answer(self, question: AskedQuestion, words: str) -> None:
        """Send the user's answer; no effect when the question is no longer open."""
        if self._runner is not None and question == self.question:
            self.question = None
            self._runner.answer(question.number, words)

    def clear(self) -> None:
        """Clear the question: the program ends."""
        self.question = self._runner = None
