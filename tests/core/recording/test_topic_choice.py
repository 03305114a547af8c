"""Tests of the selection of topics to record: stored as text in the settings and parsed from any value."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.core.recording.topic_choice import (
    RecordingChoice,
    RingSettings,
    choice_to_json,
    file_stem,
    free_path,
    parse_choice,
    parse_patterns,
    parse_ring_settings,
    ring_settings_to_json,
)


@pytest.mark.parametrize(
    ("text", "wanted", "unwanted"),
    [
        ("", (), ()),
        ("/arm/* *action*", ("/arm/*", "*action*"), ()),
        ("/a not /b, NOT /c /d", ("/a", "/d"), ("/b", "/c")),
        ("/a /a not /b not /b", ("/a",), ("/b",)),
        ("/a not", ("/a",), ()),
        ("not not /a", (), ("/a",)),
    ],
)
def test_include_and_exclude_patterns_are_parsed(text, wanted, unwanted):
    assert parse_patterns(text) == (wanted, unwanted)


def test_exclusions_take_precedence_and_no_patterns_select_all_topics():
    choice = RecordingChoice("pattern", patterns=("/arm/*",), excluded=("/arm/raw",))
    assert [choice.selection.has(topic) for topic in ("/arm/x", "/arm/raw", "/odom")] == [True, False, False]
    assert RecordingChoice("pattern", excluded=("/raw",)).selection.has("/odom")
    assert RecordingChoice("all", topics=("/a",), excluded=("/b",)).selection.has("/b")


def test_invalid_recording_choice_returns_the_reason():
    assert RecordingChoice("chosen").problem == "No topic is selected."
    assert RecordingChoice("chosen", topics=("/a",)).problem == ""
    assert RecordingChoice("pattern").problem == ""
    assert RecordingChoice("pattern", patterns=("/a\x00b",)).problem.endswith(".")


@pytest.mark.parametrize(
    "told",
    [None, 3, "x", [], {}, {"mode": 7, "topics": "abc"}, {"mode": "some", "patterns": [1, None]},
     {"ends_min": 0, "ends_gb": float("nan")}, {"ends_min": "30", "ends_gb": -1}, {"ends_min": True}],
)  # fmt: skip
def test_invalid_recording_choice_settings_become_defaults(told):
    assert parse_choice(told) == RecordingChoice()


def test_recording_choice_and_flight_recorder_settings_round_trip():
    choice = RecordingChoice("pattern", ("/a",), ("/b/*",), ("/c",), 30.0, 0.5)
    assert parse_choice(choice_to_json(choice)) == choice
    wish = RingSettings(is_on=True, seconds=90, size_gb=0.5, patterns=("/arm/*",), excluded=("/arm/raw",))
    assert parse_ring_settings(ring_settings_to_json(wish)) == wish


@pytest.mark.parametrize(
    ("ends", "so_far", "end"),
    [
        ((None, None), (10.0, 100.0, 10.0), None),
        ((1.0, None), (10.0, 100.0, 10.0), (60.0, 600.0)),
        ((1.0, None), (10.0, 100.0, None), None),
        ((1.0, 1e-6), (10.0, 100.0, 100.0), (19.0, 1000.0)),
        ((None, 1.0), (10.0, 100.0, 0.0), None),
        ((1.0, 1.0), (10.0, 100.0, 0.0), (60.0, 100.0)),
        ((0.1, None), (10.0, 100.0, 10.0), (10.0, 100.0)),  # almost finished
    ],
)
def test_final_recording_duration_and_size_are_estimated(ends, so_far, end):
    assert RecordingChoice("all", max_minutes=ends[0], max_gb=ends[1]).expected_end(*so_far) == end


@pytest.mark.parametrize(
    "told",
    [
        None,
        {"is_on": "yes", "seconds": 0, "size_gb": -1},
        {"is_on": 1, "seconds": 2**64 - 1, "size_gb": float("nan")},
        {"seconds": True, "size_gb": "2"},
    ],
)
def test_invalid_flight_recorder_settings_become_defaults(told):
    assert parse_ring_settings(told) == RingSettings()


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("Friday, greeting with Aiko", "Friday, greeting with Aiko"),
        ("../../etc/passwd", "etc passwd"),
        ("a/b\\c:d*e?", "a b c d e"),
        (" . ", ""),
        ("", ""),
        ("CON", "_CON"),
        ("nul.mcap", "_nul.mcap"),
        ("x" * 300, "x" * 80),
        ("half \ud800 sign\x07", "half sign"),
        ("perro café 犬", "perro café 犬"),
    ],
)
def test_recording_name_becomes_valid_file_name(name, stem):
    assert file_stem(name) == stem


def test_path_of_an_existing_file_gets_a_numeric_suffix(tmp_path: Path):
    first = tmp_path / "a.mcap"
    assert free_path(first) == first
    first.touch()
    (tmp_path / "a 2.mcap").touch()
    assert free_path(first).name == "a 3.mcap"
    folder = tmp_path / "a, 0.02.0 to 0.06.0, CSV"
    folder.mkdir()
    assert free_path(folder, is_folder=True).name == "a, 0.02.0 to 0.06.0, CSV 2"
