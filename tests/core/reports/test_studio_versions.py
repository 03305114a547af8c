"""Tests of the history of Studio versions: stored when the version changes, included in reports, robust."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from app.core.reports.crash_reports import CrashReports
from app.core.reports.problem_report import ReportParts, create_report
from app.core.reports.studio_versions import (
    MAX_VERSIONS,
    VersionEntries,
    add_this_version,
    format_versions,
    known_versions,
)
from app.core.storage.settings import Settings
from nep.version import __version__
from tests.core.reports.test_problem_report import opened

DAY_S = 86_400.0
OLDER = {"version": "0.0.9", "since_s": 1_700_000_000.0}


def test_version_is_recorded_when_it_changes() -> None:
    kept = add_this_version([], 1_700_000_000.0, is_first=True, version="0.0.9")
    assert kept == [OLDER]
    assert add_this_version(kept, 1_800_000_000.0, is_first=False, version="0.0.9") is None
    both = add_this_version(kept, 1_700_000_000.0 + DAY_S, is_first=False, version="0.1.0")
    assert format_versions(both) == "0.0.9 since 2023-11-14, 0.1.0 since 2023-11-15"
    back = add_this_version(both, 1_700_000_000.0 + 2 * DAY_S, is_first=False, version="0.0.9")
    assert [version for version, _since in known_versions(back)] == ["0.0.9", "0.1.0", "0.0.9"]


def test_versions_without_history_are_listed_as_earlier() -> None:
    kept = add_this_version([], 1_700_000_000.0, is_first=False, version="0.1.0")
    assert format_versions(kept) == "earlier, 0.1.0 since 2023-11-14"
    assert add_this_version(kept, 1_800_000_000.0, is_first=False, version="0.1.0") is None


def test_only_newest_entries_of_the_version_history_are_kept() -> None:
    versions: VersionEntries | None = []
    for number in range(MAX_VERSIONS + 5):
        versions = add_this_version(versions, float(number), is_first=True, version=f"1.{number}")
    assert [version for version, _since in known_versions(versions)] == [
        f"1.{number}" for number in range(5, MAX_VERSIONS + 5)
    ]


@pytest.mark.parametrize(
    "damaged",
    [
        None, "0.0.9", 7, {"version": "0.0.9"}, [None], ["0.0.9"], [{}], [{"version": "0.0.9"}],
        [{"version": 9, "since_s": 1.0}], [{"version": "0.0.9\nPython: 9", "since_s": 1.0}],
        [{"version": "9" * 41, "since_s": 1.0}], [{"version": "", "since_s": 1.0}],
        [{"version": "0.0.9", "since_s": each}
         for each in (-1, math.nan, math.inf, 2**64 - 1, 1e300, True, "1")],
    ],
)  # fmt: skip
def test_damaged_version_history_is_ignored(damaged: object) -> None:
    entries = Settings.studio_versions.value_in({Settings.studio_versions.key: damaged})
    assert known_versions(entries) == []
    assert format_versions(entries) == "unknown"
    assert add_this_version(entries, 1.0, is_first=True, version="0.1.0") == [
        {"version": "0.1.0", "since_s": 1.0}
    ]


def test_version_history_survives_the_settings_file(tmp_path: Path) -> None:
    Settings(tmp_path).studio_versions = [OLDER]
    settings = Settings(tmp_path)
    settings.studio_versions = add_this_version(settings.studio_versions, 1_800_000_000.0, is_first=False)
    entries = json.loads(settings.path.read_text())["studio_versions"]
    assert [version for version, _since in known_versions(entries)] == [
        "0.0.9",
        __version__,
    ]


def test_report_after_an_update_lists_both_versions(tmp_path: Path) -> None:
    values = {"studio_versions": add_this_version([OLDER], 1_800_000_000.0, is_first=False)}
    parts = ReportParts((), values, lambda: "", tmp_path, CrashReports(tmp_path / "crashes"))
    lines = opened(create_report(parts, ""))["versions.txt"].splitlines()
    assert f"NEP Studio: {__version__}" in lines
    assert f"versions used here: 0.0.9 since 2023-11-14, {__version__} since 2027-01-15" in lines
