"""Ask and wait: one question at a time, and what an answer is."""

from __future__ import annotations

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.questions import LONGEST_QUESTION, ProgramQuestion, as_value
from tests.blocks.fakes import Play, play, until
from tests.blocks.samples import block, boolean, get, number, stack, started, text, workspace, write


class Person:
    """Sees the questions of a program, as a window would."""

    def __init__(self, saved: dict[str, object]) -> None:
        program = compile_behaviour(saved, [])
        self.shown: list[ProgramQuestion | None] = []
        self.run = Play(program, asked=self.shown.append).start()

    def sees(self, words: str | None) -> ProgramQuestion:
        until(lambda: bool(self.shown) and (self.shown[-1].text if self.shown[-1] else None) == words)
        return self.shown[-1] or ProgramQuestion(0, "")

    def answers(self, question: str, words: str) -> None:
        self.run.runtime.questions.answered(self.sees(question).id, words)


def ask(question: object) -> dict[str, object]:
    return block("asking_ask", QUESTION=question if isinstance(question, dict) else text(question))


def answer() -> dict[str, object]:
    return block("asking_answer")


def test_the_script_waits_for_the_answer_and_the_others_go_on():
    them = Person(
        workspace(started(write(answer()), ask("Name?"), write(answer())), started(write(text("other"))))
    )
    them.sees("Name?")
    until(lambda: sorted(them.run.lines) == ["", "other"])
    them.answers("Name?", "Ada")
    them.run.end()
    assert them.run.lines[-1] == "Ada"
    assert them.shown[-1] is None


def test_two_scripts_that_ask_are_asked_one_after_the_other():
    one = started(ask("one"), write(answer()))
    them = Person(workspace(one, started(ask("two"), write(answer()))))
    until(lambda: len(them.run.runtime.scheduler.snapshot().blocks) == 2)
    first = them.shown[-1]
    assert first is not None
    other = {"one": "two", "two": "one"}[first.text]
    them.run.runtime.questions.answered(first.id + 99, "too early")
    them.answers(first.text, "A")
    them.answers(other, "B")
    them.run.end()
    assert them.run.lines == ["A", "B"]


def test_a_script_that_is_ended_takes_its_question_back():
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


def test_the_end_of_the_program_takes_the_question_back():
    them = Person(workspace(started(ask("Name?"))))
    them.sees("Name?")
    them.run.stop()
    them.sees(None)


def test_pause_stands_while_a_question_is_asked():
    them = Person(workspace(started(ask("Name?"), write(answer()))))
    them.sees("Name?")
    them.run.runtime.scheduler.pause()
    until(lambda: them.run.runtime.scheduler.snapshot().paused)
    them.answers("Name?", "Ada")
    them.run.runtime.scheduler.go_on()
    them.run.end()
    assert them.run.lines == ["Ada"]


def test_where_nobody_can_answer_a_sentence_says_so():
    run = play(workspace(started(ask("Name?") | {"id": "q"})))
    assert run.runtime.error is not None
    assert run.runtime.error.block == "q"
    assert run.runtime.error.sentence == "Nobody can answer: the behaviour runs outside of Studio."


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        (text(""), ""),
        (text("👍?"), "👍?"),
        (number(-1), "-1"),
        (number(2**64 - 1), "1.8446744073709552e+19"),
        (boolean(True), "true"),
        (block("lists_empty"), "[]"),
        (text("x" * 9999), "x" * LONGEST_QUESTION),
    ],
)
def test_anything_can_be_asked(asked, shown):
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
def test_what_is_typed_as_a_number_is_one(typed, value):
    assert (type(as_value(typed)), as_value(typed)) == (type(value), value)


def test_an_answer_can_be_compared_and_counted_with():
    twice = block("control_repeat", TIMES=answer(), BODY=[write(text("hop"))])
    same = block("values_compare", A=answer(), RELATION="==", B=number(2))
    them = Person(workspace(stack(block("events_started"), ask("How often?"), twice, write(same))))
    them.answers("How often?", "2")
    them.run.end()
    assert them.run.lines == ["hop", "hop", "true"]
