"""Questions of a program to the user, shown one at a time in the order in which scripts ask them."""

from __future__ import annotations

import itertools
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass

from app.blocks.runtime.errors import BehaviourError, type_name
from app.blocks.runtime.scheduler import Scheduler
from app.blocks.runtime.values import text
from nep.i18n import _

MAX_QUESTION_LENGTH = 500
MAX_ANSWER_LENGTH = 10_000
MAX_CHOICE_LENGTH = 200
MAX_CHOICES = 12
_NUMBER = re.compile(r"-?(?:0|[1-9]\d{0,14})(?:[.,]\d{1,9})?", re.ASCII)


@dataclass
class ProgramQuestion:
    """Question to the user.

    Attributes:
        id: Id of the question.
        text: Text of the question.
        answer: Answer as text; None until the user has answered.
        choices: Labels of the buttons; empty if the user enters a text.
    """

    id: int
    text: str
    answer: str | None = None
    choices: tuple[str, ...] = ()


QuestionCallback = Callable[[ProgramQuestion | None], None]
"""Callback that receives the question to show, or None to hide it."""


class Questions:
    """Queue of questions. Scripts ask questions, another thread passes the answers.

    Attributes:
        answer: Last answer; "" before the first one.

    Args:
        scheduler: Scheduler of the program.
        on_question: Called with the question to show, or None; without this callback, questions can't be
            asked.
    """

    def __init__(self, scheduler: Scheduler, on_question: QuestionCallback | None) -> None:
        self._scheduler, self._on_question = scheduler, on_question
        self._lock = threading.Lock()
        self._ids = itertools.count(1)
        self._queue: list[ProgramQuestion] = []
        self.answer: object = ""

    def ask(self, question_text: object) -> None:
        """Ask a question and wait for the answer, which is stored in `answer`.

        Raises:
            BehaviourError: The program runs outside of Studio.
        """
        if self._on_question is None:
            raise BehaviourError(
                _("Can't ask the question: the behaviour runs outside Studio. Run it in Studio.")
            )
        self.answer = parse_answer(self._wait_for_answer(text(question_text)))

    def ask_with_choices(self, question_text: object, choices: object) -> None:
        """Ask a question with a button for each item of a list, and store the selected item in `answer`.

        The answer is an empty text if the user presses Esc.

        Raises:
            BehaviourError: The program runs outside of Studio, or `choices` is not a list, is empty or
                is too long.
        """
        if self._on_question is None:
            raise BehaviourError(
                _("Can't ask the question: the behaviour runs outside Studio. Run it in Studio.")
            )
        values_by_label = choices_by_label(choices)
        chosen_label = self._wait_for_answer(text(question_text), tuple(values_by_label))
        value = values_by_label.get(chosen_label, "")
        self.answer = parse_answer(value) if isinstance(value, str) else value

    def _wait_for_answer(self, question_text: str, choices: tuple[str, ...] = ()) -> str:
        question = ProgramQuestion(next(self._ids), question_text[:MAX_QUESTION_LENGTH], choices=choices)
        self._update_queue(self._queue.append, question)
        try:
            self._scheduler.wait_until(lambda: question.answer is not None, None, cause="answer")
        finally:  # also if the script ends meanwhile
            self._update_queue(self._queue.remove, question)
        return question.answer or ""

    def set_answer(self, id: int, answer: str) -> None:
        """Store the user's answer to a question; ignored if the question is no longer open.

        Args:
            id: Id of the question.
            answer: Answer.
        """
        with self._lock:
            for question in self._queue:
                if question.id == id:
                    question.answer = answer[:MAX_ANSWER_LENGTH]

    def _update_queue(self, change: Callable[[ProgramQuestion], None], question: ProgramQuestion) -> None:
        with self._lock:
            first_before = self._queue[:1]
            change(question)
            if first_before != self._queue[:1] and self._on_question is not None:
                self._on_question(self._queue[0] if self._queue else None)


def choices_by_label(choices: object) -> dict[str, object]:
    """Return the items of a list by the texts of their buttons, without empty and duplicate texts.

    Raises:
        BehaviourError: The value is not a list, or the list is empty or too long.
    """
    if not isinstance(choices, list):
        raise BehaviourError(
            _("A question with choices needs a list of choices, not {value}.").format(
                value=type_name(choices)
            )
        )
    values_by_label: dict[str, object] = {}
    for item in choices:
        if choice_label := " ".join(text(item).split())[:MAX_CHOICE_LENGTH]:
            values_by_label.setdefault(choice_label, item)
        if len(values_by_label) > MAX_CHOICES:
            raise BehaviourError(
                _("A question can have at most {most} choices; this list has {count}.").format(
                    most=MAX_CHOICES, count=len(choices)
                )
            )
    if not values_by_label:
        raise BehaviourError(_("The list of choices is empty."))
    return values_by_label


def parse_answer(answer: str) -> str | int | float:
    """Convert an answer to a number if it is one; other texts are returned unchanged.

    "007" and numbers with more than 15 digits remain texts.
    """
    stripped = answer.strip()
    if not _NUMBER.fullmatch(stripped):
        return answer
    parsed = float(stripped.replace(",", "."))
    return int(parsed) if parsed.is_integer() else parsed
