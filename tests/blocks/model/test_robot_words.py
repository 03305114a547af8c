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
def test_action_is_found_by_synonyms_of_its_name_title_or_type(names, word):
    assert word in words_of_action(names).words.split(", ")


def test_used_resources_add_search_words_when_action_name_is_unknown():
    assert "talk" in words_of_action(["hola"], ["speech"]).words.split(", ")
    assert "talk" not in words_of_action(["volume"], ["speech"]).words.split(", ")


def test_sensors_and_actions_have_different_search_words():
    assert "sonar" in words_of_sensor(["front_distance"]).words.split(", ")
    assert words_of_sensor(["walk"]).words == ""


def test_compound_names_are_matched_by_their_parts():
    assert "wink twice" in words_of_action(["wink_twice"]).english


def test_search_words_include_current_language_and_english(spanish):
    told = words_of_action(["walk"])
    assert "caminar" in told.words.split(", ")
    assert "drive" in told.english.split(", ")
    assert in_both(CHANGES).words != in_both(CHANGES).english == CHANGES
