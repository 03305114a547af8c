"""A behaviour asks, the person in front of Studio answers with the keyboard alone, and the robot says it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.behaviours import Block, block, say, started, text, write
from tests.e2e.studio import Studio

pytestmark = pytest.mark.timeout(240)

HELLO = "Pepper says “Hello Ada”"


def asks(words: str, below: Block) -> Block:
    return block("asking_ask", below=below, QUESTION=text(words))


def says_the_answer() -> Block:
    joined = {"block": block("values_join", A=text("Hello "), B={"block": block("asking_answer")})}
    said = say("")
    return {**said, "inputs": {"TEXT": joined}}


@pytest.fixture
def asking(start: Callable[..., Studio], tmp_path: Path) -> Studio:
    """Studio runs a behaviour that asks for a name."""
    script = started(asks("What is your name?", says_the_answer()))
    studio = start(str(write(tmp_path / "Mine.nepb", script)))
    studio.choose("Robots", "Use the virtual Pepper")
    studio.says("Pepper ready", 40)
    studio.spot("[data-id=started]")
    studio.click("Run", kind="RunButton")
    studio.says("What is your name?", 40)
    return studio


def test_who_is_asked_types_and_presses_enter(asking: Studio) -> None:
    asking.screen.type("Ada")
    asking.screen.key("Return")
    asking.says(HELLO)
    asking.says("Finished", 40)
    assert not asking.all(kind="QuestionCard")


def test_pause_holds_the_question_and_stop_takes_it_away(asking: Studio) -> None:
    asking.screen.type("Ad")
    asking.click("Pause")
    asking.says("Paused at “")
    asking.find("Answer", kind="Button", enabled=False)
    asking.click("Go on")
    asking.find("Answer", kind="Button", enabled=True)
    asking.screen.key("F12")
    asking.says("Pepper stopped (")
    assert not asking.all(kind="QuestionCard")
