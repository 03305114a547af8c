"""Unit tests of the pure parts: names, fields, values, event blocks and error messages."""

from __future__ import annotations

import keyword

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.blocks.model.fields import ChoiceField, ColourField, FieldError, NumberField, PathField, TopicField
from app.blocks.model.names import PythonNames
from app.blocks.model.robot_text import BlockTemplate
from app.blocks.model.workspace import parse_workspace
from app.blocks.runtime import values
from app.blocks.runtime.errors import BehaviourError, explain
from app.blocks.runtime.robot_handle import activity_text
from app.blocks.runtime.triggers import ScriptTrigger, ThresholdTrigger, change_detector, event_matches
from tests.blocks.samples import robot


@given(st.lists(st.text(), min_size=1, max_size=8))
def test_names_are_valid_python_identifiers_and_unique(words):
    names = PythonNames(frozenset({"taken"}))
    made = [names.new_name(word, "thing") for word in words]
    assert len(set(made)) == len(made)
    assert all(name.isidentifier() and not keyword.iskeyword(name) and name != "taken" for name in made)


def test_python_names_are_derived_from_block_text():
    names = PythonNames(frozenset())
    assert names.new_name("when started", "x") == "when_started"
    assert names.new_name("When started!", "x") == "when_started_2"
    assert names.new_name("123", "thing") == "thing_123"
    assert names.new_name("???", "thing") == "thing"


def test_number_field_reads_and_validates_values():
    field = NumberField("N", 5, 0, 10)
    assert [field.read(saved) for saved in (None, 3, "4.5", 2.0)] == [5, 3, 4.5, 2]
    for wrong in ("x", True, float("nan"), float("inf"), [], 11, -1):
        with pytest.raises(FieldError):
            field.read(wrong)


def test_choice_field_reads_saved_values_and_shows_their_labels():
    field = ChoiceField("C", (("yes", True), ("three", 3), ("all", "all")))
    assert [field.read(saved) for saved in ("true", "3", "all", None)] == [True, 3, "all", True]
    assert field.option_text(3) == "three"
    with pytest.raises(FieldError):
        field.read("none")
    assert ChoiceField("ROBOT", (), source="robots:nao").read("NAO") == "NAO"


def test_topic_colour_and_path_are_read_and_invalid_topics_and_colours_are_rejected():
    assert TopicField("T").read("/a/b") == "/a/b"
    for wrong in ("", "a b", "{", "\n", "x" * 201):
        with pytest.raises(FieldError):
            TopicField("T").read(wrong)
    assert ColourField("C").read("#ABCDEF") == "#abcdef"
    with pytest.raises(FieldError):
        ColourField("C").read("red")
    assert PathField("P").read("a.b") == "a.b"


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, ""),
        (True, "yes"),
        (2.0, "2"),
        (2.5, "2.5"),
        ({"a": "é"}, '{"a": "é"}'),
        ([1], "[1]"),
        ("x", "x"),
    ],
)
def test_values_are_converted_to_text(value, expected):
    assert values.text(value) == expected


def test_message_fields_are_read_by_path():
    message = {"faces": [{"name": "Ada"}], "a.b": 1}
    assert values.part(message, "faces.0.name") == "Ada"
    assert values.part(message, "a.b") == 1
    assert values.part(message, "") == message
    assert values.part("tired", "value") == "tired"
    for nothing in ("faces.1.name", "faces.x", "nobody", "faces.0.name.first"):
        assert values.part(message, nothing) is None


def test_random_numbers_stay_within_limits():
    assert {values.random_number(3, 1) for _ in range(200)} == {1, 2, 3}
    assert all(0.5 <= values.random_number(0.5, 1) <= 1 for _ in range(50))


def test_repeat_count_is_rounded_and_validated():
    assert list(values.repeat(2.5)) == [0, 1, 2]
    assert list(values.repeat(-3)) == []
    with pytest.raises(BehaviourError, match="“repeat” needs a number, not a text"):
        values.repeat("x")


def test_exceptions_are_explained():
    assert explain(OverflowError(), "÷", "b").sentence == "The result of “÷” is too large."
    assert explain(MemoryError(), "÷", "b").block == "b"
    assert explain(RecursionError(), "", None).sentence == "this block is nested too deeply."
    assert explain(KeyError("x"), "say", "b").sentence == "“say” failed: 'x'."
    inner = BehaviourError("no voice.", "inner")
    assert explain(inner, "outer", "outer").block == "inner"


def test_event_block_keeps_newest_events_and_counts_dropped_ones():
    hat = ScriptTrigger("x", max_queued=3)
    for number in range(5):
        hat.enqueue((number,))
    assert hat.dropped_count == 2
    lone = ScriptTrigger("x", max_queued=1)
    lone.enqueue(())
    lone.enqueue(())
    assert lone.dropped_count == 0  # a queue of one replaces the waiting event, which isn't counted as a drop


def test_threshold_fires_only_when_crossed():
    passed = []
    gate = ThresholdTrigger("below", 20, lambda: passed.append(1))
    for value, so_far in ((10, 0), (30, 0), (20, 0), (19, 1), (5, 1), (None, 1), (True, 1), (21, 1), (0, 2)):
        gate(value)
        assert len(passed) == so_far


def test_change_fires_only_on_different_value():
    seen = []
    told = change_detector(lambda: seen.append(1))
    for value in (1, 1, 2, 2, 1):
        told(value)
    assert len(seen) == 2


def test_events_match_their_filters():
    touched, source = robot().event("touched"), robot().source
    assert event_matches({"place": "head", "down": True}, {"place": "head"}, touched, source)
    assert not event_matches({"place": "head", "down": False}, {"place": "head"}, touched, source)
    assert not event_matches({"place": "left_hand"}, {"place": "head"}, touched, source)
    assert event_matches({"word": "Hello "}, {"word": "hello"}, robot().event("heard"), source)
    assert event_matches("no object", {}, None, {})


def test_robot_action_is_described_as_sentence():
    pepper = robot()
    turn, say = pepper.action("turn"), pepper.action("say")
    assert turn is not None
    assert say is not None
    assert activity_text(pepper, turn, {"direction": "right"}) == "Pepper turns right by 90°"
    assert activity_text(pepper, say, {"text": "Hi"}) == "Pepper says “Hi”"


def test_placeholders_in_robot_block_text_are_parsed():
    parts = BlockTemplate("%robot say %text loud %text %nobody %ROBOT", ["text", "robot", "Text", "live"])
    assert parts.text == "%ROBOT say %TEXT loud   "
    assert parts.arguments == {"text": "TEXT", "robot": "ROBOT_2", "Text": "TEXT_2", "live": "LIVE_2"}
    assert BlockTemplate("wave", []).text == "%ROBOT wave"


def test_duplicate_and_missing_block_ids_are_made_unique():
    saved = {"blocks": {"blocks": [{"type": "a", "id": "x"}, {"type": "b", "id": "x"}, {"type": "c"}]}}
    assert [block.id for block in parse_workspace(saved).all_blocks()] == ["block", "x~2", "x"]
