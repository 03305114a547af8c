"""Other words by which people look for the blocks of robots."""

from __future__ import annotations

import pytest

from app.blocks.model.robot_words import CHANGES, in_both, words_of_action, words_of_sensor
from nep.i18n import install, language


@pytest.fixture
def spanish():
    before = language()
    install("es")
    yield
    install(before)


@pytest.mark.parametrize(
    ("names", "word"),
    [
        (["walk_to_door"], "forward"),
        (["moveForward"], "drive"),
        (["x1", "Rotate"], "spin"),
        (["x2", "", "rb:SetLEDs", "iot:Light"], "lamp"),
        (["sayText"], "talk"),
    ],
)
def test_an_action_is_found_by_what_its_name_title_or_type_means(names, word):
    assert word in words_of_action(names).words.split(", ")


def test_what_an_action_uses_says_what_it_does_when_its_name_says_nothing():
    assert "talk" in words_of_action(["hola"], ["speech"]).words.split(", ")
    assert "talk" not in words_of_action(["volume"], ["speech"]).words.split(", ")


def test_a_sensor_is_found_by_other_words_than_an_action():
    assert "sonar" in words_of_sensor(["front_distance"]).words.split(", ")
    assert words_of_sensor(["walk"]).words == ""


def test_names_are_found_in_their_parts():
    assert "wink twice" in words_of_action(["wink_twice"]).english


def test_there_are_words_of_the_language_and_english_ones(spanish):
    told = words_of_action(["walk"])
    assert "caminar" in told.words.split(", ")
    assert "drive" in told.english.split(", ")
    assert in_both(CHANGES).words != in_both(CHANGES).english == CHANGES
