"""Crash reports: kept for the owner alone, ten at most, and told to a person once."""

from __future__ import annotations

import logging
import os
import stat
from pathlib import Path

import pytest

from app.core.alerts import Alerts
from app.core.reports.crash import PARTS, Crash, crash_extra
from app.core.reports.crash_reports import ALERT, MAX_REPORTS, CrashLog, CrashReports, offer, texts
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


def test_a_report_says_what_how_and_when(reports: CrashReports) -> None:
    path = reports.add(Crash("robot", "it ended by signal 11", "where it was"))
    assert path is not None
    told = path.read_text("utf-8")
    for words in ("part: robot", "how: it ended by signal 11", "noticed: 2023-11-1", "where it was"):
        assert words in told
    assert [(each.part, each.is_new, each.path) for each in reports.all()] == [("robot", True, path)]


@pytest.mark.skipif(os.name != "posix", reason="modes")
def test_it_is_for_its_owner_alone(reports: CrashReports) -> None:
    path = reports.add(Crash("studio", "how"))
    assert path is not None
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_the_home_folder_has_no_name_in_it(reports: CrashReports) -> None:
    path = reports.add(Crash("studio", "how", f"in {Path.home() / 'thing.py'}"))
    assert path is not None
    assert str(Path.home()) not in path.read_text("utf-8")


def test_ten_are_kept_the_newest(reports: CrashReports, clock: Clock) -> None:
    for number in range(MAX_REPORTS + 4):
        clock.now += 60
        reports.add(Crash("editor", f"number {number}"))
    assert len(reports.all()) == MAX_REPORTS
    told = [text.decode() for _name, text in texts(reports.all())]
    assert "number 13" in told[0]
    assert "number 4" in told[-1]


def test_several_in_one_second_have_files_of_their_own_also_when_they_were_told(
    reports: CrashReports,
) -> None:
    for how in ("one", "two"):
        reports.add(Crash("studio", how))
    assert len(reports.take_new()) == 2
    reports.add(Crash("studio", "three"))
    assert sorted(text.decode().split("how: ")[1].split()[0] for _name, text in texts(reports.all())) == [
        "one", "three", "two",
    ]  # fmt: skip


def test_each_is_told_once_also_to_two_windows(reports: CrashReports, tmp_path: Path) -> None:
    reports.add(Crash("studio", "how"))
    other = CrashReports(tmp_path / "crashes")
    assert [each.part for each in reports.take_new()] == ["studio"]
    assert other.take_new() == []
    assert reports.take_new() == []
    assert [each.is_new for each in other.all()] == [False]


def test_what_is_no_report_is_left_alone(reports: CrashReports, tmp_path: Path) -> None:
    folder = tmp_path / "crashes"
    folder.mkdir()
    for name in ("crash of mine.txt", "crash 2026-13-99 99.99.99 studio.txt", "note.txt"):
        (folder / name).write_text("mine")
    assert reports.all() == []
    for _number in range(MAX_REPORTS + 1):
        reports.add(Crash("studio", "how"))
    assert (folder / "note.txt").exists()
    assert (folder / "crash of mine.txt").exists()


def test_where_nothing_can_be_written_one_line_says_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("no folder")
    reports = CrashReports(tmp_path / "file" / "crashes")
    assert reports.add(Crash("studio", "how")) is None
    assert reports.all() == []
    assert reports.take_new() == []
    assert [each.levelname for each in caplog.records] == ["WARNING"]


def test_a_record_of_a_crash_becomes_a_report_and_others_do_not(reports: CrashReports) -> None:
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
    # of what comes again and again: the first, and the tenth
    assert sorted(each.part for each in reports.all()) == ["behaviour", "behaviour", "robot"]


def test_the_next_start_offers_the_worst_once(reports: CrashReports) -> None:
    alerts = Alerts()
    offer(alerts, reports)
    assert not alerts.has(ALERT)
    for part in ("robot", "studio", "editor"):
        reports.add(Crash(part, "how"))  # type: ignore[arg-type]
    offer(alerts, reports)
    told = alerts.active[0]
    assert (told.title, told.button, told.action) == (
        "Studio closed unexpectedly last time.",
        "Report a problem",
        "help.report",
    )
    again = Alerts()
    offer(again, reports)
    assert not again.active


def test_a_crash_of_the_version_before_an_update_is_said_to_be_of_that(reports: CrashReports) -> None:
    path = reports.add(Crash("studio", "how", "text", "0.0.9"))
    assert path is not None
    told = path.read_text("utf-8")
    assert told.startswith("Crash report of NEP Studio 0.0.9\n")
    assert f" by NEP Studio {__version__}\n" in told
    alerts = Alerts()
    offer(alerts, reports)
    assert alerts.active[0].detail == (
        f"That was NEP Studio 0.0.9; this is {__version__}. "
        "A report helps us fix the problem. Nothing is sent automatically."
    )


@pytest.mark.parametrize(
    "first", ["", "Crash report of NEP Studio \x1b[2J", "Crash report of NEP Studio " + "9" * 99]
)
def test_a_report_whose_first_line_is_damaged_is_offered_without_a_version(
    reports: CrashReports, first: str
) -> None:
    path = reports.add(Crash("robot", "how"))
    assert path is not None
    path.write_text(f"{first}\nand so on", "utf-8")
    alerts = Alerts()
    offer(alerts, reports)
    assert alerts.active[0].detail.startswith("A report helps")


@pytest.mark.parametrize("part", PARTS)
def test_every_part_is_told_in_the_language_of_the_person(pseudo: None, reports: CrashReports, part) -> None:
    alerts = Alerts()
    reports.add(Crash(part, "how", version="0.0.9"))
    offer(alerts, reports)
    told = alerts.active[0]
    assert untranslated(f"{told.title} {told.detail} {told.button}") == []
