"""Tests of the synonyms by which the blocks of robots can be searched."""

from __future__ import annotations

import pytest

from app.blocks.model.robot_keywords import (
    CHANGE_SEARCH_WORDS,
    action_search_words,
    bilingual_search_words,
    sensor_search_words,
)
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
    assert word in action_search_words(names).words.split(", ")


def test_used_resources_add_search_words_when_action_name_is_unknown():
    assert "talk" in action_search_words(["hola"], ["speech"]).words.split(", ")
    assert "talk" not in action_search_words(["volume"], ["speech"]).words.split(", ")


def test_sensors_and_actions_have_different_search_words():
    assert "sonar" in sensor_search_words(["front_distance"]).words.split(", ")
    assert sensor_search_words(["walk"]).words == ""


def test_compound_action_name_is_searchable_by_its_words():
    assert "wink twice" in action_search_words(["wink_twice"]).english


def test_search_words_include_current_language_and_english(spanish):
    told = action_search_words(["walk"])
    assert "caminar" in told.words.split(", ")
    assert "drive" in told.english.split(", ")
    assert (
        bilingual_search_words(CHANGE_SEARCH_WORDS).words
        != bilingual_search_words(CHANGE_SEARCH_WORDS).english
        == CHANGE_SEARCH_WORDS
    )
