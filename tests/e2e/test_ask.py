"""Tests of a behaviour that asks a question: the user types the answer, and the robot speaks it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.behaviours import Block, block, say, started, text, write
from tests.e2e.shared_studio import SharedStudio
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)

HELLO = "Pepper says “Hello Ada”"


def asks(words: str, below: Block) -> Block:
    return block("asking_ask", below=below, QUESTION=text(words))


def says_the_answer() -> Block:
    joined = {"block": block("values_join", A=text("Hello "), B={"block": block("asking_answer")})}
    said = say("")
    return {**said, "inputs": {"TEXT": joined}}


def chooses(words: str, choices: list[str], below: Block) -> Block:
    items = {f"ITEM{number}": text(each) for number, each in enumerate(choices)}
    held = {"type": "lists_create", "id": words, "extraState": {"items": len(choices)}, "inputs": items}
    made = block("asking_choices", below=below, QUESTION=text(words), CHOICES={"block": held})
    return {**made, "id": f"choices {words}"}


@pytest.fixture
def asking(shared: SharedStudio, tmp_path: Path) -> Studio:
    """Studio that runs a behaviour which asks for a name."""
    script = started(asks("What is your name?", says_the_answer()))
    studio = shared.open(write(tmp_path / "Mine.nepb", script))
    studio.click("Run", kind="RunButton")
    studio.says("What is your name?")
    return studio


def test_question_is_answered_by_typing_and_enter(asking: Studio) -> None:
    asking.screen.type("Ada")
    asking.screen.key("Return")
    asking.says(HELLO)
    asking.says("Finished")
    until(lambda: not asking.all(kind="QuestionCard"), "the card goes")


def test_pause_keeps_the_question_and_stop_removes_it(asking: Studio) -> None:
    asking.screen.type("Ad")
    asking.click("Pause")
    asking.says("Paused at “")
    asking.find("Answer", kind="Button", enabled=False)
    asking.click("Resume")
    asking.find("Answer", kind="Button", enabled=True)
    asking.screen.key("F12")
    asking.says("Pepper stopped (")
    until(lambda: not asking.all(kind="QuestionCard"), "the card goes")


def test_choice_is_selected_by_key_and_in_the_large_room_by_mouse(
    shared: SharedStudio, tmp_path: Path
) -> None:
    last = chooses("Which colour?", ["red", "green", "a blue like the sky"], says_the_answer())
    first = chooses("Play?", ["yes", "no"], last)
    studio = shared.open(write(tmp_path / "Mine.nepb", started(first)))
    studio.click("Run", kind="RunButton")
    studio.find("yes", kind="ChoiceButton", focus=True)
    studio.screen.key("Right")
    studio.find("no", kind="ChoiceButton", focus=True)
    studio.screen.key("Return")
    studio.find("red", kind="ChoiceButton", focus=True)
    until(lambda: not studio.all("no", kind="ChoiceButton"), "the first question goes")
    studio.click("Large room", kind="IconButton")
    studio.find(kind="LargeRoom")
    studio.find("red", kind="ChoiceButton", focus=True)
    studio.click("a blue like the sky", kind="ChoiceButton")
    studio.says("Pepper says “Hello a blue like the sky”")
    until(lambda: not studio.all(kind="QuestionCard"), "the card goes")


def test_stop_removes_the_choices_of_a_question(shared: SharedStudio, tmp_path: Path) -> None:
    script = started(chooses("Play?", ["yes", "no"], says_the_answer()))
    studio = shared.open(write(tmp_path / "Mine.nepb", script))
    studio.click("Run", kind="RunButton")
    studio.find("yes", kind="ChoiceButton", focus=True)
    studio.click("Stop", kind="StopButton")
    studio.says("Pepper stopped (")
    until(lambda: not studio.all(kind="QuestionCard"), "the card goes")
