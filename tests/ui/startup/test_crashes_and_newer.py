"""Tests of the alerts at startup (crashes, data of a newer Studio) and of termination signals."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import pytest

from app.core.projects.file_format import VERSION
from app.core.reports import studio_versions
from app.core.reports.crash import Crash
from app.core.reports.crash_reports import ALERT_ID, CrashReports
from app.core.reports.studio_run import StudioRun
from app.core.session import Session
from app.core.storage.settings import Settings
from app.ui.application import close_on_signals, raise_startup_alerts, report_crashes, save_version
from app.ui.shell.main_window import MainWindow
from nep.version import __version__
from tests.pseudo import untranslated

pytest_plugins = ["tests.ui.shell_fixtures"]


class Run:
    """Fake run of Studio with the given crashes of earlier runs."""

    def __init__(self, *left: Crash) -> None:
        self._left = list(left)
        self.is_asked = False

    def pop_crashes(self) -> list[Crash]:
        return [self._left.pop() for _each in list(self._left)]

    def expect_exit(self) -> None:
        self.is_asked = True


def test_crashes_of_several_windows_are_combined_into_one_alert(session: Session, home: Path) -> None:
    report_crashes(session, Run(Crash("studio", "without a word"), Crash("studio", "without a word")))
    assert [each.id for each in session.alerts.active] == [ALERT_ID]
    assert len(CrashReports().all()) == 2
    again = Session(Settings(home), journal_folder=home / "journal", start_processes=False)
    report_crashes(again, Run())
    assert not again.alerts.active


def test_clean_exit_offers_no_crash_report(session: Session, home: Path) -> None:
    with StudioRun(home / "runs", home / "log"):
        pass
    report_crashes(session, StudioRun(home / "runs", home / "log"))
    assert not session.alerts.active


def test_work_and_settings_of_a_newer_studio_are_reported(pseudo: None, home: Path) -> None:
    (home / "journal").mkdir(parents=True)
    entry = {"format": VERSION + 1, "pid": 2**22 + 7, "born_s": 1.0, "name": "Mine"}
    (home / "journal" / "a.json").write_text(json.dumps(entry))
    (home / "settings.json").write_text(json.dumps({"format": 7}))
    session = Session(Settings(home), journal_folder=home / "journal", start_processes=False)
    raise_startup_alerts(session)
    told = {each.id: f"{each.title} {each.detail}" for each in session.alerts.active}
    assert set(told) == {"journal:newer", "settings:notice"}
    assert "“Mine”" in told["journal:newer"]
    assert "7" in told["settings:notice"]
    assert [words for words in told.values() if untranslated(words, "Mine", "settings", "json")] == []


def test_no_alert_is_raised_without_data_of_a_newer_studio(session: Session) -> None:
    raise_startup_alerts(session)
    assert not session.alerts.active


def test_versions_are_recorded_with_the_time_of_their_first_start(window: MainWindow, home: Path) -> None:
    window.state.save(Settings.studio_versions, [{"version": "0.0.9", "since_s": 1000.0}])
    save_version(window, 2000.0)
    save_version(window, 3000.0)
    told = [("0.0.9", 1000.0), (__version__, 2000.0)]
    assert studio_versions.known_versions(Settings(home).studio_versions) == told


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_termination_signal_closes_the_window_cleanly(qtbot, window: MainWindow, name: str) -> None:
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    run = Run()
    window.show()
    try:
        close_on_signals(window, run)
        os.kill(os.getpid(), getattr(signal, name))
        qtbot.waitUntil(lambda: not window.isVisible())
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert run.is_asked


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_ignored_sighup_is_not_overridden(window: MainWindow) -> None:
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # like nohup
    try:
        close_on_signals(window, Run())
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
