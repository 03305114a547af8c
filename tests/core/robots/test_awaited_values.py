"""Tests of suggesting the words that programs wait for to a user who speaks to a robot."""

from __future__ import annotations

import pytest

from app.core.robots.awaited_values import MAX_VALUES, awaited_values
from app.robots.description.description import parse, thing_description
from app.robots.simulated import ROBOT

PEPPER = parse(thing_description(ROBOT.thing_model, "Pepper"))
HEARD = PEPPER.event("heard")


def hat(word: object, robot: str = "Pepper") -> dict[str, object]:
    return {"type": "robot_pepper_when_heard", "fields": {"ROBOT": robot, "WORD": word}}


def behaviour(*blocks: dict[str, object]) -> dict[str, object]:
    return {"blocks": {"blocks": list(blocks)}}


def words(*behaviours: dict[str, object]) -> tuple[str, ...]:
    assert HEARD is not None
    return awaited_values(behaviours, PEPPER, HEARD, "word")


def test_words_of_robot_event_blocks_precede_suggested_words() -> None:
    assert words(behaviour(hat("yes"), hat("no"), hat("yes")), behaviour(hat("stop"))) == (
        "yes",
        "no",
        "stop",
        "hello",
    )
    assert words(behaviour(hat("yes", "Other"))) == ("hello",)
    assert words() == ("hello",)


def test_text_compared_with_a_speech_sensor_is_offered_as_a_word() -> None:
    sensor = {"block": {"type": "robot_pepper_get_heard_word", "fields": {"ROBOT": "Pepper"}}}
    text = {"block": {"type": "values_text", "fields": {"TEXT": " blue "}}}
    compare = {"type": "values_compare", "inputs": {"A": sensor, "B": text}}
    inside = {"type": "control_if", "inputs": {"IF": {"block": compare}}}
    say = {"type": "robot_pepper_do_say", "inputs": {"TEXT": text}}
    assert words(behaviour(inside, say)) == ("blue", "hello")


@pytest.mark.parametrize("word", ["", "  ", None, "x" * 61])
def test_invalid_words_are_skipped(word: object) -> None:
    assert words(behaviour(hat(word), {"type": 3, "inputs": [1], "fields": "none"})) == ("hello",)  # type: ignore[dict-item]


def test_number_of_offered_words_is_limited() -> None:
    assert len(words(behaviour(*(hat(f"word {number}") for number in range(100))))) == MAX_VALUES
