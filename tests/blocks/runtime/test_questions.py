"""Tests of the *ask and wait* block: the order of questions, and the conversion of answers."""

from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.questions import (
    MAX_CHOICE_LENGTH,
    MAX_CHOICES,
    MAX_QUESTION_LENGTH,
    ProgramQuestion,
    parse_answer,
)
from tests.blocks.fakes import Play, play, until
from tests.blocks.samples import (
    block,
    boolean,
    get,
    list_of,
    number,
    stack,
    started,
    text,
    workspace,
    write,
)


class Person:
    """Simulated user who sees and answers a program's questions."""

    def __init__(self, saved: dict[str, object]) -> None:
        program = compile_behaviour(saved, [])
        self.shown: list[ProgramQuestion | None] = []
        self.run = Play(program, asked=self.shown.append).start()

    def sees(self, words: str | None) -> ProgramQuestion:
        until(lambda: bool(self.shown) and (self.shown[-1].text if self.shown[-1] else None) == words)
        return self.shown[-1] or ProgramQuestion(0, "")

    def answers(self, question: str, words: str) -> None:
        self.run.runtime.questions.set_answer(self.sees(question).id, words)


def ask(question: object) -> dict[str, object]:
    return block("asking_ask", QUESTION=question if isinstance(question, dict) else text(question))


def choose(choices: dict[str, object], question: str = "Which?") -> dict[str, object]:
    return block("asking_choices", "choose", QUESTION=text(question), CHOICES=choices)


def answer() -> dict[str, object]:
    return block("asking_answer")


def test_script_waits_for_answer_while_others_continue():
    them = Person(
        workspace(started(write(answer()), ask("Name?"), write(answer())), started(write(text("other"))))
    )
    them.sees("Name?")
    until(lambda: sorted(them.run.lines) == ["", "other"])
    them.answers("Name?", "Ada")
    them.run.end()
    assert them.run.lines[-1] == "Ada"
    assert them.shown[-1] is None


def test_questions_of_two_scripts_are_asked_one_after_another():
    one = started(ask("one"), write(answer()))
    them = Person(workspace(one, started(ask("two"), write(answer()))))
    until(lambda: len(them.run.runtime.scheduler.snapshot().blocks) == 2)
    first = them.shown[-1]
    assert first is not None
    other = {"one": "two", "two": "one"}[first.text]
    them.run.runtime.questions.set_answer(first.id + 99, "too early")
    them.answers(first.text, "A")
    them.answers(other, "B")
    them.run.end()
    assert them.run.lines == ["A", "B"]


def test_question_of_stopped_script_is_withdrawn():
    them = Person(
        workspace(
            started(ask("first"), write(text("never"))),
            started(
                block("control_wait_until", CONDITION=get("go")), block("control_stop_others"), ask("second")
            ),
            variables=("go",),
        )
    )
    them.sees("first")
    them.run.names["go"] = True
    them.answers("second", "")
    them.run.end()
    assert (them.run.lines, them.run.runtime.error) == ([], None)


def test_question_is_withdrawn_when_program_stops():
    them = Person(workspace(started(ask("Name?"))))
    them.sees("Name?")
    them.run.stop()
    them.sees(None)


def test_program_can_be_paused_while_question_is_shown():
    them = Person(workspace(started(ask("Name?"), write(answer()))))
    them.sees("Name?")
    them.run.runtime.scheduler.pause()
    until(lambda: them.run.runtime.scheduler.snapshot().is_paused)
    them.answers("Name?", "Ada")
    them.run.runtime.scheduler.resume()
    them.run.end()
    assert them.run.lines == ["Ada"]


def test_question_outside_studio_is_an_error():
    run = play(workspace(started(ask("Name?") | {"id": "q"})))
    assert run.runtime.error is not None
    assert run.runtime.error.block == "q"
    assert run.runtime.error.sentence == (
        "Can't ask the question: the behaviour runs outside Studio. Run it in Studio."
    )


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        (text(""), ""),
        (text("👍?"), "👍?"),
        (number(-1), "-1"),
        (number(2**64 - 1), "1.8446744073709552e+19"),
        (boolean(True), "yes"),
        (block("lists_empty"), "[]"),
        (text("x" * 9999), "x" * MAX_QUESTION_LENGTH),
    ],
)
def test_value_of_any_type_can_be_asked_as_question(asked, shown):
    them = Person(workspace(started(ask(asked))))
    them.answers(shown, "")
    them.run.end()
    assert them.run.runtime.error is None


@pytest.mark.parametrize(
    ("typed", "value"),
    [
        ("7", 7),
        (" 7 ", 7),
        ("0", 0),
        ("-1", -1),
        ("2.50", 2.5),
        ("2,5", 2.5),
        ("3.0", 3),
        ("007", "007"),
        ("18446744073709551615", "18446744073709551615"),
        ("nan", "nan"),
        ("inf", "inf"),
        ("1e5", "1e5"),
        ("", ""),
        ("  Ada ", "  Ada "),
        ("👍", "👍"),
        ("٣", "٣"),
    ],
)
def test_typed_decimal_number_is_converted_and_other_answers_stay_text(typed, value):
    assert (type(parse_answer(typed)), parse_answer(typed)) == (type(value), value)


def test_answer_can_be_compared_and_used_as_count():
    twice = block("control_repeat", TIMES=answer(), BODY=[write(text("hop"))])
    same = block("values_compare", A=answer(), RELATION="==", B=number(2))
    them = Person(workspace(stack(block("events_started"), ask("How often?"), twice, write(same))))
    them.answers("How often?", "2")
    them.run.end()
    assert them.run.lines == ["hop", "hop", "yes"]


def test_selected_option_is_the_answer_and_next_question_has_no_choices():
    them = Person(
        workspace(started(choose(list_of(text("cat"), text("dog"))), write(answer()), ask("Name?")))
    )
    assert them.sees("Which?").choices == ("cat", "dog")
    them.answers("Which?", "dog")
    assert them.sees("Name?").choices == ()
    them.answers("Name?", "")
    them.run.end()
    assert them.run.lines == ["dog"]


@pytest.mark.parametrize(
    ("item", "shown", "same_as"),
    [
        (number(2), "2", number(2)),
        (text("2"), "2", number(2)),
        (boolean(True), "yes", boolean(True)),
        (text(" two\n words "), "two words", text(" two\n words ")),
        (text("x" * 9999), "x" * MAX_CHOICE_LENGTH, text("x" * 9999)),
    ],
)
def test_selected_answer_is_the_list_item_itself(item, shown, same_as):
    same = block("values_compare", A=answer(), RELATION="==", B=same_as)
    them = Person(workspace(started(choose(list_of(item)), write(same))))
    assert them.sees("Which?").choices == (shown,)
    them.answers("Which?", shown)
    them.run.end()
    assert them.run.lines == ["yes"]


def test_choices_are_deduplicated_and_escape_returns_an_empty_answer():
    split = block("lists_split", TEXT=text("a,b,,a,c"), BETWEEN=text(","))
    them = Person(workspace(started(choose(split), write(block("texts_empty", TEXT=answer())))))
    assert them.sees("Which?").choices == ("a", "b", "c")
    them.answers("Which?", "")
    them.run.end()
    assert them.run.lines == ["yes"]


def test_text_and_choice_questions_are_asked_one_after_another():
    them = Person(workspace(started(ask("one")), started(choose(list_of(text("a")), "two"), write(answer()))))
    until(lambda: len(them.run.runtime.scheduler.snapshot().blocks) == 2)
    first = them.shown[-1]
    assert first is not None
    for words in (first.text, {"one": "two", "two": "one"}[first.text]):
        them.answers(words, "a")
    them.run.end()
    assert them.run.lines == ["a"]


@pytest.mark.parametrize(
    ("choices", "sentence"),
    [
        (block("lists_empty"), "The list of choices is empty."),
        (list_of(text(""), text(" ")), "The list of choices is empty."),
        (
            list_of(*(number(each) for each in range(MAX_CHOICES + 1))),
            "A question can have at most 12 choices; this list has 13.",
        ),
        (get("pets"), "A question with choices needs a list of choices, not a number."),
    ],
)
def test_invalid_choices_are_an_error_on_the_block(choices, sentence):
    them = Person(workspace(started(choose(choices)), variables=("pets",)))
    until(lambda: them.run.runtime.error is not None)
    error = them.run.runtime.error
    assert error is not None
    assert (error.block, error.sentence, them.shown) == ("choose", sentence, [])
    them.run.stop()


def test_choice_question_outside_studio_is_an_error():
    run = play(workspace(started(choose(list_of(text("a"))))))
    assert run.runtime.error is not None
    assert run.runtime.error.sentence == (
        "Can't ask the question: the behaviour runs outside Studio. Run it in Studio."
    )
