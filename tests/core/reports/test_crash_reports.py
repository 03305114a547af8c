"""Tests of crash reports: private to their owner, ten at most, shown to the user once."""

from __future__ import annotations

import logging
import os
import stat
from pathlib import Path

import pytest

from app.core.alerts.alerts import Alerts
from app.core.reports.crash import PARTS, Crash, crash_extra
from app.core.reports.crash_reports import (
    ALERT_ID,
    MAX_REPORTS,
    CrashLog,
    CrashReports,
    read_reports,
    show_crash_alert,
)
from app.intents import ReportProblem
from nep.version import __version__
from tests.pseudo import untranslated


class Clock:
    def __init__(self) -> None:
        self.now = 1_700_000_000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def reports(tmp_path: Path, clock: Clock) -> CrashReports:
    return CrashReports(tmp_path / "crashes", clock)


def test_crash_report_contains_component_cause_and_time(reports: CrashReports) -> None:
    path = reports.add(Crash("robot", "it ended by signal 11", "where it was"))
    assert path is not None
    told = path.read_text("utf-8")
    for words in ("part: robot", "how: it ended by signal 11", "noticed: 2023-11-1", "where it was"):
        assert words in told
    assert [(each.part, each.is_new, each.path) for each in reports.all()] == [("robot", True, path)]


@pytest.mark.skipif(os.name != "posix", reason="modes")
def test_crash_report_is_private_to_its_owner(reports: CrashReports) -> None:
    path = reports.add(Crash("studio", "how"))
    assert path is not None
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_home_folder_is_removed_from_crash_report(reports: CrashReports) -> None:
    path = reports.add(Crash("studio", "how", f"in {Path.home() / 'thing.py'}"))
    assert path is not None
    assert str(Path.home()) not in path.read_text("utf-8")


def test_ten_newest_crash_reports_are_kept(reports: CrashReports, clock: Clock) -> None:
    for number in range(MAX_REPORTS + 4):
        clock.now += 60
        reports.add(Crash("editor", f"number {number}"))
    assert len(reports.all()) == MAX_REPORTS
    told = [text.decode() for _name, text in read_reports(reports.all())]
    assert "number 13" in told[0]
    assert "number 4" in told[-1]


def test_crash_reports_of_the_same_second_have_separate_files(
    reports: CrashReports,
) -> None:
    for how in ("one", "two"):
        reports.add(Crash("studio", how))
    assert len(reports.take_new()) == 2
    reports.add(Crash("studio", "three"))
    assert sorted(text.decode().split("how: ")[1].split()[0] for _name,
    text in read_reports(reports.all())) == [
        "one", "three", "two",
    ]  # fmt: skip


def test_crash_report_is_offered_once_also_with_two_windows(reports: CrashReports, tmp_path: Path) -> None:
    reports.add(Crash("studio", "how"))
    other = CrashReports(tmp_path / "crashes")
    assert [each.part for each in reports.take_new()] == ["studio"]
    assert other.take_new() == []
    assert reports.take_new() == []
    assert [each.is_new for each in other.all()] == [False]


def test_files_other_than_crash_reports_in_the_crash_folder_are_kept(
    reports: CrashReports, tmp_path: Path
) -> None:
    folder = tmp_path / "crashes"
    folder.mkdir()
    for name in ("crash of mine.txt", "crash 2026-13-99 99.99.99 studio.txt", "note.txt"):
        (folder / name).write_text("mine")
    assert reports.all() == []
    for _number in range(MAX_REPORTS + 1):
        reports.add(Crash("studio", "how"))
    assert (folder / "note.txt").exists()
    assert (folder / "crash of mine.txt").exists()


def test_unwritable_crash_folder_is_logged_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "file").write_text("no folder")
    reports = CrashReports(tmp_path / "file" / "crashes")
    assert reports.add(Crash("studio", "how")) is None
    assert reports.all() == []
    assert reports.take_new() == []
    assert [each.levelname for each in caplog.records] == ["WARNING"]


def test_only_crash_log_records_become_reports(reports: CrashReports) -> None:
    log = logging.getLogger("test of crashes")
    handler = CrashLog(reports)
    log.addHandler(handler)
    try:
        log.error("it went wrong")
        for _number in range(12):
            log.error("it crashed", extra=crash_extra("behaviour", "by signal 11", "trace"))
        log.error("another crashed", extra=crash_extra("robot", "by signal 6"))
    finally:
        log.removeHandler(handler)
    # Only the first and the tenth of repeated crashes are reported.
    assert sorted(each.part for each in reports.all()) == ["behaviour", "behaviour", "robot"]


def test_next_start_offers_the_most_severe_crash_once(reports: CrashReports) -> None:
    alerts = Alerts()
    show_crash_alert(alerts, reports)
    assert not alerts.has(ALERT_ID)
    for part in ("robot", "studio", "editor"):
        reports.add(Crash(part, "how"))  # type: ignore[arg-type]
    show_crash_alert(alerts, reports)
    told = alerts.active[0]
    assert (told.title, told.button, told.intent) == (
        "Studio closed unexpectedly last time.",
        "Report a problem",
        ReportProblem(),
    )
    again = Alerts()
    show_crash_alert(again, reports)
    assert not again.active


def test_crash_before_an_update_is_reported_with_its_version(reports: CrashReports) -> None:
    path = reports.add(Crash("studio", "how", "text", "0.0.9"))
    assert path is not None
    told = path.read_text("utf-8")
    assert told.startswith("Crash report of NEP Studio 0.0.9\n")
    assert f" by NEP Studio {__version__}\n" in told
    alerts = Alerts()
    show_crash_alert(alerts, reports)
    assert alerts.active[0].detail == (
        f"The crash happened in NEP Studio 0.0.9; this is {__version__}. "
        "A report helps us fix the problem. Nothing is sent automatically."
    )


@pytest.mark.parametrize(
    "first", ["", "Crash report of NEP Studio \x1b[2J", "Crash report of NEP Studio " + "9" * 99]
)
def test_crash_report_with_damaged_first_line_is_offered_without_version(
    reports: CrashReports, first: str
) -> None:
    path = reports.add(Crash("robot", "how"))
    assert path is not None
    path.write_text(f"{first}\nand so on", "utf-8")
    alerts = Alerts()
    show_crash_alert(alerts, reports)
    assert alerts.active[0].detail.startswith("A report helps")


@pytest.mark.parametrize("part", PARTS)
def test_crash_messages_are_translated_for_every_component(pseudo: None, reports: CrashReports, part) -> None:
    alerts = Alerts()
    reports.add(Crash(part, "how", version="0.0.9"))
    show_crash_alert(alerts, reports)
    told = alerts.active[0]
    assert untranslated(f"{told.title} {told.detail} {told.button}") == []
