from __future__ import annotations

import pytest

from app.ui.text.numbers import (
    age_words,
    bandwidth_words,
    grouped,
    latency_words,
    rate_words,
    seconds_words,
    size_words,
    spoken_key,
    tip_with_key,
)
from tests.pseudo import untranslated


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (rate_words(None), ""), (rate_words(0.4), "0.4"), (rate_words(59.96), "60.0"), (rate_words(1204),
        "1\u2009204"),
        (bandwidth_words(None), ""), (bandwidth_words(92), "92 B/s"), (bandwidth_words(5.1e6), "5.1 MB/s"),
        (size_words(412), "412 B"), (size_words(1600), "1.6 kB"), (size_words(46_000), "46 kB"),
        (size_words(999_900), "1.0 MB"), (size_words(2.5e12), "2.5 TB"),
        (age_words(None), ""), (age_words(0.012), "12 ms"), (age_words(0.4), "0.4 s"), (age_words(6.2),
        "6 s"),
        (age_words(125), "2 min"), (age_words(7200), "2 h"),
        (latency_words(0.0006), "0.6 ms"), (latency_words(0.041), "41 ms"), (latency_words(1.24), "1.2 s"),
        (grouped(18204), "18\u2009204"),
        (seconds_words(1.42), "1.4 s"), (seconds_words(14.3), "14 s"), (seconds_words(180), "3 min"),
    ],
)  # fmt: skip
def test_figures_are_formatted_as_text(made: str, words: str) -> None:
    assert made == words


@pytest.mark.usefixtures("pseudo")
def test_key_names_are_translated_and_letters_are_not() -> None:
    said = [spoken_key("Ctrl+Shift+S"), spoken_key("Up, PgDown"), spoken_key("Meta+Tab", "darwin")]
    assert untranslated(" ".join(said).replace("Ctrl", "ctrl")) == []
    assert "Tab" not in said[2]
    assert said[2].startswith("⌃[")
    assert said[0].endswith("]+S")
    assert spoken_key("F12") == "F12"
    assert tip_with_key("x", "Ctrl+S", "linux") == f"x ({said[0].split('+')[0]}+S)"
