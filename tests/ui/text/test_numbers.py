from __future__ import annotations

import pytest

from app.ui.text.numbers import (
    age_text,
    bandwidth_text,
    group_digits,
    latency_text,
    rate_text,
    seconds_text,
    shortcut_text,
    size_text,
    tip_with_key,
)
from tests.pseudo import untranslated


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (rate_text(None), ""), (rate_text(0.4), "0.4"), (rate_text(59.96), "60.0"), (rate_text(1204),
        "1\u2009204"),
        (bandwidth_text(None), ""), (bandwidth_text(92), "92 B/s"), (bandwidth_text(5.1e6), "5.1 MB/s"),
        (size_text(412), "412 B"), (size_text(1600), "1.6 kB"), (size_text(46_000), "46 kB"),
        (size_text(999_900), "1.0 MB"), (size_text(2.5e12), "2.5 TB"),
        (age_text(None), ""), (age_text(0.012), "12 ms"), (age_text(0.4), "0.4 s"), (age_text(6.2),
        "6 s"),
        (age_text(125), "2 min"), (age_text(7200), "2 h"),
        (latency_text(0.0006), "0.6 ms"), (latency_text(0.041), "41 ms"), (latency_text(1.24), "1.2 s"),
        (group_digits(18204), "18\u2009204"),
        (seconds_text(1.42), "1.4 s"), (seconds_text(14.3), "14 s"), (seconds_text(180), "3 min"),
    ],
)  # fmt: skip
def test_rates_sizes_and_durations_are_formatted(made: str, words: str) -> None:
    assert made == words


@pytest.mark.usefixtures("pseudo")
def test_key_names_are_translated_and_letter_keys_are_not() -> None:
    said = [shortcut_text("Ctrl+Shift+S"), shortcut_text("Up, PgDown"), shortcut_text("Meta+Tab", "darwin")]
    assert untranslated(" ".join(said).replace("Ctrl", "ctrl")) == []
    assert "Tab" not in said[2]
    assert said[2].startswith("⌃[")
    assert said[0].endswith("]+S")
    assert shortcut_text("F12") == "F12"
    assert tip_with_key("x", "Ctrl+S", "linux") == f"x ({said[0].split('+')[0]}+S)"
