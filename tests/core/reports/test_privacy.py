"""Tests that a report contains neither the path of the home folder nor the values of private settings."""

from __future__ import annotations

import json
from pathlib import PurePosixPath, PureWindowsPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.reports.privacy import OMITTED_TEXT, PUBLIC_SETTINGS, reportable_settings, without_home

HOME = PurePosixPath("/home/Ana María")
WINDOWS = PureWindowsPath("C:\\Users\\Ana")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("can't read /home/Ana María/a.nepb", "can't read ~/a.nepb"),
        ('File "/home/Ana María", line 3', 'File "~", line 3'),
        ("file:///home/Ana%20Mar%C3%ADa/a", "file://~/a"),
        ("/home/Ana María", "~"),
        ("it is in /home/Ana María. And then", "it is in ~. And then"),
        ("/home/Ana María.old/a", "/home/Ana María.old/a"),
        ("/home/Ana Maríana/a", "/home/Ana Maríana/a"),
        ("nothing of the kind", "nothing of the kind"),
    ],
)
def test_home_folder_is_removed_on_linux_and_macos(text: str, shown: str) -> None:
    assert without_home(text, HOME) == shown  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("C:\\Users\\Ana\\a.nepb", "~\\a.nepb"),
        (json.dumps({"path": "C:\\Users\\Ana\\a"}), json.dumps({"path": "~\\a"})),
        ("file:///C:/Users/Ana/a", "file:///~/a"),
        ("C:\\Users\\Anabel\\a", "C:\\Users\\Anabel\\a"),
    ],
)
def test_home_folder_is_removed_on_windows(text: str, shown: str) -> None:
    assert without_home(text, WINDOWS) == shown  # type: ignore[arg-type]


def test_root_home_folder_is_not_removed() -> None:
    assert without_home("/usr/bin", PurePosixPath("/")) == "/usr/bin"  # type: ignore[arg-type]


def test_only_public_settings_are_reported_with_values() -> None:
    kept = {"theme": "dark", "network_keys": {"room 3": "swordfish"}, "recent": ["/home/a/Secret.nepb"]}
    shown = reportable_settings(kept)
    assert shown == {"network_keys": OMITTED_TEXT, "recent": OMITTED_TEXT, "theme": "dark"}


@given(st.dictionaries(st.text(), st.text(min_size=12), max_size=5))
def test_unknown_settings_are_reported_without_values(kept: dict[str, str]) -> None:
    told = json.dumps(reportable_settings(kept), ensure_ascii=False)
    for name, value in kept.items():
        assert (
            name in PUBLIC_SETTINGS
            or value not in told
            or value in json.dumps(sorted(kept), ensure_ascii=False)
        )


@pytest.mark.parametrize("word", ["key", "secret", "password", "code", "token", "recent", "tabs", "networks"])
def test_public_settings_contain_no_private_names(word: str) -> None:
    assert not [name for name in PUBLIC_SETTINGS if word in name]
